"""Channels that others can stand in for are left out, and those alone."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch
from torch import Tensor, nn

from lfcore.compact import CompactModel
from lfcore.idle_channels import used_layers
from lfcore.networks import PaperStack, SingleModel, initialise
from lfcore.training.narrowing import MULTIPLE, SHARE, main, narrow, stand_ins
from lfcore.weights import save_weights


def moments_of(values: Tensor) -> Tensor:
    """(samples, C) -> (C + 1, C + 1)."""
    seen = torch.cat((values, torch.ones(len(values), 1, dtype=torch.float64)), 1)
    return seen.T @ seen / len(seen)


def drawn(*shape: int, seed: int = 0) -> Tensor:
    return torch.randn(*shape, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)


@pytest.mark.parametrize("size", [1, 3])
def test_the_fit_is_that_of_least_squares_for_the_channels_that_are_kept(size: int) -> None:
    count = 2 * MULTIPLE + 5
    # As many independent ones as are to be left; the others are mixtures of them, and a little of their own.
    own = drawn(4000, MULTIPLE * size)
    values = own @ drawn(MULTIPLE * size, count * size, seed=1) + 1e-3 * drawn(4000, count * size, seed=2) + 0.7
    weights = drawn(count * size, 6, seed=3)
    kept, fitted = stand_ins(moments_of(values), weights, size)
    assert len(kept) == MULTIPLE
    places = [channel * size + k for channel in kept for k in range(size)]
    given = torch.cat((values[:, places], torch.ones(len(values), 1, dtype=torch.float64)), 1)
    wanted = values @ weights
    expected = torch.linalg.lstsq(given, wanted).solution
    lost = (given @ fitted - wanted).square().mean(), (given @ expected - wanted).square().mean()
    assert lost[0] < 1.05 * lost[1] + 1e-12 and lost[0] < SHARE * wanted.var(0).sum()


def test_nothing_is_left_out_where_each_says_something_else() -> None:
    count = 3 * MULTIPLE
    weights = drawn(count, 40, seed=3)
    kept, fitted = stand_ins(moments_of(drawn(9000, count)), weights, 1)
    assert kept == list(range(count))
    assert torch.equal(fitted[:-1], weights)


def test_the_one_that_costs_least_goes_first() -> None:
    """Independent channels cost what they bring: the order is known."""
    count = MULTIPLE + 4
    weights = torch.ones(count, 1, dtype=torch.float64)
    small = [3, 7, 11, 19]
    weights[small] = 1e-4
    kept, _ = stand_ins(moments_of(drawn(5000, count)), weights, 1)
    assert kept == [channel for channel in range(count) if channel not in small]


@torch.no_grad()
def test_a_stack_whose_channels_are_copies_loses_these_and_stays_the_same() -> None:
    model = SingleModel()
    initialise(model, 5)
    stack: PaperStack = model.colour
    generator = torch.Generator().manual_seed(9)
    for layer in (*stack.convolutions, stack.last):
        assert layer.bias is not None
        nn.init.normal_(layer.weight, std=0.06, generator=generator)
        nn.init.uniform_(layer.bias, -0.1, 0.3, generator=generator)
    for layer, different in zip(stack.convolutions[:2], (32, 16), strict=True):
        assert layer.bias is not None
        layer.weight.copy_(layer.weight[torch.arange(layer.out_channels) % different])
        layer.bias.copy_(layer.bias[torch.arange(layer.out_channels) % different])
    x = torch.rand(4, 14, 40, 44, generator=generator)
    before = stack(x)
    assert narrow(model, lambda: stack(x)) == 100 - 32 + 100 - 16
    assert [layer.out_channels for layer in used_layers(stack).hidden] == [32, 16, 50]
    assert (stack(x) - before).square().mean() < 0.1 * SHARE * before.var()


def test_a_model_of_other_layers_has_none() -> None:
    assert narrow(CompactModel(), lambda: pytest.fail("there is nothing to look at")) == 0


def test_another_models_file_is_refused_in_a_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    save_weights(tmp_path / "small.safetensors", CompactModel(), {})
    out = tmp_path / "out.safetensors"
    for path in ("small.safetensors", "missing.safetensors"):
        assert main([str(tmp_path / path), str(out), "--data", str(tmp_path)]) == 2
        assert capsys.readouterr().err.count("\n") == 1
    assert not out.exists()


def test_the_target_is_checked_before_the_work(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "none" / "w.safetensors"
    assert main([str(tmp_path / "weights"), str(out), "--data", str(tmp_path)]) == 2
    assert f"{out.parent}: it does not exist; make the folder first" in capsys.readouterr().err
