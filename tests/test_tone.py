"""The tone of looking: shaders and numpy against the definitions, one number at a time."""

from __future__ import annotations

import colorsys
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from app.canvas import Canvas, Frame
from app.looking import Looking
from app.painting import in_bytes
from app.state import Look
from app.tone import GAMMA_LIMITS, STOPS_LIMITS, Curve, Tone, toned

TONES = [Tone(curve, stops, gamma) for curve in Curve for stops, gamma in ((0.0, 2.2), (-1.5, 1.4), (2.0, 3.0))]


def by_definition(value: tuple[float, float, float], tone: Tone) -> tuple[float, float, float]:
    red, green, blue = (min(max(each * 2**tone.stops, 0.0), 1.0) for each in value)
    if tone.curve is Curve.AUTHORS:
        hue, saturation, lightness = colorsys.rgb_to_hsv(*(each ** (1 / 1.5) for each in (red, green, blue)))
        return colorsys.hsv_to_rgb(hue, min(1.5 * saturation, 1.0), lightness)
    return curved(red, tone), curved(green, tone), curved(blue, tone)


def curved(value: float, tone: Tone) -> float:
    if tone.curve is Curve.GAMMA:
        return float(value ** (1 / tone.gamma))
    if tone.curve is Curve.SRGB:
        return float(12.92 * value if value <= 0.0031308 else 1.055 * value ** (1 / 2.4) - 0.055)
    return value


@pytest.fixture
def canvas(gl: Any) -> Iterator[Canvas]:
    made = Canvas(gl, "f4")
    yield made
    made.clear()
    assert gl.error == "GL_NO_ERROR"


def test_every_picture_is_shown_in_every_tone(canvas: Canvas) -> None:
    chance = np.random.default_rng(3)
    corners = chance.random((4, 6, 7, 3)).astype(np.float32) ** 3
    corners[0, 0, 0] = (0.0, 0.001, 0.003)  # the straight part of sRGB
    image = corners[0].copy()
    canvas.set_light_field(corners)
    canvas.set_synthesis(image, in_bytes(image), np.zeros((6, 7), np.float32), (0.0, 0.0))
    for tone in TONES:
        expected = np.array([[by_definition(tuple(pixel), tone) for pixel in row] for row in image])
        for look in (Look.SYNTHESIS, Look.WARPED_TOP_LEFT):  # at (0, 0) with no disparity, that input is the picture
            shown = canvas.read(Frame(look, (0.0, 0.0), tone=tone))
            np.testing.assert_allclose(np.clip(shown, 0, 1), expected, atol=2e-5)
        np.testing.assert_allclose(toned(image, tone), expected, atol=1e-5)


def test_a_tone_changes_the_picture_that_was_made_before(canvas: Canvas) -> None:
    canvas.set_light_field(np.full((4, 2, 2, 3), 0.25, np.float32))
    frame = Frame(Look.SYNTHESIS, (0.5, 0.5))
    assert canvas.read(frame)[0, 0, 0] == pytest.approx(0.25)
    assert canvas.read(Frame(Look.SYNTHESIS, (0.5, 0.5), tone=Tone(stops=1.0)))[0, 0, 0] == pytest.approx(0.5)
    assert canvas.read(frame)[0, 0, 0] == pytest.approx(0.25)


def test_exposure_and_gamma_stay_within_limits() -> None:
    tone = Tone()
    for _ in range(50):
        tone = tone.exposed(0.5)
    assert tone.stops == STOPS_LIMITS[1]
    assert Tone(stops=-99.0, gamma=99.0).bounded() == Tone(stops=STOPS_LIMITS[0], gamma=GAMMA_LIMITS[1])


def test_the_next_curve_goes_round_and_brightening_goes_back_and_forth() -> None:
    tone = Tone(stops=1.0)
    seen = []
    for _ in Curve:
        tone = tone.next_curve()
        seen.append(tone.curve)
    assert sorted(curve.name for curve in seen) == sorted(curve.name for curve in Curve)
    assert tone == Tone(stops=1.0)
    brightened = Looking(tone).brightened_or_not()
    assert brightened.tone == Tone(Curve.AUTHORS, stops=1.0)
    assert brightened.brightened_or_not() == Looking(tone)
