"""The compact networks as they are computed for synthesis: the arithmetic of lfcore.compact, laid out for speed.

What differs is where numbers lie and when they are scaled, not what is computed:
- Convolutions run in channels_last order and in the given type; scales of their inputs stand in their weights.
- The picture is kept as its four half-size phases: pixel (2 y + dy, 2 x + dx) stands at [2 dy + dx, y, x], since the disparity
  comes out so and the colour network wants it so; only the results are put together at full size.
- Scores and weights of neighbours are one matrix product, in float32.
"""

from __future__ import annotations

from collections.abc import Callable

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from lfcore.compact import CompactModel, ResidualBlock, log_nearness
from lfcore.networks import INPUTS
from lfcore.tone import stored_from_root

Layer = Callable[[Tensor], Tensor]

# The scales that CompactDisparity gives its features, without the shift, which `sweep_input` gives.
_MEAN_SCALE, _MEAN_SHIFT, _DEVIATION_SCALE = 4.0, -2.0, 10.0


def sweep_input(luma: Tensor) -> Tensor:
    """The luminance over which the plane sweep for `CompactInference` runs."""
    return _MEAN_SCALE * luma + _MEAN_SHIFT


class CompactInference:
    """Both networks of a model, whose weights are copied."""

    def __init__(self, model: CompactModel, dtype: torch.dtype) -> None:
        self.dtype = dtype
        config, disparity, colour = model.config, model.disparity, model.colour
        self._levels = config.levels.count
        with torch.no_grad():
            features = torch.ones(2 * self._levels)
            features[self._levels :] = _DEVIATION_SCALE / _MEAN_SCALE  # the sweep's input carries the scale of the means
            self._stem = _layer(disparity.stem, dtype, features)
            self._skip = _layer(disparity.skip, dtype, features)
            self._blocks = _block_layers(disparity.blocks, dtype)
            # By phase, then channel: so that a pixel's channels stay together when the phases are put side by side.
            by_phase = torch.arange(4 * config.fine_width).view(-1, 4).T.flatten()
            self._rise = _layer(disparity.rise, dtype, outputs=by_phase)
            self._join = _layer(disparity.join, dtype)
            self._score = _matrix(disparity.score)
            self._spread = _matrix(disparity.spread)
            self._sharpness = float(disparity.sharpness) / _MEAN_SCALE
            self._values = config.levels.values()
            x_scale = torch.cat((torch.full((12,), 4.0), torch.full((48,), 10.0), torch.ones(2), torch.full((2,), 0.2)))
            self._colour_stem = _layer(colour.stem, dtype, x_scale)
            self._straight = _layer(colour.straight, dtype, x_scale)
            self._colour_blocks = _block_layers(colour.blocks, dtype)
            self._weights, self._residual = _layer(colour.weights, dtype), _layer(colour.residual, dtype)
            self._nearness = float(colour.nearness)

    def disparity(self, features: Tensor) -> Tensor:
        """(1, 2 L, h, w) of the sweep over `sweep_input`, channels_last, to the phases (4, h, w) of the disparity, px."""
        _, _, h, w = features.shape
        coarse = _residuals(self._stem(features), self._blocks)
        fine = _side_by_side(self._rise(coarse.relu_())).add_(self._skip(features)).relu_()
        fine = self._join(fine).add_(fine).relu_()
        pixels = fine.permute(0, 2, 3, 1).reshape(h * w, -1).float()  # (h w, C)
        agreement = _box(features[:, self._levels :].to(torch.float32, memory_format=torch.channels_last))
        scores = torch.addmm(self._score[1], pixels, self._score[0].T)  # (h w, L)
        scores.sub_(agreement.permute(0, 2, 3, 1).reshape(h * w, -1), alpha=self._sharpness)
        coarse_disparity = (scores.softmax(1) @ self._values).view(1, 1, h, w)
        padded = F.pad(coarse_disparity, (1, 1, 1, 1), mode="replicate")[0, 0]
        near = torch.stack([padded[y : y + h, x : x + w] for y in range(3) for x in range(3)])  # (9, h, w)
        weights = torch.addmm(self._spread[1][:, None], self._spread[0], pixels.T).view(4, 9, h, w).softmax(1)
        return weights.mul_(near).sum(1)

    def colour(self, warped: Tensor, disparity: Tensor, positions: Tensor) -> Tensor:
        """As `weighed_colour`, the picture alone."""
        return self.weighed_colour(warped, disparity, positions)[0]

    def weighed_colour(self, warped: Tensor, disparity: Tensor, positions: Tensor) -> tuple[Tensor, Tensor]:
        """Phases of the warped inputs (4, 3, 4, h, w) less 0.5, in the root tone, and of the disparity (4, h, w); positions
        (1, 2). Returns the phases of the picture (3, 4, h, w), stored values, and the weights of the inputs (4, 4, h, w)."""
        h, w = disparity.shape[-2:]
        x = torch.empty(1, 64, h, w, dtype=self.dtype)
        mean = warped.mean(0)  # (3, 4, h, w)
        x[0, :12] = mean.flatten(0, 1)
        x[0, 12:60] = (warped - mean).flatten(0, 2)
        x[0, 60:62] = (positions[0] * 2 - 1).view(2, 1, 1)
        x[0, 62] = disparity.mean(0)
        x[0, 63] = _widest(disparity.amax(0)) + _widest(-disparity.amin(0))
        x = x.contiguous(memory_format=torch.channels_last)
        hidden = _residuals(self._colour_stem(x), self._colour_blocks).relu_()
        logits = _planes(self._weights(hidden)).view(INPUTS, 4, h, w)
        weights = logits.add_(self._nearness * log_nearness(positions)[0].unsqueeze(1)).softmax(0)
        residual = _planes(self._residual(hidden).add_(self._straight(x))).view(3, 4, h, w)
        blended = residual.mul_(0.1).add_(0.5)
        for share, part in zip(weights, warped, strict=True):
            blended.addcmul_(share, part)
        return stored_from_root(blended), weights


