"""The compact networks as they are computed for synthesis: the arithmetic of lfcore.compact, laid out for speed.

What differs is where numbers lie and when they are scaled, not what is computed: convolutions run in channels_last order and in
the given type, scales of their inputs stand in their weights, and pictures are kept as four phases (lfcore.compact_parts).
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor, nn

from lfcore.compact import DEVIATION_SCALE, CompactModel, ResidualBlock, log_nearness
from lfcore.compact_parts import (
    LOGITS,
    MIDDLE,
    PHASES,
    Gathered,
    Heads,
    Places,
    as_rows,
    gathered_order,
    input_shares,
    level_costs,
    parts_of,
)
from lfcore.expected_disparities import expected
from lfcore.layers import Layer, UnsetConvolution, make_layer
from lfcore.tuned_stack import Tuning


@dataclass(frozen=True)
class Coloured:
    """What the colour network puts out."""

    image: Tensor  # (H, W, 3), stored values within 0 and 1
    logits: Tensor  # (1, 16, h, w): scores of the inputs
    nearness: Tensor  # (4,), which is added to them

    def shares(self) -> Tensor:
        """The phases of the weights of the inputs, (4, 4, h, w)."""
        return input_shares(self.logits, self.nearness)


class CompactInference:
    """Both networks of a model, whose weights are copied, by the type and the way that `tuning` says."""

    def __init__(self, model: CompactModel, tuning: Tuning) -> None:
        self.dtype, self._way = tuning.dtype, tuning.way
        config, disparity, colour = model.config, model.disparity, model.colour
        with torch.no_grad():
            scale = torch.full((config.levels.count,), DEVIATION_SCALE)
            self._stem = self._layer(disparity.stem, scale)
            self._skip = self._layer(disparity.skip, scale)
            self._blocks = self._block_layers(disparity.blocks)
            # By phase, then channel: so that a pixel's channels stay together when the phases are put side by side.
            self._rise = self._layer(disparity.rise, outputs=_by_phase(config.fine_width))
            self._join = self._layer(disparity.join)
            score, spread = _matrix(disparity.score), _matrix(disparity.spread)
            self._heads = Heads(score, spread, config.levels.values(), float(disparity.sharpness))
            self._parts = parts_of(self._heads, tuning.dtype)
            x_scale = torch.cat((torch.full((12,), 4.0), torch.full((48,), 10.0), torch.ones(2), torch.full((2,), 0.2)))
            order = gathered_order()
            self._colour_stem = self._layer(colour.stem, x_scale, order)
            self._straight = self._layer(colour.straight, x_scale, order, _by_phase(3))
            self._colour_blocks = self._block_layers(colour.blocks)
            both = torch.cat((torch.arange(LOGITS), LOGITS + _by_phase(3)))
            self._outputs = self._layer(_joined(colour.weights, colour.residual), outputs=both)
            self._nearness = float(colour.nearness)

    def _layer(
        self, convolution: nn.Conv2d, scale: Tensor | None = None, inputs: Tensor | None = None, outputs: Tensor | None = None
    ) -> Layer:
        """A convolution whose input channels are multiplied by `scale`, and whose channels are in another order."""
        weight, bias = convolution.weight.detach(), convolution.bias
        if scale is not None:
            weight = weight * scale.view(1, -1, 1, 1)
        if inputs is not None:
            weight = weight[:, inputs]
        bias = None if bias is None else bias.detach()
        if outputs is not None:
            weight, bias = weight[outputs], None if bias is None else bias[outputs]
        (stride, _), padding, (dilation, _) = convolution.stride, convolution.padding[0], convolution.dilation
        assert isinstance(padding, int)
        return make_layer(weight, bias, self.dtype, self._way, stride, padding, dilation)

    def _block_layers(self, blocks: nn.Sequential) -> list[tuple[Layer, Layer]]:
        return [(self._layer(block.first), self._layer(block.second)) for block in blocks if isinstance(block, ResidualBlock)]

    def prepared(self, toned: Tensor) -> Tensor:
        """Corner views (4, 3, H, W) in the root tone, continued beyond their edges, as `warp` takes them."""
        return self._parts.prepared(toned - MIDDLE)

    def expect(self, deviations: Tensor) -> None:
        """From now on, prefer disparities that a light field is sure to have, by the (1, L, h, w) of its sweep."""
        heads, costs = self._heads, level_costs(deviations)
        probabilities = heads.probabilities(as_rows(self._hidden(deviations)), costs)
        limits = expected(probabilities, costs, heads.values)
        self._parts = parts_of(heads if limits is None else heads.lowered(limits.penalties(heads.values)), self.dtype)

    def disparity(self, deviations: Tensor) -> Tensor:
        """(1, L, h, w) of the sweep, channels_last, to the phases (4, h, w) of the disparity, px."""
        return self._parts.disparity(self._hidden(deviations), deviations)

    def aligned(self, luma: Tensor, disparity: Tensor, places: Places, most: float) -> Tensor:
        """The phases of a disparity, px as this network counts them, changed by up to `most` to where the inputs agree best.

        luma: (4, H, W), luminance of the corner views in the root tone, continued beyond their edges as `prepared` ones are.
        """
        return self._parts.aligned(luma, disparity, places, most)

    def _hidden(self, deviations: Tensor) -> Tensor:
        """The disparity network's last hidden channels, (1, C, h, w)."""
        coarse = _residuals(self._stem(deviations), self._blocks)
        risen = _side_by_side(self._rise(coarse, of_positive=True, positive=True))
        fine = self._skip(deviations, plus=risen, positive=True)
        return self._join(fine, plus=fine, positive=True)

    def warp(self, corners: Tensor, disparity: Tensor, places: Places, position: tuple[float, float]) -> Gathered:
        """`prepared` corners warped by the phases of a disparity, px as this network counts them. position: (u, v)."""
        u, v = position
        return self._parts.gathered(corners, disparity, places, (2 * u - 1, 2 * v - 1))

    def colour(self, gathered: Gathered, position: tuple[float, float], size: tuple[int, int]) -> Coloured:
        """The picture, (height, width) = `size`, of the warped inputs at (u, v)."""
        x = gathered.channels
        outputs = self._outputs(_residuals(self._colour_stem(x), self._colour_blocks), of_positive=True)
        nearness = self._nearness * log_nearness(torch.tensor([position])).flatten()
        image = self._parts.blended(outputs, self._straight(x), gathered.warped, nearness, size)
        return Coloured(image, outputs[:, :LOGITS], nearness)

    def warped_pictures(self, gathered: Gathered) -> Tensor:
        """The warped inputs at full size, (4, 3, 2 h, 2 w), in the root tone."""
        return self._parts.pictures(gathered.warped)


