"""A better conditioned start for the disparity network, at no change to the network.

Its 200 features differ in size by far: the brightness that all 100 means share is ten times larger than what tells the
levels apart, the differences between deviations. The first layer is therefore trained as W = V T with a fixed invertible
matrix T over the channels that enlarges those differences, which is the same as training on the features T f. What is
saved is W, an ordinary convolution on the ordinary features.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn.utils import parametrize

from lfcore.networks import FullModel, initialise
from lfcore.planesweep import Levels

# Of means and of deviations: how much their differences between levels grow, and what becomes of what all levels share.
# Measured over training patches, these bring all four to a size of about 0.3 to 1.
_MEAN_DIFFERENCES, _MEAN_SHARED = 5.0, 1.0
_DEVIATION_DIFFERENCES, _DEVIATION_SHARED = 20.0, 5.0


class _ChannelMixing(nn.Module):
    """W = V T: (out, channels, kh, kw) -> the same shape."""

    mixing: Tensor
    unmixing: Tensor

    def __init__(self, mixing: Tensor) -> None:
        super().__init__()
        self.register_buffer("mixing", mixing, persistent=False)
        self.register_buffer("unmixing", torch.linalg.inv(mixing.double()).float(), persistent=False)

    def forward(self, weight: Tensor) -> Tensor:
        return torch.einsum("ocyx,cd->odyx", weight, self.mixing)

    def right_inverse(self, weight: Tensor) -> Tensor:
        """The V of a given W: how weights that are there already are gone on from."""
        return torch.einsum("ocyx,cd->odyx", weight, self.unmixing)


def mixing_matrix(levels: Levels) -> Tensor:
    """T, (2 L, 2 L), for the features [means, deviations]."""
    count = levels.count
    shared = torch.full((count, count), 1 / count)
    differences = torch.eye(count) - shared
    mixing = torch.zeros(2 * count, 2 * count)
    mixing[:count, :count] = _MEAN_DIFFERENCES * differences + _MEAN_SHARED * shared
    mixing[count:, count:] = _DEVIATION_DIFFERENCES * differences + _DEVIATION_SHARED * shared
    return mixing


def condition(model: FullModel) -> None:
    """Train the first layer of the disparity network in the better conditioned coordinates from now on."""
    mixing = _ChannelMixing(mixing_matrix(model.config.levels))
    parametrize.register_parametrization(_first_layer(model), "weight", mixing)


def initialise_conditioned(model: FullModel, seed: int) -> None:
    """Xavier initialisation of V, not of W: of the weights on the enlarged features."""
    initialise(model, seed)
    layer = _first_layer(model)
    with torch.no_grad():
        layer.weight.copy_(torch.einsum("ocyx,cd->odyx", layer.weight, mixing_matrix(model.config.levels)))


def plain_copy(model: FullModel) -> FullModel:
    """The model with ordinary weights, float32 on the CPU."""
    plain = FullModel(model.config)
    state = {name: value for name, value in model.state_dict().items() if "parametrizations" not in name}
    state["disparity.hidden.0.weight"] = _first_layer(model).weight.detach()
    plain.load_state_dict({name: value.float().cpu() for name, value in state.items()})
    return plain


def _first_layer(model: FullModel) -> nn.Conv2d:
    layer = model.disparity.hidden[0]
    assert isinstance(layer, nn.Conv2d)
    return layer
