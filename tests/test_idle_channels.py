"""Channels that count for nothing are found, set to 0 while training, and left out of what is computed."""

import copy
import subprocess
import sys

import pytest
import torch
from torch import Tensor, nn

from assets import weights_path
from lfcore.compact import CompactModel
from lfcore.idle_channels import UsedLayers, used_layers
from lfcore.networks import FullModel, PaperStack, SingleModel, initialise
from lfcore.training.clearing import clear
from lfcore.tuned_stack import TunedStack, Tuning
from lfcore.weights import load_weights

IDLE = ([2, 77], [0, 50, 99], [49])  # channels by hidden layer


def widths(used: UsedLayers) -> list[int]:
    return [layer.out_channels for layer in used.hidden]


@pytest.fixture
def stack() -> PaperStack:
    torch.manual_seed(3)
    return PaperStack(9, 2).requires_grad_(False)


@pytest.fixture
def patches() -> Tensor:
    return torch.rand(2, 9, 30, 33, generator=torch.Generator().manual_seed(4))


def without_onward(stack: PaperStack) -> None:
    for following, channels in zip((*stack.convolutions[1:], stack.last), IDLE, strict=True):
        following.weight[:, channels] = 0


def test_a_stack_without_its_idle_channels_is_the_same(stack: PaperStack, patches: Tensor) -> None:
    assert widths(used_layers(stack)) == [100, 100, 50]
    without_onward(stack)
    assert widths(used_layers(stack)) == [98, 97, 49]
    x = patches[:1]
    tuned = TunedStack(stack, Tuning())
    given = tuned.empty_input(*x.shape[2:])
    given[:, :9] = x
    torch.testing.assert_close(tuned(given), stack(x), atol=1e-6, rtol=1e-5)


def test_what_only_idle_channels_take_is_idle_too(stack: PaperStack) -> None:
    first, second, third = stack.convolutions
    stack.last.weight[:, 7] = 0
    third.weight[torch.arange(50) != 7, 5] = 0  # the fifth channel of the second layer is for the seventh of the third alone
    second.weight[torch.arange(100) != 5, 3] = 0
    assert widths(used_layers(stack)) == [99, 99, 49]
    assert first.out_channels == 100  # the stack itself keeps its shape


def test_a_stack_that_uses_nothing_is_its_bias(stack: PaperStack, patches: Tensor) -> None:
    stack.last.weight.zero_()
    assert widths(used_layers(stack)) == [100, 100, 1]
    tuned = TunedStack(stack, Tuning())
    given = tuned.empty_input(30, 33)
    given[:, :9] = patches[:1]
    assert torch.allclose(tuned(given), stack.last.bias.view(1, 2, 1, 1).expand(1, 2, 18, 21))  # type: ignore[union-attr]


@torch.no_grad()
def test_channels_that_are_dead_or_always_the_same_are_cleared_and_no_result_changes(patches: Tensor) -> None:
    """Those that count stay as they are; a picture changes by less than its rounding to 8 bits would."""
    model = SingleModel()
    initialise(model, 5)
    x = torch.cat((patches, patches), 1)[:, :14]
    inputs = x
    for layer in model.colour.convolutions:
        assert layer.bias is not None
        nn.init.normal_(layer.weight, std=0.05, generator=torch.Generator().manual_seed(9))
        layer.bias -= layer(inputs).mean((0, 2, 3))
        layer.bias[10] = -1000.0  # dead
        layer.weight[20], layer.bias[20] = 0, 0.5  # the same everywhere
        inputs = layer(inputs).relu()
    before, former = model.colour(x), copy.deepcopy(model.colour)
    assert clear(model, lambda: model.colour(x)) == 6
    assert widths(used_layers(model.colour)) == [98, 98, 48]
    torch.testing.assert_close(model.colour(x), before, atol=2e-3 * float(before.std()), rtol=0)
    for layer, was, inputs_idle in zip(model.colour.convolutions, former.convolutions, (0, 2, 2), strict=True):
        outputs = [channel for channel in range(was.out_channels) if channel not in (10, 20)]
        taken = [c for c in range(was.in_channels) if not inputs_idle or c not in (10, 20)]
        assert torch.equal(layer.weight[outputs][:, taken], was.weight[outputs][:, taken])


def test_a_model_of_other_layers_has_none() -> None:
    assert clear(CompactModel(), lambda: pytest.fail("there is nothing to look at")) == 0


def test_the_shipped_networks_have_as_many_idle_channels_as_their_file_says() -> None:
    weights = load_weights(weights_path("full"))
    assert isinstance(weights.model, FullModel)
    used = [widths(used_layers(stack)) for stack in (weights.model.disparity, weights.model.colour)]
    assert 500 - sum(map(sum, used)) == weights.training["idle_channels"] > 100


def test_no_model_loads_a_library_that_it_does_not_need() -> None:
    """Half a second of each start was one for symbolic mathematics, which torch loads for some ways of making a layer."""
    code = """
import sys
import numpy as np
from lfcore.lightfield import LightField
from lfcore.synthesizer import make_synthesizer
for model in ("realtime", "full", "single"):
    synthesizer = make_synthesizer(model)
    synthesizer.set_light_field(LightField(np.zeros((2, 2, 40, 48, 3), np.uint8), "made up", "", ""))
    synthesizer.synthesize(0.5, 0.5)
assert "torch" in sys.modules
sys.exit("sympy" in sys.modules)
"""
    assert subprocess.run([sys.executable, "-c", code], check=False, timeout=120).returncode == 0
