"""Hidden channels whose weights onward are all 0 count for nothing, and are left out of what is computed. No result changes.

Training sets the weights of such channels to 0 (lfcore.training.clearing): the weights keep the paper's shape, and synthesis
its speed.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor, nn

from lfcore.layers import UnsetConvolution
from lfcore.networks import PaperStack


@dataclass(frozen=True)
class UsedLayers:
    """The layers of a PaperStack without their idle channels."""

    hidden: list[nn.Conv2d]
    last: nn.Conv2d


def used_layers(stack: PaperStack) -> UsedLayers:
    """Copies of the layers, each hidden channel of which the next one uses; of a layer that is not used at all one is left."""
    following, kept_layers = stack.last, []
    outputs = torch.arange(following.out_channels)
    for layer in reversed(stack.convolutions):
        used = following.weight[outputs].detach().abs().amax((0, 2, 3)).nonzero().flatten()
        used = used if len(used) else torch.zeros(1, dtype=torch.long)
        kept_layers.append(_part(following, outputs, used))
        following, outputs = layer, used
    kept_layers.append(_part(following, outputs, torch.arange(following.in_channels)))
    last, *hidden = kept_layers
    return UsedLayers(hidden[::-1], last)


def _part(layer: nn.Conv2d, outputs: Tensor, inputs: Tensor) -> nn.Conv2d:
    """A layer's channels alone, in and out."""
    kernel = layer.kernel_size
    part = UnsetConvolution(len(inputs), len(outputs), (kernel[0], kernel[1]))
    assert part.bias is not None and layer.bias is not None
    with torch.no_grad():
        part.weight.copy_(layer.weight[outputs][:, inputs])
        part.bias.copy_(layer.bias[outputs])
    return part.requires_grad_(False)
