"""How far the disparities of a light field reach, and how networks that know so many px are set to it.

The networks look from -21 to 21 px over the baseline from corner to corner, which is what cameras with microlenses have.
Gantries and arrays of cameras go farther. A sweep whose levels all lie `shift` px higher shows a network exactly what it would
see of a scene with disparities so much lower (it was trained with such shifts), and one of pictures made `scale` times smaller
what it would see of disparities so many times smaller.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor

from lfcore.expected_disparities import clarity
from lfcore.lightfield import CORNERS, EXTRAPOLATION_LIMIT
from lfcore.planesweep import Levels, Window, deviation_sweep, luminance
from lfcore.synthesizer import continued, corner_offsets
from lfcore.tone import root_tone

_SMALLER = 4  # times: of the pictures in which disparities are looked for
_LONG_SIDE = 512  # px that these have at most, so that a large picture takes no longer
_WIDEST = 32  # px, of these, and three eighths of their shorter side at most
_AROUND = 5  # px a side, over which deviations are averaged
_LOCAL = 6  # px either way, of the mean that brightness is compared with
_DARK = 0.1  # of a view's mean is added to that, so that noise in the dark does not count
_STRIDE = 2  # px from one place that is asked to the next
_CLEAR = 0.5  # lfcore.expected_disparities.clarity from which on a place tells
_OUTERMOST = (0.5, 99.5)  # percentiles of those that tell
_ENOUGH = 0.01  # of all places must


@dataclass(frozen=True)
class Reach:
    """Disparities, px over the full baseline, as far as a coarse look tells."""

    low: float
    mean: float
    high: float
    step: float  # by which both may be off


@dataclass(frozen=True)
class Span:
    """What a network's px stand for in a light field: scale * px + shift."""

    scale: int = 1
    shift: float = 0.0

    @property
    def in_small(self) -> float:
        """The shift in px of pictures made `scale` times smaller."""
        return self.shift / self.scale

    def disparity(self, found: Tensor) -> Tensor:
        """px over the full baseline, of a network's px."""
        return found if self == Span() else self.scale * found + self.shift

    def edges(self, reach: int, levels: Levels) -> tuple[int, int]:
        """By how many px pictures, and those made smaller, must be continued beyond their edges, where without a span it is
        `reach`; even, if that is."""
        own = abs(self.shift) + (self.scale - 1) * levels.reach
        of_small = abs(self.in_small)
        return reach + _even((1 + EXTRAPOLATION_LIMIT) * own), reach + _even((1 + EXTRAPOLATION_LIMIT) * of_small)


def span_of(corners: Tensor, levels: Levels) -> Span:
    """The span that brings a light field's disparities within a network's levels; none where they are, or where too little
    tells. corners: (4, 3, H, W), as stored. Takes 10 to 20 ms for views of 541 x 376 px."""
    reach = disparity_reach(corners)
    if reach is None:
        return Span()
    if max(-reach.low, reach.high) <= levels.reach + reach.step:
        return Span()
    half = (reach.high - reach.low) / 2
    scale = max(math.ceil((half - reach.step / 2) / levels.reach), 1)
    # As near to the mean, by which pictures continue one another, as all lie well within then.
    slack = max(scale * levels.reach - half - reach.step, 0)
    middle = (reach.low + reach.high) / 2
    return Span(scale, float(round(min(max(reach.mean, middle - slack), middle + slack))))


