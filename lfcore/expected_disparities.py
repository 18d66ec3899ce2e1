"""Which disparities a light field takes, as far as a network that names probabilities of levels is sure of them.

A repetitive pattern fits at several disparities, a period apart, and a flat place at any. Networks that have been trained on
all disparities alike do not prefer those that the rest of the scene has; these limits make them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from torch import Tensor

SURE = 1.4  # px, the deviation of the probabilities below which a pixel tells: levels on both sides of a disparity have less
CLEAR = 0.3  # and where the sweep's least cost is this share of the way below the mean of all from the next one elsewhere,
ELSEWHERE = 3.0  # px off: a repetitive pattern has a second one, about as low
OUTERMOST = 0.0003  # of the pixels that tell, at either end, do not; what is smaller is hardly found in any case
ENOUGH = 0.01  # of all pixels must tell for limits to be found
MARGIN = 2.0  # px that are allowed beyond what they say: a disparity in between is a mean of levels on both sides
STEEPNESS = 8.0  # by which a level's score is lowered for each level that it lies farther out: a few thousand times less likely


@dataclass(frozen=True)
class Limits:
    """Disparities that are expected, px over the full baseline."""

    low: float
    high: float

    def penalties(self, values: Tensor) -> Tensor:
        """What is taken off the scores of evenly spaced levels (L,), px: 0 within, more the farther they lie out."""
        step = float(values[1] - values[0])
        outside = (self.low - values).clamp(min=0) + (values - self.high).clamp(min=0)
        return STEEPNESS / step * outside


def expected(probabilities: Tensor, costs: Tensor, values: Tensor) -> Limits | None:
    """The limits that the levels' probabilities at many pixels speak for; None where too few tell.

    probabilities, costs: (N, L), the latter how far the inputs disagree. values: (L,), px.
    """
    mean = probabilities @ values
    deviation = (probabilities @ values.square() - mean.square()).clamp(min=0).sqrt()
    telling = mean[(deviation < SURE) & (clarity(costs, values) > CLEAR)].sort().values
    if len(telling) < ENOUGH * len(mean):
        return None
    outermost = int(OUTERMOST * len(telling))
    return Limits(float(telling[outermost]) - MARGIN, float(telling[-1 - outermost]) + MARGIN)


def clarity(costs: Tensor, values: Tensor) -> Tensor:
    """How far the least cost lies below the next one elsewhere, as a share of how far it lies below the mean: (N,)."""
    least, at = costs.min(1)
    near = (values - values[at].unsqueeze(1)).abs() <= ELSEWHERE  # (N, L)
    second = costs.masked_fill(near, math.inf).amin(1)
    return (second - least) / (costs.mean(1) - least).clamp(min=1e-6)
