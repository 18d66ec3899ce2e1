"""How many operations the networks of a model ask for, counted from their layers."""

from __future__ import annotations

from torch import nn

from lfcore.compact import ALIGNMENT, CompactConfig, CompactModel
from lfcore.models import Config
from lfcore.networks import BORDER, FullModel, ModelConfig, PaperStack, SingleConfig, SingleModel


def network_operations(config: Config, size: tuple[int, ...]) -> dict[str, float]:
    """Operations of the convolutions for one view of (height, width), by stage of the synthesis; a multiply-add is two."""
    if isinstance(config, ModelConfig):
        full = FullModel(config)
        return {"disparity": _stack_operations(full.disparity, size), "colour": _stack_operations(full.colour, size)}
    if isinstance(config, SingleConfig):
        return {"colour": _stack_operations(SingleModel(config).colour, size)}
    return _compact_operations(config, size)


def _stack_operations(stack: PaperStack, size: tuple[int, ...]) -> float:
    height, width = (extent + 2 * BORDER for extent in size)
    total = 0.0
    for layer in (*stack.hidden, stack.last):
        if isinstance(layer, nn.Conv2d):
            height, width = height - layer.kernel_size[0] + 1, width - layer.kernel_size[1] + 1
            total += _per_pixel(layer) * height * width
    return total


def _compact_operations(config: CompactConfig, size: tuple[int, ...]) -> dict[str, float]:
    model = CompactModel(config)
    height, width = (-(-extent // ALIGNMENT) * ALIGNMENT for extent in size)
    # All layers keep the size, at half the resolution, but for the stem and what follows it, at a quarter.
    halves, quarters = height * width / 4, height * width / 16
    first = model.disparity
    coarse = {id(layer) for part in (first.stem, first.blocks, first.rise) for layer in part.modules()}
    return {
        stage: sum(
            _per_pixel(layer) * (quarters if id(layer) in coarse else halves)
            for layer in network.modules()
            if isinstance(layer, nn.Conv2d)
        )
        for stage, network in (("disparity", first), ("colour", model.colour))
    }


def _per_pixel(layer: nn.Conv2d) -> float:
    return 2.0 * layer.weight[0].numel() * layer.out_channels
