"""A small pair of networks of the paper's design, for real time: disparity from a plane sweep, then colour. No I/O here.

What differs from the paper: the sweep runs at half resolution over fewer levels, and its means are left out, which told nothing
that the deviations do not; the disparity network looks far (a stride and dilated layers), names a probability for every level,
starts from the sweep's own minimum, and brings its result to full resolution by learned weights; one step without weights moves
that to where the inputs agree best (lfcore.alignment); the colour network works on 2 x 2 blocks of pixels, weighs the four
warped inputs and adds what is missing. Both see pictures in the root tone (lfcore.tone), which evens out exposure and noise.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from lfcore.neighbourhoods import greatest_around, in_blocks, mean_around
from lfcore.networks import INPUTS
from lfcore.planesweep import Levels
from lfcore.tone import stored_from_root

AGREEMENT_REACH = 2  # pixels of half resolution around each over which the sweep's deviation is looked at
DEVIATION_SCALE = 10.0  # brings them to about 1
ALIGNMENT = 4  # height and width must be whole numbers of so many pixels: half resolution, and a stride of 2 from there


@dataclass(frozen=True)
class CompactConfig:
    """What a weight file must match."""

    name: str = "realtime"
    levels: Levels = field(default_factory=lambda: Levels(32))
    width: int = 64  # channels of the disparity network at a quarter of the resolution
    dilations: tuple[int, ...] = (1, 8)  # of its residual blocks
    fine_width: int = 32  # its channels at half resolution
    colour_width: int = 32
    colour_blocks: int = 2
    inner_width: int = 32  # channels between the two convolutions of a residual block, in both networks


class CompactModel(nn.Module):
    """Disparity and colour network; see the module's text."""

    def __init__(self, config: CompactConfig | None = None) -> None:
        super().__init__()
        self.config = config or CompactConfig()
        self.disparity = CompactDisparity(self.config)
        self.colour = CompactColour(self.config)


class ResidualBlock(nn.Module):
    """x + conv(relu(conv(relu(x)))), 3x3, size unchanged."""

    def __init__(self, channels: int, inner: int, dilation: int = 1) -> None:
        super().__init__()
        self.first = nn.Conv2d(channels, inner, 3, padding=dilation, dilation=dilation)
        self.second = nn.Conv2d(inner, channels, 3, padding=dilation, dilation=dilation)

    def forward(self, x: Tensor) -> Tensor:
        result: Tensor = x + self.second(F.relu(self.first(F.relu(x))))
        return result


class CompactDisparity(nn.Module):
    """Deviations of the half-resolution sweep to disparity at full resolution.

    (B, L, h, w), h and w even -> (B, 1, 2 h, 2 w), px of full resolution over the full baseline.
    """

    values: Tensor

    def __init__(self, config: CompactConfig) -> None:
        super().__init__()
        count, width, fine = config.levels.count, config.width, config.fine_width
        self.stem = nn.Conv2d(count, width, 3, stride=2, padding=1)
        self.blocks = nn.Sequential(*(ResidualBlock(width, config.inner_width, dilation) for dilation in config.dilations))
        self.rise = nn.Conv2d(width, 4 * fine, 1)
        self.skip = nn.Conv2d(count, fine, 3, padding=1)
        self.join = nn.Conv2d(fine, fine, 3, padding=1)
        self.score = nn.Conv2d(fine, count, 1)  # of each level
        self.spread = nn.Conv2d(fine, 4 * 9, 1)  # weights of nine neighbours for each of four pixels
        self.sharpness = nn.Parameter(torch.tensor(30.0))  # how steeply a level's score falls with its deviation
        self.register_buffer("values", config.levels.values(), persistent=False)

    def forward(self, deviations: Tensor) -> Tensor:
        scaled = DEVIATION_SCALE * deviations
        coarse = F.relu(self.rise(F.relu(self.blocks(self.stem(scaled)))))
        h = F.relu(F.pixel_shuffle(coarse, 2) + self.skip(scaled))
        h = F.relu(h + self.join(h))
        with torch.autocast(deviations.device.type, enabled=False):  # in bfloat16 the mean over levels would be rounded
            h = h.float()
            # The start is the paper's classical forebear: the level at which the inputs agree best in a small window.
            agreement = mean_around(deviations.float(), AGREEMENT_REACH)
            logits = self.score(h) - self.sharpness * agreement
            coarse_disparity = (logits.softmax(1) * self.values.view(1, -1, 1, 1)).sum(1, keepdim=True)
            return spread_out(coarse_disparity, self.spread(h))


