"""How pictures and maps are looked at: tone, colours, range, level. One value, so that it is undone and kept as one."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

from app.limits import within
from app.tone import Curve, Tone
from lfcore.colormaps import ColourMap
from lfcore.key_frames import MAX_FOCUS

# Of the plane sweep, px over the baseline: those of the paper's disparity network, and as far beyond as a light field reaches.
LEVELS = (-21.0, 21.0)
LEVEL_STEP = (LEVELS[1] - LEVELS[0]) / 99
_SAME_LEVEL = 1e-6  # of a step: what rounding leaves

# Red, green and blue (1 = full) by which the inputs, in the order of CORNERS, are told apart,
# by colour-blind eyes too (Okabe and Ito 2008).
CORNER_COLOURS = ((0.90, 0.62, 0.0), (0.34, 0.71, 0.91), (0.0, 0.62, 0.45), (0.80, 0.47, 0.65))

# Likeness of a picture to a warped input: the mean squared difference over every second pixel, so many of these to each side,
# by this tolerance.
LEAN_REACH = 1
LEAN_TOLERANCE = 0.04

RANGE_LIMITS = (-MAX_FOCUS, MAX_FOCUS)  # disparities, px over the baseline
LEAST_RANGE = 0.1


@dataclass(frozen=True)
class Looking:
    """What belongs to looking, beyond the look itself. `hand_range`: disparities (px over the baseline) of the first and the
    last colour, None: by percentiles. `level`: the disparity at which the plane sweep is shown, px over the baseline."""

    tone: Tone = field(default_factory=Tone)
    colour_map: ColourMap = ColourMap.VIRIDIS
    hand_range: tuple[float, float] | None = None
    level: float = 0.0

    def bounded(self) -> Looking:
        """With everything held within its limits."""
        chosen = self.with_range(*self.hand_range) if self.hand_range is not None else self
        return replace(chosen, tone=self.tone.bounded(), level=within(self.level, RANGE_LIMITS))

    def with_range(self, low: float, high: float) -> Looking:
        """With colours from and to these disparities, LEAST_RANGE apart at the least."""
        low, high = within(min(low, high), RANGE_LIMITS), within(max(low, high), RANGE_LIMITS)
        middle, half = (low + high) / 2, max(high - low, LEAST_RANGE) / 2
        return replace(self, hand_range=(middle - half, middle + half))

    def with_range_scaled(self, factor: float) -> Looking:
        """With a range by hand that is so many times as wide, about its middle."""
        assert self.hand_range is not None
        low, high = self.hand_range
        middle, half = (low + high) / 2, factor * (high - low) / 2
        return self.with_range(middle - half, middle + half)

    def at_next_level(self, step: int, limits: tuple[float, float]) -> Looking:
        """At the level of the disparity network that comes next in that direction, or so many after it; beyond the network's
        they go on in the same steps, as far as the limits."""
        place = (self.level - LEVELS[0]) / LEVEL_STEP  # a whole number at a level of the network
        nearest = round(place)
        if abs(place - nearest) > _SAME_LEVEL:
            nearest = math.floor(place) if step > 0 else math.ceil(place)
        return replace(self, level=within(LEVELS[0] + (nearest + step) * LEVEL_STEP, limits))

    def next_colour_map(self) -> Looking:
        """With the colour map after this one, going round."""
        maps = list(ColourMap)
        return replace(self, colour_map=maps[(maps.index(self.colour_map) + 1) % len(maps)])

    def brightened_or_not(self) -> Looking:
        """In the authors' tone, or as stored where it was in that."""
        curve = Curve.STORED if self.tone.curve is Curve.AUTHORS else Curve.AUTHORS
        return replace(self, tone=replace(self.tone, curve=curve))


def level_limits(disparities: tuple[float, float] | None) -> tuple[float, float]:
    """From which to which level the plane sweep is looked at, where these disparities are shown."""
    low, high = disparities or LEVELS
    return min(low, LEVELS[0]), max(high, LEVELS[1])
