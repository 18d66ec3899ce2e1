"""A disparity network that takes the plane sweep's means at a few levels, in place of all of them.

From level to level a mean changes slowly: the inputs move by a fifth of a pixel along each axis. A mean between two levels that
are kept is taken as their mixture, and what the first layer makes of a mixture is a mixture of its weights: so the layer that
takes the longest has 112 channels to take in place of 200. docs/speed.md says what this costs.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import torch
from torch import Tensor, nn

from lfcore.networks import PaperStack
from lfcore.planesweep import Levels


def kept_levels(levels: Levels, means: int) -> list[int]:
    """So many of the levels, evenly spread, the first and the last among them; at most all of them."""
    if means >= levels.count:
        return list(range(levels.count))
    return [int(level) for level in torch.linspace(0, levels.count - 1, means).round()]


def interpolation(levels: Levels, kept: Sequence[int]) -> Tensor:
    """How much each of K kept levels counts for the mean of every level: (L, K) float32, linear between neighbours."""
    weights = torch.zeros(levels.count, len(kept))
    for place, (low, high) in enumerate(pairwise(kept)):
        share = torch.arange(high - low + 1) / (high - low)
        weights[low : high + 1, place] = 1 - share
        weights[low : high + 1, place + 1] = share
    return weights


def with_fewer_means(stack: PaperStack, levels: Levels, kept: Sequence[int]) -> PaperStack:
    """The disparity network for the features of `planesweep.sparse_sweep`, from that for those of `plane_sweep`."""
    first = stack.hidden[0]
    assert isinstance(first, nn.Conv2d)
    fewer = PaperStack(len(kept) + levels.count, stack.last.out_channels)
    means, deviations = first.weight.detach().split(levels.count, 1)  # (O, L, 7, 7) each
    mixed = torch.einsum("olyx,lk->okyx", means, interpolation(levels, kept))
    state = {name: value for name, value in stack.state_dict().items() if name != "hidden.0.weight"}
    fewer.load_state_dict({**state, "hidden.0.weight": torch.cat((mixed, deviations), 1)})
    return fewer
