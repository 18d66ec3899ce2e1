"""Training without the idle channels of given weights, which synthesis leaves out too (lfcore.idle_channels).

Where dead channels are not taken up again (lfcore.training.revival), a channel with weights and bias of 0 on both sides stays
as it is through all of training, for nothing reaches it. So it need not be computed, and is put back, as zeros, when saved.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import torch
from torch import Tensor, nn

from lfcore.idle_channels import used_channels
from lfcore.models import Model
from lfcore.networks import PaperStack
from lfcore.training.revival import paper_stacks, trained_weight


@dataclass(frozen=True)
class Trimmed:
    """What is left of each PaperStack of a model: see `used_channels`. The sizes of its layers are those of `PaperStack`."""

    channels: tuple[tuple[Tensor, ...], ...]  # by stack

    @torch.no_grad()
    def whole(self, model: Model) -> Model:
        """A trimmed model, in place, with what has been left out as zeros."""
        for stack, channels in zip(paper_stacks(model), self.channels, strict=True):
            full = PaperStack(len(channels[0]), len(channels[-1]))
            for layer, of_full, (taken, given) in zip(stack.layers, full.layers, pairwise(channels), strict=True):
                weight, bias = trained_weight(layer), layer.bias
                assert isinstance(bias, nn.Parameter)
                whole_weight, whole_bias = weight.new_zeros(of_full.weight.shape), bias.new_zeros(of_full.out_channels)
                whole_weight[given[:, None], taken], whole_bias[given] = weight, bias
                weight.data, bias.data = whole_weight, whole_bias
        return model


@torch.no_grad()
def trim(model: Model) -> Trimmed:
    """Leave the idle channels out of every PaperStack of a model, in place; one without any stays as it is."""
    trimmed = Trimmed(tuple(tuple(used_channels(stack)) for stack in paper_stacks(model)))
    for stack, channels in zip(paper_stacks(model), trimmed.channels, strict=True):
        for layer, (taken, given) in zip(stack.layers, pairwise(channels), strict=True):
            assert layer.bias is not None
            layer.weight = nn.Parameter(layer.weight[given][:, taken])
            layer.bias = nn.Parameter(layer.bias[given])
    return trimmed
