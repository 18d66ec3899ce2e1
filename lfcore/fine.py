"""A larger pair of networks, for quality: the disparity of the small pair, then two surfaces a pixel, then colour. No I/O here.

Where one surface hides another, a pixel's four inputs do not all show the same one, and one disparity cannot bring them all to
the right place. So the disparity of the small pair (lfcore.compact) is only the start: a second look at the inputs warped by
it refines it, and names another one a pixel, at edges of depth that of the neighbouring surface. The inputs are warped by
both, and the colour network chooses among the eight and adds what is missing.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from typing import Protocol

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from lfcore.compact import CompactDisparity, ResidualBlock, initialise_layers, log_nearness, start_as_sweep
from lfcore.neighbourhoods import greatest_around, in_blocks
from lfcore.networks import INPUTS
from lfcore.planesweep import Levels, mean_and_deviation
from lfcore.tone import stored_from_root

SURFACES = 2  # disparities a pixel
OFF_PLANE = (-1.5, -0.5, 0.5, 1.5)  # px beside the first disparity at which the inputs' agreement is looked at as well
_NEIGHBOURHOODS = (1, 3)  # pixels of half resolution each way, within which another surface is looked for
_CANDIDATES = 1 + len(_NEIGHBOURHOODS)


@dataclass(frozen=True)
class FineConfig:
    """What a weight file must match."""

    name: str = "fine"
    levels: Levels = field(default_factory=lambda: Levels(48))
    width: int = 64  # of the first disparity network, as in CompactConfig
    dilations: tuple[int, ...] = (1, 2, 4, 8, 1)
    fine_width: int = 48
    surface_width: int = 64  # channels of the second look
    surface_dilations: tuple[int, ...] = (1, 2, 4, 1)
    colour_width: int = 96
    colour_dilations: tuple[int, ...] = (1, 2, 1, 1)


Autocast = Callable[[], AbstractContextManager[object]]


def _unnoticed(stage: str) -> None:
    pass


class Warp(Protocol):
    """The four inputs at one viewpoint, warped by a disparity (B, 1, h, w), px. In the root tone."""

    def pictures(self, disparity: Tensor) -> Tensor:
        """(B, 12, h, w), by input, then channel."""

    def luminances(self, disparity: Tensor) -> list[Tensor]:
        """Of each input (B, 1, h, w), to be overwritten."""


@dataclass(frozen=True)
class FineResult:
    """What comes out of one pass."""

    image: Tensor  # (B, 3, h, w), stored values
    disparities: Tensor  # (B, 2, h, w), px over the full baseline; the first is the pixel's own
    warped: Tensor  # (B, 24, h, w), root tone, by surface, input and channel
    weights: Tensor  # (B, 8, h, w), of the warped inputs in the image


class FineModel(nn.Module):
    """First disparity, surfaces and colour; see the module's text."""

    def __init__(self, config: FineConfig | None = None) -> None:
        super().__init__()
        self.config = config or FineConfig()
        self.disparity = CompactDisparity(self.config)
        self.surfaces = Surfaces(self.config)
        self.colour = FineColour(self.config)

    def forward(
        self,
        features: Tensor,
        warp: Warp,
        positions: Tensor,
        autocast: Autocast = nullcontext,
        passed: Callable[[str], None] = _unnoticed,
    ) -> FineResult:
        """features: (B, 2 L, h / 2, w / 2) of the sweep at half resolution, as CompactDisparity wants them; positions: (B, 2),
        (u, v). The networks run under `autocast`, the warps in float32. `passed` is told the name of each stage at its end."""
        with autocast():
            first, seen = self.disparity.look(features)  # (B, 1, h, w)
        passed("disparity")
        warped = warp.pictures(first)
        with torch.no_grad():
            off_plane = torch.cat([mean_and_deviation(warp.luminances(first + step))[1] for step in OFF_PLANE], 1)
        passed("warp")
        with autocast():
            disparities, seen = self.surfaces(warped, off_plane, first, seen, positions)
        passed("disparity")
        both = torch.cat([warp.pictures(part) for part in disparities.split(1, 1)], 1)
        passed("warp")
        with autocast():
            image, weights = self.colour(both, disparities, seen, positions)
        passed("colour")
        return FineResult(image, disparities, both, weights)


