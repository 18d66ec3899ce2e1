"""One whole use by mouse and keys on a virtual screen: open, drag, look, wipe, refocus, export, close."""

from __future__ import annotations

from pathlib import Path

import av
import numpy as np
from moving_scene import light_field, truth
from virtual_screen import VirtualScreen, wait_until

from tests.test_whole_program import BESIDE, EXACT, VIEW, save, shown, shows

VIEWPOINT = (2 / 3, 2 / 3)  # the captured view of 4 x 4 that S finds from the middle
FRAMES = 120  # of an export as it is offered


# The program with nothing open, on a model that knows the truth.
PROGRAM = """
from app.engine import Engine, ModelChoice
from app.viewer import show
from tests.moving_scene import TruthSynthesizer
make = lambda: TruthSynthesizer(0.02)
show(None, Engine(make, 2**26, name="truth"), "truth", models={"truth": ModelChoice(make, False)})
"""


def test_open_drag_look_wipe_refocus_export_close(screen: VirtualScreen, tmp_path: Path) -> None:
    views = tmp_path / "a light field"
    views.mkdir()
    save(light_field(4, 4, VIEW), views)
    with screen.program(PROGRAM) as program:
        wait_until(lambda: screen.pixels().max() > 100, "the window")
        screen.xdotool("mousemove", *BESIDE)

        # Open by its path.
        wait_until(screen.still, "the start picture")
        screen.press_and_see("ctrl+shift+o", "the path field")
        wait_until(lambda: screen.still(but_for_a_caret=True), "the path field to take keys")
        link = tmp_path / "field"  # a short path, so that typing it takes no time
        link.symlink_to(views)
        screen.xdotool("type", "--delay", 40, str(link))
        screen.xdotool("key", "Return")
        wait_until(lambda: (screen.xdotool("key", "z"), shows(screen, truth(0.5, 0.5, VIEW), EXACT))[1], "the first synthesis")

        # Drag, and undo the drag.
        screen.drag(BESIDE, (60, 40))
        screen.xdotool("mouseup", 1)
        wait_until(lambda: not shows(screen, truth(0.5, 0.5, VIEW), 4 / 255), "the dragged picture")
        screen.xdotool("key", "ctrl+z")
        wait_until(lambda: shows(screen, truth(0.5, 0.5, VIEW), EXACT), "the viewpoint of before")

        # Every look of the number row, and back.
        pictures = set()
        for key in ("2", "4", "5", "9", "0", "1"):
            screen.press_and_see(key, f"the look of key {key}")
            wait_until(screen.still, "its end")
            pictures.add(screen.pixels().tobytes())
        assert len(pictures) == 6

        # Wipe against the captured view, which the truth equals.
        screen.xdotool("key", "s")
        screen.xdotool("key", "w")
        wait_until(lambda: _shows_nearly_all(screen, VIEWPOINT), "the wipe")
        screen.xdotool("key", "w")

        # Refocus on the plane: all views agree there, so the picture is the truth.
        screen.xdotool("key", "o")
        screen.xdotool("mousemove", 490, 385)
        screen.xdotool("click", 1)
        screen.xdotool("mousemove", *BESIDE)  # the cursor itself is no part of the picture
        wait_until(lambda: shows(screen, truth(*VIEWPOINT, VIEW), 6 / 255), "the refocused picture")
        screen.xdotool("key", "o")

        # Export.
        screen.press_and_see("ctrl+e", "the tab Export")
        screen.xdotool("key", "ctrl+shift+e")
        video = tmp_path / f"{views.name} sweep.mp4"
        wait_until(video.is_file, "the exported video")
        with av.open(str(video)) as container:
            frames = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
        assert len(frames) == FRAMES
        assert frames[0].shape == (*VIEW, 3)
        assert np.abs(frames[0] - 255 * truth(0.8, 0.5, VIEW)).mean() < 6  # the circle begins at the right
        assert [each.name for each in tmp_path.iterdir() if each.suffix] == [video.name]

        screen.xdotool("key", "ctrl+w")
        screen.xdotool("key", "ctrl+q")
        assert program.wait(30) == 0
        assert program.stderr is not None
        assert program.stderr.read() == ""


def _shows_nearly_all(screen: VirtualScreen, viewpoint: tuple[float, float]) -> bool:
    """Whether the picture of that viewpoint is there, but for a line with its handle."""
    return float((np.abs(shown(screen) - truth(*viewpoint, VIEW)).max(2) <= EXACT).mean()) > 0.9
