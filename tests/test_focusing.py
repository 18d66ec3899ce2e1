"""Values of refocusing, slices and stereo; the disparity of one point, against the shader that carries whole maps."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from canvas_maps import map_of

from app.canvas import Canvas, Frame
from app.focusing import (
    APERTURE_LIMITS,
    Choice,
    Focusing,
    captured_sliced,
    captured_summed,
    carried_disparity,
    focus_limits,
    place_in_slice,
    share_of_slice,
)
from app.layout import lay_out, with_strips
from app.painting import in_bytes
from app.plain_json import from_json, to_json
from app.state import Look
from lfcore.key_frames import MAX_FOCUS


@pytest.fixture
def canvas(gl: Any) -> Iterator[Canvas]:
    made = Canvas(gl, "f4")
    yield made
    made.clear()
    assert gl.error == "GL_NO_ERROR"


def test_the_disparity_of_a_point_is_that_of_the_shader(canvas: Canvas) -> None:
    height, width = 40, 50
    y, x = np.mgrid[:height, :width]
    disparity = np.where((abs(x - 25) < 8) & (abs(y - 20) < 9), -6.0, 3.0 + 0.02 * x).astype(np.float32)  # a near box
    canvas.set_light_field(np.zeros((4, height, width, 3), np.uint8))
    image = np.zeros((height, width, 3), np.float32)
    made_at = (0.5, 0.4)
    canvas.set_synthesis(image, in_bytes(image), disparity, made_at)
    chance = np.random.default_rng(0)
    for viewpoint in (made_at, (0.1, 0.9), (1.2, -0.2)):
        frame = Frame(Look.DISPARITY, viewpoint)
        carried = map_of(canvas, frame)
        for _ in range(60):
            px, py = int(chance.integers(width)), int(chance.integers(height))
            found = carried_disparity(disparity, made_at, viewpoint, (px + 0.7, py + 0.2))
            assert found == pytest.approx(float(carried[py, px]))
    assert carried_disparity(disparity, made_at, made_at, (-0.1, 3)) is None
    assert carried_disparity(disparity, made_at, made_at, (3, height)) is None


def test_captured_views_serve_where_there_are_enough_and_close_enough() -> None:
    assert captured_summed(Choice.AUTOMATIC, 8, 8, (-4.0, 5.0))
    assert not captured_summed(Choice.AUTOMATIC, 2, 2, (-4.0, 5.0))
    assert not captured_summed(Choice.AUTOMATIC, 5, 5, (-14.0, 14.0))  # 7 px from view to view: ghosts
    assert captured_summed(Choice.AUTOMATIC, 2, 2, None)  # nothing else can be done without any disparity
    assert captured_summed(Choice.CAPTURED, 2, 2, (-4.0, 5.0))
    assert not captured_summed(Choice.SYNTHESIZED, 8, 8, (-4.0, 5.0))
    assert captured_summed(Choice.SYNTHESIZED, 8, 8, None)
    assert captured_sliced(Choice.AUTOMATIC, 3, 3)
    assert not captured_sliced(Choice.AUTOMATIC, 2, 9)
    assert captured_sliced(Choice.CAPTURED, 2, 2)


def test_values_stay_within_their_limits() -> None:
    wild = Focusing(focus=1e9, aperture=-3.0, baseline=99.0, convergence=-1e9).bounded()
    assert (wild.focus, wild.aperture, wild.baseline, wild.convergence) == (MAX_FOCUS, 0.0, 1.0, -MAX_FOCUS)
    focusing = Focusing(aperture=0.1)
    for _ in range(60):
        focusing = focusing.with_aperture_scaled(-1)
    assert focusing.aperture == 0.0
    seen = []
    for _ in range(60):
        focusing = focusing.with_aperture_scaled(1)
        seen.append(focusing.aperture)
    assert seen == sorted(seen)
    assert 0 < seen[0] < 0.1
    assert focusing.aperture == APERTURE_LIMITS[1]


def test_it_is_kept_as_json() -> None:
    value = Focusing(-2.5, 0.4, Choice.CAPTURED, True, (3.0, 4.5), 0.2, 1.0)
    assert from_json(Focusing, to_json(value)) == value


def test_a_slider_of_focus_goes_beyond_the_scene_in_whole_pixels() -> None:
    assert focus_limits(None) == (-8.0, 8.0)
    low, high = focus_limits((-3.2, 4.9))
    assert low < -3.2 - 1 and high > 4.9 + 1
    assert low == int(low) and high == int(high)


def test_eyes_lie_beside_the_viewpoint() -> None:
    left, right = Focusing(baseline=0.4).eyes((0.5, 0.3))
    assert left == pytest.approx((0.3, 0.3))  # u is the camera's own position to the right
    assert right == pytest.approx((0.7, 0.3))


def test_places_in_a_slice_and_back() -> None:
    for place in (0.0, 0.25, 1.0):
        share = share_of_slice(place)
        assert 0 < share < 1
        assert place_in_slice(share) == pytest.approx(place)


def test_strips_take_their_room_from_the_picture() -> None:
    layout = lay_out(1280, 800, 1.0, True)
    shared = with_strips(layout, 1.0)
    assert shared.strips is not None
    picture, below, beside = shared.picture, shared.strips.below, shared.strips.beside
    assert below.y >= picture.y + picture.height and below.y + below.height == layout.picture.y + layout.picture.height
    assert beside.x >= picture.x + picture.width and beside.x + beside.width == layout.picture.x + layout.picture.width
    assert below.width == picture.width and beside.height == picture.height
    small = lay_out(200, 150, 1.0, True)
    assert with_strips(small, 1.0) == small
