"""Convolution by the matrix unit of processors that have one (Intel's AMX), with what comes before and after it in one pass.

Products of bfloat16, sums in float32. The unit multiplies 16 rows of 32 values by 32 x 16 at once. Here a row is a pixel, and
its values are the channels under a row of the kernel, which lie side by side in memory, so that nothing is gathered. Compiled
(lfcore.kernels).
"""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor

from lfcore.kernels import AMX_MOST_PIECES, AMX_PIECE, COLUMNS, AmxKernel, amx_convolution, amx_packed, amx_pieces, has_amx


class AmxConvolution:
    """See lfcore.layers.Layer. weight: (O, C, k, k) float32; bias: (O,) float32, or None. Weights are copied, as bfloat16.

    `can_compute` tells whether these arguments are taken.
    """

    def __init__(self, weight: Tensor, bias: Tensor | None, stride: int = 1, padding: int = 0, dilation: int = 1) -> None:
        assert can_compute(weight, torch.bfloat16, dilation)
        outputs, _, kernel, _ = weight.shape
        self._outputs = outputs
        rows = F.pad(_runs(weight.detach(), dilation), (0, 0, 0, -_run_length(weight, dilation) % AMX_PIECE))
        whole = torch.zeros(outputs + -outputs % COLUMNS)
        if bias is not None:
            whole[:outputs] = bias.detach()
        self._kernel = AmxKernel(amx_packed(rows.flatten(0, 1).unsqueeze(0)), whole, kernel, stride, padding, dilation)

    def __call__(self, x: Tensor, *, of_positive: bool = False, plus: Tensor | None = None, positive: bool = False) -> Tensor:
        """See Layer."""
        kernel = self._kernel
        lost = (kernel.size - 1) * kernel.dilation - 2 * kernel.padding
        height, width = ((extent - lost - 1) // kernel.stride + 1 for extent in x.shape[2:])
        out = torch.empty(1, self._outputs, height, width, dtype=torch.bfloat16, memory_format=torch.channels_last)
        amx_convolution(x, kernel, plus, out, of_positive, positive)
        return out


def can_compute(weight: Tensor, dtype: torch.dtype, dilation: int = 1) -> bool:
    """Whether there is an AmxConvolution for weights (O, C, k, k) in a type."""
    _, channels, height, width = weight.shape
    few_enough = amx_pieces(width, channels, dilation) <= AMX_MOST_PIECES
    return height == width and dtype == torch.bfloat16 and few_enough and has_amx()


def _run_length(weight: Tensor, dilation: int) -> int:
    """Values of the picture under a kernel (O, C, k, k) that lie side by side: of a row of pixels, or with gaps of a pixel."""
    _, channels, _, width = weight.shape
    return channels * (width if dilation == 1 else 1)


def _runs(weight: Tensor, dilation: int) -> Tensor:
    """Kernels (O, C, k, k) as matrices (runs, run length, O)."""
    return weight.permute(2, 3, 1, 0).reshape(-1, _run_length(weight, dilation), weight.shape[0])
