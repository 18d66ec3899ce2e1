"""View synthesis without networks: a plane sweep, the best disparity at each pixel, and a weighted blend of the warped inputs.

What the networks are measured against, in the spirit of Tao et al. 2013 (agreement of the views as the cost, its clarity as
confidence, smoothing that trusts the confident) and of Chaurasia et al. 2013 (inputs weighted by nearness, the disagreeing left
out). Aggregation is by the guided filter of He, Sun and Tang (2010), computed at half size (He and Sun 2015).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor

from lfcore.errors import InputError
from lfcore.illum_correction import IllumCorrection
from lfcore.lightfield import EXTRAPOLATION_LIMIT, LightField, check_viewpoint
from lfcore.planesweep import Levels, Shifted, Window, luminance, shifted_inputs
from lfcore.span import disparity_reach
from lfcore.synthesizer import Clock, Synthesis, check_cancelled, corner_offsets, corner_tensor, never, picture
from lfcore.warp import backward_warp


@dataclass(frozen=True)
class Tuning:
    """The numbers of the method, chosen on training scenes. Differences are in units of the root of the brightest tone."""

    step: float = 0.5  # px of disparity between two levels
    ceiling: float = 0.15  # a cost hardly grows beyond it: an occluded input is no worse than a wrong one
    gradient: float = 2.0  # weight of differences of the gradient
    first_radius: int = 2  # of the box that gives the first disparity, half-size px
    radius: int = 4  # of the guided filter over costs, half-size px
    epsilon: float = 1e-3  # contrast (squared) that the guided filters take for an edge
    trust: float = 2.0  # power of the confidence
    smooth_radius: int = 3  # of the smoothing of disparity, px
    disagreement: float = 0.12  # difference from the median at which an input loses two thirds of its weight


# The widest sweep, px, and the levels that find out which part of it a light field takes.
_WIDEST = Levels(count=97, low=-24.0, high=24.0)
_SURE = 0.5  # the confidence from which on a pixel tells
_MARGIN_PX = 1.5  # added to that part on each side
_OUTERMOST = (0.1, 99.9)  # percentiles that it lies between
# Rows are worked on in bands of about this many pixels; a band's costs take 0.5 kB a pixel at the most.
_BAND_PIXELS = 2**19
_ALONE = 0.05  # deviation that stands for "nothing to compare with"
_LEAST_WEIGHT = 1e-6  # so that a place that no input sees still has a blend


class PlaneSweepSynthesizer:
    """The classical way; its Synthesis has disparity, warped inputs and timings like that of the networks."""

    name = "planesweep"
    key = "planesweep 2"

    def __init__(self, tuning: Tuning | None = None) -> None:
        self._tuning = tuning or Tuning()
        self._correction = IllumCorrection()
        self._corners: Tensor | None = None  # (4, 3, H, W)
        self._toned: Tensor | None = None  # (4, 3, H, W), the root of it, 1 = the brightest tone
        self._brightest = 1.0
        self._levels = _WIDEST

    @property
    def levels(self) -> Levels:
        """The disparities that are tried for this light field."""
        return self._levels

    def set_light_field(self, light_field: LightField) -> None:
        """See Synthesizer: the root tone, in which noise is even, and the range of disparities are found here."""
        self._correction = IllumCorrection(light_field.aperture)
        self._corners = self._correction.true(corner_tensor(light_field))
        with torch.inference_mode():
            self._brightest = brightest_tone(self._corners)
            self._toned = _toned(self._corners, self._brightest)
            self._levels = self._found_levels(self._corners, self._toned)

    def _found_levels(self, corners: Tensor, toned: Tensor) -> Levels:
        """As many as the widest sweep has at most, where disparities reach farther than that farther apart."""
        reach = disparity_reach(corners)
        if reach is not None and max(-reach.low, reach.high) > _WIDEST.high + reach.step:
            low, high = reach.low - reach.step, reach.high + reach.step
        else:
            low, high = disparity_range(toned, self._tuning)
        return Levels(min(math.ceil((high - low) / self._tuning.step) + 1, _WIDEST.count), low, high)

    def synthesize(self, u: float, v: float, cancelled: Callable[[], bool] = never) -> Synthesis:
        if self._corners is None or self._toned is None:
            raise InputError("No light field is set; call set_light_field first.")
        check_viewpoint(u, v)
        clock = Clock()
        _, _, height, width = self._corners.shape
        offsets = corner_offsets(u, v)
        image, disparity, warped = torch.empty(3, height, width), torch.empty(height, width), torch.empty(4, 3, height, width)
        with torch.inference_mode():
            for rows, source in _bands(height, width, self._context):
                scene = _Scene(self._toned[:, :, source], offsets, self._levels, self._tuning)
                found = scene.disparity(clock, cancelled)
                parts = scene.blended(self._corners[:, :, source], self._brightest, found, self._correction.moves(u, v))
                inside = slice(rows.start - source.start, rows.stop - source.start)
                disparity[rows] = found[inside]
                image[:, rows], warped[:, :, rows] = parts[0][:, inside], parts[1][:, :, inside]
                clock.lap("colour")
        seen = self._correction.stored(picture(image.clamp_(0, 1)), u, v)
        inputs = self._correction.stored_of_corners(picture(warped))
        return Synthesis(u, v, self.name, seen, disparity.numpy(), inputs, clock.timings())

    @property
    def _context(self) -> int:
        """Rows beyond a band that its result depends on."""
        tuning = self._tuning
        sampling = math.ceil(self._levels.reach * (1 + EXTRAPOLATION_LIMIT)) + 3
        return sampling + 2 * (tuning.first_radius + 2 * tuning.radius) + 4 * tuning.smooth_radius + 4


class _Scene:
    """One band of a light field and one viewpoint."""

    def __init__(self, toned: Tensor, offsets: Tensor, levels: Levels, tuning: Tuning) -> None:
        self._toned, self._offsets, self._levels, self._tuning = toned, offsets, levels, tuning  # toned: (4, 3, h, w)

    def disparity(self, clock: Clock, cancelled: Callable[[], bool]) -> Tensor:
        """Disparity at the novel view, px over the full baseline: (h, w)."""
        tuning, (height, width) = self._tuning, self._toned.shape[-2:]
        volume = cost_volume(self._toned, self._offsets, self._levels, tuning, cancelled)  # (L, 1, h / 2, w / 2)
        clock.lap("features")
        first = _Winner(self._levels)
        for cost in _box(volume, tuning.first_radius):
            first.take(cost[0])
        start = _resized(first.disparity()[None, None], (height, width))[0, 0]
        guide = self._guide(start)  # (1, 1, h, w)
        clock.lap("warp")
        best = _Winner(self._levels)
        for cost in _guided_levels(volume, guide, tuning.radius, tuning.epsilon):
            check_cancelled(cancelled)
            best.take(cost)
        found = best.disparity()
        guide = self._guide(found)
        trust = best.confidence().pow(tuning.trust)[None, None] + 1e-3
        smooth = _guided(torch.cat((trust * found, trust)), guide, tuning.smooth_radius, tuning.epsilon)  # (2, 1, h, w)
        clock.lap("disparity")
        return (smooth[0, 0] / smooth[1, 0].clamp(min=1e-3)).clamp(self._levels.low, self._levels.high)

    def blended(
        self, corners: Tensor, brightest: float, disparity: Tensor, moves: tuple[float, float]
    ) -> tuple[Tensor, Tensor]:
        """The novel view (3, h, w) of the corners, sampled so many px farther on along x and y, and the warped inputs (4, 3, h,
        w), 0 outside of them."""
        warped = self._warped(corners, disparity, moves)
        weights = self._weights(_toned(warped, brightest), disparity)  # (4, 1, h, w)
        return (warped * weights).sum(0), warped * self._inside(disparity)

    def _guide(self, disparity: Tensor) -> Tensor:
        """Luminance of the blended inputs in the root tone: (1, 1, h, w)."""
        warped = self._warped(luminance(self._toned).unsqueeze(1), disparity)
        return (warped * self._weights(warped, disparity)).sum(0, keepdim=True)

    def _warped(self, inputs: Tensor, disparity: Tensor, moves: tuple[float, float] = (0, 0)) -> Tensor:
        """The inputs (4, C, h, w) warped; beyond its edge each is continued by the edge, for places that no input sees."""
        reach = math.ceil(self._levels.reach * float(self._offsets.abs().max())) + 1
        padded = F.pad(inputs, (reach,) * 4, mode="replicate")
        return backward_warp(padded, disparity.expand(4, 1, -1, -1), self._offsets, (reach + moves[1], reach + moves[0]))

    def _weights(self, toned: Tensor, disparity: Tensor) -> Tensor:
        """Weights of the warped inputs (4, C, h, w), their sum 1: more for near ones, less for those that disagree."""
        near = (1 - self._offsets.abs()).clamp(min=0.05).prod(1).view(4, 1, 1, 1)
        weights = near * self._inside(disparity) + _LEAST_WEIGHT
        ordered = toned.sort(0).values
        median = (ordered[1] + ordered[2]) / 2
        distance = _box((toned - median).abs().mean(1, keepdim=True), 1)
        weights = weights * torch.exp(-(distance / self._tuning.disagreement).square()) + _LEAST_WEIGHT**2
        return weights / weights.sum(0)

    def _inside(self, disparity: Tensor) -> Tensor:
        """Which samples lie in their picture: bool (4, 1, h, w)."""
        height, width = disparity.shape
        du, dv = self._offsets.view(4, 2, 1, 1).unbind(1)
        x = torch.arange(width) + du * disparity  # (4, h, w)
        y = torch.arange(height).view(-1, 1) + dv * disparity
        return ((x >= 0) & (x <= width - 1) & (y >= 0) & (y <= height - 1)).unsqueeze(1)


def cost_volume(
    toned: Tensor, offsets: Tensor, levels: Levels, tuning: Tuning, cancelled: Callable[[], bool] = never
) -> Tensor:
    """How far the inputs disagree at each level, at half size: (L, 1, ceil(h / 2), ceil(w / 2)), 0 to `ceiling`.

    toned: (4, 3, h, w). The mean absolute deviation from the mean over the inputs that are inside, of colour and of the
    gradient of luminance.
    """
    _, _, height, width = toned.shape
    whole = Window(0, height, 0, width)
    costs = toned.new_empty(levels.count, 1, -(-height // 2), -(-width // 2))
    for level, shifted in enumerate(shifted_inputs(toned, offsets, levels, whole)):
        check_cancelled(cancelled)
        deviation = _deviation(shifted, (height, width), tuning.gradient)
        saturated = tuning.ceiling * (1 - torch.exp(-deviation / tuning.ceiling))
        costs[level] = F.avg_pool2d(saturated[None], 2, ceil_mode=True, count_include_pad=False)
    return costs


def disparity_range(toned: Tensor, tuning: Tuning) -> tuple[float, float]:
    """(lowest, highest) disparity of a light field, px over the full baseline, with a margin; within the widest sweep.

    A sweep at the middle view tells at half size; only pixels whose best level stands out count, and the outermost
    thousandth on each side does not.
    """
    if min(toned.shape[2:]) < 2:
        return _WIDEST.low, _WIDEST.high
    half = F.avg_pool2d(toned, 2)  # (4, 3, h / 2, w / 2)
    levels = Levels(_WIDEST.count // 2 + 1, _WIDEST.low / 2, _WIDEST.high / 2)
    offsets = corner_offsets(0.5, 0.5)
    best = _Winner(levels)
    for cost in _box(cost_volume(half, offsets, levels, tuning), 2):
        best.take(cost[0])
    sure = best.confidence().flatten() >= _SURE
    if int(sure.sum()) < 100:
        return _WIDEST.low, _WIDEST.high
    low, high = np.percentile(2 * best.disparity().flatten()[sure].numpy(), _OUTERMOST).tolist()
    return max(low - _MARGIN_PX, _WIDEST.low), min(high + _MARGIN_PX, _WIDEST.high)


class _Winner:
    """Takes the costs (h, w) of one level after the other; keeps the least, its neighbours and the mean."""

    def __init__(self, levels: Levels) -> None:
        self._levels = levels
        self._taken = 0
        self._last: Tensor | None = None

    def take(self, cost: Tensor) -> None:
        """The costs of the next level."""
        if self._last is None:
            self._total = cost.clone()
            self._least = cost.clone()
            self._index = torch.zeros_like(cost)
            self._before = torch.full_like(cost, math.inf)
            self._after = torch.full_like(cost, math.inf)
        else:
            self._total += cost
            follows = self._index == self._taken - 1
            self._after = torch.where(follows, cost, self._after)
            better = cost < self._least
            self._before = torch.where(better, self._last, self._before)
            self._least = torch.where(better, cost, self._least)
            self._after.masked_fill_(better, math.inf)
            self._index.masked_fill_(better, float(self._taken))
        self._last = cost
        self._taken += 1

    def disparity(self) -> Tensor:
        """The least cost's disparity, px, moved to the bottom of the parabola through it and its neighbours: (h, w)."""
        bend = self._before - 2 * self._least + self._after
        offset = (self._before - self._after) / (2 * bend.clamp(min=1e-9))
        offset = torch.where(torch.isfinite(bend), offset, 0).clamp(-0.5, 0.5)
        step = (self._levels.high - self._levels.low) / max(self._levels.count - 1, 1)
        return self._levels.low + (self._index + offset) * step

    def confidence(self) -> Tensor:
        """How far the least cost stands out from the mean of all, 0 to 1: (h, w)."""
        mean = self._total / self._taken
        return ((mean - self._least) / (mean + 0.005)).clamp(0, 1)


