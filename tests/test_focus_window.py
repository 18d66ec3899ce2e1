"""Refocusing, stereo and slices in the real window on a virtual screen, by real mouse and key events."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from app.focusing import place_in_slice
from app.geometry import Rect, Zoom, place
from app.layout import lay_out, with_strips
from lfcore.export import write_picture
from lfcore.lightfield import FloatArray, LightField
from lfcore.refocus import aperture_weights, refocus
from tests.plane_synthesizer import DISPARITY, view
from tests.scenes import plane
from tests.virtual_screen import SIZE, VirtualScreen, wait_until

VIEW = (120, 160)
MARGIN = 9  # what some views do not see
INSIDE = (slice(MARGIN, -MARGIN), slice(MARGIN, -MARGIN))
TOLERANCE = 3 / 255  # views of 8 bits, summed up, rounded to 8 bits
CARRIED = 5 / 255  # cubic interpolation between them
BESIDE = (150, 650)  # in the area of the picture, but not on it: the cursor is drawn into the pixels of the screen

PROGRAM = """
import sys
from pathlib import Path
from app.engine import Engine
from app.viewer import show
from tests.plane_synthesizer import PlaneSynthesizer
show(Path(sys.argv[1]), Engine(PlaneSynthesizer, 2**26), "truth")
"""


def shown(screen: VirtualScreen, area: Rect, size: tuple[int, int] = (VIEW[1], VIEW[0])) -> FloatArray:
    """The picture of that (width, height) on the screen at 1:1, float32 (H, W, 3)."""
    x, y = map(int, place(Zoom(1.0), size, area).origin)
    return screen.pixels()[y : y + size[1], x : x + size[0]].astype(np.float32) / 255


def captured() -> LightField:
    """7 x 7 views of the plane in 8 bits."""
    return LightField(np.round(plane(DISPARITY, (7, 7), VIEW).views * 255).astype(np.uint8), "plane", "tests", "made up")


def refocused(scene: LightField, focus: float) -> FloatArray:
    """All views inside an aperture of one baseline, by the library."""
    places = [(row, column) for row in range(scene.rows) for column in range(scene.columns)]
    positions = np.array([scene.position(*each) for each in places])
    weights = aperture_weights(positions, (0.5, 0.5), 1.0, 1 / (scene.rows - 1))
    return refocus(
        ((scene.position(*each), scene.view(*each), weight) for each, weight in zip(places, weights, strict=True)),
        (0.5, 0.5),
        focus,
    )


def test_refocus_stereo_and_slices(screen: VirtualScreen, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    scene = captured()
    folder = tmp_path / "a scene é"
    folder.mkdir()
    for row, views in enumerate(scene.views):
        for column, picture in enumerate(views):
            write_picture(folder / f"view_{row:02}_{column:02}.png", picture)
    layout = lay_out(*SIZE, 1.0, panel_wanted=True)
    area = layout.picture

    def shows(expected: FloatArray, tolerance: float) -> bool:
        return float(np.abs(shown(screen, area) - expected)[INSIDE].max()) <= tolerance

    with screen.program(PROGRAM, str(folder)) as program:
        wait_until(lambda: screen.pixels().max() > 100, "the window")
        screen.xdotool("mousemove", *BESIDE)
        here = view(0.5, 0.5, VIEW)
        wait_until(lambda: (screen.xdotool("key", "z"), shows(here, TOLERANCE))[1], "the first synthesis")

        # At another disparity than the scene's it is blurred as the library says; a click focuses on the scene.
        screen.xdotool("key", "o")
        wait_until(lambda: shows(refocused(scene, 0.0), TOLERANCE), "the picture focused at 0")
        assert not shows(here, 10 / 255)
        x, y = place(Zoom(1.0), (VIEW[1], VIEW[0]), area).to_window((70.5, 60.5))
        screen.click(int(x), int(y))
        screen.xdotool("mousemove", *BESIDE)
        wait_until(lambda: shows(here, TOLERANCE), "the picture focused where it was clicked")

        # A pair: what eyes 0.3 of the baseline apart see.
        screen.xdotool("key", "j", "sleep", 0.3, "key", "j")

        def shows_pair() -> bool:
            pair = shown(screen, area, (2 * VIEW[1], VIEW[0]))
            eyes = ((pair[:, : VIEW[1]], 0.35), (pair[:, VIEW[1] :], 0.65))
            return all(np.abs(half - view(u, 0.5, VIEW))[INSIDE].max() <= CARRIED for half, u in eyes)

        wait_until(shows_pair, "the pair side by side")
        screen.xdotool("key", "1")

        # Slices through the cursor: each row is the line of the captured view there.
        screen.xdotool("key", "u")
        shared = with_strips(layout, 1.0)
        assert shared.strips is not None
        origin = place(Zoom(1.0), (VIEW[1], VIEW[0]), shared.picture).origin
        point = (70, 60)
        screen.xdotool("mousemove", int(origin[0]) + point[0], int(origin[1]) + point[1])
        below = shared.strips.below
        expected = {}
        for k in range(int(below.height)):
            place_in_grid = 6 * place_in_slice((k + 0.5) / below.height)
            column = min(max(round(place_in_grid), 0), 6)
            if abs(place_in_grid - column) < 0.3 and column != 3:  # 3 is where u is drawn
                expected[k] = scene.view(3, column)[point[1]]

        def shows_slice() -> bool:
            strip = screen.pixels()[int(below.y) : int(below.y + below.height), int(origin[0]) : int(origin[0]) + VIEW[1]]
            values = strip.astype(np.float32) / 255
            beside = np.abs(np.arange(VIEW[1]) - point[0]) > 12  # the slope of the disparity is drawn there
            return all(np.abs(values[k] - line)[beside].max() <= TOLERANCE for k, line in expected.items())

        wait_until(shows_slice, "the slice")

        # A click in it goes to that u; the slope of what is under the cursor has been its disparity.
        screen.click(int(below.x) + 300, int(below.y) + 10)
        u = place_in_slice(10.5 / below.height)
        screen.xdotool("mousemove", 150, 560)

        def moved() -> bool:
            picture = shown(screen, shared.picture)
            beside = np.ones(VIEW, bool)
            beside[point[1] - 2 : point[1] + 3] = beside[:, point[0] - 2 : point[0] + 3] = False  # lines are drawn there
            there = [np.abs(picture - view(at, 0.5, VIEW)).max(-1)[INSIDE][beside[INSIDE]].max() for at in (u, 0.0)]
            return min(there) <= TOLERANCE

        wait_until(moved, "the viewpoint that was clicked in the slice")
        screen.xdotool("key", "ctrl+q")
        assert program.wait(60) == 0
        assert program.stderr is not None
        assert program.stderr.read() == ""


def test_the_truth_is_as_it_says() -> None:
    """What the other test relies on: the scene lies at its disparity, and is far from sharp at 0."""
    scene, here = captured(), view(0.5, 0.5, VIEW)
    assert np.abs(refocused(scene, DISPARITY) - here)[INSIDE].max() < TOLERANCE
    assert np.abs(refocused(scene, 0.0) - here)[INSIDE].max() > 10 * TOLERANCE
