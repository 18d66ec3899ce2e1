"""Partners, differences and maps on a software rasteriser, against numpy."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from moving_scene import DISPARITY, SIZE, truth

from app.canvas import Canvas, Frame
from app.comparison import BLOCK_RANGE, Difference, Source
from app.painting import in_bytes
from app.state import Look
from lfcore import colormaps
from lfcore.lightfield import CORNERS, FloatArray, as_float

HERE = (0.5, 0.5)


@pytest.fixture
def canvas(gl: Any) -> Iterator[Canvas]:
    made = Canvas(gl, "f4")
    made.set_light_field(np.stack([truth(u, v) for u, v in CORNERS]))
    made.set_synthesis(truth(*HERE), in_bytes(truth(*HERE)), np.full(SIZE, DISPARITY, np.float32), HERE)
    yield made
    made.clear()
    assert gl.error == "GL_NO_ERROR"


def other_picture(seed: int) -> FloatArray:
    noise = np.random.default_rng(seed).normal(0, 0.05, (*SIZE, 3))
    return np.clip(truth(*HERE) + noise, 0, 1).astype(np.float32)


def false_colour(values: FloatArray) -> FloatArray:
    """Colours of errors, 0 to 1, in between two entries of the table as the graphics have it."""
    table = colormaps.error_colours().astype(np.float64) / 255
    places = np.clip(values, 0, 1) * 255
    low = np.minimum(places.astype(int), 254)
    return (table[low] + (places - low)[..., None] * (table[low + 1] - table[low])).astype(np.float32)


EXPECTED: dict[Difference, Callable[[FloatArray, float], FloatArray]] = {
    Difference.ABSOLUTE: lambda d, gain: gain * np.abs(d),
    Difference.SIGNED: lambda d, gain: 0.5 + 0.5 * gain * d,
    Difference.SQUARED: lambda d, gain: (gain * d) ** 2,
    Difference.FALSE_COLOUR: lambda d, gain: false_colour(gain * np.abs(d).mean(axis=2)),
}


@pytest.mark.parametrize("difference", EXPECTED)
@pytest.mark.parametrize("source", [Source.CAPTURED, Source.MODEL])
def test_each_kind_of_difference_is_what_its_name_says(canvas: Canvas, difference: Difference, source: Source) -> None:
    captured = (other_picture(1) * 255).round()
    partner = other_picture(2)
    canvas.set_light_field(np.zeros((4, *SIZE, 3), np.uint8))
    canvas.set_synthesis(truth(*HERE), in_bytes(truth(*HERE)), None, HERE)
    canvas.set_captured(captured.astype(np.uint8))
    canvas.set_partner(partner)
    d = truth(*HERE) - (as_float(captured.astype(np.uint8)) if source is Source.CAPTURED else partner)
    for gain in (2.0, 6.0):
        shown = canvas.read(Frame(Look.ERROR, HERE, partner=source, difference=difference, gain=gain))
        tolerance = 0.01 if difference is Difference.FALSE_COLOUR else 1e-5  # a texture's weights have 8 bits
        np.testing.assert_allclose(shown, EXPECTED[difference](d, gain), atol=tolerance)


def test_partners_are_shown_as_they_are(canvas: Canvas) -> None:
    captured, partner = other_picture(3), other_picture(4)
    canvas.set_captured(captured)
    canvas.set_partner(partner)
    for _ in range(2):  # one after the other, as panes ask for them
        for source, expected in ((Source.CAPTURED, captured), (Source.MODEL, partner), (Source.SYNTHESIS, truth(*HERE))):
            np.testing.assert_allclose(canvas.read(Frame(Look.SYNTHESIS, HERE, source=source)), expected, atol=1e-6)
    margin = 9  # content that some corner does not see
    instant = canvas.read(Frame(Look.SYNTHESIS, HERE, source=Source.INSTANT))
    inside = (slice(margin, -margin), slice(margin, -margin))
    np.testing.assert_allclose(instant[inside], truth(*HERE)[inside], atol=2e-3)
    assert np.abs(instant - truth(*HERE)).max() > 1e-6  # it is not the synthesis itself


def test_panes_do_not_drive_each_other_out(canvas: Canvas) -> None:
    """Each picture is made once, however often the two are drawn in turn."""
    canvas.set_captured(other_picture(3))
    sources = (Source.SYNTHESIS, Source.CAPTURED, Source.INSTANT)
    frames = [Frame(Look.ERROR, HERE), *(Frame(Look.SYNTHESIS, HERE, source=source) for source in sources)]
    for frame in frames:
        canvas.prepare(frame)
    assert not any(canvas.prepare(frame) for frame in frames)


def test_a_new_partner_is_seen_at_once(canvas: Canvas) -> None:
    frame = Frame(Look.ERROR, HERE, partner=Source.MODEL)
    canvas.set_partner(truth(*HERE))
    assert canvas.read(frame).max() == 0
    canvas.set_partner(truth(*HERE) + np.float32(0.25))
    np.testing.assert_allclose(canvas.read(frame), 0.25, atol=1e-6)


@pytest.mark.parametrize("difference", [Difference.SIMILARITY, Difference.BLOCKS])
def test_maps_are_coloured_by_how_bad_they_are_and_grey_where_they_have_no_value(
    canvas: Canvas, difference: Difference
) -> None:
    values = np.full(SIZE, np.nan, np.float32)
    good, bad = BLOCK_RANGE if difference is Difference.BLOCKS else (1.0, 1 - 1 / 4)
    shares = np.linspace(-0.2, 1.2, 60, dtype=np.float32)
    values[30, :60] = good + shares * (bad - good)
    values[31, 0] = np.inf
    canvas.set_map(values)
    shown = canvas.read(Frame(Look.ERROR, HERE, difference=difference, gain=4.0))
    np.testing.assert_allclose(shown[30, :60], false_colour(shares), atol=0.01)
    np.testing.assert_allclose(shown[31, 0], 0, atol=1e-6)  # equal blocks
    np.testing.assert_allclose(shown[29], 0.25, atol=1e-6)
