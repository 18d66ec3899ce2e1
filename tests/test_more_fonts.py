"""Letters that the typeface does not have are taken from the fonts of the system, when one has been drawn and not before."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import imgui_bundle
import pytest

from app import more_fonts, theme
from app.more_fonts import FontFile, MoreFonts, fonts_of_the_system
from app.offscreen import Offscreen

BOLD_A = "\U0001d400"  # mathematical bold; Roboto does not have it, and this font does
MATHEMATICAL = FontFile(Path(imgui_bundle.__file__).parent / "assets" / "fonts" / "latex" / "latinmodern-math.otf")

Search = Callable[[], tuple[FontFile, ...]]


@pytest.fixture
def searches(monkeypatch: pytest.MonkeyPatch) -> list[Search]:
    """How the system answers, each time that it is asked; it is not to be asked more often."""
    answers: list[Search] = []
    monkeypatch.setattr(more_fonts, "fonts_of_the_system", lambda: answers.pop(0)())
    return answers


def draw(imgui: Any, words: str, face: Any, size: float) -> None:
    imgui.new_frame()
    imgui.begin("names")
    imgui.push_font(face, size)
    imgui.text_unformatted(words)
    imgui.pop_font()
    imgui.text_unformatted("after it")
    imgui.end()
    imgui.render()


def until_found(more: MoreFonts) -> None:
    deadline = time.monotonic() + 30
    while more.looking:
        assert time.monotonic() < deadline
        more.follow()
        time.sleep(0.01)


@pytest.mark.parametrize("scale", [1.0, 1.1, 2.0])
@pytest.mark.parametrize("size", [theme.SMALL, theme.FONT_SIZE, theme.LARGE])
@pytest.mark.parametrize("face", ["regular", "bold"])
def test_a_letter_that_was_missing_is_there_afterwards(
    imgui_context: Any, searches: list[Search], face: str, size: float, scale: float
) -> None:
    searches.append(lambda: (MATHEMATICAL,))
    fonts = theme.apply(scale)
    more = MoreFonts(fonts)
    draw(imgui_context, f"a name {BOLD_A}", getattr(fonts, face), size)
    assert more.looking and not fonts.regular.is_glyph_in_font(ord(BOLD_A))
    until_found(more)
    assert fonts.regular.is_glyph_in_font(ord(BOLD_A)) and fonts.bold.is_glyph_in_font(ord(BOLD_A))
    draw(imgui_context, f"a name {BOLD_A}", getattr(fonts, face), size)
    more.follow()
    assert not more.looking and not searches


def test_what_the_typeface_has_asks_for_nothing(imgui_context: Any, searches: list[Search]) -> None:
    fonts = theme.apply(1.0)
    more = MoreFonts(fonts)
    draw(imgui_context, "Prés de l'été, Łódź, Ελλάδα, Москва × 3", fonts.regular, theme.FONT_SIZE)
    more.follow()
    assert not more.looking


def test_the_window_itself_draws_nothing_that_its_typeface_lacks(
    monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest
) -> None:
    asked: list[bool] = []  # a fault would be a message in the window
    monkeypatch.setattr(more_fonts, "fonts_of_the_system", lambda: asked.append(True) or ())
    viewer: Offscreen = request.getfixturevalue("viewer")
    viewer.settled()
    assert not asked
    viewer.interface.controller.say(BOLD_A)
    viewer.settled()
    assert asked == [True]


@pytest.mark.parametrize("content", [None, b"", b"no font at all" * 1000])
def test_a_font_that_is_none_adds_nothing(
    imgui_context: Any, searches: list[Search], tmp_path: Path, content: bytes | None
) -> None:
    damaged = tmp_path / "damaged.ttf"
    if content is not None:
        damaged.write_bytes(content)
    searches.append(lambda: (FontFile(damaged), MATHEMATICAL))
    fonts = theme.apply(1.0)
    more = MoreFonts(fonts)
    draw(imgui_context, BOLD_A, fonts.regular, theme.FONT_SIZE)
    until_found(more)
    draw(imgui_context, BOLD_A, fonts.regular, theme.FONT_SIZE)
    assert fonts.regular.is_glyph_in_font(ord(BOLD_A))


def test_where_no_font_has_it_the_system_is_asked_once(imgui_context: Any, searches: list[Search]) -> None:
    searches.append(lambda: ())
    fonts = theme.apply(1.0)
    more = MoreFonts(fonts)
    for _ in range(3):
        draw(imgui_context, BOLD_A, fonts.regular, theme.FONT_SIZE)
        until_found(more)
    assert not searches


@pytest.fixture
def fontconfig(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], None]:
    """What fc-match does, as lines of shell."""
    folder = tmp_path / "programs"
    folder.mkdir()
    monkeypatch.setenv("PATH", str(folder), prepend=":")

    def does(lines: str) -> None:
        program = folder / "fc-match"
        program.write_text(f"#!/bin/sh\n{lines}\n")
        program.chmod(0o755)

    return does


linux = pytest.mark.skipif(sys.platform != "linux", reason="fontconfig is asked on Linux")


@linux
def test_fonts_are_those_that_fontconfig_names_and_that_have_the_letter(fontconfig: Callable[[str], None]) -> None:
    fontconfig(
        """
        case "$2" in
            *charset=4e2d:*) printf '/fonts/han.ttc\\n65538\\n20-7e 4e00-9fff' ;;
            *charset=3042:*) printf '/fonts/han.ttc\\n2\\n3041-3096' ;;
            *charset=d55c:*) printf '/fonts/stub.ttf\\n0\\nac00 d7a2-d7a3' ;;
            *charset=5d0:*) printf '/fonts/hebrew.ttf\\n0\\n5d0' ;;
            *) exit 1 ;;
        esac
        """
    )
    assert fonts_of_the_system() == (FontFile(Path("/fonts/han.ttc"), 2), FontFile(Path("/fonts/hebrew.ttf")))


@linux
@pytest.mark.parametrize("answer", ["", "a\\nb\\nc", "a\\n0\\nx-y", "\\377\\n0\\n4e2d"])
def test_an_answer_that_makes_no_sense_is_none(fontconfig: Callable[[str], None], answer: str) -> None:
    fontconfig(f"printf '{answer}'")
    assert fonts_of_the_system() == ()


@linux
def test_without_fontconfig_there_is_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    assert fonts_of_the_system() == ()
