"""Dead channels of a stack come back to life, and nothing else changes."""

import copy

import pytest
import torch
from torch import Tensor, nn

from lfcore.compact import CompactModel
from lfcore.networks import FullModel, PaperStack, SingleModel, initialise
from lfcore.training.conditioning import condition, plain_copy
from lfcore.training.revival import Part, Surroundings, revive

DEAD = {0: [3, 40, 99], 1: [0, 7], 2: [11, 12, 49]}  # channels by hidden layer


def alone(show: object, told: list[tuple[nn.Parameter, Part]] | None = None) -> Surroundings:
    kept: list[tuple[nn.Parameter, Part]] = [] if told is None else told
    assert callable(show)
    return Surroundings(show, lambda *what: kept.append(what), lambda tensor: tensor, torch.Generator().manual_seed(4))


def values(stack: PaperStack, x: Tensor) -> list[Tensor]:
    """What each hidden layer puts out, rectified: (100 or 50, places) each."""
    found = []
    for layer in stack.convolutions:
        x = layer(x).relu()
        found.append(x.transpose(0, 1).flatten(1))
    return found


@pytest.fixture
def model(patches: Tensor) -> SingleModel:
    """With some channels that are never positive, each with weights onward that would show it if it were."""
    made = SingleModel()
    initialise(made, 5)
    with torch.no_grad():
        x = patches
        for layer, channels in zip(made.colour.convolutions, DEAD.values(), strict=True):
            assert layer.bias is not None
            nn.init.normal_(layer.weight, std=0.05, generator=torch.Generator().manual_seed(9))
            layer.bias -= layer(x).mean((0, 2, 3))  # all others are positive in half of all places
            layer.bias[channels] = -1000.0
            x = layer(x).relu()
    return made


@pytest.fixture
def patches() -> Tensor:
    return torch.rand(3, 14, 40, 44, generator=torch.Generator().manual_seed(6))


@torch.no_grad()
def test_dead_channels_are_positive_in_half_of_all_places_and_no_result_changes(model: SingleModel, patches: Tensor) -> None:
    before, former = model.colour(patches), copy.deepcopy(model)
    assert revive(model, alone(lambda: model.colour(patches))) == sum(map(len, DEAD.values()))
    torch.testing.assert_close(model.colour(patches), before, atol=1e-6, rtol=1e-5)
    for layer, (index, channels) in zip(values(model.colour, patches), DEAD.items(), strict=True):
        alive = (layer > 0).float().mean(1)
        assert ((alive[channels] > 0.3) & (alive[channels] < 0.7)).all(), index
        others = [channel for channel in range(len(layer)) if channel not in channels]
        sizes = layer.square().mean(1).sqrt()
        assert float(sizes[channels].min()) > 0.3 * float(sizes[others].median())
        assert float(sizes[channels].max()) < 3 * float(sizes[others].median())
        # What lived has the weights that it had, but for those with which it takes what was dead.
        kept, was = model.colour.convolutions[index], former.colour.convolutions[index]
        taken = [channel for channel in range(kept.in_channels) if index == 0 or channel not in DEAD[index - 1]]
        assert torch.equal(kept.weight[others][:, taken], was.weight[others][:, taken])


@torch.no_grad()
def test_nothing_changes_where_nothing_is_dead(model: SingleModel, patches: Tensor) -> None:
    revive(model, alone(lambda: model.colour(patches)))
    former, told = copy.deepcopy(model.state_dict()), []  # type: ignore[var-annotated]
    assert revive(model, alone(lambda: model.colour(patches), told)) == 0
    assert not told
    assert all(torch.equal(value, former[name]) for name, value in model.state_dict().items())
    compact = CompactModel()
    assert revive(compact, alone(lambda: pytest.fail("there is nothing to look at"))) == 0


@torch.no_grad()
def test_all_that_is_set_anew_is_told(model: SingleModel, patches: Tensor) -> None:
    """Put back where it is told, everything is as it was."""
    former, told = copy.deepcopy(model), []  # type: ignore[var-annotated]
    revive(model, alone(lambda: model.colour(patches), told))
    old = dict(zip(model.parameters(), former.parameters(), strict=True))
    for parameter, part in told:
        assert not torch.equal(parameter[part], old[parameter][part])
        parameter[part] = old[parameter][part]
    for name, value in former.state_dict().items():
        assert torch.equal(model.state_dict()[name], value), name


def test_a_channel_that_was_dead_learns_again(model: SingleModel, patches: Tensor) -> None:
    last = model.colour.last
    for revived in (False, True):
        if revived:
            revive(model, alone(lambda: model.colour(patches)))
        model.zero_grad()
        (model.colour(patches) - 0.3).square().mean().backward()
        assert last.weight.grad is not None
        assert bool((last.weight.grad[:, DEAD[2]] != 0).all()) is revived


@torch.no_grad()
def test_in_the_coordinates_in_which_the_first_layer_is_trained_too() -> None:
    full = FullModel()
    initialise(full, 7)
    first = full.disparity.convolutions[0]
    first.bias[[5, 50]] = -1000.0  # type: ignore[index]
    condition(full)
    features = torch.rand(2, 200, 24, 25, generator=torch.Generator().manual_seed(8))
    before = full.disparity(features)
    assert revive(full, alone(lambda: (full.disparity(features), full.colour(torch.rand(2, 15, 20, 20))))) >= 2
    torch.testing.assert_close(full.disparity(features), before, atol=1e-5, rtol=1e-5)
    alive = (values(plain_copy(full).disparity, features)[0] > 0).float().mean(1)
    assert ((alive[[5, 50]] > 0.3) & (alive[[5, 50]] < 0.7)).all()
