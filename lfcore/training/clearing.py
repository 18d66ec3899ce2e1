"""Channels of a PaperStack that count next to nothing get weights of 0, so that synthesis leaves them out.

Many of the paper's channels are not needed for what its networks learn here: of the colour network's 100, 100 and 50 the
pictures of `full` are made of a third (docs/training.md). See lfcore.idle_channels for what becomes of them.
"""

from __future__ import annotations

from collections.abc import Callable

import torch
import torch.nn.functional as F
from torch import Tensor

from lfcore.models import Model
from lfcore.networks import PaperStack
from lfcore.training.revival import stacks_and_inputs

SHARE = 1e-7  # of what a layer's channels bring to the next one's sums, as variance, all that are cleared have together


@torch.no_grad()
def clear(model: Model, show: Callable[[], None]) -> int:
    """Set the weights of idle channels to 0, in and out; returns how many there are.

    show: runs the model over patches. What a channel is there in the mean goes into the biases of the next layer.
    """
    return sum(_clear_stack(stack, inputs) for stack, inputs in stacks_and_inputs(model, show))


def _clear_stack(stack: PaperStack, inputs: list[Tensor]) -> int:
    layers = stack.convolutions
    moments = []
    for layer in layers:
        inputs = [F.relu(layer(x)) for x in inputs]
        moments.append(_moments(inputs))
    cleared = 0
    # From the last layer on: what only idle channels would take is idle, too.
    for layer, following, (mean, variance) in reversed(list(zip(layers, [*layers[1:], stack.last], moments, strict=True))):
        assert layer.bias is not None and following.bias is not None
        idle = _idle(variance * following.weight.double().square().sum((0, 2, 3)))
        following.bias += (following.weight.double().sum((2, 3)) @ (mean * idle)).float()
        following.weight[:, idle] = 0
        layer.weight[idle] = 0
        layer.bias[idle] = 0
        cleared += int(idle.sum())
    return cleared


def _moments(values: list[Tensor]) -> tuple[Tensor, Tensor]:
    """Mean and variance of each channel: (C,) float64 each."""
    count = sum(part[:, 0].numel() for part in values)
    mean = torch.stack([part.double().sum((0, 2, 3)) for part in values]).sum(0) / count
    squares = torch.stack([part.double().square().sum((0, 2, 3)) for part in values]).sum(0) / count
    return mean, (squares - mean.square()).clamp(min=0)


def _idle(brought: Tensor) -> Tensor:
    """Which of these count least, and together less than SHARE of all: (C,) bool."""
    order = brought.argsort()
    idle = torch.zeros(len(brought), dtype=torch.bool)
    idle[order] = brought[order].cumsum(0) <= SHARE * brought.sum()
    return idle
