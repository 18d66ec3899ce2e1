"""The inner pictures of a synthesis, drawn by shaders, against numpy, the networks' own features, and known answers."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import torch
from canvas_maps import map_of

from app.canvas import Canvas, Frame
from app.looking import CORNER_COLOURS, LEVEL_STEP, LEVELS
from app.painting import in_bytes
from app.state import Look
from lfcore import colormaps
from lfcore.colormaps import ColourMap
from lfcore.lightfield import CORNERS, FloatArray
from lfcore.networks import ModelConfig, sweep_luminance
from lfcore.planesweep import Levels, Window, plane_sweep
from lfcore.synthesizer import corner_offsets

HEIGHT, WIDTH = 40, 56
VIEWPOINT = (0.3, 0.6)
INPUTS = (Look.WARPED_TOP_LEFT, Look.WARPED_BOTTOM_LEFT, Look.WARPED_TOP_RIGHT, Look.WARPED_BOTTOM_RIGHT)


@pytest.fixture
def canvas(gl: Any) -> Iterator[Canvas]:
    made = Canvas(gl, "f4")
    yield made
    made.clear()
    assert gl.error == "GL_NO_ERROR"


@pytest.fixture
def corners() -> FloatArray:
    return np.random.default_rng(4).random((4, HEIGHT, WIDTH, 3)).astype(np.float32)


def give(canvas: Canvas, image: FloatArray, disparity: FloatArray) -> None:
    canvas.set_synthesis(image, in_bytes(image), disparity, VIEWPOINT)


def test_disagreement_is_the_deviation_of_the_warped_inputs(canvas: Canvas, corners: FloatArray) -> None:
    canvas.set_light_field(corners)
    disparity = np.random.default_rng(1).uniform(-9, 9, (HEIGHT, WIDTH)).astype(np.float32)
    give(canvas, corners[0], disparity)
    warped = np.stack([canvas.read(Frame(look, VIEWPOINT)) for look in INPUTS])  # (4, H, W, 3), 0 outside
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    counts = np.stack(
        [
            (x + (u - VIEWPOINT[0]) * disparity >= 0)
            & (x + (u - VIEWPOINT[0]) * disparity <= WIDTH - 1)
            & (y + (v - VIEWPOINT[1]) * disparity >= 0)
            & (y + (v - VIEWPOINT[1]) * disparity <= HEIGHT - 1)
            for u, v in CORNERS
        ]
    )
    expected = np.zeros((HEIGHT, WIDTH))
    for row, column in np.ndindex(HEIGHT, WIDTH):
        seen = warped[counts[:, row, column], row, column]
        if len(seen) > 1:
            expected[row, column] = np.sqrt(seen.astype(float).var(axis=0, ddof=1).mean())
    assert counts.all(0).any() and not counts.all()
    np.testing.assert_allclose(map_of(canvas, Frame(Look.DISAGREEMENT, VIEWPOINT)), expected, atol=1e-5)


@pytest.mark.parametrize("level", [0.0, 3.7, -12.0])
def test_the_sweep_is_what_the_disparity_network_sees(canvas: Canvas, corners: FloatArray, level: float) -> None:
    canvas.set_light_field(corners)
    luma = sweep_luminance(torch.from_numpy(corners).permute(0, 3, 1, 2), ModelConfig()).unsqueeze(1)
    whole = Window(0, HEIGHT, 0, WIDTH)
    expected = plane_sweep(luma, corner_offsets(*VIEWPOINT), Levels(1, level, level), whole)[0].numpy()  # (2, H, W)
    mean = canvas.read(Frame(Look.SWEEP_MEAN, VIEWPOINT, level=level))
    np.testing.assert_allclose(mean, np.repeat(expected[0][..., None], 3, axis=2), atol=1e-5)
    deviation = map_of(canvas, Frame(Look.SWEEP_DEVIATION, VIEWPOINT, level=level))
    np.testing.assert_allclose(deviation, expected[1], atol=2e-5)


def test_the_levels_are_those_of_the_network() -> None:
    levels = Levels().values()
    assert (float(levels[0]), float(levels[-1])) == LEVELS
    assert float(levels[1] - levels[0]) == pytest.approx(LEVEL_STEP, rel=1e-4)


@pytest.mark.parametrize("corner", range(4))
def test_a_picture_that_is_one_of_the_inputs_leans_on_it(canvas: Canvas, corners: FloatArray, corner: int) -> None:
    canvas.set_light_field(corners)
    give(canvas, corners[corner], np.zeros((HEIGHT, WIDTH), np.float32))
    shown = canvas.read(Frame(Look.LEAN, VIEWPOINT))
    near = np.abs(shown - CORNER_COLOURS[corner]).max(axis=2) < 0.02
    assert near.mean() > 0.99  # a pixel in a thousand is alike in two views by chance


def test_where_all_inputs_agree_the_picture_leans_on_all(canvas: Canvas) -> None:
    canvas.set_light_field(np.full((4, HEIGHT, WIDTH, 3), 0.4, np.float32))
    give(canvas, np.full((HEIGHT, WIDTH, 3), 0.5, np.float32), np.zeros((HEIGHT, WIDTH), np.float32))
    shown = canvas.read(Frame(Look.LEAN, VIEWPOINT))
    np.testing.assert_allclose(shown, np.broadcast_to(np.mean(CORNER_COLOURS, axis=0), shown.shape), atol=1e-5)


@pytest.mark.parametrize("chosen", list(ColourMap))
def test_maps_are_shown_in_every_colour_map(canvas: Canvas, corners: FloatArray, chosen: ColourMap) -> None:
    canvas.set_light_field(corners)
    disparity = np.linspace(-5, 5, HEIGHT * WIDTH, dtype=np.float32).reshape(HEIGHT, WIDTH)
    give(canvas, corners[0], disparity)
    shown = canvas.read(Frame(Look.DISPARITY, VIEWPOINT, disparity_range=(-4.0, 3.0), colour_map=chosen))
    expected = colormaps.apply(colormaps.colours(chosen), disparity, -4.0, 3.0)
    assert np.abs(255 * shown - expected).max() <= 8  # between two neighbouring colours of the table


def test_deviations_are_shown_from_none_to_white_over_gain(canvas: Canvas, corners: FloatArray) -> None:
    canvas.set_light_field(corners)
    frame = Frame(Look.SWEEP_DEVIATION, VIEWPOINT, level=1.0, gain=4.0, colour_map=ColourMap.GREY)
    expected = colormaps.apply(colormaps.colours(ColourMap.GREY), map_of(canvas, frame), 0.0, 0.25)
    assert np.abs(255 * canvas.read(frame) - expected).max() <= 18  # grey rises steeply where it begins


@pytest.mark.parametrize("chosen", [each for each in ColourMap if each is not ColourMap.TURBO])
def test_lightness_rises_evenly_with_the_value(chosen: ColourMap) -> None:
    """As CIE L* has it, which is another measure than the one by which the maps are made."""
    encoded = colormaps.colours(chosen) / 255
    linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    luminance = linear @ [0.2126, 0.7152, 0.0722]
    lightness = np.where(luminance > 0.008856, 116 * np.cbrt(luminance) - 16, 903.3 * luminance)
    steps = np.diff(lightness[48::16])  # near black the two measures differ
    assert steps.min() > 0.7 * steps.mean()


def test_turbo_goes_through_blue_green_and_red() -> None:
    table = colormaps.colours(ColourMap.TURBO)
    for place, brightest in ((30, 2), (128, 1), (220, 0)):
        assert table[place].argmax() == brightest
    assert table[0].max() < 64 < 100 < table[255].max()  # darker at both ends
