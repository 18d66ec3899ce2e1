"""The two networks of Kalantari, Wang and Ramamoorthi (SIGGRAPH Asia 2016), Section 3: disparity, then colour. No I/O here."""

from __future__ import annotations

from dataclasses import dataclass, field

import torch
from torch import Tensor, nn

from lfcore.planesweep import Levels

INPUTS = 4


@dataclass(frozen=True)
class ModelConfig:
    """What a weight file must match. `full` is the paper's pair of networks to the letter."""

    name: str = "full"
    levels: Levels = field(default_factory=Levels)


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


def colour_features(disparity: Tensor, warped: Tensor, positions: Tensor) -> Tensor:
    """Input of the colour network: disparity, four warped inputs, v - 0.5, u - 0.5 (authors' code).

    disparity: (B, 1, h, w), px. warped: (B, 12, h, w), the inputs in the order of lightfield.CORNERS. positions: (B, 2),
    the novel views' (u, v). Returns (B, 15, h, w).
    """
    b, _, h, w = disparity.shape
    uv = (positions - 0.5).flip(1).view(b, 2, 1, 1).expand(b, 2, h, w)
    return torch.cat((disparity, warped, uv), 1)


def initialise(model: FullModel, seed: int) -> None:
    """Xavier initialisation, as the paper; the colour network starts as the average of its four warped inputs.

    The averaging path is a start, not a constraint: twelve of the hidden channels carry the warped inputs (which are not
    negative, so that ReLU passes them), the last layer takes their mean, and all weights are trained from there.
    """
    generator = torch.Generator().manual_seed(seed)
    for module in model.modules():
        if isinstance(module, nn.Conv2d):
            nn.init.xavier_uniform_(module.weight, generator=generator)
            assert module.bias is not None
            nn.init.zeros_(module.bias)
    stack = model.colour
    with torch.no_grad():
        layers = [layer for layer in stack.hidden if isinstance(layer, nn.Conv2d)]
        # Disparities are some ten times as large as colours: without this their random weights drown the average.
        layers[0].weight[:, 0] *= 0.1
        for layer in layers:
            centre = layer.kernel_size[0] // 2
            layer.weight[: 3 * INPUTS] = 0
            for channel in range(3 * INPUTS):
                # In the features of the first layer the disparity stands before the warped inputs.
                layer.weight[channel, channel + (layer is layers[0]), centre, centre] = 1
        stack.last.weight *= 0.1
        for colour in range(3):
            stack.last.weight[colour, : 3 * INPUTS] = 0
            stack.last.weight[colour, colour : 3 * INPUTS : 3] = 1 / INPUTS
