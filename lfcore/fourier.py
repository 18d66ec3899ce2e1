"""Convolution by Fourier transforms: the large kernels of the paper's networks with an eighth of the multiplications.

The picture is cut into overlapping tiles of 16 x 16 px. Between a transform and its inverse, a convolution with a kernel of
k x k px is a product of matrices at each frequency, (tiles, channels in) by (channels in, channels out), and gives 17 - k px
of a tile along each axis ("overlap-save"): 576 real multiplications a tile and pair of channels, where 7 x 7 px take 4900 for
the same 100 pixels, 5 x 5 take 3600 for 144, 3 x 3 take 1764 for 196. The transforms are compiled (lfcore.kernels); the
products are torch's, or those of the processor's matrix unit.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Protocol

import torch
from torch import Tensor, nn

from lfcore.kernels import (
    FOURIER_FREQUENCIES,
    FOURIER_LEAST_CHANNELS,
    amx_packed,
    amx_products,
    amx_room,
    fourier_backward,
    fourier_forward,
    has_amx,
)

SIZE = 16  # px of a tile
LEAST_CHANNELS = FOURIER_LEAST_CHANNELS  # of the input and of the result


def unchecked() -> None:
    """For work that is never broken off."""


class FourierConvolution:
    """ReLU of a convolution without padding, stride or dilation. Weights are copied.

    dtype: of pictures and spectra. In bfloat16 a spectrum is rounded as a picture would be, but for frequency 0: the sum of a
    tile, often by far the largest, is kept in float32 (rounded, it moved the disparity of `full` by three times as much).
    """

    def __init__(self, layer: nn.Conv2d, dtype: torch.dtype) -> None:
        self.dtype = dtype
        self.kernel = layer.kernel_size[0]
        assert layer.kernel_size == (self.kernel, self.kernel) and self.kernel <= SIZE and layer.bias is not None
        assert (layer.stride, layer.padding, layer.dilation) == ((1, 1), (0, 0), (1, 1))
        assert min(layer.in_channels, layer.out_channels) >= LEAST_CHANNELS
        self._bias = layer.bias.detach().float().clone()
        weight = layer.weight.detach().float()
        self._products = _products_with(_spectral_weights(weight), dtype)
        self._channels, self._outputs = layer.in_channels, layer.out_channels
        self._sum_weights = weight.sum((2, 3)).T / SIZE**2  # (C, O)

    def __call__(self, x: Tensor, check: Callable[[], None] = unchecked) -> Tensor:
        """(1, C, H, W) channels_last -> (1, O, H - k + 1, W - k + 1) channels_last. `check` is called every few milliseconds;
        what it raises ends the work."""
        _, channels, height, width = x.shape
        assert channels == self._channels
        step = SIZE - self.kernel + 1
        out = torch.empty(
            1,
            self._outputs,
            height - self.kernel + 1,
            width - self.kernel + 1,
            dtype=self.dtype,
            memory_format=torch.channels_last,
        )
        count = math.ceil(out.shape[2] / step) * math.ceil(out.shape[3] / step)
        # Blocks of about equal size, an odd number of tiles: frequencies should not all fall on the same places of a cache.
        at_once = math.ceil(count / math.ceil(count / self._products.tiles)) | 1
        room = self._products.room(at_once)
        for first in range(0, count, at_once):
            check()
            tiles = min(at_once, count - first)
            own = room[: FOURIER_FREQUENCIES * tiles * 2 * channels].view(FOURIER_FREQUENCIES, tiles, 2 * channels)
            sums = torch.empty(tiles, channels)
            fourier_forward(x, own, sums, step, first)
            product = self._products(room, tiles)
            fourier_backward(product, sums @ self._sum_weights, self._bias, out, step, first)
        return out


class _Products(Protocol):
    """Products of spectra with matrices (129, 2 C, 2 O)."""

    @property
    def tiles(self) -> int:
        """How many at a time: enough for the products to be fast, few enough for a core's share of the usual caches."""

    def room(self, tiles: int) -> Tensor:
        """Flat memory for the spectra of so many tiles."""

    def __call__(self, room: Tensor, tiles: int) -> Tensor:
        """Spectra (129, tiles, 2 C), with which `room` begins, to (129, tiles, 2 O)."""


def _products_with(matrices: Tensor, dtype: torch.dtype) -> _Products:
    """The faster ones there are here."""
    if dtype == torch.bfloat16 and has_amx():
        return _AmxProducts(matrices)
    return _TorchProducts(matrices, dtype)


class _TorchProducts:
    """See _Products."""

    def __init__(self, matrices: Tensor, dtype: torch.dtype) -> None:
        self._matrices = matrices.to(dtype)
        self.tiles = 191 if dtype == torch.bfloat16 else 96  # about as many bytes

    def room(self, tiles: int) -> Tensor:
        return torch.empty(tiles * self._matrices[:, :, 0].numel(), dtype=self._matrices.dtype)

    def __call__(self, room: Tensor, tiles: int) -> Tensor:
        frequencies, values, _ = self._matrices.shape
        return torch.bmm(room[: frequencies * tiles * values].view(frequencies, tiles, values), self._matrices)


class _AmxProducts:
    """See _Products: by the matrix unit (lfcore.kernels), which reads the matrices anew for every block of tiles."""

    tiles = 191

    def __init__(self, matrices: Tensor) -> None:
        _, self._values, self._columns = matrices.shape
        self._packed = amx_packed(matrices)

    def room(self, tiles: int) -> Tensor:
        return amx_room(FOURIER_FREQUENCIES, tiles, self._values)

    def __call__(self, room: Tensor, tiles: int) -> Tensor:
        out = torch.empty(FOURIER_FREQUENCIES, tiles, self._columns, dtype=torch.bfloat16)
        amx_products(room, self._values, self._packed, out)
        return out


def _spectral_weights(weight: Tensor) -> Tensor:
    """Kernels (O, C, k, k) to matrices (129, 2 C, 2 O) by which a row of real, then imaginary parts is multiplied."""
    rows, columns = _frequencies()
    along = 2 * math.pi / SIZE * torch.arange(weight.shape[-1], dtype=torch.float64)
    angles = (rows[:, None, None] * along[:, None] + columns[:, None, None] * along).float()  # (129, k, k)
    # Conjugated, since networks correlate.
    real, imaginary = (
        torch.tensordot(wave / SIZE**2, weight, ((1, 2), (2, 3))).transpose(1, 2) for wave in (angles.cos(), angles.sin())
    )  # (129, C, O)
    return torch.cat((torch.cat((real, imaginary), 2), torch.cat((-imaginary, real), 2)), 1)


def _frequencies() -> tuple[Tensor, Tensor]:
    """Rows and columns of the frequencies of a real picture, but for 0, in the order of lfcore/kernels/fourier.c."""
    half = SIZE // 2
    inner = [(row, column) for column in range(1, half) for row in range(SIZE)]
    edges = [(row, column) for column in (0, half) for row in range(half + 1)]
    rows, columns = zip(*inner, *edges[1:], strict=True)
    return torch.tensor(rows), torch.tensor(columns)