def brightest_tone(corners: Tensor) -> float:
    """The 99th percentile of the stored values."""
    return max(float(np.quantile(corners[:, :, ::4, ::4].numpy(), 0.99)), 1e-3)


def _toned(stored: Tensor, brightest: float) -> Tensor:
    """The square root of stored values over the brightest tone: shot noise is as large everywhere, however dark the capture."""
    return (stored.clamp(min=0) / brightest).sqrt()


def _deviation(shifted: list[Shifted], size: tuple[int, int], gradient: float) -> Tensor:
    """Mean absolute deviation from the mean, of colour and gradient: (1, h, w). Bad where one input or none is inside."""
    total, count = torch.zeros(3, *size), torch.zeros(size)
    for part in shifted:
        total[(slice(None), *part.window)] += part.image
        count[part.window] += 1
    mean = total / count.clamp(min=1)
    deviation = torch.zeros(size)
    for part in shifted:
        difference = part.image - mean[(slice(None), *part.window)]  # (3, h', w')
        absolute = difference.abs().sum(0)
        grey = difference.mean(0)
        absolute[:, 1:-1] += (gradient / 2) * (grey[:, 2:] - grey[:, :-2]).abs()
        absolute[1:-1] += (gradient / 2) * (grey[2:] - grey[:-2]).abs()
        deviation[part.window] += absolute / 5  # five features
    return torch.where(count >= 2, deviation / count.clamp(min=1), _ALONE)[None]


