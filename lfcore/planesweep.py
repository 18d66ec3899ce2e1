"""The plane sweep: the inputs warped at each of L fixed disparities, as mean and standard deviation (paper, Eqs. 4 and 5).

A warp by one disparity is a shift by one constant per input and level, so it needs no gather: four taps along one axis, then
four along the other. Samples outside the picture do not count; where none counts, mean and deviation are 0, and where only
one counts, the deviation is 0 (authors' code).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import torch
import torch.nn.functional as F
from torch import Tensor

from lfcore import kernels
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

    def moved(self, by: float) -> Levels:
        """As many levels, all `by` px higher."""
        return Levels(self.count, self.low + by, self.high + by)

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

    def moved(self, by: int) -> Window:
        """As large, so many px farther down and to the right."""
        return Window(self.top + by, self.bottom + by, self.left + by, self.right + by)


# A block of the sweep (rows x columns x levels of one input) should stay in the cache of a core or two.
_BLOCK_VALUES = 2**19
_BLOCK_LEVELS = 16


def plane_sweep(luma: Tensor, offsets: Tensor, levels: Levels, window: Window, out: Tensor | None = None) -> Tensor:
    """Features of the disparity network at one viewpoint, over a window of the picture.

    luma: (N, B, H, W) float32, luminance of the N inputs of B light fields that share the viewpoint. offsets: (N, 2), p_i - q
    of each input, (u, v). Returns (B, 2 L, h, w) float32 in torch's channels_last order, which the networks want: the L means,
    then the L standard deviations (with N - 1). `out` of that shape, of any float type and order, takes the result in place
    of a new tensor. Beside it, memory for N + 4 blocks of _BLOCK_VALUES.
    """
    return sparse_sweep(luma, offsets, levels, range(levels.count), window, out)


def deviation_sweep(luma: Tensor, offsets: Tensor, levels: Levels, window: Window, out: Tensor | None = None) -> Tensor:
    """As `plane_sweep`, but the L standard deviations alone: (B, L, h, w)."""
    return sparse_sweep(luma, offsets, levels, (), window, out)


def sparse_sweep(
    luma: Tensor, offsets: Tensor, levels: Levels, kept: Sequence[int], window: Window, out: Tensor | None = None
) -> Tensor:
    """As `plane_sweep`, but with the means of the K levels in `kept`, ascending, alone: (B, K + L, h, w)."""
    if out is None:
        shape = (luma.shape[1], len(kept) + levels.count, *window.shape)
        out = torch.empty(shape, device=luma.device, memory_format=torch.channels_last)
    if kernels.can_sweep(luma, out):
        _sweep_compiled(luma, offsets, levels, kept, window, out)
    else:
        _sweep_by_torch(luma, offsets, levels, kept, window, out)
    return out


def _sweep_compiled(luma: Tensor, offsets: Tensor, levels: Levels, kept: Sequence[int], window: Window, out: Tensor) -> None:
    """`sparse_sweep` by the compiled kernel."""
    shifts = levels.values().double()[None, :, None] * offsets.double()[:, None]  # (N, L, 2), along x and y
    whole = shifts.floor()
    height, width = luma.shape[-2:]
    last = torch.tensor([width - 1, height - 1], dtype=torch.float64) - shifts
    valid = torch.stack(((-shifts).ceil(), last.floor() + 1), -1)
    means = torch.tensor(kept, dtype=torch.int32)
    kernels.plane_sweep(luma, whole, cubic_taps(shifts - whole), valid, means, (window.top, window.left), out)


def _sweep_by_torch(luma: Tensor, offsets: Tensor, levels: Levels, kept: Sequence[int], window: Window, out: Tensor) -> None:
    """`sparse_sweep` by operations of torch."""
    means, deviations = out.split((len(kept), levels.count), 1)
    values = levels.values().double()
    for first in range(0, levels.count, _BLOCK_LEVELS):
        chosen = slice(first, first + _BLOCK_LEVELS)
        of_block = [(place, level - first) for place, level in enumerate(kept) if first <= level < chosen.stop]
        shifts = [(values[chosen] * across, values[chosen] * down) for across, down in offsets.tolist()]
        taps = {part: _level_taps(values[chosen] * part, luma.device) for part in set(offsets.flatten().tolist())}
        for block, whole in _blocks(window, _valid_for_all(shifts, window, luma.shape[-2:]), shifts[0][0].numel()):
            shifted = [
                _shift_all(image, taps[across], taps[down], block)
                for image, (across, down) in zip(luma, offsets.tolist(), strict=True)
            ]
            counted = None if whole else [_counts(across, down, block, luma) for across, down in shifts]
            mean, deviation = mean_and_deviation(shifted, counted)
            rows = slice(block.top - window.top, block.bottom - window.top)
            columns = slice(block.left - window.left, block.right - window.left)
            for place, level in of_block:
                means[:, place, rows, columns] = mean[:, level]
            deviations[:, chosen, rows, columns] = deviation


@dataclass(frozen=True)
class _LevelTaps:
    """The taps along one axis of several shifts, side by side."""

    first: int  # where the first lies from the output's place
    weights: Tensor  # (L, K) float32


def _shift_all(image: Tensor, across: _LevelTaps, down: _LevelTaps, window: Window) -> Tensor:
    """One input (B, H, W) at several shifts: (B, L, h, w), channels_last. What lies beyond its edge repeats the edge.

    The shifts along y are one matrix product, whose weights hold the four taps of each level at their places, those along x
    one convolution of the same kind. Most of the weights are 0, and still this takes a fraction of the time that one small
    operation per level and tap does.
    """
    h, w = window.shape
    levels, taps_y = down.weights.shape
    rows, columns = h + taps_y - 1, w + across.weights.shape[1] - 1
    source = _edge_slice(_edge_slice(image, -2, window.top + down.first, rows), -1, window.left + across.first, columns)
    moved = source.unfold(-2, taps_y, 1) @ down.weights.T  # (B, h, columns, L)
    return F.conv2d(moved.permute(0, 3, 1, 2), across.weights[:, None, None, :], groups=levels)


def _level_taps(shifts: Tensor, device: torch.device) -> _LevelTaps:
    """The taps of shifts (L,), px."""
    whole = shifts.floor()
    first, last = int(whole.min()) - 1, int(whole.max()) + 2
    taps = torch.zeros(len(shifts), last - first + 1, dtype=torch.float64)
    places = (whole.long() - 1 - first).unsqueeze(1) + torch.arange(4)
    taps.scatter_(1, places, cubic_taps(shifts - whole))
    return _LevelTaps(first, taps.float().to(device))


def mean_and_deviation(shifted: list[Tensor], counted: list[Tensor] | None = None) -> tuple[Tensor, Tensor]:
    """Mean and standard deviation (N - 1) over the inputs (B, L, h, w), or over those that count at each place.

    torch.std_mean over a leading dimension is 15 times slower than this. The inputs are overwritten.
    """
    if counted is not None:
        for part, counts in zip(shifted, counted, strict=True):
            part.mul_(counts)
    mean = shifted[0] + shifted[1]
    for part in shifted[2:]:
        mean.add_(part)
    if counted is None:
        mean.mul_(1 / len(shifted))
    else:
        number = torch.stack(counted).sum(0)
        mean.div_(number.clamp(min=1))
    for part in shifted:
        part.sub_(mean)
    if counted is not None:
        for part, counts in zip(shifted, counted, strict=True):
            part.mul_(counts)
    squares = shifted[0].square_()
    for part in shifted[1:]:
        squares.addcmul_(part, part)
    squares = squares.mul_(1 / (len(shifted) - 1)) if counted is None else squares.div_((number - 1).clamp(min=1))
    return mean, squares.sqrt_()


def _counts(across: Tensor, down: Tensor, window: Window, luma: Tensor) -> Tensor:
    """1 where a sample of the shifted input lies inside its picture, else 0: (1, L, h, w), channels_last.

    Output s reads position s + shift; it counts where 0 <= s + shift <= size - 1.
    """
    height, width = luma.shape[-2:]
    x = torch.arange(window.left, window.right) + across[:, None]  # (L, w)
    y = torch.arange(window.top, window.bottom) + down[:, None]
    inside_x, inside_y = (x >= 0) & (x <= width - 1), (y >= 0) & (y <= height - 1)
    both = (inside_y.T[:, None] & inside_x.T).float()  # (h, w, L)
    return both.permute(2, 0, 1)[None].to(luma.device)


def _valid_for_all(shifts: Sequence[tuple[Tensor, Tensor]], window: Window, size: Sequence[int]) -> Window:
    """The part of a window in which every shift of every input has a sample; its stops are not before its starts."""
    height, width = size
    left = max(window.left, *(math.ceil(-float(across.min())) for across, _ in shifts))
    right = min(window.right, *(math.floor(width - 1 - float(across.max())) + 1 for across, _ in shifts))
    top = max(window.top, *(math.ceil(-float(down.min())) for _, down in shifts))
    bottom = min(window.bottom, *(math.floor(height - 1 - float(down.max())) + 1 for _, down in shifts))
    if right <= left or bottom <= top:  # nowhere: an empty part at the window's beginning
        return Window(window.top, window.top, window.left, window.left)
    return Window(top, bottom, left, right)


def _blocks(window: Window, inner: Window, levels: int) -> Iterator[tuple[Window, bool]]:
    """A window in blocks that suit the cache, and of each whether it belongs to the inner part; a frame surrounds that."""
    parts = (
        (inner, True),
        (Window(window.top, inner.top, window.left, window.right), False),
        (Window(inner.bottom, window.bottom, window.left, window.right), False),
        (Window(inner.top, inner.bottom, window.left, inner.left), False),
        (Window(inner.top, inner.bottom, inner.right, window.right), False),
    )
    for part, whole in parts:
        w = part.right - part.left
        rows = max(_BLOCK_VALUES // max(w * levels, 1), 1)
        for top in range(part.top, part.bottom, rows) if w else ():
            yield Window(top, min(top + rows, part.bottom), part.left, part.right), whole


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
