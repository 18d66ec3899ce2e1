"""Stereo pairs, anaglyphs and epipolar slices in shaders, against known truth and slow computation."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from moving_scene import DISPARITY, SIZE, light_field, truth

from app.canvas import Canvas, Frame, Target
from app.canvas.slices import Slicing
from app.focusing import Focusing, place_in_slice
from app.geometry import Placement, Rect
from app.layout import Strips
from app.painting import in_bytes
from app.state import Look
from app.tone import Tone
from lfcore.lightfield import CORNERS, FloatArray

HEIGHT, WIDTH = SIZE
INSIDE = (slice(9, -9), slice(9, -9))
HERE = (0.5, 0.5)


@pytest.fixture
def canvas(gl: Any) -> Iterator[Canvas]:
    made = Canvas(gl, "f4")
    made.set_light_field(np.stack([truth(u, v) for u, v in CORNERS]))
    scene = light_field(5, 5)
    made.set_views(scene.views, scene.dark)
    image = truth(*HERE)
    made.set_synthesis(image, in_bytes(image), np.full(SIZE, DISPARITY, np.float32), HERE)
    yield made
    made.clear()
    assert gl.error == "GL_NO_ERROR"


@pytest.mark.parametrize("baseline", [0.1, 0.3, 0.8])  # carried from the synthesis, and farther off from the corners
def test_a_pair_is_what_the_two_eyes_see(canvas: Canvas, baseline: float) -> None:
    focusing = Focusing(baseline=baseline)
    pair = canvas.read(Frame(Look.STEREO_PARALLEL, HERE, focusing=focusing))
    assert pair.shape == (HEIGHT, 2 * WIDTH, 3)
    left, right = pair[:, :WIDTH], pair[:, WIDTH:]
    np.testing.assert_allclose(left[INSIDE], truth(0.5 - baseline / 2, 0.5)[INSIDE], atol=0.006)
    np.testing.assert_allclose(right[INSIDE], truth(0.5 + baseline / 2, 0.5)[INSIDE], atol=0.006)
    crossed = canvas.read(Frame(Look.STEREO_CROSSED, HERE, focusing=focusing))
    np.testing.assert_array_equal(crossed, np.concatenate([right, left], 1))


def test_both_eyes_see_the_disparity_of_convergence_at_the_same_place(canvas: Canvas) -> None:
    pair = canvas.read(Frame(Look.STEREO_PARALLEL, HERE, focusing=Focusing(baseline=0.4, convergence=DISPARITY)))
    np.testing.assert_allclose(pair[:, :WIDTH][INSIDE], truth(*HERE)[INSIDE], atol=0.006)
    np.testing.assert_allclose(pair[:, WIDTH:][INSIDE], truth(*HERE)[INSIDE], atol=0.006)


def test_an_anaglyph_mixes_the_pair_by_the_published_matrices(canvas: Canvas) -> None:
    focusing = Focusing(baseline=0.4)
    pair = canvas.read(Frame(Look.STEREO_PARALLEL, HERE, focusing=focusing))
    left, right = (np.clip(half.astype(np.float64), 0, 1) ** 2 for half in (pair[:, :WIDTH], pair[:, WIDTH:]))
    of_left = np.array([[0.437, 0.449, 0.164], [-0.062, -0.062, -0.024], [-0.048, -0.050, -0.017]])
    of_right = np.array([[-0.011, -0.032, -0.007], [0.377, 0.761, 0.009], [-0.026, -0.093, 1.234]])
    expected = np.sqrt(np.clip(left @ of_left.T + right @ of_right.T, 0, 1))
    np.testing.assert_allclose(canvas.read(Frame(Look.ANAGLYPH, HERE, focusing=focusing)), expected, atol=2e-4)


def test_in_an_anaglyph_grey_stays_grey_and_each_filter_has_its_eye(canvas: Canvas) -> None:
    flat = Focusing(baseline=0.4)
    for value in (0.2, 0.7):
        grey = np.full((*SIZE, 3), value, np.float32)
        canvas.set_light_field(np.stack([grey] * 4))
        canvas.set_synthesis(grey, in_bytes(grey), np.zeros(SIZE, np.float32), HERE)
        shown = canvas.read(Frame(Look.ANAGLYPH, HERE, focusing=flat))
        np.testing.assert_allclose(shown, value, atol=0.006)
    # A white bar that the eyes see at different places: its red part is where the left eye sees it.
    corners = np.zeros((4, *SIZE, 3), np.float32)
    disparity = -20.0
    for index, (u, _) in enumerate(CORNERS):
        start = 60 + round(disparity * (u - 0.5))
        corners[index, :, start : start + 4] = 1
    image = np.zeros((*SIZE, 3), np.float32)
    image[:, 60:64] = 1
    canvas.set_light_field(corners)
    canvas.set_synthesis(image, in_bytes(image), np.full(SIZE, disparity, np.float32), HERE)
    shown = canvas.read(Frame(Look.ANAGLYPH, HERE, focusing=replace(flat, baseline=0.4)))[HEIGHT // 2]
    # The left eye is at u = 0.3, and near content lies farther to the right there.
    assert shown[64:68, 0].min() > 0.9 and shown[64:68, 1:].max() < 0.1
    assert shown[56:60, 1:].min() > 0.9 and shown[56:60, 0].max() < 0.1


SCALE, MARGIN, EXTENT = 2.0, 7.0, 60.0  # of the window below


def sliced(canvas: Canvas, slicing: Slicing) -> tuple[FloatArray, FloatArray]:
    """Both slices at the scale, (EXTENT, ...) below and (..., EXTENT) beside, and nothing else is drawn."""
    width, height = int(SCALE * WIDTH + MARGIN + EXTENT), int(SCALE * HEIGHT + MARGIN + EXTENT)
    texture = canvas.context.texture((width, height), 4, dtype="f4")
    framebuffer = canvas.context.framebuffer([texture])
    framebuffer.clear(-1.0, -1.0, -1.0)
    area = Rect(0, 0, SCALE * WIDTH, SCALE * HEIGHT)
    strips = Strips(
        Rect(0, SCALE * HEIGHT + MARGIN, SCALE * WIDTH, EXTENT), Rect(SCALE * WIDTH + MARGIN, 0, EXTENT, SCALE * HEIGHT)
    )
    target = Target(framebuffer, (width, height))
    for _ in range(50):
        canvas.prepare(Frame(Look.SYNTHESIS, slicing.viewpoint))
        canvas.draw_slices(slicing, Tone(), target, strips, area, Placement(SCALE, (0.0, 0.0)))
        if not canvas.unfinished:
            break
    assert not canvas.unfinished
    values = np.frombuffer(framebuffer.read(components=3, dtype="f4"), np.float32).reshape(height, width, 3)[::-1]
    canvas._resting_place.use()
    framebuffer.release()
    texture.release()
    beyond = np.ones((height, width), bool)
    below = (slice(int(strips.below.y), None), slice(0, int(strips.below.width)))
    beside = (slice(0, int(strips.beside.height)), slice(int(strips.beside.x), None))
    beyond[below] = beyond[beside] = False
    assert (values[beyond] == -1).all()
    return values[below].copy(), values[beside].copy()


def test_slices_of_captured_views_are_their_lines(canvas: Canvas) -> None:
    scene = light_field(5, 5)
    below, beside = sliced(canvas, Slicing((40.6, 33.2), (0.3, 0.8), True))
    y = int(EXTENT)
    for k in range(y):
        place = place_in_slice((k + 0.5) / EXTENT)
        nearest = min(max(round(place * 4), 0), 4)
        if abs(place * 4 - round(place * 4)) > 0.45:
            continue  # between two views
        # Row 3 is nearest to v = 0.8, column 1 to u = 0.3. A pixel's two window pixels lie a quarter beside its centre.
        line = scene.view(3, nearest)[33]
        column = scene.view(nearest, 1)[:, 40]
        for found, expected in ((below[k], line), (beside[:, k], column)):
            quarter = 0.75 * expected[1:-1] + 0.25 * expected[:-2]
            np.testing.assert_allclose(found[2:-2:2], quarter, atol=1e-5)
            quarter = 0.75 * expected[1:-1] + 0.25 * expected[2:]
            np.testing.assert_allclose(found[3:-2:2], quarter, atol=1e-5)


def test_slices_of_carried_views_are_the_truth_in_between(canvas: Canvas) -> None:
    below, beside = sliced(canvas, Slicing((40.6, 33.2), (0.45, 0.6), False))
    for k in range(0, int(EXTENT), 7):
        place = place_in_slice((k + 0.5) / EXTENT)
        line = truth(place, 0.6)[33]
        column = truth(0.45, place)[:, 40]
        for found, expected in ((below[k], line), (beside[:, k], column)):
            between = (found[0::2] + found[1::2]) / 2  # the mean of a pixel's two window pixels is nearly its centre
            np.testing.assert_allclose(between[9:-9], expected[9:-9], atol=0.01)


def test_syntheses_for_the_eyes_take_the_place_of_carried_ones(canvas: Canvas) -> None:
    focusing = Focusing(baseline=0.4, convergence=1.0)  # shifts by whole and broken pixels: 0.2 px
    eyes = focusing.eyes(HERE)
    carried = canvas.read(Frame(Look.STEREO_PARALLEL, HERE, focusing=focusing))
    assert np.abs(carried - 0.5).max() > 0.2
    grey = in_bytes(np.full((*SIZE, 3), 0.5, np.float32))
    canvas.set_eyes({eyes[1]: grey})
    pair = canvas.read(Frame(Look.STEREO_PARALLEL, HERE, focusing=focusing))
    np.testing.assert_array_equal(pair[:, :WIDTH], carried[:, :WIDTH])
    np.testing.assert_allclose(pair[:, WIDTH:], 0.5, atol=0.003)
    canvas.set_eyes({eyes[0]: grey, eyes[1]: grey})
    crossed = canvas.read(Frame(Look.STEREO_CROSSED, HERE, focusing=focusing))
    np.testing.assert_allclose(crossed, 0.5, atol=0.003)
    # They are for those viewpoints only, and another model's answers may come instead.
    elsewhere = canvas.read(Frame(Look.STEREO_PARALLEL, HERE, focusing=replace(focusing, baseline=0.5)))
    assert np.abs(elsewhere - 0.5).max() > 0.2
    canvas.set_eyes({})
    np.testing.assert_array_equal(canvas.read(Frame(Look.STEREO_PARALLEL, HERE, focusing=focusing)), carried)


def test_a_synthesis_for_an_eye_is_moved_by_the_convergence(canvas: Canvas) -> None:
    focusing = Focusing(baseline=0.4, convergence=DISPARITY)
    canvas.set_eyes({eye: in_bytes(truth(*eye)) for eye in focusing.eyes(HERE)})
    pair = canvas.read(Frame(Look.STEREO_PARALLEL, HERE, focusing=focusing))
    for half in (pair[:, :WIDTH], pair[:, WIDTH:]):
        np.testing.assert_allclose(half[INSIDE], truth(*HERE)[INSIDE], atol=0.006)