def _guided_levels(volume: Tensor, guide: Tensor, radius: int, epsilon: float) -> Iterator[Tensor]:
    """The costs (L, 1, h / 2, w / 2) filtered along the edges of the guide (1, 1, h, w): one level after the other, (h, w)."""
    size = guide.shape[-2:]
    half = F.avg_pool2d(guide, 2, ceil_mode=True, count_include_pad=False)
    mean = _box(half, radius)
    spread = _box(half * half, radius) - mean * mean + epsilon
    for cost in volume:
        slope, offset = _line(cost[None], half, mean, spread, radius)
        both = _resized(_box(torch.cat((slope, offset)), radius), size)
        yield both[0, 0] * guide[0, 0] + both[1, 0]


def _guided(values: Tensor, guide: Tensor, radius: int, epsilon: float) -> Tensor:
    """Values (N, 1, h, w) filtered along the edges of the guide (1, 1, h, w)."""
    mean = _box(guide, radius)
    spread = _box(guide * guide, radius) - mean * mean + epsilon
    slope, offset = _line(values, guide, mean, spread, radius)
    return _box(slope, radius) * guide + _box(offset, radius)


def _line(values: Tensor, guide: Tensor, mean: Tensor, spread: Tensor, radius: int) -> tuple[Tensor, Tensor]:
    """Slope and offset of the straight line from guide to values that fits best in each box."""
    average = _box(values, radius)
    slope = (_box(values * guide, radius) - average * mean) / spread
    return slope, average - slope * mean


def _box(values: Tensor, radius: int) -> Tensor:
    """Mean over boxes of 2 radius + 1 px, of (N, 1, h, w); at the edge over what there is of the box."""
    side = 2 * radius + 1
    across = F.avg_pool2d(values, (1, side), 1, (0, radius), count_include_pad=False)
    return F.avg_pool2d(across, (side, 1), 1, (radius, 0), count_include_pad=False)


def _resized(values: Tensor, size: tuple[int, ...]) -> Tensor:
    """Half-size maps (N, 1, h / 2, w / 2), whose pixels are means of 2 x 2, to full size."""
    grown = F.interpolate(values, scale_factor=2, mode="bilinear", align_corners=False)
    return grown[..., : size[0], : size[1]]


def _bands(height: int, width: int, context: int) -> Iterator[tuple[slice, slice]]:
    """Rows to compute, with the rows that they depend on, which begin at an even row."""
    rows = max(_BAND_PIXELS // width, 2 * context)
    for top in range(0, height, rows):
        bottom = min(top + rows, height)
        yield slice(top, bottom), slice(max(top - context, 0) // 2 * 2, min(bottom + context, height))