def full_size(phases: Tensor) -> Tensor:
    """(..., 4, h, w) -> (..., 2 h, 2 w), contiguous."""
    *leading, _, h, w = phases.shape
    result = torch.empty(*leading, 2 * h, 2 * w)
    for phase in range(4):
        result[..., phase // 2 :: 2, phase % 2 :: 2] = phases[..., phase, :, :]
    return result


def _layer(
    convolution: nn.Conv2d, dtype: torch.dtype, scale: Tensor | None = None, outputs: Tensor | None = None
) -> Layer:
    """A convolution in `dtype` whose input channels are multiplied by `scale`, and whose outputs are in another order."""
    weight, bias = convolution.weight.detach(), convolution.bias
    if scale is not None:
        weight = weight * scale.view(1, -1, 1, 1)
    if outputs is not None:
        weight, bias = weight[outputs], None if bias is None else bias[outputs]
    weight = weight.to(dtype=dtype, memory_format=torch.channels_last)
    bias = None if bias is None else bias.detach().to(dtype)
    stride, padding, dilation = convolution.stride, convolution.padding, convolution.dilation
    return lambda x: F.conv2d(x, weight, bias, stride, padding, dilation)


def _block_layers(blocks: nn.Sequential, dtype: torch.dtype) -> list[tuple[Layer, Layer]]:
    return [
        (_layer(block.first, dtype), _layer(block.second, dtype)) for block in blocks if isinstance(block, ResidualBlock)
    ]


def _matrix(convolution: nn.Conv2d) -> tuple[Tensor, Tensor]:
    """Weights (out, in) and bias of a 1x1 convolution, float32."""
    assert convolution.bias is not None
    return convolution.weight.detach().flatten(1).clone(), convolution.bias.detach().clone()


def _residuals(x: Tensor, blocks: list[tuple[Layer, Layer]]) -> Tensor:
    for first, second in blocks:
        x.add_(second(first(x.relu()).relu_()))
    return x


def _side_by_side(phases: Tensor) -> Tensor:
    """(1, 4 C, h, w), by phase and channel, rectified, to (1, C, 2 h, 2 w); both channels_last."""
    _, channels, h, w = phases.shape
    pixels = phases.relu_().permute(0, 2, 3, 1).view(h, w, 2, 2, channels // 4)
    return pixels.transpose(1, 2).reshape(1, 2 * h, 2 * w, channels // 4).permute(0, 3, 1, 2)


def _planes(values: Tensor) -> Tensor:
    """float32 in torch's usual order."""
    return values.contiguous().float()


def _box(values: Tensor) -> Tensor:
    """Mean over 5 x 5, at the edges over what there is. A convolution is four times as fast as torch's pooling here."""
    channels, height, width = values.shape[1:]
    sums = F.conv2d(values, torch.ones(channels, 1, 5, 5), padding=2, groups=channels)
    return sums.div_(_neighbours(height).unsqueeze(1) * _neighbours(width))


def _neighbours(size: int) -> Tensor:
    """How many of five places around each lie within the size."""
    places = torch.arange(size)
    return ((places + 3).clamp(max=size) - (places - 2).clamp(min=0)).float()


def _widest(values: Tensor) -> Tensor:
    """The greatest of 3 x 3, at the edges of what there is: (h, w). Torch's pooling of one plane takes ten times as long."""
    for dim in (0, 1):
        size = values.shape[dim]
        greatest = values.clone()
        after, before = greatest.narrow(dim, 1, size - 1), greatest.narrow(dim, 0, size - 1)
        torch.maximum(after, values.narrow(dim, 0, size - 1), out=after)
        torch.maximum(before, values.narrow(dim, 1, size - 1), out=before)
        values = greatest
    return values
