"""The inspector, the grid and the values on pixels, and the double click: by fed events and what is then drawn."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from app.geometry import Rect, Zoom, place
from app.overlays.pixels import seen
from app.panels import picture_size
from app.samples import Part, Samples
from app.state import Look
from lfcore.lightfield import CORNERS, LightField
from tests.test_panels import OPEN, Screen

HEIGHT, WIDTH = 376, 541


@pytest.fixture
def samples() -> Samples:
    views = np.full((2, 2, HEIGHT, WIDTH, 3), 128, np.uint8)
    image = np.full((HEIGHT, WIDTH, 3), 0.25, np.float32)
    return Samples(LightField(views, "flat", "", ""), (0.5, 0.5), image, np.zeros((HEIGHT, WIDTH), np.float32))


@pytest.fixture
def screen(imgui_context: Any, samples: Samples) -> Screen:
    made = Screen(imgui_context)
    made.readout = replace(OPEN, samples=samples, has_disparity=True, disparity_range=(-1.0, 1.0))
    return made


def vertices(screen: Screen) -> int:
    screen.frame(3)
    return int(screen.imgui.get_draw_data().total_vtx_count)


def of_the_inspector(screen: Screen) -> int:
    """How many more vertices there are with it than without."""
    screen.state.inspector = False
    without = vertices(screen)
    screen.state.inspector = True
    return vertices(screen) - without


def test_the_inspector_comes_and_goes_by_its_key(screen: Screen) -> None:
    screen.move(400, 300)
    before = vertices(screen)
    screen.press("V")
    assert screen.state.inspector
    shown = vertices(screen)
    assert shown > before + 200  # a card full of words
    screen.move(*SIZE_BESIDE)
    assert before < vertices(screen) < shown  # names without values
    screen.press("V")
    screen.move(400, 300)
    assert vertices(screen) == before


SIZE_BESIDE = (400, 5)  # over the area, but beside the picture


@pytest.mark.parametrize("look", list(Look))
def test_it_has_something_to_say_in_every_look(screen: Screen, look: Look) -> None:
    screen.state.look, screen.state.zoom = look, Zoom(40.0)
    screen.move(400, 300)
    assert of_the_inspector(screen) > 200
    screen.move(950, 700)  # beyond the view, in looks that show larger pictures
    told = of_the_inspector(screen)
    screen.readout = replace(screen.readout, samples=None)
    assert 200 < of_the_inspector(screen) < told  # names without values


def test_grid_and_values_come_with_the_magnification(screen: Screen) -> None:
    drawn = {}
    for scale in (15.0, 17.0, 33.0):
        screen.state.zoom = Zoom(scale)
        drawn[scale] = vertices(screen)
    area = screen.layout.picture
    lines = area.width / 17 + area.height / 17
    assert drawn[17.0] - drawn[15.0] == pytest.approx(4 * lines, rel=0.1)
    digits = 3 * 2 * (area.width / 33) * (area.height / 33)  # "64" three times a pixel
    assert drawn[33.0] - drawn[15.0] == pytest.approx(4 * (digits + area.width / 33 + area.height / 33), rel=0.15)
    screen.readout = replace(screen.readout, samples=None)
    assert vertices(screen) < drawn[17.0]  # a wider grid, and no values


def test_only_pixels_in_sight_are_asked_for() -> None:
    area = Rect(10, 20, 100, 60)
    for scale, centre in ((16.0, (0.5, 0.5)), (40.0, (0.0, 1.0)), (7.3, (0.9, 0.2))):
        placement = place(Zoom(scale, centre), (80, 50), area)
        part = seen(placement, (80, 50), area)
        assert part is not None
        for x in range(80):
            left, right = placement.to_window((x, 0))[0], placement.to_window((x + 1, 0))[0]
            assert (part.left <= x < part.right) == (right > area.x and left < area.x + area.width)
        for y in range(50):
            top, bottom = placement.to_window((0, y))[1], placement.to_window((0, y + 1))[1]
            assert (part.top <= y < part.bottom) == (bottom > area.y and top < area.y + area.height)
    assert seen(place(Zoom(2.0, (0.5, 0.5)), (80, 50), area), (80, 50), Rect(900, 900, 10, 10)) is None


def test_a_double_click_goes_to_1_to_1_about_the_cursor_and_back(screen: Screen) -> None:
    state, picture, area = screen.state, picture_size(screen.readout, screen.state), screen.layout.picture
    at = (300, 250)
    before = place(state.zoom, picture, area).to_picture(at)
    for scale in (1.0, None):
        screen.click(*at)
        screen.click(*at)
        assert state.zoom.scale == scale
        if scale is not None:
            after = place(state.zoom, picture, area).to_picture(at)
            assert after == pytest.approx(before, abs=0.6)  # pictures lie on whole pixels of the window
        for _ in range(40):  # so that the next click is not the third of the same
            screen.frame()
            screen.io.delta_time = 0.02
    assert (state.u, state.v) == (0.5, 0.5)


def test_on_the_sheet_the_input_under_the_cursor_is_known(screen: Screen) -> None:
    state, area = screen.state, screen.layout.picture
    state.look, state.inspector = Look.WARPED_ALL, True
    screen.frame(2)
    placement = place(state.zoom, picture_size(screen.readout, state), area)
    for u, v in CORNERS:
        screen.move(*placement.to_window((u * WIDTH + 100.5, v * HEIGHT + 50.5)))
        screen.frame()
        assert state.tile == (u, v)
        assert state.cursor == pytest.approx((100.5, 50.5), abs=1.2)  # the mouse is on whole pixels of the window


def test_a_part_is_rows_and_columns() -> None:
    assert Part(3, 5, 17, 11).slices == (slice(5, 11), slice(3, 17))
