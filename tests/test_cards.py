"""The palette, the browser, the settings and the start picture by fed mouse and key events, without any GL."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from test_panels import OPEN, Screen

from app import theme
from app.commands import COMMANDS, Action, Ask, Browse, OpenPath
from app.desk import Card, Folder, Shelf, Thumbnail
from app.dialogs import Purpose
from app.overlays import tiles
from app.overlays.palette import matches
from app.readout import Readout
from app.settings import SCALE_LIMITS, Theme
from app.state import Look

MEMBERS = tuple(Path(f"/scenes/{number:03}") for number in range(500))


@pytest.fixture
def screen(imgui_context: Any) -> Screen:
    return Screen(imgui_context)


def type_in(screen: Screen, words: str) -> None:
    for character in words:
        screen.io.add_input_character(ord(character))
        screen.frame()
    screen.frame(2)


def key(screen: Screen, name: str) -> None:
    code = getattr(screen.imgui.Key, name)
    for down in (True, False):
        screen.io.add_key_event(code, down)
        screen.frame()
    screen.frame()


# The palette.


@pytest.mark.parametrize("opener", ["Ctrl+P", "Ctrl+Shift+P", "/"])
def test_a_command_is_found_by_its_words_and_run_by_enter(screen: Screen, opener: str) -> None:
    screen.press(opener)
    screen.frame(2)
    assert screen.state.desk.card is Card.PALETTE
    type_in(screen, "dispa col")
    assert screen.state.desk.query == "dispa col"
    assert screen.state.look is Look.SYNTHESIS  # letters are text now, not commands
    key(screen, "enter")
    assert screen.state.look is Look.DISPARITY
    assert screen.state.desk.card is None


def test_arrows_choose_in_the_palette_and_leave_the_viewpoint_alone(screen: Screen) -> None:
    screen.press("Ctrl+P")
    screen.frame(2)
    names = matches("", replaced_context(screen))
    for _ in range(3):
        key(screen, "down_arrow")
    key(screen, "up_arrow")
    assert screen.state.desk.chosen == 2
    assert (screen.state.u, screen.state.v) == (0.5, 0.5)
    key(screen, "page_down")
    assert screen.state.desk.chosen == 14
    for _ in range(len(names) // 12 + 1):
        key(screen, "page_down")
    assert screen.state.desk.chosen == len(names) - 1
    key(screen, "escape")
    assert screen.state.desk.card is None


def replaced_context(screen: Screen) -> Any:
    from app.commands import Context
    from app.geometry import Rect

    return Context(screen.state, screen.readout.grid, (1, 1), Rect(0, 0, 1, 1))


def test_the_palette_offers_every_command_that_can_be_run_now(screen: Screen) -> None:
    context = replaced_context(screen)
    assert set(matches("", context)) == set(COMMANDS) - {"palette"}
    for name, command in COMMANDS.items():
        assert name == "palette" or name in matches(command.text, context)
    screen.readout = Readout()
    anytime = matches("", replaced_context(screen))
    assert "disparity" not in anytime
    assert "open" in anytime
    assert matches("xyzzy", context) == []


def test_what_begins_with_the_words_comes_first(screen: Screen) -> None:
    found = matches("open", replaced_context(screen))
    assert COMMANDS[found[0]].text.startswith("Open")
    texts = [COMMANDS[name].text.startswith("Open") for name in found]
    assert texts == sorted(texts, reverse=True)


def test_a_command_is_run_by_a_click(screen: Screen) -> None:
    screen.press("Ctrl+P")
    screen.frame(2)
    area = screen.layout.picture
    x, y = area.x + area.width / 2, area.y + 0.1 * area.height
    while screen.state.desk.card is Card.PALETTE and y < area.height:
        screen.click(x, y)
        y += 8
    assert screen.state.desk.card is None


# The browser.


def browse(screen: Screen, reasons: dict[Path, str] | None = None) -> list[Path]:
    """Show the folder; the paths that are asked for are noted."""
    asked: list[Path] = []

    def thumbnail(path: Path) -> Thumbnail:
        asked.append(path)
        return Thumbnail("2 × 2 views", (reasons or {}).get(path, ""))

    screen.readout = replace(OPEN, shelf=Shelf(folder=Folder(Path("/scenes"), MEMBERS), thumbnail=thumbnail))
    screen.press("Ctrl+B")
    screen.frame(3)
    assert Browse(None) in screen.requests
    asked.clear()
    screen.frame()
    return asked


def test_only_what_is_in_sight_and_next_to_it_is_asked_for(screen: Screen) -> None:
    asked = browse(screen)
    assert asked[:10] == list(MEMBERS[:10])
    assert 10 < len(asked) < 80
    screen.move(400, 400)
    for _ in range(30):
        screen.io.add_mouse_wheel_event(0, -1)
        screen.frame()
    asked.clear()
    screen.frame()
    assert asked[0] > MEMBERS[10]
    assert len(asked) < 80


def test_keys_choose_and_open_a_light_field(screen: Screen) -> None:
    browse(screen)
    for name in ("right_arrow", "right_arrow", "left_arrow", "down_arrow"):
        key(screen, name)
    columns = screen.state.desk.chosen - 1
    assert columns > 1
    key(screen, "enter")
    assert screen.requests[-1] == OpenPath(MEMBERS[columns + 1])
    assert (screen.state.u, screen.state.v) == (0.5, 0.5)
    key(screen, "end")
    assert screen.state.desk.chosen == len(MEMBERS) - 1
    key(screen, "home")
    assert screen.state.desk.chosen == 0
    key(screen, "backspace")
    assert screen.requests[-1] == Browse(Path("/"))
    key(screen, "escape")
    assert screen.state.desk.card is None


def test_the_chosen_tile_is_brought_into_sight(screen: Screen) -> None:
    asked = browse(screen)
    key(screen, "end")
    screen.frame(2)
    asked.clear()
    screen.frame()
    assert MEMBERS[-1] in asked
    assert MEMBERS[0] not in asked


def test_a_click_opens_a_light_field(screen: Screen) -> None:
    browse(screen)
    area = screen.layout.picture
    screen.click(area.x + 30 + tiles.size().x * 1.5, area.y + 140)
    assert screen.requests[-1] == OpenPath(MEMBERS[1])


# Settings.


def test_theme_and_scale_by_keys(screen: Screen) -> None:
    desk = screen.state.desk
    screen.press("Ctrl+Shift+L")
    assert desk.theme is Theme.LIGHT
    screen.press("Ctrl+Plus")
    assert desk.scale == 1.25
    screen.scale = 2.9
    screen.press("Ctrl+Plus")
    screen.press("Ctrl+Plus")
    assert desk.scale == SCALE_LIMITS[1]
    screen.scale = 1.0
    screen.press("Ctrl+Minus")
    assert desk.scale == SCALE_LIMITS[0]
    screen.press("Ctrl+0")
    assert desk.scale is None


def test_plus_means_plus_with_and_without_shift(screen: Screen) -> None:
    screen.press("Ctrl+Shift+Plus")
    assert screen.state.desk.scale == 1.25
    screen.press("+")
    assert screen.state.zoom.scale is not None  # alone it zooms, as before


def test_the_card_of_settings_opens_by_its_key_and_forgets(screen: Screen) -> None:
    screen.readout = replace(OPEN, shelf=Shelf(recent=(Path("/a"),)))
    screen.press("Ctrl+Comma")
    screen.frame(2)
    assert screen.state.desk.card is Card.SETTINGS
    area = screen.layout.picture
    x, y = area.x + area.width / 2 - 165, area.y + 0.2 * area.height  # left of the lists that would open
    while Action.FORGET not in screen.requests and y < area.height:
        screen.click(x, y)
        y += 8
    assert Action.FORGET in screen.requests


# The page of keys.


def test_the_page_of_keys_scrolls_by_keys_and_the_viewpoint_stays(screen: Screen) -> None:
    def scroll() -> float:
        return float(screen.imgui.internal.find_window_by_name("keys").scroll.y)

    screen.size = (800.0, 400.0)
    screen.press("F1")
    screen.frame(3)
    key(screen, "page_down")
    down = scroll()
    assert down > 100
    key(screen, "up_arrow")
    assert 0 < scroll() < down
    assert (screen.state.u, screen.state.v) == (0.5, 0.5)
    screen.press("F1")
    key(screen, "up_arrow")
    assert screen.state.v < 0.5


# The start picture.


def test_recent_files_are_shown_those_that_are_gone_last(screen: Screen) -> None:
    recent = tuple(Path(f"/{name}") for name in ("gone", "first", "second"))

    def thumbnail(path: Path) -> Thumbnail:
        return Thumbnail(reason="gone" if path.name == "gone" else "")

    screen.readout = Readout(shelf=Shelf(recent=recent, thumbnail=thumbnail))
    screen.frame(4)
    opened = []
    for y in range(330, 560, 20):
        for x in range(200, 1100, 60):
            screen.requests.clear()
            screen.click(x, y)
            opened += [str(each.path) for each in screen.requests if isinstance(each, OpenPath)]
    assert list(dict.fromkeys(opened)) == ["/first", "/second", "/gone"]


def test_the_start_picture_offers_three_things_to_do(screen: Screen) -> None:
    screen.readout = Readout()
    screen.frame(4)
    for y in range(250, 500, 8):
        screen.click(520, y)
    asked = list(dict.fromkeys(screen.requests))
    assert asked == [Ask(Purpose.OPEN_FILE), Ask(Purpose.OPEN_FOLDER), Action.OPEN_SAMPLE]


@pytest.mark.parametrize("size", [(200, 150), (640, 400), (5000, 3000)])
@pytest.mark.parametrize("card", [None, *Card])
def test_every_card_is_drawn_at_any_size_and_scale(imgui_context: Any, size: tuple[float, float], card: Card | None) -> None:
    screen = Screen(imgui_context)
    shelf = Shelf(MEMBERS[:20], Folder(Path("/scenes"), MEMBERS), thumbnail=lambda path: Thumbnail(reason="no " * 200))
    for scale in (1.0, 3.0):
        theme.change_scale(scale)
        screen.scale, screen.size = scale, size
        for readout in (OPEN, Readout()):
            screen.readout = replace(readout, shelf=shelf)
            screen.state.desk.card = card
            screen.frame(3)
            assert screen.state.desk.card is card


def test_names_that_are_no_text_are_shown_as_far_as_they_are(screen: Screen) -> None:
    """In the browser, as recent files, in messages, while one is being opened, and as the name of what is open."""
    odd = Path("/scenes/caf\udce9")
    seen = Thumbnail(reason=f"{odd} is damaged.")
    shelf = Shelf((odd,), Folder(odd.parent, (odd, odd / "inside")), thumbnail=lambda path: seen)
    screen.readout = replace(OPEN, shelf=shelf, messages=(f"{odd} is damaged.",), loading=0.5, loading_name=odd.name)
    screen.press("Ctrl+B")
    screen.frame(3)
    screen.press("Enter")
    assert screen.requests[-1] == OpenPath(odd)
    screen.readout = replace(screen.readout, grid=None)
    screen.state.desk.card = None
    screen.frame(3)
    screen.readout = replace(OPEN, name="caf\udce9", source=str(odd))
    screen.frame(3)
    assert screen.layout.panel is not None
    screen.move(screen.layout.panel.x + 30, screen.layout.panel.y + 20)
    screen.frame(60)  # the tooltip
