"""What is idle in given weights is left out while they are trained on, and put back as zeros when they are saved."""

import copy
from pathlib import Path

import pytest
import torch
from scenes import plane
from torch import Tensor

from lfcore.compact import CompactModel
from lfcore.networks import FullModel, PaperStack, initialise
from lfcore.training import loop
from lfcore.training.conditioning import condition, plain_copy
from lfcore.training.loop import Progress, Runtime, TrainConfig, train
from lfcore.training.loss import LossConfig
from lfcore.training.patches import PatchConfig
from lfcore.training.trimming import trim
from lfcore.weights import Weights, load_weights, save_weights

IDLE = ([2, 77], [0, 50, 99], [*range(20, 40)])  # channels by hidden layer


def with_idle_channels() -> FullModel:
    model = FullModel()
    initialise(model, 5)
    with torch.no_grad():
        for stack in (model.disparity, model.colour):
            onward = (*stack.convolutions[1:], stack.last)
            for layer, following, channels in zip(stack.convolutions, onward, IDLE, strict=True):
                assert layer.bias is not None
                layer.weight[channels], layer.bias[channels], following.weight[:, channels] = 0, 0, 0
    return model


def idle_parts(stack: PaperStack) -> list[Tensor]:
    """All weights and biases of the idle channels, in and out."""
    onward = (*stack.convolutions[1:], stack.last)
    parts = []
    for layer, following, channels in zip(stack.convolutions, onward, IDLE, strict=True):
        assert layer.bias is not None
        parts += [layer.weight[channels], layer.bias[channels], following.weight[:, channels]]
    return parts


def test_nothing_reaches_an_idle_channel_so_that_it_may_be_left_out() -> None:
    model = with_idle_channels()
    model.colour(torch.rand(1, 15, 20, 20)).square().sum().backward()
    for layer, channels in zip(model.colour.convolutions, IDLE, strict=True):
        assert layer.weight.grad is not None and layer.bias is not None and layer.bias.grad is not None
        assert (layer.weight.grad[channels] == 0).all() and (layer.bias.grad[channels] == 0).all()
    for following, channels in zip((*model.colour.convolutions[1:], model.colour.last), IDLE, strict=True):
        assert following.weight.grad is not None
        assert (following.weight.grad[:, channels] == 0).all() and (following.weight.grad != 0).any()


def test_a_trimmed_model_computes_the_same_with_less() -> None:
    model = with_idle_channels()
    small = copy.deepcopy(model)
    trim(small)
    assert [layer.weight.shape[:2] for layer in small.colour.convolutions] == [(98, 15), (97, 98), (30, 97)]
    x = torch.rand(2, 15, 22, 25)
    with torch.no_grad():
        torch.testing.assert_close(small.colour(x), model.colour(x), atol=1e-6, rtol=1e-5)


@pytest.mark.parametrize("conditioned", [False, True])
def test_what_was_left_out_comes_back_as_zeros(conditioned: bool) -> None:
    model = with_idle_channels()
    small = copy.deepcopy(model)
    trimmed = trim(small)
    if conditioned:
        condition(small)
    whole = trimmed.whole(small)
    assert isinstance(whole, FullModel)
    plain = plain_copy(whole) if conditioned else whole
    for name, value in model.state_dict().items():
        torch.testing.assert_close(plain.state_dict()[name], value, atol=1e-5, rtol=1e-4)
    assert all((part == 0).all() for stack in (plain.disparity, plain.colour) for part in idle_parts(stack))


def test_a_model_without_such_stacks_stays_as_it_is() -> None:
    model = CompactModel()
    before = copy.deepcopy(model.state_dict())
    trimmed = trim(model)
    assert trimmed.channels == ()
    for name, value in trimmed.whole(model).state_dict().items():
        assert torch.equal(value, before[name])


def run(given: Weights, folder: Path, name: str, stop_at: int | None = None) -> list[Progress]:
    patches = PatchConfig(size=32, batch=2, group=2, tone_share=0.0)
    config = TrainConfig(steps=4, decay_share=0, loss=LossConfig(matching_steps=0), patches=patches, revival_steps=0)
    reports: list[Progress] = []
    train(
        config,
        Runtime(device="cpu"),
        [plane(2.0, (3, 3), (120, 120))],
        [plane(1.0, (3, 3), (72, 72))],
        folder / f"{name}.safetensors",
        folder / name,
        reports.append,
        lambda: stop_at is not None and len(reports) + 1 >= stop_at,
        given,
    )
    return reports


def test_a_run_without_revival_trains_the_others_and_saves_the_papers_shape(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(loop, "_LOOKED_AT", 4)  # patches, which would take longer than the steps
    save_weights(tmp_path / "given.safetensors", with_idle_channels(), {})
    given = load_weights(tmp_path / "given.safetensors")
    run(given, tmp_path, "straight")
    run(given, tmp_path, "halved", stop_at=2)
    assert [report.step for report in run(given, tmp_path, "halved")] == [3, 4]
    straight, halved = (load_weights(tmp_path / f"{name}.safetensors").model for name in ("straight", "halved"))
    assert isinstance(straight, FullModel)
    before, after = given.model.state_dict(), straight.state_dict()
    assert all((after[name] != before[name]).any() for name in before)
    assert all((part == 0).all() for stack in (straight.disparity, straight.colour) for part in idle_parts(stack))
    for name, value in halved.state_dict().items():
        torch.testing.assert_close(value, after[name], atol=1e-6, rtol=1e-5)
