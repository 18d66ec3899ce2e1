"""Convolution with 3 x 3 kernels in float32 by Winograd's transforms: a quarter of the multiplications.

F(4 x 4, 3 x 3) of Lavin and Gray (CVPR 2016): the picture is cut into tiles of 6 x 6 px, which overlap; between a transform and
its inverse, a convolution is a product of matrices at each of 36 places, (tiles, channels in) by (channels in, channels
out), and gives 4 x 4 px: 36 multiplications a tile and pair of channels in place of 144. Compiled (lfcore.kernels). Numbers
lose about a digit, so in bfloat16 it would not do.
"""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor

from lfcore.kernels import WINOGRAD_COLUMNS, WINOGRAD_LEAST_CHANNELS, winograd_convolution

LEAST_CHANNELS = WINOGRAD_LEAST_CHANNELS  # of the input and of the result


class WinogradConvolution:
    """See lfcore.layers.Layer. weight: (O, C, 3, 3) float32; bias: (O,) float32, or None. Weights are copied."""

    def __init__(self, weight: Tensor, bias: Tensor | None, padding: int = 0, dilation: int = 1) -> None:
        outputs, inputs, *kernel = weight.shape
        assert kernel == [3, 3] and min(outputs, inputs) >= LEAST_CHANNELS
        self._padding, self._dilation = padding, dilation
        self._bias = torch.zeros(outputs) if bias is None else bias.detach().float().clone()
        self._weights = _transformed(weight.detach())

    def __call__(self, x: Tensor, *, of_positive: bool = False, plus: Tensor | None = None, positive: bool = False) -> Tensor:
        """See Layer."""
        _, _, height, width = x.shape
        lost = 2 * (self._dilation - self._padding)
        shape = 1, self._bias.numel(), height - lost, width - lost
        out = torch.empty(shape, memory_format=torch.channels_last)
        winograd_convolution(x, self._weights, self._bias, plus, out, self._padding, self._dilation, of_positive, positive)
        return out


def _transformed(weight: Tensor) -> Tensor:
    """Kernels (O, C, 3, 3) to matrices (36, groups, C, WINOGRAD_COLUMNS)."""
    rows = [[1 / 4, 0, 0], *([-1 / 6, sign / 6, -1 / 6] for sign in (-1, 1))]
    rows += [*([1 / 24, sign / 12, 1 / 6] for sign in (1, -1)), [0, 0, 1]]
    g = torch.tensor(rows, dtype=torch.float64)
    matrices = torch.einsum("ia,jb,ocab->ijco", g, g, weight.double()).flatten(0, 1).float()  # (36, C, O)
    filled = F.pad(matrices, (0, -matrices.shape[2] % WINOGRAD_COLUMNS))
    return filled.unflatten(2, (-1, WINOGRAD_COLUMNS)).transpose(1, 2).contiguous()