def disparity_reach(corners: Tensor) -> Reach | None:
    """How far the disparities of four corner views (4, 3, H, W) reach, by a sweep at a fraction of their size; None where too
    little tells. What lies farther than three eighths of the shorter side is not found."""
    smaller = _SMALLER * math.ceil(max(corners.shape[2:]) / (_SMALLER * _LONG_SIDE))
    if min(corners.shape[2:]) < smaller * _AROUND:
        return None
    widest = min(_WIDEST, 3 * min(corners.shape[2:]) // (8 * smaller))
    levels = Levels(2 * widest + 1, -widest, widest)
    with torch.inference_mode():
        costs = _costs(made_smaller(corners, smaller), levels).flatten(2)[0].T  # (N, L)
        values = levels.values()
        found = smaller * values[costs.argmin(1)][clarity(costs, values) > _CLEAR]
    if len(found) < _ENOUGH * len(costs):
        return None
    low, high = np.percentile(found.numpy(), _OUTERMOST).tolist()
    return Reach(low, float(found[(found >= low) & (found <= high)].mean()), high, float(smaller))


def _costs(corners: Tensor, levels: Levels) -> Tensor:
    """How far they disagree at each level around places of the middle view: (1, L, h, w)."""
    edge = math.ceil(levels.reach / 2) + 3  # half of the baseline, and the taps
    luma = _detail(root_tone(luminance(continued(corners, edge))).unsqueeze(1))
    height, width = corners.shape[2:]
    deviations = torch.empty(1, levels.count, height, width, memory_format=torch.channels_last)
    deviation_sweep(luma, corner_offsets(0.5, 0.5), levels, Window(edge, edge + height, edge, edge + width), deviations)
    return F.avg_pool2d(deviations, _AROUND, _STRIDE)


def _detail(luma: Tensor) -> Tensor:
    """(4, 1, h, w) -> the same over the mean around each pixel, less 1: one view may be darker than another, or darker to one
    side, and would else match best wherever that does not show."""
    side = 2 * _LOCAL + 1
    around = F.avg_pool2d(F.pad(luma, (_LOCAL,) * 4, mode="replicate"), side, 1)
    return luma / (around + _DARK * luma.mean((1, 2, 3), keepdim=True)).clamp(min=1e-6) - 1


def continued_by_others(corners: Tensor, by: int, shift: float, alignment: int = 1) -> Tensor:
    """The four corner views (4, C, H, W) continued by `by` px, as lfcore.synthesizer.continued does, but first by one another:
    where all disparities are about `shift`, what lies beyond the edge of one is in the next, moved by so much. |shift| is less
    than by, H and W.

    Else the networks would see edges repeated for half of the shift, where they know a few px of that.
    """
    move = round(shift)
    if move == 0:
        return continued(corners, by, alignment)
    return torch.cat([_seen_by_all(corners, own, move, by, alignment) for own in range(len(CORNERS))])


def _seen_by_all(corners: Tensor, own: int, move: int, by: int, alignment: int) -> Tensor:
    """One of them, (1, C, ., .), continued by the others."""
    height, width = corners.shape[2:]
    beyond = abs(move)
    u, v = CORNERS[own]
    # Where each lies in this one: at (p_i - p_j) D, all of them to one side.
    across = [round(move * (u - other_u)) for other_u, _ in CORNERS]
    down = [round(move * (v - other_v)) for _, other_v in CORNERS]
    left, above = (beyond if min(moves) < 0 else 0 for moves in (across, down))
    canvas = corners.new_empty(1, corners.shape[1], height + beyond, width + beyond)
    for other in sorted(range(len(CORNERS)), key=lambda n: -abs(across[n]) - abs(down[n])):  # the nearer, the later
        x, y = left + across[other], above + down[other]
        canvas[0, :, y : y + height, x : x + width] = corners[other]
    rest = by - left, by - (beyond - left) + -width % alignment, by - above, by - (beyond - above) + -height % alignment
    return F.pad(canvas, rest, mode="replicate")


def made_smaller(pictures: Tensor, times: int) -> Tensor:
    """(N, C, H, W) -> (N, C, H / times, W / times), rounded up: means of blocks, those at the edges of repeated edges."""
    return F.avg_pool2d(continued(pictures, 0, times), times)


def made_larger(values: Tensor, times: int) -> Tensor:
    """(N, C, h, w) -> (N, C, times h, times w), linear between the middles of blocks."""
    return F.interpolate(values, scale_factor=times, mode="bilinear", align_corners=False)


def _even(length: float) -> int:
    return 2 * math.ceil(length / 2)
