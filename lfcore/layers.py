"""Convolutions as they are computed for synthesis, with what comes directly before and after them."""

from __future__ import annotations

from enum import Enum
from typing import Protocol

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from lfcore import amx, winograd


class Way(Enum):
    """How a convolution is computed."""

    TORCH = "torch"
    WINOGRAD = "winograd"  # by Winograd's transforms (lfcore.winograd)
    AMX = "amx"  # by the processor's matrix unit (lfcore.amx)


class Layer(Protocol):
    """A convolution. Pictures are (1, channels, height, width), channels_last."""

    def __call__(self, x: Tensor, *, of_positive: bool = False, plus: Tensor | None = None, positive: bool = False) -> Tensor:
        """The convolution of x, or of ReLU(x) where `of_positive`; `plus` added; then ReLU where `positive`. A new tensor."""


class UnsetConvolution(nn.Conv2d):
    """A convolution whose weights are yet to be set: no random numbers are drawn for them. What torch offers for it
    (nn.utils.skip_init) loads a library for symbolic mathematics, which took a start half a second and more."""

    def reset_parameters(self) -> None:
        """Nothing."""


class DirectConvolution:
    """By torch, in the type of its weights."""

    def __init__(self, weight: Tensor, bias: Tensor | None, stride: int = 1, padding: int = 0, dilation: int = 1) -> None:
        self._weight = weight.contiguous(memory_format=torch.channels_last)
        self._bias = bias
        self._stride, self._padding, self._dilation = stride, padding, dilation

    def __call__(self, x: Tensor, *, of_positive: bool = False, plus: Tensor | None = None, positive: bool = False) -> Tensor:
        """See Layer."""
        y = F.conv2d(x.relu() if of_positive else x, self._weight, self._bias, self._stride, self._padding, self._dilation)
        if plus is not None:
            y.add_(plus)
        return y.relu_() if positive else y


def make_layer(
    weight: Tensor,
    bias: Tensor | None,
    dtype: torch.dtype,
    way: Way,
    stride: int = 1,
    padding: int = 0,
    dilation: int = 1,
) -> Layer:
    """A layer in a type. weight: (out, in, k, k) float32. Where `way` has nothing for such a layer, it is torch's."""
    if way is Way.WINOGRAD and stride == 1 and winograd.can_compute(weight, dtype):
        return winograd.WinogradConvolution(weight, bias, padding, dilation, dtype)
    if way is Way.AMX and amx.can_compute(weight, dtype, dilation):
        return amx.AmxConvolution(weight, bias, stride, padding, dilation)
    return DirectConvolution(weight.to(dtype), None if bias is None else bias.to(dtype), stride, padding, dilation)
