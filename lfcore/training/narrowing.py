"""Channels that others can stand in for get weights of 0, so that synthesis leaves them out.

Of the hidden channels of the paper's networks many say nearly the same. One after the other that one is left out whose loss the
others make up best, their weights onward fitted anew by least squares to what the layer after them is given; after each, what
every other would then cost is known exactly without another fit ("optimal brain surgeon", Hassibi and Stork 1993, by whole
channels). Nothing is trained.

    python -m lfcore.training.narrowing WEIGHTS OUT --data FOLDER...

Dead channels and constant ones, and those before the last layer, are lfcore.training.clearing's; lfcore.idle_channels says what
becomes of all of them.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor, nn

from lfcore.errors import LfviewError
from lfcore.export import check_target
from lfcore.formats import open_light_field
from lfcore.models import Model
from lfcore.networks import FullModel, PaperStack
from lfcore.training.architectures import Batch, architecture
from lfcore.training.loop import prepare_scene
from lfcore.training.patches import PatchConfig, sample_group
from lfcore.training.revival import stacks_and_inputs
from lfcore.weights import load_weights, save_weights

SHARE = 3e-4  # of the variance of the next layer's sums, that may be lost
MULTIPLE = 16  # channels are computed by so many
_WINDOWS = 1500  # of a patch
_RIDGE = 1e-7  # of the mean second moment, added to each
_GROUPS = 64
_SEED = 7


@dataclass(frozen=True)
class Moments:
    """Second moments of what a layer is given: of a window's values (channel by channel) and a 1 at the end, float64."""

    values: Tensor  # (C k k + 1, C k k + 1)

    @staticmethod
    def of(inputs: list[Tensor], kernel: int, generator: torch.Generator) -> Moments:
        """From pictures (B, C, H, W), at random places."""
        total, count = torch.zeros(1), 0
        for x in inputs:
            windows = F.unfold(x, kernel)  # (B, C k k, places)
            places = torch.randint(windows.shape[2], (_WINDOWS,), generator=generator)
            seen = windows[:, :, places].movedim(1, 0).flatten(1)
            seen = torch.cat((seen, torch.ones(1, seen.shape[1])))
            total, count = total + (seen @ seen.T).double(), count + seen.shape[1]
        return Moments(total / count)

    def part(self, channels: list[int], kernel: int) -> Tensor:
        """Of these channels alone, and the 1."""
        size = kernel**2
        places = [*(channel * size + k for channel in channels for k in range(size)), len(self.values) - 1]
        return self.values[places][:, places]


@torch.no_grad()
def narrow(model: Model, show: Callable[[], None]) -> int:
    """Leave channels out of every PaperStack of a model; returns how many. `show` runs the model over patches."""
    return sum(_narrow_stack(stack, inputs) for stack, inputs in stacks_and_inputs(model, show))


def _narrow_stack(stack: PaperStack, inputs: list[Tensor]) -> int:
    generator = torch.Generator().manual_seed(_SEED)
    layers, moments = stack.convolutions, []
    for layer, following in pairwise(layers):
        inputs = [F.relu(layer(x)) for x in inputs]
        moments.append(Moments.of(inputs, following.kernel_size[0], generator))
    onward = [*layers[2:], stack.last]
    # From the last layer on: what only left-out channels would take counts no more.
    left_out = 0
    for layer, following, after, seen in reversed(list(zip(layers, layers[1:], onward, moments, strict=False))):
        left_out += _narrow_layer(layer, following, _used(after), seen)
    return left_out


def _used(following: nn.Conv2d) -> list[int]:
    """The channels that a layer takes."""
    used: list[int] = following.weight.abs().amax((0, 2, 3)).nonzero().flatten().tolist()
    return used


