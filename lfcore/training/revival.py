"""New weights for channels that have died: those of a PaperStack that are never positive, so that their gradients stay 0.

Large steps leave them behind: `full` once used 20 and 16 of the 100 and 50 channels before the last layer of its colour
network (docs/training.md). A channel that is taken up again gets random weights, as large as its neighbours' and positive in
half of all places, and counts nothing at first, so that no result changes (Sokar et al. 2023, "The dormant neuron phenomenon").
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import cast

import torch
import torch.nn.functional as F
from torch import Tensor, nn
from torch.nn.utils import parametrize

from lfcore.models import Model
from lfcore.networks import PaperStack

Part = tuple[slice | Tensor, ...]  # of a parameter


@dataclass(frozen=True)
class Surroundings:
    """What else has to do with a model that is trained."""

    show: Callable[[], None]  # runs the model over patches: what is never positive there counts as dead
    forget: Callable[[nn.Parameter, Part], None]  # told what is set anew, so that optimiser and running average may follow
    agree: Callable[[Tensor], Tensor]  # the same tensor in all processes that train together
    generator: torch.Generator


@torch.no_grad()
def revive(model: Model, around: Surroundings) -> int:
    """Give the dead channels of every PaperStack of a model new weights; returns how many there were."""
    return sum(_revive_stack(stack, inputs, around) for stack, inputs in stacks_and_inputs(model, around.show))


def paper_stacks(model: Model) -> list[PaperStack]:
    """Those of a model, in the order of its modules."""
    return [module for module in model.modules() if isinstance(module, PaperStack)]


def stacks_and_inputs(model: Model, show: Callable[[], None]) -> list[tuple[PaperStack, list[Tensor]]]:
    """Each PaperStack of a model, and what it is given while `show` runs, float32; a model without any is not shown."""
    stacks = paper_stacks(model)
    if not stacks:
        return []
    with _inputs_of(stacks) as seen:
        show()
    return list(zip(stacks, seen, strict=True))


@contextmanager
def _inputs_of(stacks: Sequence[PaperStack]) -> Iterator[list[list[Tensor]]]:
    """What each stack is given while the block runs, float32."""
    seen: list[list[Tensor]] = [[] for _ in stacks]
    hooks = [
        stack.register_forward_pre_hook(lambda _, arguments, kept=kept: kept.append(arguments[0].float()))
        for stack, kept in zip(stacks, seen, strict=True)
    ]
    try:
        yield seen
    finally:
        for hook in hooks:
            hook.remove()


def _revive_stack(stack: PaperStack, inputs: list[Tensor], around: Surroundings) -> int:
    layers = stack.convolutions
    revived = 0
    for layer, following in zip(layers, [*layers[1:], stack.last], strict=True):
        sums = [layer(x) for x in inputs]  # before the ReLU
        greatest = torch.stack([part.amax((0, 2, 3)) for part in sums]).amax(0)
        dead = around.agree(greatest) <= 0
        if bool(dead.any()) and not bool(dead.all()):
            _renew(layer, following, dead, inputs, sums, around)
            sums = [layer(x) for x in inputs]
            revived += int(dead.sum())
        inputs = [F.relu(part) for part in sums]
    return revived


def _renew(
    layer: nn.Conv2d,
    following: nn.Conv2d,
    dead: Tensor,
    inputs: Sequence[Tensor],
    sums: Sequence[Tensor],
    around: Surroundings,
) -> None:
    """New weights for the channels of `layer` that are `dead` (out,); `following` takes them with weights of 0."""
    weight, onward, bias = trained_weight(layer), trained_weight(following), layer.bias
    assert isinstance(bias, nn.Parameter)
    size = torch.stack([F.relu(part[:, ~dead]).square().mean((0, 2, 3)) for part in sums]).mean(0).sqrt().median()
    drawn = torch.randn(weight[dead].shape, generator=around.generator).to(weight)
    weight[dead], bias[dead], onward[:, dead] = drawn, 0.0, 0.0
    fresh = torch.cat([layer(x)[:, dead].transpose(0, 1).flatten(1) for x in inputs], 1)  # (dead, places)
    mean, deviation = fresh.mean(1), fresh.std(1)
    scale = 1.4 * size / deviation.clamp(min=1e-12)  # half of it is cut away, and with it half of the squares
    weight[dead] = around.agree(drawn * scale.view(-1, 1, 1, 1))
    bias[dead] = around.agree(-mean * scale)
    parts: list[tuple[nn.Parameter, Part]] = [(weight, (dead,)), (bias, (dead,)), (onward, (slice(None), dead))]
    for parameter, part in parts:
        around.forget(parameter, part)


def trained_weight(layer: nn.Conv2d) -> nn.Parameter:
    """The parameter from which a layer's weights come."""
    if parametrize.is_parametrized(layer, "weight"):
        parametrizations = cast(nn.ModuleDict, layer.parametrizations)
        original = parametrizations["weight"].original
    else:
        original = layer.weight
    assert isinstance(original, nn.Parameter)
    return original
