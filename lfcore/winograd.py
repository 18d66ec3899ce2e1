"""Convolution with 3 x 3 kernels by Winograd's transforms: a quarter of the multiplications.

F(4 x 4, 3 x 3) of Lavin and Gray (CVPR 2016): the picture is cut into tiles of 6 x 6 px, which overlap; between a transform and
its inverse, a convolution is a product of matrices at each of 36 places, (tiles, channels in) by (channels in,
channels out), and gives 4 x 4 px: 36 multiplications a tile and pair of channels in place of 144. Compiled (lfcore.kernels).

The polynomials of the transforms are taken at 0, at infinity, and at the square roots of 1/2 and 2, with both signs: numbers
lose fewer digits than with 1 and 2 in their place, so that what lies between the transforms may be bfloat16.
"""

from __future__ import annotations

from math import sqrt

import torch
import torch.nn.functional as F
from torch import Tensor

from lfcore.kernels import COLUMNS, WINOGRAD_LEAST_CHANNELS, can_convolve, paired, winograd_convolution

_POINTS = (-1.5, 0.5, sqrt(0.5)), (6.0, 2.0, sqrt(2.0))  # what a pair's rows are divided by, their squares, they themselves


class WinogradConvolution:
    """See lfcore.layers.Layer. weight: (O, C, 3, 3) float32; bias: (O,) float32, or None. Weights are copied.

    dtype: of pictures, and of what lies between the transforms. `can_compute` tells whether these arguments are taken.
    """

    def __init__(
        self, weight: Tensor, bias: Tensor | None, padding: int = 0, dilation: int = 1, dtype: torch.dtype = torch.float32
    ) -> None:
        assert can_compute(weight, dtype)
        self._padding, self._dilation, self._dtype = padding, dilation, dtype
        self._bias = torch.zeros(weight.shape[0]) if bias is None else bias.detach().float().clone()
        matrices = _transformed(weight.detach())
        self._weights = _grouped(matrices) if dtype == torch.float32 else paired(_evens_first(matrices))

    def __call__(self, x: Tensor, *, of_positive: bool = False, plus: Tensor | None = None, positive: bool = False) -> Tensor:
        """See Layer."""
        _, _, height, width = x.shape
        lost = 2 * (self._dilation - self._padding)
        shape = 1, self._bias.numel(), height - lost, width - lost
        out = torch.empty(shape, dtype=self._dtype, memory_format=torch.channels_last)
        winograd_convolution(x, self._weights, self._bias, plus, out, self._padding, self._dilation, of_positive, positive)
        return out


def can_compute(weight: Tensor, dtype: torch.dtype) -> bool:
    """Whether there is a WinogradConvolution for weights (O, C, k, k) in a type."""
    outputs, inputs, *kernel = weight.shape
    enough = dtype != torch.float32 or min(inputs, outputs) >= WINOGRAD_LEAST_CHANNELS
    return kernel == [3, 3] and can_convolve(dtype) and enough


def _transformed(weight: Tensor) -> Tensor:
    """Kernels (O, C, 3, 3) to matrices (36, C, O) float32."""
    pairs = [[1 / divisor, sign * point / divisor, square / divisor] for divisor, square, point in _POINTS for sign in (1, -1)]
    g = torch.tensor([[1.0, 0.0, 0.0], *pairs, [0.0, 0.0, 1.0]], dtype=torch.float64)
    return torch.einsum("ia,jb,ocab->ijco", g, g, weight.double()).flatten(0, 1).float()


def _grouped(matrices: Tensor) -> Tensor:
    """(36, C, O) to (36, groups, C, COLUMNS), O filled up to whole groups."""
    filled = F.pad(matrices, (0, -matrices.shape[2] % COLUMNS))
    return filled.unflatten(2, (-1, COLUMNS)).transpose(1, 2).contiguous()


def _evens_first(matrices: Tensor) -> Tensor:
    """(36, C, O), of each full 32 channels in the even ones first, then the odd ones, as the compiled code has them."""
    channels = matrices.shape[1]
    whole = channels - channels % 32
    order = torch.arange(whole).view(-1, 16, 2).transpose(1, 2).flatten()
    return matrices[:, torch.cat((order, torch.arange(whole, channels)))]