def _by_phase(channels: int) -> Tensor:
    """The order of a pixel shuffle's channels, by channel, then phase, as one by phase, then channel."""
    return torch.arange(PHASES * channels).view(channels, PHASES).T.flatten()


def _joined(first: nn.Conv2d, second: nn.Conv2d) -> nn.Conv2d:
    """Both as one, whose outputs are those of one and then of the other."""
    outputs, (height, width) = first.out_channels + second.out_channels, first.kernel_size
    assert not isinstance(first.padding, str)
    above, left = first.padding
    joined = UnsetConvolution(first.in_channels, outputs, (height, width), padding=(above, left))
    assert joined.bias is not None and first.bias is not None and second.bias is not None
    joined.weight.copy_(torch.cat((first.weight, second.weight)))
    joined.bias.copy_(torch.cat((first.bias, second.bias)))
    return joined


def _matrix(convolution: nn.Conv2d) -> tuple[Tensor, Tensor]:
    """Weights (out, in) and bias of a 1x1 convolution, float32."""
    assert convolution.bias is not None
    return convolution.weight.detach().flatten(1).clone(), convolution.bias.detach().clone()


def _residuals(x: Tensor, blocks: list[tuple[Layer, Layer]]) -> Tensor:
    for first, second in blocks:
        x = second(first(x, of_positive=True, positive=True), plus=x)
    return x


def _side_by_side(phases: Tensor) -> Tensor:
    """(1, 4 C, h, w), by phase and channel, to (1, C, 2 h, 2 w); both channels_last."""
    _, channels, h, w = phases.shape
    pixels = phases.permute(0, 2, 3, 1).view(h, w, 2, 2, channels // 4)
    return pixels.transpose(1, 2).reshape(1, 2 * h, 2 * w, channels // 4).permute(0, 3, 1, 2)
