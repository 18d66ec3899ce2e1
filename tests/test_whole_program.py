"""The program as a person uses it: a window on a virtual screen, real mouse and key events, and what is then on the screen."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from moving_scene import DISPARITY, light_field, truth
from virtual_screen import SIZE, VirtualScreen, wait_until

from app.geometry import Zoom, place
from app.layout import lay_out
from app.picture import DRAG_SPAN
from lfcore import colormaps
from lfcore.lightfield import FloatArray, LightField

ROOT = Path(__file__).parents[1]
VIEW = (240, 320)  # (H, W)
MARGIN = 8  # what some corner view does not see
BESIDE = (150, 650)  # in the area of the picture, but not on it: the cursor is drawn into the pixels of the screen
INSIDE = (slice(MARGIN, -MARGIN), slice(MARGIN, -MARGIN))

# The program itself, on a model that knows the truth and takes half a second for it.
PROGRAM = """
import sys
from pathlib import Path
from app.engine import Engine
from app.viewer import show
from tests.moving_scene import TruthSynthesizer
show(Path(sys.argv[1]), Engine(lambda: TruthSynthesizer(0.5), 2**26), "truth")
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The made-up light field as a folder of 4 x 4 views; its path has spaces and letters beyond ASCII."""
    return save(light_field(4, 4, VIEW), tmp_path_factory.mktemp("ein Lichtfeld für Tests"))


def save(made: LightField, folder: Path) -> Path:
    for row in range(made.rows):
        for column in range(made.columns):
            buffer = oiio.ImageBuf(oiio.ImageSpec(made.width, made.height, 3, oiio.UINT8))
            buffer.set_pixels(oiio.ROI(), made.views[row, column])
            assert buffer.write(str(folder / f"view_{row:02d}_{column:02d}.png"))
    return folder


def shown(screen: VirtualScreen) -> FloatArray:
    """The picture on the screen at 1:1, float32 (H, W, 3)."""
    area = lay_out(*SIZE, 1.0, panel_wanted=True).picture
    x, y = map(int, place(Zoom(1.0), (VIEW[1], VIEW[0]), area).origin)
    return screen.pixels()[y : y + VIEW[0], x : x + VIEW[1]].astype(np.float32) / 255


def shows(screen: VirtualScreen, expected: FloatArray, tolerance: float) -> bool:
    return float(np.abs(shown(screen) - expected)[INSIDE].max()) <= tolerance


EXACT = 1.1 / 255  # the truth, rounded to 8 bits
WARPED = 4 / 255  # bicubic interpolation between 8-bit values


def test_drag_and_overlays(screen: VirtualScreen, folder: Path) -> None:
    with screen.program(PROGRAM, str(folder)) as program:
        wait_until(lambda: screen.pixels().max() > 100, "the window")
        screen.xdotool("mousemove", *BESIDE)
        # 1:1 before anything else; the key is pressed again until the window takes keys.
        wait_until(lambda: (screen.xdotool("key", "z"), shows(screen, truth(0.5, 0.5, VIEW), EXACT))[1], "the first synthesis")

        # Dragging shows the warped corners at once, before the synthesis can be there; the content goes with the hand.
        delta = (54, -36)
        u, v = 0.5 - delta[0] / DRAG_SPAN, 0.5 - delta[1] / DRAG_SPAN
        screen.drag(BESIDE, delta)
        wait_until(lambda: shows(screen, truth(u, v, VIEW), WARPED), "the picture of the dragged viewpoint")
        screen.xdotool("mouseup", 1)
        wait_until(lambda: shows(screen, truth(u, v, VIEW), EXACT), "its synthesis")
        assert DISPARITY < 0  # near content: it has moved to the right, as the hand has
        assert not shows(screen, truth(0.5, 0.5, VIEW), WARPED)

        # One disparity everywhere takes the colour in the middle of the map.
        screen.xdotool("key", "2")
        middle = colormaps.disparity_colours()[127:129].mean(0) / 255
        wait_until(lambda: shows(screen, np.broadcast_to(middle, (*VIEW, 3)), 3 / 255), "the disparity")

        # The warped top left input is, where that view sees it, the same picture.
        screen.xdotool("key", "5")
        wait_until(lambda: shows(screen, truth(u, v, VIEW), WARPED), "a warped input")

        # On a captured view, the error of a true synthesis is that of 8 bits, and 8 times as bright.
        screen.xdotool("key", "s")
        screen.xdotool("key", "3")
        legend = slice(0, VIEW[0] // 2)  # the scale lies over the lower part
        wait_until(lambda: shown(screen)[legend].max() <= 8 * 0.51 / 255 + EXACT, "the error")
        screen.xdotool("key", "1")
        screen.xdotool("key", "c")
        u, v = (np.round(np.array((u, v)) * 3) / 3).tolist()
        wait_until(lambda: shows(screen, truth(u, v, VIEW), EXACT), "the captured view")

        screen.xdotool("key", "ctrl+q")
        assert program.wait(30) == 0
        assert program.stderr is not None
        assert program.stderr.read() == ""


def test_a_faulty_path_is_said_and_the_viewer_lives_on(screen: VirtualScreen, folder: Path, tmp_path: Path) -> None:
    empty = tmp_path / "empty"
    empty.mkdir()
    with screen.program(PROGRAM, str(empty)) as program:
        wait_until(lambda: screen.pixels().max() > 100, "the window")
        message = (232, 118, 108)  # the edge of a message

        def message_shown() -> bool:
            return bool((np.abs(screen.pixels().astype(int) - message).sum(2) <= 6).sum() > 50)

        wait_until(message_shown, "the message")
        screen.xdotool("mousemove", *BESIDE)
        screen.xdotool("key", "Escape")
        wait_until(lambda: not message_shown(), "the message to go")
        wait_until(screen.still, "the start picture")
        screen.press_and_see("ctrl+shift+o", "the path field")
        wait_until(lambda: screen.still(but_for_a_caret=True), "the path field to take keys")
        link = tmp_path / "field"
        link.symlink_to(folder)
        screen.xdotool("type", "--delay", 40, str(link))
        screen.xdotool("key", "Return")
        screen.xdotool("key", "z")
        wait_until(lambda: (screen.xdotool("key", "z"), shows(screen, truth(0.5, 0.5, VIEW), EXACT))[1], "the synthesis")
        screen.xdotool("key", "ctrl+q")
        assert program.wait(30) == 0


def test_without_a_display_one_sentence_says_so() -> None:
    code = "from app.viewer import run_viewer\nfrom lfcore.errors import LfviewError\n"
    code += "try:\n    run_viewer(None)\nexcept LfviewError as error:\n    print(error)"
    environment = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")}
    result = subprocess.run([sys.executable, "-c", code], env=environment, cwd=ROOT, capture_output=True, text=True, timeout=60)
    assert result.returncode == 0, result.stderr
    assert "no display" in result.stdout
    assert result.stdout.count("\n") == 1


def test_the_window_is_imported_without_torch() -> None:
    code = "import sys, app.viewer; print('torch' in sys.modules)"
    result = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, timeout=60)
    assert result.stdout == "False\n", result.stderr
