"""Neighbourhoods against torch's own, slower operations."""

import pytest
import torch
import torch.nn.functional as F

from lfcore.neighbourhoods import greatest_around, in_blocks, mean_around

SIZES = [(9, 14), (3, 2)]  # the second smaller than a neighbourhood


@pytest.fixture(params=SIZES)
def values(request: pytest.FixtureRequest) -> torch.Tensor:
    torch.manual_seed(1)
    return torch.randn(2, 5, *request.param)


@pytest.mark.parametrize("reach", [1, 2, 3])
def test_means_are_those_of_average_pooling(values: torch.Tensor, reach: int) -> None:
    padded, ones = (F.pad(part, (reach,) * 4) for part in (values, torch.ones_like(values)))
    size = 2 * reach + 1
    expected = F.avg_pool2d(padded, size, 1) / F.avg_pool2d(ones, size, 1)
    torch.testing.assert_close(mean_around(values, reach), expected)


@pytest.mark.parametrize("reach", [1, 3])
def test_the_greatest_are_those_of_maximum_pooling(values: torch.Tensor, reach: int) -> None:
    padded = F.pad(values, (reach,) * 4, value=-1e9)
    assert torch.equal(greatest_around(values, reach), F.max_pool2d(padded, 2 * reach + 1, 1))


def test_the_gradient_goes_to_the_greatest() -> None:
    torch.manual_seed(2)
    values = torch.randn(1, 1, 7, 6, requires_grad=True)
    weights = torch.randn(1, 1, 7, 6)
    (greatest_around(values, 1) * weights).sum().backward()
    found = values.grad
    values.grad = None
    (F.max_pool2d(values, 3, 1, 1) * weights).sum().backward()
    assert found is not None and values.grad is not None
    torch.testing.assert_close(found, values.grad)


def test_blocks_are_those_of_pixel_unshuffle() -> None:
    values = torch.rand(2, 3, 8, 6)
    assert torch.equal(in_blocks(values), F.pixel_unshuffle(values, 2))
    last = values.contiguous(memory_format=torch.channels_last)
    assert torch.equal(in_blocks(last), F.pixel_unshuffle(values, 2))
