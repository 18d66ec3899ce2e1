"""What lies beside the convolutions of the small pair (lfcore.compact), by operations of torch and by compiled kernels.

The picture is kept as its four half-size phases: pixel (2 y + dy, 2 x + dx) stands at [2 dy + dx, y, x], since the disparity
comes out so and the colour network wants it so; only the results are put together at full size. Networks' values are in
channels_last order.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import torch
import torch.nn.functional as F
from torch import Tensor

from lfcore import kernels
from lfcore.alignment import FLAT, WEIGHTS, alignment_step
from lfcore.compact import AGREEMENT_REACH
from lfcore.kernels import PixelMatrix
from lfcore.neighbourhoods import greatest_around, mean_around
from lfcore.networks import INPUTS
from lfcore.tone import TOE, stored_from_root
from lfcore.warp import QUICK_A, quick_sample

MIDDLE = 0.5  # is taken off toned pictures before they are warped, since the colour network wants them around 0
RESIDUAL = 0.1  # what the colour network's residual counts
PHASES = 4
LOGITS = INPUTS * PHASES  # scores of the inputs
GATHERED = 64  # channels that the colour network takes


@dataclass(frozen=True)
class Heads:
    """Weights of the disparity network's last steps, float32."""

    score: tuple[Tensor, Tensor]  # of each level: (L, C), (L,)
    spread: tuple[Tensor, Tensor]  # of nine neighbours for each phase: (36, C), (36,), by phase, then neighbour
    values: Tensor  # (L,), px
    sharpness: float  # how steeply a level's score falls with its deviation

    def lowered(self, penalties: Tensor) -> Heads:
        """With this (L,) taken off the scores of the levels."""
        matrix, bias = self.score
        return replace(self, score=(matrix, bias - penalties))

    def probabilities(self, pixels: Tensor, costs: Tensor) -> Tensor:
        """Of each level at pixels, by their hidden channels (N, C) and their costs (N, L): (N, L)."""
        return torch.addmm(self.score[1], pixels, self.score[0].T).sub_(costs, alpha=self.sharpness).softmax(1)


@dataclass(frozen=True)
class Places:
    """Where the inputs are sampled: at x + move + offset * disparity, x counted from a place `reach` px within them."""

    offsets: Tensor  # (4, 2)
    moves: Tensor  # (4, 2), px
    reach: int


@dataclass(frozen=True)
class Gathered:
    """The warped inputs."""

    channels: Tensor  # (1, 64, h, w): what the colour network takes, in the order of `gathered_order`
    warped: Tensor  # as the parts that made it want it again


class Parts(Protocol):
    """One way to compute them."""

    def prepared(self, corners: Tensor) -> Tensor:
        """Corner views (4, 3, H, W) in the root tone less MIDDLE, continued beyond their edges, as `gathered` takes them."""

    def disparity(self, pixels: Tensor, deviations: Tensor) -> Tensor:
        """Hidden channels (1, C, h, w), not negative, and the sweep's deviations (1, L, h, w) to phases (4, h, w), px."""

    def aligned(self, luma: Tensor, disparity: Tensor, places: Places, most: float) -> Tensor:
        """The phases of a disparity, changed by up to `most` px to where the inputs agree best (lfcore.alignment). luma: (4, H,
        W), luminance of the inputs in the root tone, continued beyond their edges as they are."""

    def gathered(self, corners: Tensor, disparity: Tensor, places: Places, position: tuple[float, float]) -> Gathered:
        """The corners warped by the phases of the disparity; position: as the network takes it."""

    def blended(self, outputs: Tensor, straight: Tensor, warped: Tensor, nearness: Tensor, size: tuple[int, int]) -> Tensor:
        """The picture (*size, 3), stored values within 0 and 1. outputs: (1, 28, h, w), LOGITS scores of the inputs by input,
        then phase, and a residual by phase, then channel; straight: (1, 12, h, w), added to it. nearness: (4,), added to the
        scores."""

    def pictures(self, warped: Tensor) -> Tensor:
        """The warped inputs of a Gathered at full size, (4, 3, 2 h, 2 w), in the root tone."""


def gathered_order() -> Tensor:
    """Which channel of lfcore.compact's colour network stands at each of the 64 places: by phase, then the mean and the inputs,
    then colour, where that one has all means by colour, then phase, and then the inputs in the same way."""
    theirs = torch.arange(60).view(1 + INPUTS, 3, PHASES)
    return torch.cat((theirs.permute(2, 0, 1).flatten(), torch.arange(60, GATHERED)))


