"""The plane sweep: the inputs warped at each of L fixed disparities, as mean and standard deviation (paper, Eqs. 4 and 5).

A warp by one disparity is a shift by one constant per input and level, so it needs no gather: four taps along x, then four
along y. Samples outside the picture do not count; where none counts, mean and deviation are 0, and where only one counts,
the deviation is 0 (authors' code).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import torch
import torch.nn.functional as F
from torch import Tensor

from lfcore.warp import cubic_taps

# Rec. 601 luma, as MATLAB's rgb2gray has it (authors' code).
LUMINANCE = (0.2989, 0.5870, 0.1140)


def luminance(images: Tensor) -> Tensor:
    """(..., 3, H, W) RGB -> (..., H, W), the weighted sum that the features are made of."""
    r, g, b = images.unbind(-3)
    return LUMINANCE[0] * r + LUMINANCE[1] * g + LUMINANCE[2] * b


@dataclass(frozen=True)
class Levels:
    """The fixed disparities of a plane sweep: `count` values from `low` to `high`, px over the full baseline."""

    count: int = 100
    low: float = -21.0
    high: float = 21.0

    def values(self) -> Tensor:
        """(L,) float32, ascending."""
        return torch.linspace(self.low, self.high, self.count)

    @property
    def reach(self) -> float:
        """The largest disparity in size, px."""
        return max(abs(self.low), abs(self.high))


@dataclass(frozen=True)
class Window:
    """A part of the novel view: rows top to bottom, columns left to right, the stops not included."""

    top: int
    bottom: int
    left: int
    right: int

    @property
    def shape(self) -> tuple[int, int]:
        """(height, width)."""
        return self.bottom - self.top, self.right - self.left


def plane_sweep(
    luma: Tensor, offsets: Tensor, levels: Levels, window: Window, out: Tensor | None = None
) -> Tensor:
    """Features of the disparity network at one viewpoint, over a window of the picture.

    luma: (N, B, H, W) float32, luminance of the N inputs of B light fields that share the viewpoint. offsets: (N, 2), p_i - q
    of each input, (u, v). Returns (B, 2 L, h, w) float32: the L means, then the L standard deviations (with N - 1). `out`
    of that shape and any float type takes the result and saves its allocation; beside it, N + 2 planes of the window.
    """
    h, w = window.shape
    if out is None:
        out = torch.empty(luma.shape[1], 2 * levels.count, h, w, device=luma.device)
    for level, shifted in enumerate(shifted_inputs(luma, offsets, levels, window)):
        mean, deviation = _mean_and_deviation(shifted, (luma.shape[1], h, w), luma.device)
        out[:, level] = mean
        out[:, levels.count + level] = deviation
    return out


def inner_plane_sweep(luma: Tensor, offsets: Tensor, levels: Levels, window: Window) -> Tensor:
    """`plane_sweep` for a window all of whose samples lie inside the pictures; three times as fast.

    All levels of an input are shifted at once by two convolutions, along x and along y, whose kernels hold the four taps of
    each level at its place: most of their weights are 0, and still they beat one small operation per level and tap. Returns
    (B, 2 L, h, w) float32 in torch's channels_last order, which the networks want. Memory: 6 L planes of the window.
    """
    shifted = [_shift_all(image, offset, levels, window) for image, offset in zip(luma, offsets.tolist(), strict=True)]
    b, count, h, w = shifted[0].shape
    out = torch.empty(b, 2 * count, h, w, device=luma.device, memory_format=torch.channels_last)
    mean = shifted[0] + shifted[1]
    for part in shifted[2:]:
        mean.add_(part)
    mean.mul_(1 / len(shifted))
    out[:, :count] = mean
    squares = shifted[0].sub_(mean).square_()
    for part in shifted[1:]:
        part.sub_(mean)
        squares.addcmul_(part, part)
    torch.sqrt(squares.mul_(1 / (len(shifted) - 1)), out=squares)
    out[:, count:] = squares
    return out


def _shift_all(image: Tensor, offset: Sequence[float], levels: Levels, window: Window) -> Tensor:
    """One input (B, H, W) at all levels: (B, L, h, w), channels_last."""
    (first_x, across), (first_y, down) = (_level_taps(part, levels, image.device) for part in offset)
    top, left = window.top + first_y, window.left + first_x
    h, w = window.shape
    rows, columns = h + down.shape[1] - 1, w + across.shape[1] - 1
    if min(top, left) < 0 or top + rows > image.shape[1] or left + columns > image.shape[2]:
        raise ValueError(f"samples of {window} lie outside the picture of {tuple(image.shape[1:])}")
    source = image[:, None, top : top + rows, left : left + columns]
    moved = F.conv2d(source, across[:, None, None, :]).contiguous(memory_format=torch.channels_last)
    return F.conv2d(moved, down[:, None, :, None], groups=levels.count)


def _level_taps(offset: float, levels: Levels, device: torch.device) -> tuple[int, Tensor]:
    """The taps of every level's shift side by side: where the first lies from the output's place, and weights (L, K)."""
    shifts = levels.values().double() * offset
    whole = shifts.floor()
    first, last = int(whole.min()) - 1, int(whole.max()) + 2
    taps = torch.zeros(levels.count, last - first + 1, dtype=torch.float64)
    places = (whole.long() - 1 - first).unsqueeze(1) + torch.arange(4)
    taps.scatter_(1, places, cubic_taps(shifts - whole))
    return first, taps.float().to(device)


def matching_disparity(
    luma: Tensor, offsets: Tensor, levels: Levels, window: Window, target: Tensor, box: int = 5
) -> tuple[Tensor, Tensor]:
    """The level at which the shifted inputs agree best with the captured novel view.

    For training only, where that view is known: a start for the disparity network, whose gradient through the warp sees no
    further than a few pixels. Arguments as for `plane_sweep`; the window must keep all samples inside the picture. target:
    (B, h, w), luminance of the captured view. At each level the two inputs that agree best count (an occluded input must not
    spoil it), averaged over a box of `box` x `box` px. Returns disparity (B, 1, h, w), px over the full baseline, and
    confidence (B, 1, h, w) in [0, 1]: how far the best level stands out.
    """
    costs = []
    for shifted in shifted_inputs(luma, offsets, levels, window):
        least, second = target.new_full(target.shape, math.inf), target.new_full(target.shape, math.inf)
        for part in shifted:
            difference = (part.image - target).abs_()
            second = torch.minimum(second, torch.maximum(least, difference))
            least = torch.minimum(least, difference)
        costs.append(least.add_(second).mul_(0.5))
    cost = F.avg_pool2d(torch.stack(costs, 1), box, stride=1, padding=box // 2, count_include_pad=False)  # (B, L, h, w)
    best, index = cost.min(1, keepdim=True)
    typical = cost.mean(1, keepdim=True)
    confidence = ((typical - best) / (typical + 0.005)).clamp(0, 1)
    return levels.values().to(cost.device)[index], confidence


@dataclass(frozen=True)
class Shifted:
    """The part of a window in which a shifted input is valid, and its samples there."""

    image: Tensor  # (B, h', w')
    window: tuple[slice, slice]


def shifted_inputs(luma: Tensor, offsets: Tensor, levels: Levels, window: Window) -> Iterator[list[Shifted]]:
    """For each level, the inputs that have any valid sample in the window."""
    height, width = luma.shape[-2:]
    for disparity in levels.values().tolist():
        shifted = []
        for image, (du, dv) in zip(luma, offsets.tolist(), strict=True):
            across = _axis_shift(du * disparity, window.left, window.right, width)
            down = _axis_shift(dv * disparity, window.top, window.bottom, height)
            if across is not None and down is not None:
                shifted.append(Shifted(_shift(image, down, across), (down.window, across.window)))
        yield shifted


@dataclass(frozen=True)
class _AxisShift:
    """A shift along one axis: where it is valid within the window, from which sample on it reads, and its four weights."""

    window: slice  # of the output window
    first: int  # source sample under tap 0 (= -1) of the window's first valid output
    taps: tuple[float, float, float, float]


def _axis_shift(shift: float, start: int, stop: int, size: int) -> _AxisShift | None:
    # Output s reads position s + shift; it counts where 0 <= s + shift <= size - 1.
    first = max(start, math.ceil(-shift))
    last = min(stop - 1, math.floor(size - 1 - shift))
    if first > last:
        return None
    whole = math.floor(shift)
    w0, w1, w2, w3 = cubic_taps(torch.tensor(shift - whole, dtype=torch.float64)).tolist()
    return _AxisShift(slice(first - start, last + 1 - start), first + whole - 1, (w0, w1, w2, w3))


def _shift(image: Tensor, down: _AxisShift, across: _AxisShift) -> Tensor:
    """The valid part of `image` (B, H, W) shifted: four taps along x in all rows that the taps along y need, then those."""
    h = down.window.stop - down.window.start
    w = across.window.stop - across.window.start
    source = _edge_slice(_edge_slice(image, -2, down.first, h + 3), -1, across.first, w + 3)
    return _taps(_taps(source, -1, across.taps, w), -2, down.taps, h)


def _edge_slice(image: Tensor, dim: int, start: int, length: int) -> Tensor:
    """image[start : start + length] along `dim`, where samples beyond the edge repeat it."""
    size = image.shape[dim]
    if start >= 0 and start + length <= size:
        return image.narrow(dim, start, length)
    index = torch.arange(start, start + length, device=image.device).clamp(0, size - 1)
    return image.index_select(dim, index)


def _taps(source: Tensor, dim: int, taps: tuple[float, float, float, float], length: int) -> Tensor:
    if taps[1] == 1.0:  # a whole number of pixels
        return source.narrow(dim, 1, length)
    out = source.narrow(dim, 0, length) * taps[0]
    for k in (1, 2, 3):
        out.add_(source.narrow(dim, k, length), alpha=taps[k])
    return out


def _mean_and_deviation(
    shifted: list[Shifted], shape: tuple[int, int, int], device: torch.device
) -> tuple[Tensor, Tensor]:
    """Mean and standard deviation (N - 1) at each pixel over the inputs that are valid there: both (B, h, w)."""
    if len(shifted) > 1 and all(part.image.shape == shape for part in shifted):  # all valid: by far the commonest case
        # torch.std_mean over a leading dimension is 15 times slower than this.
        mean = shifted[0].image + shifted[1].image
        for part in shifted[2:]:
            mean.add_(part.image)
        mean.mul_(1 / len(shifted))
        squares = (shifted[0].image - mean).square_()
        for part in shifted[1:]:
            difference = part.image - mean
            squares.addcmul_(difference, difference)
        return mean, squares.mul_(1 / (len(shifted) - 1)).sqrt_()
    total, count, squares = (torch.zeros(shape, device=device) for _ in range(3))
    for part in shifted:
        total[(slice(None), *part.window)] += part.image
        count[(slice(None), *part.window)] += 1
    mean = total / count.clamp(min=1)
    for part in shifted:
        squares[(slice(None), *part.window)] += (part.image - mean[(slice(None), *part.window)]).square_()
    return mean, (squares / (count - 1).clamp(min=1)).sqrt_()