def _narrow_layer(layer: nn.Conv2d, following: nn.Conv2d, rows: list[int], seen: Moments) -> int:
    """The same for the channels that one layer makes. rows: of the next one's, those that count."""
    assert layer.bias is not None and following.bias is not None
    kernel, used = following.kernel_size[0], _used(following)
    weights = following.weight[rows][:, used].double().flatten(1)  # (rows, C k k)
    kept, fitted = stand_ins(seen.part(used, kernel), weights.T, kernel**2)
    if len(kept) == len(used):
        return 0
    onward = torch.zeros(len(rows), following.in_channels, kernel, kernel)
    onward[:, [used[channel] for channel in kept]] = fitted[:-1].T.reshape(len(rows), len(kept), kernel, kernel).float()
    following.weight.zero_()[rows] = onward
    following.bias[rows] += fitted[-1].float()
    gone = sorted(set(range(layer.out_channels)) - {used[channel] for channel in kept})
    layer.weight[gone] = 0
    layer.bias[gone] = 0
    return len(used) - len(kept)


def stand_ins(moments: Tensor, weights: Tensor, size: int) -> tuple[list[int], Tensor]:
    """Which channels to keep, a multiple of MULTIPLE or all, and with which weights.

    moments: (C size + 1, the same), of each channel `size` values, and a 1. weights: (C size, rows), of the sums that are
    wanted. Returned weights: (kept size + 1, rows), the last of the 1.
    """
    channels = list(range(len(weights) // size))
    wanted = torch.cat((weights, torch.zeros(1, weights.shape[1], dtype=torch.float64)))
    variance = float(((moments @ wanted) * wanted).sum() - (moments[-1] @ wanted).square().sum())
    inverse = torch.linalg.inv(moments + _RIDGE * moments.diagonal().mean() * torch.eye(len(moments), dtype=torch.float64))
    fitted, lost = wanted, 0.0
    best = channels, fitted
    while len(channels) > MULTIPLE:
        blocks = torch.stack([inverse[i : i + size, i : i + size] for i in range(0, len(channels) * size, size)])
        parts = fitted[:-1].reshape(len(channels), size, -1)
        costs = (parts * torch.linalg.solve(blocks, parts)).sum((1, 2))
        least = int(costs.argmin())
        lost += float(costs[least])
        if lost > SHARE * variance:
            break
        own = slice(least * size, (least + 1) * size)
        others = torch.cat((torch.arange(own.start), torch.arange(own.stop, len(inverse))))
        shares = torch.linalg.solve(inverse[own, own], inverse[own])
        fitted = (fitted - shares.T @ fitted[own])[others]
        inverse = (inverse - inverse[:, own] @ shares)[others][:, others]
        channels = [*channels[:least], *channels[least + 1 :]]
        if len(channels) % MULTIPLE == 0:
            best = channels, fitted
    return best


def narrowed_file(path: Path, out: Path, folders: list[Path]) -> int:
    """Narrow the paper's pair in a weight file, on patches of these light fields; returns how many channels were left out.

    Raises LfviewError for what cannot be read or written, and ValueError for another model's file.
    """
    check_target(out, (".safetensors",))
    weights = load_weights(path)
    model = weights.model
    if not isinstance(model, FullModel):
        raise ValueError(f"{path} holds weights of {model.config.name}; only full can be narrowed.")
    scenes = [prepare_scene(open_light_field(folder)) for folder in folders]
    paper, patches = architecture("full"), PatchConfig(size=128, batch=2, group=2)

    def show() -> None:
        for index in range(_GROUPS):
            group = sample_group(scenes, patches, model.config.levels, np.random.default_rng((_SEED, index)))
            paper.predict(model, Batch.of([group], torch.device("cpu")), lambda: torch.autocast("cpu", enabled=False))

    count = narrow(model, show)
    idle = int(weights.training.get("idle_channels", 0)) + count
    save_weights(out, model, {**weights.training, "idle_channels": idle, "narrowed_by": count})
    return count


def main(arguments: list[str] | None = None) -> int:
    """The command: exit code 0, or 2 with one sentence on stderr."""
    parser = argparse.ArgumentParser(prog="python -m lfcore.training.narrowing", description=(__doc__ or "").split("\n")[0])
    parser.add_argument("weights", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--data", type=Path, nargs="+", required=True, help="light fields with views between the corners")
    options = parser.parse_args(arguments)
    try:
        count = narrowed_file(options.weights, options.out, options.data)
    except (LfviewError, ValueError) as error:
        print(f"lfview: {error}", file=sys.stderr)
        return 2
    print(f"{options.out}: {count} channels fewer")
    return 0


if __name__ == "__main__":
    sys.exit(main())