def full_size(phases: Tensor) -> Tensor:
    """(..., 4, h, w) -> (..., 2 h, 2 w), contiguous."""
    *leading, _, h, w = phases.shape
    result = torch.empty(*leading, 2 * h, 2 * w)
    for phase in range(PHASES):
        result[..., phase // 2 :: 2, phase % 2 :: 2] = phases[..., phase, :, :]
    return result


def phases_of(picture: Tensor) -> Tensor:
    """(2 h, 2 w) -> (4, h, w): what `full_size` puts together."""
    return torch.stack([picture[phase // 2 :: 2, phase % 2 :: 2] for phase in range(PHASES)])


class CompiledParts:
    """See Parts: by lfcore.kernels."""

    def __init__(self, heads: Heads, dtype: torch.dtype) -> None:
        self._dtype = dtype
        matrix, bias = heads.score
        self._score = PixelMatrix.of(matrix.T, bias)
        self._values = F.pad(heads.values, (0, len(self._score.bias) - len(bias)))
        self._spread = PixelMatrix.of(*_by_neighbour(heads.spread))
        self._sharpness = heads.sharpness

    def prepared(self, corners: Tensor) -> Tensor:
        """(4, H, W, 4): the colours of a pixel, and one value more, side by side."""
        return F.pad(corners.permute(0, 2, 3, 1), (0, 1)).to(kernels.warp_type(self._dtype)).contiguous()

    def disparity(self, pixels: Tensor, deviations: Tensor) -> Tensor:
        return kernels.compact_disparity(pixels, deviations, self._score, self._values, self._spread, self._sharpness)

    def aligned(self, luma: Tensor, disparity: Tensor, places: Places, most: float) -> Tensor:
        where = places.offsets, places.moves, places.reach, QUICK_A
        return kernels.compact_align(luma, disparity, *where, torch.tensor(WEIGHTS), FLAT, most)

    def gathered(self, corners: Tensor, disparity: Tensor, places: Places, position: tuple[float, float]) -> Gathered:
        ways = places.offsets, places.moves
        return Gathered(*kernels.compact_warp(corners, disparity, *ways, places.reach, QUICK_A, position, self._dtype))

    def blended(self, outputs: Tensor, straight: Tensor, warped: Tensor, nearness: Tensor, size: tuple[int, int]) -> Tensor:
        return kernels.compact_blend(outputs, straight, warped, nearness, size, (MIDDLE, RESIDUAL, TOE))

    def pictures(self, warped: Tensor) -> Tensor:
        return full_size(warped[..., :3].permute(3, 4, 2, 0, 1).float()) + MIDDLE


def _by_neighbour(spread: tuple[Tensor, Tensor]) -> tuple[Tensor, Tensor]:
    """Matrix (C, 36) and bias, by neighbour, then phase."""
    matrix, bias = spread
    order = torch.arange(len(bias)).view(PHASES, -1).T.flatten()
    return matrix[order].T, bias[order]


class TorchParts:
    """See Parts: by operations of torch. Scores and weights are one matrix product each, in float32."""

    def __init__(self, heads: Heads, dtype: torch.dtype) -> None:
        self._heads, self._dtype = heads, dtype

    def prepared(self, corners: Tensor) -> Tensor:
        """As they are."""
        return corners

    def disparity(self, pixels: Tensor, deviations: Tensor) -> Tensor:
        _, _, h, w = pixels.shape
        heads = self._heads
        rows = as_rows(pixels)
        coarse = (heads.probabilities(rows, level_costs(deviations)) @ heads.values).view(1, 1, h, w)
        padded = F.pad(coarse, (1, 1, 1, 1), mode="replicate")[0, 0]
        near = torch.stack([padded[y : y + h, x : x + w] for y in range(3) for x in range(3)])  # (9, h, w)
        weights = torch.addmm(heads.spread[1][:, None], heads.spread[0], rows.T).view(PHASES, 9, h, w).softmax(1)
        return weights.mul_(near).sum(1)

    def aligned(self, luma: Tensor, disparity: Tensor, places: Places, most: float) -> Tensor:
        warped = full_size(_warped_phases(luma.unsqueeze(1), disparity, places))  # (4, 1, 2 h, 2 w)
        return disparity + phases_of(alignment_step(warped, places.offsets, most)[0, 0])

    def gathered(self, corners: Tensor, disparity: Tensor, places: Places, position: tuple[float, float]) -> Gathered:
        """`warped` is (4, 3, 4, h, w), by input, channel and phase."""
        _, h, w = disparity.shape
        warped = _warped_phases(corners, disparity, places)
        mean = warped.mean(0)  # (3, 4, h, w)
        channels = torch.empty(1, GATHERED, h, w, dtype=self._dtype)
        colours = channels[0, :60].view(PHASES, 1 + INPUTS, 3, h, w)
        colours[:, 0] = mean.transpose(0, 1)
        colours[:, 1:] = (warped - mean).permute(2, 0, 1, 3, 4)
        channels[0, 60:62] = torch.tensor(position).view(2, 1, 1)
        channels[0, 62] = disparity.mean(0)
        channels[0, 63] = greatest_around(disparity.amax(0), 1) + greatest_around(-disparity.amin(0), 1)
        return Gathered(channels.contiguous(memory_format=torch.channels_last), warped)

    def blended(self, outputs: Tensor, straight: Tensor, warped: Tensor, nearness: Tensor, size: tuple[int, int]) -> Tensor:
        shares = input_shares(outputs[:, :LOGITS], nearness)  # (4, 4, h, w)
        added = planes(outputs[:, LOGITS:] + straight).view(PHASES, 3, *shares.shape[2:]).transpose(0, 1)  # (3, 4, h, w)
        toned = added.mul_(RESIDUAL).add_(MIDDLE)
        for share, part in zip(shares, warped, strict=True):
            toned.addcmul_(share, part)
        image = full_size(stored_from_root(toned).clamp_(0, 1))
        return image[:, : size[0], : size[1]].permute(1, 2, 0).contiguous()

    def pictures(self, warped: Tensor) -> Tensor:
        return full_size(warped) + MIDDLE


def input_shares(logits: Tensor, nearness: Tensor) -> Tensor:
    """Scores (1, 16, h, w) of the inputs, by input, then phase, to weights (4, 4, h, w) whose sum over the inputs is 1."""
    values = planes(logits).view(INPUTS, PHASES, *logits.shape[2:])
    return (values + nearness.view(INPUTS, 1, 1, 1)).softmax(0)


def level_costs(deviations: Tensor) -> Tensor:
    """How far the inputs disagree around each pixel, by the sweep (1, L, h, w): (h w, L)."""
    return as_rows(mean_around(deviations.to(torch.float32, memory_format=torch.channels_last), AGREEMENT_REACH))


def as_rows(values: Tensor) -> Tensor:
    """(1, C, h, w) as a row of float32 for each pixel: (h w, C)."""
    return values[0].permute(1, 2, 0).flatten(0, 1).float()


def planes(values: Tensor) -> Tensor:
    """float32 in torch's usual order."""
    return values.contiguous().float()


def _warped_phases(corners: Tensor, disparity: Tensor, places: Places) -> Tensor:
    """The inputs (4, C, ., .) warped by the phases (4, h, w) of a disparity: (4, C, 4, h, w)."""
    _, h, w = disparity.shape
    phase = torch.arange(PHASES).view(PHASES, 1, 1)
    rows = (2 * torch.arange(h).view(1, h, 1) + phase // 2 + places.reach).float()  # (4, h, 1)
    columns = (2 * torch.arange(w).view(1, 1, w) + phase % 2 + places.reach).float()
    du, dv = places.offsets.view(INPUTS, 2, 1, 1, 1).unbind(1)
    move_x, move_y = places.moves.view(INPUTS, 2, 1, 1, 1).unbind(1)
    x = torch.addcmul(columns + move_x, du, disparity).view(INPUTS, PHASES * h, w)
    y = torch.addcmul(rows + move_y, dv, disparity).view(INPUTS, PHASES * h, w)
    return quick_sample(corners, x, y).view(INPUTS, -1, PHASES, h, w)


def parts_of(heads: Heads, dtype: torch.dtype) -> Parts:
    """The fastest way there is here, for networks of a type."""
    return CompiledParts(heads, dtype) if kernels.compiled() else TorchParts(heads, dtype)
