"""The plain values behind the window: placement, zoom, the grid of captured views, the hand that drags."""

from __future__ import annotations

import random

import pytest

from app.controller import MAGNET_RADIUS
from app.geometry import ZOOM_LIMITS, Rect, Zoom, fit_scale, pan_by, place, zoom_about
from app.layout import lay_out
from app.state import GAIN_LIMITS, Grid, Look, ViewState
from lfcore.lightfield import CORNERS

AREA = Rect(0, 0, 984, 770)
PICTURE = (541, 376)


def test_fit_shows_the_whole_picture_as_large_as_possible() -> None:
    placement = place(Zoom(), PICTURE, AREA)
    left, top = placement.to_window((0, 0))
    right, bottom = placement.to_window(PICTURE)
    assert left >= -0.5
    assert top >= -0.5
    assert right <= AREA.width + 0.5
    assert bottom <= AREA.height + 0.5
    assert min(AREA.width - (right - left), AREA.height - (bottom - top)) == pytest.approx(0, abs=1e-6)


def test_window_and_picture_points_are_inverse() -> None:
    chance = random.Random(1)
    for _ in range(100):
        zoom = Zoom(chance.uniform(0.1, 20), (chance.random(), chance.random()))
        placement = place(zoom, PICTURE, AREA)
        point = (chance.uniform(0, 541), chance.uniform(0, 376))
        assert placement.to_picture(placement.to_window(point)) == pytest.approx(point)


def test_zooming_keeps_the_point_under_the_cursor() -> None:
    cursor = (300.0, 420.0)
    zoom = Zoom(2.0, (0.5, 0.5))
    before = place(zoom, PICTURE, AREA).to_picture(cursor)
    for factor in (1.2, 1.5, 0.9):
        zoom = zoom_about(zoom, factor, cursor, PICTURE, AREA)
        placement = place(zoom, PICTURE, AREA)
        # Origins lie on whole window pixels, so the point may be half a window pixel off.
        assert placement.to_picture(cursor) == pytest.approx(before, abs=0.51 / placement.scale)


def test_zoom_stays_within_its_limits() -> None:
    zoom = Zoom()
    for _ in range(100):
        zoom = zoom_about(zoom, 1.5, (10, 10), PICTURE, AREA)
    assert zoom.scale == ZOOM_LIMITS[1]
    for _ in range(100):
        zoom = zoom_about(zoom, 0.5, (10, 10), PICTURE, AREA)
    assert zoom.scale == ZOOM_LIMITS[0]


def test_panning_moves_the_picture_with_the_hand_and_never_out_of_sight() -> None:
    zoom = Zoom(2.0, (0.5, 0.5))
    moved = pan_by(zoom, (30, -20), PICTURE, AREA)
    before, after = place(zoom, PICTURE, AREA).origin, place(moved, PICTURE, AREA).origin
    assert (after[0] - before[0], after[1] - before[1]) == pytest.approx((30, -20), abs=1)
    far = pan_by(zoom, (1e6, 1e6), PICTURE, AREA)
    x, y = place(far, PICTURE, AREA).origin
    assert AREA.contains((x, y))


def test_panning_a_fitted_picture_keeps_its_size() -> None:
    assert pan_by(Zoom(), (10, 0), PICTURE, AREA).scale == fit_scale(PICTURE, AREA)


def test_captured_views_are_counted_row_by_row() -> None:
    grid = Grid(rows=3, columns=5, width=10, height=10)
    assert grid.position(0) == (0, 0)
    assert grid.position(4) == (1, 0)
    assert grid.position(5) == (0, 0.5)
    assert grid.position(14) == (1, 1)
    for index in range(15):
        assert grid.nearest(*grid.position(index)) == index
        assert grid.at(*grid.position(index)) == index


def test_captured_views_between_and_beyond() -> None:
    grid = Grid(rows=3, columns=5, width=10, height=10)
    assert grid.at(0.3, 0.5) is None
    assert grid.nearest(-0.25, 1.25) == 10
    assert grid.stepped(1, 1, 1) == 0
    assert grid.stepped(0, 0, -1) == 14
    assert grid.stepped(0.01, 0, 0) == 0


def test_viewpoint_is_clamped_to_the_extrapolation_limit() -> None:
    state = ViewState()
    state.move_to(9, -9)
    assert (state.u, state.v) == (1.25, -0.25)
    state.drag_by(-9, 9)
    assert (state.u, state.v) == (-0.25, 1.25)


def test_a_drag_goes_on_from_the_hand_not_from_the_magnet() -> None:
    state = ViewState()
    state.drag_by(0.1, 0)
    state.u += MAGNET_RADIUS  # a magnet has pulled the viewpoint
    state.drag_by(0.1, 0)
    assert state.u == pytest.approx(0.7)


def test_contrast_changes_what_is_looked_at_only() -> None:
    state = ViewState(look=Look.ERROR)
    gain, tail = state.gain, state.tail
    state.change_contrast(2)
    assert (state.gain, state.tail) == (2 * gain, tail)
    for _ in range(20):
        state.change_contrast(2)
    assert state.gain == GAIN_LIMITS[1]
    state.look = Look.DISPARITY
    state.change_contrast(0.5)
    assert state.tail < tail


def test_each_single_warped_look_is_the_corner_of_its_name() -> None:
    for look in Look:
        if look.corner is not None:
            u, v = CORNERS[look.corner]
            assert look.value.endswith(f"{'bottom' if v else 'top'} {'right' if u else 'left'}")


@pytest.mark.parametrize("size", [(200, 150), (10, 10), (1280, 800), (5000, 3000)])
@pytest.mark.parametrize("scale", [1.0, 2.0, 3.0])
def test_parts_of_the_window_fill_it_without_overlap(size: tuple[int, int], scale: float) -> None:
    layout = lay_out(*size, scale, panel_wanted=True)
    parts = [layout.picture, layout.status] + ([layout.panel] if layout.panel else [])
    assert sum(part.width * part.height for part in parts) == pytest.approx(size[0] * size[1])
    assert all(part.width > 0 and part.height > 0 for part in parts)
    assert layout.picture.width >= size[0] / 2