class Surfaces(nn.Module):
    """Two disparities a pixel, from the inputs warped by the first.

    warped: (B, 12, h, w) in the root tone, h and w even; off_plane: (B, 4, h, w), deviation of the inputs' luminance, warped by
    the first disparity and OFF_PLANE; disparity: (B, 1, h, w), px; seen: (B, C, h / 2, w / 2), what the first network made of
    the sweep; positions: (B, 2), (u, v). Returns disparities (B, 2, h, w), px, and what was made of it all,
    (B, surface_width, h / 2, w / 2).
    """

    def __init__(self, config: FineConfig) -> None:
        super().__init__()
        width = config.surface_width
        given = 4 * (3 + 3 * INPUTS + len(OFF_PLANE)) + 2 + 4 + 1 + 2 * len(_NEIGHBOURHOODS) + config.fine_width
        self.stem = nn.Conv2d(given, width, 3, padding=1)
        self.blocks = nn.Sequential(*(ResidualBlock(width, dilation) for dilation in config.surface_dilations))
        self.choice = nn.Conv2d(width, 4 * SURFACES * (_CANDIDATES + 1), 3, padding=1)
        self.farthest = max(abs(config.levels.low), abs(config.levels.high))

    def forward(
        self, warped: Tensor, off_plane: Tensor, disparity: Tensor, seen: Tensor, positions: Tensor
    ) -> tuple[Tensor, Tensor]:
        own = in_blocks(disparity)  # (B, 4, h/2, w/2)
        middle = own.mean(1, keepdim=True)
        high, low = own.amax(1, keepdim=True), -own.amin(1, keepdim=True)
        ranges = [(greatest_around(high, reach), -greatest_around(low, reach)) for reach in _NEIGHBOURHOODS]
        apart = [part for most, least in ranges for part in (most - middle, middle - least)]
        x = torch.cat(
            (
                in_blocks(torch.cat((_contrasts(warped), 10 * off_plane), 1)),
                _flat(positions, own),
                own - middle,
                middle / 5,
                *(part / 5 for part in apart),
                seen,
            ),
            1,
        )
        hidden = F.relu(self.blocks(self.stem(x)))
        choice = self.choice(hidden)
        with torch.autocast(disparity.device.type, enabled=False):
            b, _, h, w = own.shape
            logits, residual = choice.float().view(b, SURFACES, _CANDIDATES + 1, 4, h, w).split((_CANDIDATES, 1), 2)
            # The other surface nearby is the one farther from the pixel's own.
            others = [torch.where(most - own > own - least, most, least) for most, least in ranges]
            candidates = torch.stack((own, *others), 1).unsqueeze(1)  # (B, 1, candidates, 4, h/2, w/2)
            chosen = (logits.softmax(2) * candidates).sum(2) + residual.squeeze(2)
            return F.pixel_shuffle(chosen.flatten(1, 2), 2).clamp(-self.farthest, self.farthest), hidden


class FineColour(nn.Module):
    """The inputs, warped by both disparities, to the picture: a weight for each of the eight, and a residual.

    warped: (B, 24, h, w) in the root tone, by surface, then input; disparities: (B, 2, h, w), px; seen: (B, C, h / 2, w / 2),
    what `Surfaces` made of its inputs; positions: (B, 2), (u, v). Returns (B, 3, h, w), stored values, and the
    weights (B, 8, h, w).
    """

    def __init__(self, config: FineConfig) -> None:
        super().__init__()
        width = config.colour_width
        given = 4 * (3 + 3 * INPUTS * SURFACES) + 2 + 1 + 4 + config.surface_width
        self.stem = nn.Conv2d(given, width, 3, padding=1)
        self.blocks = nn.Sequential(*(ResidualBlock(width, dilation) for dilation in config.colour_dilations))
        self.weights = nn.Conv2d(width, 4 * INPUTS * SURFACES, 3, padding=1)
        self.residual = nn.Conv2d(width, 4 * 3, 3, padding=1)
        # A straight way past the layers: sharpening and a change of colours are nearly linear, and are learnt here first.
        self.straight = nn.Conv2d(given, 4 * 3, 3, padding=1, bias=False)
        self.nearness = nn.Parameter(torch.tensor(0.3))  # how much a near input counts before the network has a say
        self.second = nn.Parameter(torch.tensor(-2.0))  # and how much less one that the second disparity brings

    def forward(self, warped: Tensor, disparities: Tensor, seen: Tensor, positions: Tensor) -> tuple[Tensor, Tensor]:
        b, _, h, w = warped.shape
        first, second = in_blocks(disparities[:, :1]), in_blocks(disparities[:, 1:])
        x = torch.cat(
            (
                in_blocks(_contrasts(warped)),
                _flat(positions, first),
                first.mean(1, keepdim=True) / 5,
                (second - first) / 5,
                seen,
            ),
            1,
        )
        hidden = F.relu(self.blocks(self.stem(x)))
        logits, residual = self.weights(hidden), self.residual(hidden) + self.straight(x)
        with torch.autocast(warped.device.type, enabled=False):
            near = self.nearness * log_nearness(positions)  # (B, 4, 1, 1)
            logits = F.pixel_shuffle(logits.float(), 2) + torch.cat((near, near + self.second), 1)  # (B, 8, h, w)
            weights = logits.softmax(1)
            inputs = warped.view(b, SURFACES * INPUTS, 3, h, w)
            blended = (weights.unsqueeze(2) * inputs).sum(1)
            return stored_from_root(blended + 0.1 * F.pixel_shuffle(residual.float(), 2)), weights


def _contrasts(warped: Tensor) -> Tensor:
    """Mean of the first four inputs (B, 3 N, h, w) and the difference of each from it, scaled: (B, 3 + 3 N, h, w)."""
    b, channels, h, w = warped.shape
    inputs = warped.view(b, channels // 3, 3, h, w)
    mean = inputs[:, :INPUTS].mean(1)
    return torch.cat((4 * mean - 2, 10 * (inputs - mean.unsqueeze(1)).flatten(1, 2)), 1)


def _flat(positions: Tensor, like: Tensor) -> Tensor:
    """(B, 2) of 0 .. 1 as planes of -1 .. 1 in the size of `like`."""
    return (2 * positions - 1)[:, :, None, None].expand(-1, 2, *like.shape[2:])


def initialise_fine(model: FineModel, seed: int) -> None:
    """He initialisation; what is added to a path that already works starts small."""
    initialise_layers(model, seed)
    with torch.no_grad():
        model.colour.straight.weight.zero_()
        for layer in (model.surfaces.choice, model.colour.weights, model.colour.residual):
            layer.weight *= 0.1
        start_as_sweep(model.disparity)
        # The first surface starts as the pixel's own, the second as the nearest other.
        assert model.surfaces.choice.bias is not None
        starts = model.surfaces.choice.bias.view(SURFACES, _CANDIDATES + 1, 4)
        starts[0, 0], starts[1, 1] = 3.0, 2.0
