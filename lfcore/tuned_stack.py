"""The paper's stack of layers as it is computed for synthesis: laid out for the machine, in tiles. No weights change."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise

import torch
from torch import Tensor, nn

from lfcore.fourier import LEAST_CHANNELS, FourierConvolution, unchecked
from lfcore.idle_channels import used_layers
from lfcore.layers import DirectConvolution, UnsetConvolution, Way, make_layer
from lfcore.networks import BORDER, PaperStack
from lfcore.planesweep import Levels, Window

# Features of one tile take (2 L) values a pixel: so many pixels in bfloat16 are 23 MB.
TILE_PIXELS = 200 * 288
HiddenLayer = Callable[[Tensor, Callable[[], None]], Tensor]  # of a picture, and what is called now and then
_FEW_CHANNELS = 32  # in: of so few, the matrix unit computes large kernels directly in half of Fourier transforms' time
_FEW_MEANS = 12  # with the deviations of 100 levels seven sixteens of channels, as Fourier transforms take them at once
_STEP = 16  # widths that are multiples of it suit the blocks in which convolutions are computed


@dataclass(frozen=True)
class Tuning:
    """How the paper's networks are computed; the type also serves the other networks."""

    dtype: torch.dtype = torch.float32
    tile_width: int = 288  # px that come out; the height follows from tile_pixels
    channel_multiple: int = 1  # channels of hidden layers are filled up with zeros to a multiple of this
    tile_pixels: int = TILE_PIXELS
    way: Way = Way.TORCH  # in which convolutions are computed, those of the small pair too
    # Whether Fourier transforms (lfcore.fourier) are the way of larger kernels than 3 x 3, and of those where `way` is torch's.
    # Large kernels of few channels are the matrix unit's where it is `way`.
    fourier: bool = False
    means: int = Levels().count  # of the plane sweep's levels, those whose means are computed (lfcore.fewer_means)

    @classmethod
    def by_fourier(cls, dtype: torch.dtype, way: Way = Way.TORCH) -> Tuning:
        """With Fourier transforms, few means, and larger tiles, since the transforms' own have overlaps already."""
        return cls(dtype, 2 * 288, 1, 2 * TILE_PIXELS, way, fourier=True, means=_FEW_MEANS)

    def tiles(self, height: int, width: int) -> Iterator[Tile]:
        """Cover what comes out with tiles of about equal size, from the top left."""
        for top, bottom in _spans(height, max(self.tile_pixels // self.tile_width, _STEP)):
            for left, right in _spans(width, self.tile_width):
                yield Tile(Window(top, bottom, left, right))


@dataclass(frozen=True)
class Tile:
    """A part of what a PaperStack puts out, and of its input, which is BORDER larger on each side."""

    window: Window  # of what comes out

    @property
    def source(self) -> Window:
        """What the stack must see for it, of the input."""
        window = self.window
        return Window(window.top, window.bottom + 2 * BORDER, window.left, window.right + 2 * BORDER)


def _spans(size: int, most: int) -> list[tuple[int, int]]:
    count = -(-size // most)
    even = -(-size // count)
    rounded = -(-even // _STEP) * _STEP
    step = rounded if rounded <= most else even
    return list(pairwise([*range(0, size, step), size]))


class TunedStack:
    """A PaperStack for inference: its hidden layers without idle channels, in the tuned type, channels_last, and filled up.

    A filled channel has weights and bias of 0, so that it stays 0 and no result changes.
    """

    def __init__(self, stack: PaperStack, tuning: Tuning) -> None:
        self.dtype = tuning.dtype
        used = used_layers(stack)
        convolutions = used.hidden
        self._channels = convolutions[0].in_channels
        least = LEAST_CHANNELS if tuning.fourier else 1
        filled = [_filled(layer, tuning.channel_multiple, least) for layer in convolutions]
        self._input_channels = filled[0].in_channels
        self._hidden = [_tuned(layer, tuning) for layer in filled]
        self._last = used.last
        self._outputs = convolutions[-1].out_channels

    def empty_input(self, height: int, width: int) -> Tensor:
        """Where an input is written: (1, C, height, width) in the layout and type that the first layer wants. The stack's own
        channels come first and are not set; filled ones are 0."""
        x = torch.empty(1, self._input_channels, height, width, dtype=self.dtype, memory_format=torch.channels_last)
        x[:, self._channels :] = 0
        return x

    def tile_input(self, features: Tensor, tile: Tile) -> Tensor:
        """What the stack must see for a tile, of its whole input (1, channels, H, W)."""
        source = tile.source
        x = self.empty_input(*source.shape)
        x[:, : self._channels] = features[:, :, source.top : source.bottom, source.left : source.right]
        return x

    def __call__(self, x: Tensor, check: Callable[[], None] = unchecked) -> Tensor:
        """An input as `empty_input` makes it to (1, outputs, height - 12, width - 12) float32. `check` is called before
        each hidden layer, and within long ones; what it raises ends the work."""
        for layer in self._hidden:
            x = layer(x, check)
        result: Tensor = self._last(x[:, : self._outputs].float())
        return result


def _tuned(layer: nn.Conv2d, tuning: Tuning) -> HiddenLayer:
    """The layer with its ReLU."""
    assert layer.bias is not None
    plain = make_layer(layer.weight, layer.bias, tuning.dtype, tuning.way)
    small = layer.kernel_size == (3, 3) or (layer.in_channels <= _FEW_CHANNELS and tuning.way is Way.AMX)
    if tuning.fourier and (isinstance(plain, DirectConvolution) or not small):
        return FourierConvolution(layer, tuning.dtype)

    def computed(x: Tensor, check: Callable[[], None]) -> Tensor:
        check()
        return plain(x, positive=True)

    return computed


def _filled(layer: nn.Conv2d, multiple: int, least: int) -> nn.Conv2d:
    inputs, outputs = (max(-(-count // multiple) * multiple, least) for count in (layer.in_channels, layer.out_channels))
    kernel = layer.kernel_size
    filled = UnsetConvolution(inputs, outputs, (kernel[0], kernel[1]))
    assert filled.bias is not None and layer.bias is not None
    with torch.no_grad():
        filled.weight.zero_()[: layer.out_channels, : layer.in_channels] = layer.weight
        filled.bias.zero_()[: layer.out_channels] = layer.bias
    return filled.requires_grad_(False)
