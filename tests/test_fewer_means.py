from itertools import pairwise

import pytest
import torch
from test_planesweep import random_luma

from lfcore.fewer_means import interpolation, kept_levels, with_fewer_means
from lfcore.networks import PaperStack
from lfcore.planesweep import Levels, Window, plane_sweep, sparse_sweep
from lfcore.synthesizer import corner_offsets

pytestmark = pytest.mark.usefixtures("several_threads")


@pytest.mark.usefixtures("either_route")
@pytest.mark.parametrize("dtype", [torch.float32, torch.bfloat16])
@pytest.mark.parametrize("kept", [(0,), (5,), (1, 2, 19), (0, 4, 16, 17, 18), tuple(range(20))])
def test_a_sweep_with_some_means_is_a_part_of_the_whole(kept: tuple[int, ...], dtype: torch.dtype) -> None:
    luma, levels, window = random_luma(6, (23, 37), batch=2), Levels(20, -21, 21), Window(1, 22, 3, 36)
    offsets, channels = corner_offsets(0.2, 0.9), len(kept) + 20
    chosen = [*kept, *range(20, 40)]
    expected = plane_sweep(luma, offsets, levels, window)[:, chosen].to(dtype)
    around = torch.full((2, channels + 1, 21, 33), 7.0, dtype=dtype).to(memory_format=torch.channels_last)
    found = sparse_sweep(luma, offsets, levels, kept, window, around[:, :channels])
    torch.testing.assert_close(found, expected, atol=4e-3 if dtype is torch.bfloat16 else 1e-6, rtol=0)
    assert torch.equal(around[:, channels], torch.full((2, 21, 33), 7.0, dtype=dtype))


@pytest.mark.parametrize(("count", "means"), [(100, 12), (100, 2), (100, 100), (7, 12), (13, 4)])
def test_kept_levels_are_spread_evenly_from_the_first_to_the_last(count: int, means: int) -> None:
    kept = kept_levels(Levels(count), means)
    assert len(kept) == min(count, means) and kept[0] == 0 and kept[-1] == count - 1
    steps = [high - low for low, high in pairwise(kept)]
    assert max(steps) - min(steps) <= 1 and min(steps) >= 1


def test_interpolation_gives_back_what_is_linear_between_kept_levels() -> None:
    kept = kept_levels(Levels(13), 4)
    weights = interpolation(Levels(13), kept)
    straight = 3 * torch.arange(13.0) - 5
    torch.testing.assert_close(weights @ straight[kept], straight)
    assert torch.equal(weights[kept], torch.eye(4))


def test_a_network_for_fewer_means_is_the_network_where_means_are_mixtures_of_those() -> None:
    torch.manual_seed(2)
    levels = Levels(9)
    stack = PaperStack(18, 1)
    kept = kept_levels(levels, 3)
    means, deviations = torch.rand(1, 3, 20, 21), torch.rand(1, 9, 20, 21)
    whole = torch.cat((torch.einsum("lk,bkhw->blhw", interpolation(levels, kept), means), deviations), 1)
    fewer = with_fewer_means(stack, levels, kept)
    with torch.no_grad():
        torch.testing.assert_close(fewer(torch.cat((means, deviations), 1)), stack(whole), atol=1e-6, rtol=1e-5)


def test_nothing_changes_where_all_levels_are_kept() -> None:
    stack, levels = PaperStack(14, 1), Levels(7)
    fewer = with_fewer_means(stack, levels, range(7))
    for name, value in stack.state_dict().items():
        torch.testing.assert_close(fewer.state_dict()[name], value)
