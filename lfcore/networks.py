"""The two networks of Kalantari, Wang and Ramamoorthi (SIGGRAPH Asia 2016), Section 3: disparity, then colour. No I/O here."""

from __future__ import annotations

from dataclasses import dataclass, field

import torch
from torch import Tensor, nn

from lfcore.planesweep import Levels, luminance
from lfcore.tone import root_tone

INPUTS = 4


@dataclass(frozen=True)
class ModelConfig:
    """What a weight file must match. `full` is the paper's pair of networks to the letter."""

    name: str = "full"
    levels: Levels = field(default_factory=Levels)
    tone: str = "root"  # in which the luminance is swept: "root" (lfcore.tone), or "stored" as in the authors' code


class PaperStack(nn.Module):
    """The stack that both networks share: 7x7, 5x5, 3x3, 1x1, ReLU after all but the last, no padding (paper, Fig. 4).

    (N, C, H, W) -> (N, out, H - 12, W - 12). The last layer is computed in float32 whatever the type of the others: in
    bfloat16 its output would be rounded to 8 bits, which for a disparity of 10 px is 1/16 px.
    """

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.hidden = nn.Sequential(
            nn.Conv2d(inputs, 100, 7),
            nn.ReLU(inplace=True),
            nn.Conv2d(100, 100, 5),
            nn.ReLU(inplace=True),
            nn.Conv2d(100, 50, 3),
            nn.ReLU(inplace=True),
        )
        self.last = nn.Conv2d(50, outputs, 1)

    @property
    def convolutions(self) -> list[nn.Conv2d]:
        """The hidden layers."""
        return [layer for layer in self.hidden if isinstance(layer, nn.Conv2d)]

    @property
    def layers(self) -> list[nn.Conv2d]:
        """All of them."""
        return [*self.convolutions, self.last]

    def forward(self, x: Tensor) -> Tensor:
        hidden = self.hidden(x)
        with torch.autocast(x.device.type, enabled=False):
            result: Tensor = self.last(hidden.float())
        return result


# What a PaperStack loses on each side: 3 + 2 + 1 pixels.
BORDER = 6


class FullModel(nn.Module):
    """The paper's two networks. The disparity network puts out px over the full baseline (the authors' release: 1/7 px)."""

    def __init__(self, config: ModelConfig | None = None) -> None:
        super().__init__()
        self.config = config or ModelConfig()
        self.disparity = PaperStack(2 * self.config.levels.count, 1)
        self.colour = PaperStack(3 * INPUTS + 3, 3)


def sweep_luminance(images: Tensor, config: ModelConfig) -> Tensor:
    """(..., 3, H, W) stored values -> (..., H, W), what the plane sweep of this model runs over."""
    luma = luminance(images)
    return root_tone(luma) if config.tone == "root" else luma


@dataclass(frozen=True)
class SingleConfig:
    """The ablation of the paper's Section 5: no disparity, one network."""

    name: str = "single"


class SingleModel(nn.Module):
    """One stack from the four inputs, unwarped, and the position straight to the picture (paper, Fig. 10: blurred, ghosts)."""

    def __init__(self, config: SingleConfig | None = None) -> None:
        super().__init__()
        self.config = config or SingleConfig()
        self.colour = PaperStack(3 * INPUTS + 2, 3)


def single_features(inputs: Tensor, positions: Tensor) -> Tensor:
    """inputs: (B, 12, h, w); positions: (B, 2), (u, v). Returns (B, 14, h, w): the inputs, v - 0.5, u - 0.5."""
    b, _, h, w = inputs.shape
    uv = (positions - 0.5).flip(1).view(b, 2, 1, 1).expand(b, 2, h, w)
    return torch.cat((inputs, uv), 1)


def colour_features(disparity: Tensor, warped: Tensor, positions: Tensor) -> Tensor:
    """Input of the colour network: disparity, four warped inputs, v - 0.5, u - 0.5 (authors' code).

    disparity: (B, 1, h, w), px. warped: (B, 12, h, w), the inputs in the order of lightfield.CORNERS. positions: (B, 2),
    the novel views' (u, v). Returns (B, 15, h, w).
    """
    return torch.cat((disparity, single_features(warped, positions)), 1)


def initialise(model: FullModel | SingleModel, seed: int) -> None:
    """Xavier initialisation, as the paper; the stack that puts out the picture starts as the average of its four inputs.

    The averaging path is a start, not a constraint: twelve of the hidden channels carry the inputs (which are not
    negative, so that ReLU passes them), the last layer takes their mean, and all weights are trained from there.
    """
    generator = torch.Generator().manual_seed(seed)
    for module in model.modules():
        if isinstance(module, nn.Conv2d):
            nn.init.xavier_uniform_(module.weight, generator=generator)
            assert module.bias is not None
            nn.init.zeros_(module.bias)
    # In the features of the full model's colour network the disparity stands before the inputs.
    _start_as_average(model.colour, first_input=1 if isinstance(model, FullModel) else 0)


def _start_as_average(stack: PaperStack, first_input: int) -> None:
    with torch.no_grad():
        layers = stack.convolutions
        # Disparities are some ten times as large as colours: without this their random weights drown the average.
        layers[0].weight[:, :first_input] *= 0.1
        for layer in layers:
            centre = layer.kernel_size[0] // 2
            layer.weight[: 3 * INPUTS] = 0
            shift = first_input if layer is layers[0] else 0
            for channel in range(3 * INPUTS):
                layer.weight[channel, channel + shift, centre, centre] = 1
        stack.last.weight *= 0.1
        for colour in range(3):
            stack.last.weight[colour, : 3 * INPUTS] = 0
            stack.last.weight[colour, colour : 3 * INPUTS : 3] = 1 / INPUTS
