"""Values printed on pixels are those that the shaders draw there: two computations of the same, held against each other."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from app.canvas import Canvas, Frame
from app.looking import Looking
from app.painting import in_bytes
from app.samples import Part, Samples
from app.state import Look
from app.tone import Curve, Tone
from lfcore.colormaps import ColourMap
from lfcore.lightfield import CORNERS, FloatArray, LightField, as_float

HEIGHT, WIDTH = 30, 44
VIEWPOINT = (0.25, 0.5)
LOOKING = Looking(Tone(Curve.GAMMA, stops=0.5), ColourMap.TURBO, level=2.3)
SPAN, GAIN = (-6.0, 5.0), 2.0
PARTS = (Part(0, 0, WIDTH, HEIGHT), Part(3, 5, 17, 11), Part(0, 20, 1, 21), Part(WIDTH - 3, HEIGHT - 2, WIDTH, HEIGHT))
MAPS = (Look.DISPARITY, Look.DISAGREEMENT, Look.SWEEP_DEVIATION)
PICTURES = (Look.SYNTHESIS, Look.SWEEP_MEAN, Look.LEAN, *(look for look in Look if look.corner is not None))


@pytest.fixture
def canvas(gl: Any) -> Iterator[Canvas]:
    made = Canvas(gl, "f4")
    yield made
    made.clear()
    assert gl.error == "GL_NO_ERROR"


@pytest.fixture
def light_field() -> LightField:
    views = np.random.default_rng(7).integers(0, 65536, (3, 5, HEIGHT, WIDTH, 3)).astype(np.uint16)
    return LightField(views, "chance", "", "")


@pytest.fixture
def samples(light_field: LightField) -> Samples:
    chance = np.random.default_rng(8)
    image = 0.9 * light_field.view(0, 0) + 0.1 * chance.random((HEIGHT, WIDTH, 3)).astype(np.float32)
    disparity = chance.uniform(-6, 6, (HEIGHT, WIDTH)).astype(np.float32)
    return Samples(light_field, VIEWPOINT, image, disparity, light_field.views[1, 1], light_field.view(1, 1))


def drawn(canvas: Canvas, samples: Samples, light_field: LightField, look: Look) -> FloatArray:
    canvas.set_light_field(np.stack([light_field.views[-int(v), -int(u)] for u, v in CORNERS]))
    canvas.set_synthesis(samples.image, in_bytes(samples.image), samples.disparity, VIEWPOINT)
    return canvas.read(
        Frame(
            look,
            VIEWPOINT,
            tone=LOOKING.tone,
            gain=GAIN,
            disparity_range=SPAN,
            colour_map=LOOKING.colour_map,
            level=LOOKING.level,
        )
    )


@pytest.mark.parametrize("look", (*MAPS, *PICTURES))
def test_samples_are_what_is_drawn(canvas: Canvas, samples: Samples, light_field: LightField, look: Look) -> None:
    picture = drawn(canvas, samples, light_field, look)
    # Shaders do not interpolate colour maps as numpy does; with positions in float32, an edge pixel may fall outside.
    tolerance = 0.04 if look in MAPS else 2e-4
    for part in PARTS:
        patch = samples.patch(look, part, LOOKING, GAIN, SPAN)
        assert patch is not None
        assert np.abs(patch.light - np.clip(picture[part.slices], 0, 1)).max() <= tolerance
        assert len(patch.labels) == patch.light.shape[0] * patch.light.shape[1]


def test_the_sheet_has_values_across_its_four_inputs(canvas: Canvas, samples: Samples, light_field: LightField) -> None:
    picture = drawn(canvas, samples, light_field, Look.WARPED_ALL)
    for part in (*PARTS, Part(WIDTH - 3, HEIGHT - 4, WIDTH + 5, HEIGHT + 6), Part(0, 0, 2 * WIDTH, 2 * HEIGHT)):
        patch = samples.patch(Look.WARPED_ALL, part, LOOKING, GAIN, SPAN)
        assert patch is not None
        assert np.abs(patch.light - np.clip(picture[part.slices], 0, 1)).max() <= 2e-4


def test_values_are_in_units_that_people_know(samples: Samples) -> None:
    part = Part(10, 12, 11, 13)
    disparity = samples.patch(Look.DISPARITY, part, LOOKING, GAIN, SPAN)
    assert disparity is not None and samples.disparity is not None
    assert disparity.values[0, 0, 0] == samples.disparity[12, 10]
    picture = samples.patch(Look.SYNTHESIS, part, LOOKING, GAIN, SPAN)
    assert picture is not None
    np.testing.assert_allclose(picture.values[0, 0], 255 * samples.image[12, 10], rtol=1e-6)
    error = samples.patch(Look.ERROR, part, LOOKING, GAIN, SPAN)
    assert error is not None and samples.captured is not None
    expected = 255 * (samples.image[12, 10] - as_float(samples.captured[12, 10]))
    np.testing.assert_allclose(error.values[0, 0], expected, rtol=1e-5)
    [(x, y, words, _)] = error.labels
    assert (x, y) == (10, 12)
    assert words == "\n".join(f"{value:.1f}".replace("-", "\N{MINUS SIGN}") for value in expected)


def test_the_captured_view_is_sampled_where_it_is_shown(samples: Samples) -> None:
    assert samples.captured is not None
    shown = replace(samples, shows_captured=True)
    np.testing.assert_array_equal(shown.picture(PARTS[1]), as_float(samples.captured)[PARTS[1].slices])


def test_what_is_not_there_has_no_values(samples: Samples) -> None:
    bare = replace(samples, disparity=None, captured=None, partner=None)
    for look in Look:
        there = look in (Look.SYNTHESIS, Look.SWEEP_MEAN, Look.SWEEP_DEVIATION)
        assert (bare.patch(look, PARTS[1], LOOKING, GAIN, SPAN) is not None) is there
    assert bare.error(PARTS[1]) is None
    assert samples.patch(Look.SYNTHESIS, Part(0, 0, WIDTH + 1, 2), LOOKING, GAIN, SPAN) is None


def test_what_was_asked_for_last_is_not_computed_again(samples: Samples) -> None:
    """The window's and the cursor's patches, in turn; the cursor moves on."""
    window = samples.patch(Look.DISAGREEMENT, PARTS[1], LOOKING, GAIN, SPAN)
    for x in range(12):
        samples.patch(Look.DISAGREEMENT, Part(x, 0, x + 1, 1), LOOKING, GAIN, SPAN)
        assert samples.patch(Look.DISAGREEMENT, PARTS[1], LOOKING, GAIN, SPAN) is window
    samples.patch(Look.DISAGREEMENT, PARTS[1], LOOKING, 2 * GAIN, SPAN)
    assert samples.patch(Look.DISAGREEMENT, PARTS[1], LOOKING, 2 * GAIN, SPAN) is not window


def test_a_window_full_of_values_takes_no_frame(light_field: LightField, samples: Samples) -> None:
    """As many pixels as fit at 32 window pixels each; the worst of the looks."""
    big = LightField(np.zeros((2, 2, 60, 80, 3), np.uint8), "big", "", "")
    zeros = np.zeros((60, 80, 3), np.float32)
    wide = Samples(big, VIEWPOINT, zeros, zeros[..., 0], None, None)
    part = Part(10, 10, 41, 34)
    for look in (Look.LEAN, Look.SWEEP_DEVIATION, Look.SYNTHESIS):
        best = 1.0
        for _ in range(5):
            start = time.perf_counter()
            patch = wide.patch(look, part, LOOKING, GAIN, SPAN)
            assert patch is not None and patch.labels
            best = min(best, time.perf_counter() - start)
        assert best < 0.1
