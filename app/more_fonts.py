"""Letters that the interface's typeface does not have, as in names of files, from the fonts that the system has.

They are looked for once, when such a letter has been drawn: whoever needs none pays nothing. No shaping: letters of scripts
that join or reorder them stand side by side, each as it is alone.
"""

from __future__ import annotations

import contextlib
import subprocess
import sys
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from imgui_bundle import imgui

from app import theme

# A usual letter of each script that is looked for: Han, Hiragana, Hangul, Hebrew, Arabic, Devanagari, Thai, and an emoji. (Some
# fonts have just the first and the last letter of a script.)
_LETTERS = (0x4E2D, 0x3042, 0xD55C, 0x5D0, 0x627, 0x905, 0xE01, 0x1F600)
# All that the interface draws of itself is below; a letter that is missing is there, or at U+FFFD, which stands for it.
_BEYOND = 0x2FFF
_PATIENCE_SECONDS = 20.0  # fontconfig reads all fonts when it is asked for the first time
# Where there is no fontconfig; the first that is there of each line.
_KNOWN_PLACES = {
    "darwin": (
        ("/System/Library/Fonts/Supplemental/Arial Unicode.ttf", "/Library/Fonts/Arial Unicode.ttf"),
        ("/System/Library/Fonts/AppleSDGothicNeo.ttc",),
    ),
    "win32": (
        ("C:/Windows/Fonts/msyh.ttc", "C:/Windows/Fonts/simsun.ttc"),
        ("C:/Windows/Fonts/YuGothM.ttc", "C:/Windows/Fonts/msgothic.ttc"),
        ("C:/Windows/Fonts/malgun.ttf",),
    ),
}


@dataclass(frozen=True)
class FontFile:
    """A typeface in a file, which may hold several."""

    path: Path
    number: int = 0


class MoreFonts:
    """Gives the interface's fonts, regular and bold, the letters that they lack. Belongs to the thread of the imgui context."""

    def __init__(self, fonts: theme.Fonts) -> None:
        self._fonts = fonts
        self._found: Future[tuple[FontFile, ...]] | None = None
        self._done = False

    @property
    def looking(self) -> bool:
        """Whether the system is being asked, or is to be, so that another frame should follow."""
        return not self._done and (self._found is not None or self._missed_a_letter())

    def follow(self) -> None:
        """Once before each frame: look for fonts where a letter was missing in one before, and take those that were found."""
        if self._done:
            return
        if self._found is None:
            if self._missed_a_letter():
                pool = ThreadPoolExecutor(1, "fonts")
                self._found = pool.submit(fonts_of_the_system)
                pool.shutdown(wait=False)
        elif self._found.done():
            self._done = True
            for file in self._found.result():
                for font in (self._fonts.regular, self._fonts.bold):
                    _merge(font, file)

    def _missed_a_letter(self) -> bool:
        """imgui's table of a font in one size grows to the largest letter that has been asked for."""
        scale = imgui.get_style().font_scale_dpi
        sizes = (theme.SMALL * scale, theme.FONT_SIZE * scale, theme.LARGE * scale)
        fonts = (self._fonts.regular, self._fonts.bold)
        return any(font.get_font_baked(size).index_advance_x.size() > _BEYOND for font in fonts for size in sizes)


def fonts_of_the_system() -> tuple[FontFile, ...]:
    """Fonts with outlines for the scripts named above, none twice; none where the system has none or does not tell."""
    if sys.platform in _KNOWN_PLACES:
        there = (next((path for path in map(Path, line) if path.is_file()), None) for line in _KNOWN_PLACES[sys.platform])
        return tuple(FontFile(path) for path in there if path is not None)
    found = (_by_fontconfig(letter) for letter in _LETTERS)
    return tuple(dict.fromkeys(file for file in found if file is not None))


def _by_fontconfig(letter: int) -> FontFile | None:
    """The font that fontconfig gives for a letter, in the person's language, where that font has it."""
    pattern = f"sans-serif:charset={letter:x}:outline=true:color=false"
    command = ["fc-match", "--format=%{file}\\n%{index}\\n%{charset}", pattern]
    try:
        told = subprocess.run(command, capture_output=True, text=True, timeout=_PATIENCE_SECONDS, check=True).stdout
        path, number, ranges = told.split("\n")
        return FontFile(Path(path), int(number) & 0xFFFF) if _holds(ranges, letter) else None
    except (OSError, ValueError, subprocess.SubprocessError):
        return None


def _holds(ranges: str, letter: int) -> bool:
    """Whether a letter is among fontconfig's ranges, "20-7e a0 ..."."""
    ends = ([int(end, 16) for end in span.split("-")] for span in ranges.split())
    return any(span[0] <= letter <= span[-1] for span in ends)


def _merge(font: imgui.ImFont, file: FontFile) -> None:
    config = imgui.ImFontConfig()
    config.merge_mode, config.dst_font, config.font_no = True, font, file.number
    config.flags = imgui.ImFontFlags_.no_load_error.value  # a file that has gone, or is damaged, adds nothing
    with contextlib.suppress(RuntimeError):  # as one that is next to empty
        imgui.get_io().fonts.add_font_from_file_ttf(str(file.path), theme.FONT_SIZE, config)
