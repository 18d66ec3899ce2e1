"""What lies around the picture, used by real mouse and key events: a folder, the palette, undo, settings that are kept."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from moving_scene import light_field, truth
from test_whole_program import BESIDE, EXACT, INSIDE, VIEW, save, shown, shows
from virtual_screen import VirtualScreen, wait_until

from app.settings import Settings, SettingsFile, Theme
from lfcore import colormaps

PROGRAM = """
import sys
from pathlib import Path
from app.engine import Engine
from app.settings import SettingsFile
from app.surroundings import Keeping
from app.viewer import show
from lfcore.thumbnails import ThumbnailStore
from tests.moving_scene import TruthSynthesizer
file = SettingsFile(Path(sys.argv[1]))
store = ThumbnailStore(Path(sys.argv[1]).parent / "thumbnails")
keeping = Keeping(file.load()[0], None, file, lambda: store)
path = Path(sys.argv[2]) if len(sys.argv) > 2 else None
show(path, Engine(lambda: TruthSynthesizer(0.1), 2**26), "truth", keeping=keeping)
"""
MIDDLE = colormaps.disparity_colours()[127:129].mean(0) / 255  # one disparity everywhere takes the colour in the middle


def settings_of(kept: Path) -> Settings:
    return SettingsFile(kept).load()[0]


def test_from_a_folder_to_a_view_and_back_in_the_next_run(screen: VirtualScreen, tmp_path: Path) -> None:
    kept, folder = tmp_path / "settings.json", tmp_path / "scenes"
    for name in ("a", "b"):
        (folder / name).mkdir(parents=True)
        save(light_field(3, 3, VIEW), folder / name)
    disparity = np.broadcast_to(MIDDLE, (*VIEW, 3)).astype(np.float32)

    with screen.program(PROGRAM, str(kept), str(folder)) as program:
        # The browser with two thumbnails; the second is chosen and opened.
        wait_until(lambda: screen.pixels()[100:220, 20:380].std() > 25, "the thumbnails")
        screen.xdotool("mousemove", *BESIDE)
        screen.xdotool("key", "Right")
        screen.xdotool("key", "Return")
        wait_until(lambda: (screen.xdotool("key", "z"), shows(screen, truth(0.5, 0.5, VIEW), EXACT))[1], "the light field")
        # The disparity by the palette.
        wait_until(screen.still, "nothing more to be computed")
        screen.press_and_see("ctrl+p", "the palette")
        wait_until(lambda: screen.still(but_for_a_caret=True), "the palette to take keys")
        screen.xdotool("type", "--delay", 40, "disparity, in col")
        screen.xdotool("key", "Return")
        wait_until(lambda: shows(screen, disparity, 3 / 255), "the disparity")
        # Undone and redone.
        screen.xdotool("key", "ctrl+z")
        wait_until(lambda: shows(screen, truth(0.5, 0.5, VIEW), EXACT), "the synthesis again")
        screen.xdotool("key", "ctrl+y")
        wait_until(lambda: shows(screen, disparity, 3 / 255), "the disparity again")
        screen.xdotool("key", "ctrl+shift+l")
        wait_until(lambda: screen.pixels()[50:150, 1100:1270].mean() > 150, "the light theme")
        screen.xdotool("key", "ctrl+q")
        assert program.wait(30) == 0
        assert program.stderr is not None
        assert program.stderr.read() == ""
    assert settings_of(kept).recent == (str(folder / "b"),)
    assert settings_of(kept).theme is Theme.LIGHT

    with screen.program(PROGRAM, str(kept)) as program:
        # The start picture shows it; a click opens it as it was looked at.
        wait_until(lambda: screen.pixels()[50:150, 1100:1270].mean() > 150, "the light theme from the start")
        wait_until(lambda: len(pictured(screen)) > 500, "the thumbnail of the recent file")
        y, x = pictured(screen).mean(0).astype(int).tolist()
        screen.xdotool("mousemove", x, y, "click", 1, "mousemove", *BESIDE)
        wait_until(lambda: shows(screen, disparity, 3 / 255), "the light field as it was left")
        assert float(np.abs(shown(screen) - disparity)[INSIDE].max()) <= 3 / 255
        screen.xdotool("key", "ctrl+q")
        assert program.wait(30) == 0


def pictured(screen: VirtualScreen) -> np.ndarray:
    """(y, x) of the pixels that are neither grey nor of a tint of the interface: a thumbnail's."""
    pixels = screen.pixels().astype(int)
    return np.argwhere(np.ptp(pixels, axis=2) > 60)
