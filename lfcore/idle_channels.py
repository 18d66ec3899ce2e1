"""Hidden channels whose weights onward are all 0 count for nothing, and are left out of what is computed. No result changes.

Training sets the weights of such channels to 0 (lfcore.training.clearing): the weights keep the paper's shape, and synthesis
its speed.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import torch
from torch import Tensor, nn

from lfcore.layers import UnsetConvolution
from lfcore.networks import PaperStack


@dataclass(frozen=True)
class UsedLayers:
    """The layers of a PaperStack without their idle channels."""

    hidden: list[nn.Conv2d]
    last: nn.Conv2d


def used_channels(stack: PaperStack) -> list[Tensor]:
    """What the first layer takes, what of each layer the next one uses, and what the last one gives: indices, ascending.

    Of a layer that is not used at all one channel is left.
    """
    layers, channels = stack.layers, [torch.arange(stack.last.out_channels)]
    for layer in reversed(layers[1:]):
        used = layer.weight[channels[0]].detach().abs().amax((0, 2, 3)).nonzero().flatten()
        channels.insert(0, used if len(used) else torch.zeros(1, dtype=torch.long))
    return [torch.arange(layers[0].in_channels), *channels]


def used_layers(stack: PaperStack) -> UsedLayers:
    """Copies of the layers with their used channels alone."""
    layers = zip(stack.layers, pairwise(used_channels(stack)), strict=True)
    *hidden, last = [_part(layer, given, taken) for layer, (taken, given) in layers]
    return UsedLayers(hidden, last)


def _part(layer: nn.Conv2d, outputs: Tensor, inputs: Tensor) -> nn.Conv2d:
    """A layer's channels alone, in and out."""
    kernel = layer.kernel_size
    part = UnsetConvolution(len(inputs), len(outputs), (kernel[0], kernel[1]))
    assert part.bias is not None and layer.bias is not None
    with torch.no_grad():
        part.weight.copy_(layer.weight[outputs][:, inputs])
        part.bias.copy_(layer.bias[outputs])
    return part.requires_grad_(False)
