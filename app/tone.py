"""The tone in which pictures are looked at: exposure, then a curve. Nothing is computed in it, and no score sees it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from app.limits import within
from lfcore.display_tone import brightened
from lfcore.lightfield import FloatArray

STOPS_LIMITS = (-6.0, 6.0)
GAMMA_LIMITS = (1.0, 3.0)
STOPS_STEP = 0.5  # by a key


class Curve(Enum):
    """How values become light on screen, after exposure; the value is the name on screen."""

    STORED = "As stored"
    SRGB = "Linear to sRGB"
    GAMMA = "Gamma"
    AUTHORS = "Authors' tone"


CURVE_MEANING = {
    Curve.STORED: "Values are shown as they are stored.",
    Curve.SRGB: "For linear values, as an ESLF holds: encoded for the screen by IEC 61966-2-1.",
    Curve.GAMMA: "Values to the power of one over gamma.",
    Curve.AUTHORS: "As the paper's authors show dark captures: to the power of 1/1.5, then saturation (HSV) times 1.5.",
}


@dataclass(frozen=True)
class Tone:
    """`stops`: values are multiplied by 2 to the power of it. `gamma` counts for Curve.GAMMA only."""

    curve: Curve = Curve.STORED
    stops: float = 0.0
    gamma: float = 2.2

    @property
    def exposure(self) -> float:
        """What stored values are multiplied by."""
        return float(2.0**self.stops)

    def exposed(self, stops: float) -> Tone:
        """With so many stops more, within the limits."""
        return replace(self, stops=within(self.stops + stops, STOPS_LIMITS))

    def bounded(self) -> Tone:
        """With stops and gamma held within their limits."""
        return replace(self.exposed(0.0), gamma=within(self.gamma, GAMMA_LIMITS))

    def next_curve(self) -> Tone:
        """With the curve after this one, going round."""
        curves = list(Curve)
        return replace(self, curve=curves[(curves.index(self.curve) + 1) % len(curves)])

    def words(self) -> str:
        """What differs from the stored values, short; empty where nothing does."""
        parts = []
        if self.curve is Curve.GAMMA:
            parts.append(f"gamma {self.gamma:.2f}")
        elif self.curve is not Curve.STORED:
            parts.append({Curve.SRGB: "sRGB", Curve.AUTHORS: "authors' tone"}[self.curve])
        if self.stops:
            parts.append(f"{self.stops:+.1f} stops".replace("-", "\N{MINUS SIGN}"))
        return ", ".join(parts)


def toned(values: FloatArray, tone: Tone) -> FloatArray:
    """What the shaders tone_*.glsl make of stored values (H, W, 3), 1 = white: light on screen, float32 from 0 to 1."""
    exposed = np.clip(values * np.float32(tone.exposure), 0, 1, dtype=np.float32)
    if tone.curve is Curve.AUTHORS:
        return brightened(exposed)
    if tone.curve is Curve.GAMMA:
        return exposed ** np.float32(1 / tone.gamma)
    if tone.curve is Curve.SRGB:
        return np.where(exposed <= 0.0031308, 12.92 * exposed, 1.055 * exposed ** np.float32(1 / 2.4) - 0.055)
    return exposed