def spread_out(coarse: Tensor, logits: Tensor) -> Tensor:
    """Twice the resolution: each of the four new pixels of a pixel is a weighted mean of that pixel and its eight neighbours.

    coarse: (B, 1, h, w); logits: (B, 36, h, w), softmax over each nine gives the weights. Returns (B, 1, 2 h, 2 w).
    """
    b, _, h, w = coarse.shape
    padded = F.pad(coarse, (1, 1, 1, 1), mode="replicate")
    near = torch.cat([padded[:, :, y : y + h, x : x + w] for y in range(3) for x in range(3)], 1)  # (B, 9, h, w)
    weights = logits.view(b, 4, 9, h, w).softmax(2)
    return F.pixel_shuffle((weights * near.unsqueeze(1)).sum(2), 2)


class CompactColour(nn.Module):
    """Four warped inputs to the picture: a weight for each, and a residual.

    warped: (B, 12, h, w) in the root tone, h and w even; disparity: (B, 1, h, w), px; positions: (B, 2), (u, v). Returns
    (B, 3, h, w), stored values.
    """

    def __init__(self, config: CompactConfig) -> None:
        super().__init__()
        width = config.colour_width
        self.stem = nn.Conv2d(4 * (3 + 3 * INPUTS) + 4, width, 3, padding=1)
        self.blocks = nn.Sequential(*(ResidualBlock(width, config.inner_width) for _ in range(config.colour_blocks)))
        self.weights = nn.Conv2d(width, 4 * INPUTS, 3, padding=1)
        self.residual = nn.Conv2d(width, 4 * 3, 3, padding=1)
        # A straight way past the layers: sharpening and a change of colours are nearly linear, and are learnt here first.
        self.straight = nn.Conv2d(4 * (3 + 3 * INPUTS) + 4, 4 * 3, 3, padding=1, bias=False)
        self.nearness = nn.Parameter(torch.tensor(0.3))  # how much a near input counts before the network has a say

    def forward(self, warped: Tensor, disparity: Tensor, positions: Tensor) -> Tensor:
        b, _, h, w = warped.shape
        inputs = warped.view(b, INPUTS, 3, h, w)
        mean = inputs.mean(1)  # (B, 3, h, w)
        differences = (inputs - mean.unsqueeze(1)).view(b, 3 * INPUTS, h, w)
        colours = in_blocks(torch.cat((4 * mean - 2, 10 * differences), 1))  # (B, 60, h/2, w/2)
        flat = positions.view(b, 2, 1, 1).expand(b, 2, h // 2, w // 2) * 2 - 1
        own = in_blocks(disparity)
        slope = own.mean(1, keepdim=True) / 5
        greatest, least = own.amax(1, keepdim=True), own.amin(1, keepdim=True)
        range_ = greatest_around(greatest, 1) + greatest_around(-least, 1)  # how near an edge of depth is
        x = torch.cat((colours, flat, slope, range_ / 5), 1)
        hidden = F.relu(self.blocks(self.stem(x)))
        logits, residual = self.weights(hidden), self.residual(hidden) + self.straight(x)
        with torch.autocast(warped.device.type, enabled=False):
            logits = F.pixel_shuffle(logits.float(), 2) + self.nearness * log_nearness(positions)  # (B, 4, h, w)
            weights = logits.softmax(1).unsqueeze(2)
            return stored_from_root((weights * inputs).sum(1) + 0.1 * F.pixel_shuffle(residual.float(), 2))


def log_nearness(positions: Tensor) -> Tensor:
    """Logarithm of the bilinear weight of each input at (u, v), kept finite: (B, 2) -> (B, 4, 1, 1), CORNERS order."""
    u, v = positions.clamp(0, 1).unbind(1)
    weights = torch.stack(((1 - u) * (1 - v), (1 - u) * v, u * (1 - v), u * v), 1)
    return (weights + 0.02).log().view(-1, INPUTS, 1, 1)


def initialise_compact(model: CompactModel, seed: int) -> None:
    """He initialisation; what is added to a path that already works starts small."""
    _initialise_layers(model, seed)
    with torch.no_grad():
        model.colour.straight.weight.zero_()
        for layer in (model.colour.weights, model.colour.residual):
            layer.weight *= 0.1
        _start_as_sweep(model.disparity)


def _initialise_layers(model: nn.Module, seed: int) -> None:
    """He initialisation of all convolutions; residual blocks start small."""
    generator = torch.Generator().manual_seed(seed)
    for module in model.modules():
        if isinstance(module, nn.Conv2d):
            nn.init.kaiming_normal_(module.weight, nonlinearity="relu", generator=generator)
            if module.bias is not None:
                nn.init.zeros_(module.bias)
    with torch.no_grad():
        for module in model.modules():
            if isinstance(module, ResidualBlock):
                module.second.weight *= 0.3


def _start_as_sweep(network: CompactDisparity) -> None:
    """Begin with little more than the sweep's own minimum; full resolution starts as the coarse pixel itself, mostly."""
    with torch.no_grad():
        network.score.weight *= 0.05
        network.spread.weight *= 0.1
        assert network.spread.bias is not None
        network.spread.bias.view(4, 9)[:, 4] = 2.0
