"""The last step to the disparity of the small pair: moved, by part of a pixel, to where the inputs agree best.

The sweep has half the resolution and levels more than a pixel apart, so what the network makes of it knows edges only so well.
The inputs that it warps know more: to first order, a change of the disparity moves each of them along its own slope, so the
change for which they differ least around a pixel is a quotient of two sums, one step of Gauss and Newton (Lucas and Kanade
1981, with the paper's four views in place of two). No I/O here.
"""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor

from lfcore.networks import INPUTS

# Weights of the pixels up to 3 px away, along each axis: means over 3 px of means over 5.
WEIGHTS = (1 / 15, 2 / 15, 3 / 15, 3 / 15, 3 / 15, 2 / 15, 1 / 15)
# Added to the sums of squared slopes, which are per px of disparity: where they are less, noise decides, and little is changed.
FLAT = 1e-3
MOST = 1.0  # px of the picture by which a disparity is changed: slopes do not tell of more


def alignment_step(warped: Tensor, offsets: Tensor, most: float) -> Tensor:
    """The change of disparity for which warped inputs differ least around each pixel; differentiable.

    warped: (4, B, h, w), luminance of the inputs in the root tone, warped by the disparity. offsets: (4, 2), px along x and y
    by which a px of disparity moves the place where an input is sampled. Returns (B, 1, h, w), px, within -most and most.
    """
    padded = F.pad(warped, (1, 1, 1, 1), mode="replicate")
    across = (padded[..., 1:-1, 2:] - padded[..., 1:-1, :-2]) / 2
    down = (padded[..., 2:, 1:-1] - padded[..., :-2, 1:-1]) / 2
    along_x, along_y = offsets.to(warped).view(INPUTS, 2, 1, 1, 1).unbind(1)
    slopes = along_x * across + along_y * down
    slopes = slopes - slopes.mean(0)
    differences = warped - warped.mean(0)
    sums = _around(torch.stack(((differences * slopes).sum(0), slopes.square().sum(0)), 1))  # (B, 2, h, w)
    return (-sums[:, :1] / (sums[:, 1:] + FLAT)).clamp(-most, most)


def _around(values: Tensor) -> Tensor:
    """Weighted sums over the pixels around each, beyond the edges nothing: (B, C, h, w)."""
    weights = torch.tensor(WEIGHTS, device=values.device)
    channels, reach = values.shape[1], len(WEIGHTS) // 2
    rows = F.conv2d(values, weights.view(1, 1, -1, 1).expand(channels, 1, -1, 1), padding=(reach, 0), groups=channels)
    return F.conv2d(rows, weights.view(1, 1, 1, -1).expand(channels, 1, 1, -1), padding=(0, reach), groups=channels)
