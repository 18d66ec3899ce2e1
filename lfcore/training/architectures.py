"""What differs between the models while they are trained: their start, and the way from patches to pictures.

The loop (lfcore.training.loop) knows none of them; it asks `architecture(name)`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import torch
import torch.nn.functional as F
from torch import Tensor

from lfcore.alignment import MOST, alignment_step
from lfcore.compact import ALIGNMENT, CompactModel, initialise_compact
from lfcore.compact_synthesizer import REACH, half_luma, half_resolution
from lfcore.models import Model
from lfcore.networks import BORDER, FullModel, SingleModel, colour_features, initialise, single_features, sweep_luminance
from lfcore.planesweep import Levels, Window, deviation_sweep, luminance, plane_sweep
from lfcore.synthesizer import corner_offsets
from lfcore.tone import root_tone
from lfcore.training.conditioning import condition, initialise_conditioned, plain_copy
from lfcore.training.patches import PatchGroup
from lfcore.warp import backward_warp, quick_warp

Autocast = Callable[[], torch.autocast]


@dataclass(frozen=True)
class Batch:
    """The groups of one step as tensors on the device that trains."""

    groups: Sequence[PatchGroup]
    inputs: Sequence[Tensor]  # of each group, (4, B, 3, H, W)
    targets: Tensor  # (sum of B, 3, P, P)
    offsets: Sequence[Tensor]  # of each group, (4, 2), p_i - q
    positions: Tensor  # (sum of B, 2), (u, v)

    @staticmethod
    def of(groups: Sequence[PatchGroup], device: torch.device) -> Batch:
        """Move groups to the device."""
        return Batch(
            groups,
            [torch.from_numpy(group.inputs).to(device) for group in groups],
            torch.cat([torch.from_numpy(group.target).to(device) for group in groups]),
            [corner_offsets(group.u, group.v) for group in groups],
            torch.cat([torch.tensor([[g.u, g.v]]).expand(g.target.shape[0], 2) for g in groups]).to(device),
        )

    @property
    def sizes(self) -> list[int]:
        """Patches in each group."""
        return [images.shape[1] for images in self.inputs]


@dataclass(frozen=True)
class Prediction:
    """What a model makes of a batch. `border`: what the picture, and the disparity, lose on each side of the patch, px. The
    disparity is that of the scene with its group's shift."""

    image: Tensor  # (sum of B, 3, P - 2 border, P - 2 border)
    border: int
    disparity: Tensor | None  # (sum of B, 1, P - 2 disparity_border, P - 2 disparity_border)
    disparity_border: int


class Architecture(Protocol):
    """One model's part in training. `alignment`: the side of a patch must be a multiple of so many px."""

    alignment: int

    def levels(self, model: Model) -> Levels | None:
        """The disparities that a model can name; None where it has none."""

    def start(self, seed: int) -> Model:
        """A model with random weights."""

    def prepare(self, model: Model) -> None:
        """Change how the weights are held, if that helps while training; `plain` undoes it."""

    def plain(self, model: Model) -> Model:
        """A copy to be saved and used: float32, on the CPU."""

    def predict(self, model: Model, batch: Batch, autocast: Autocast) -> Prediction:
        """Picture and disparity of the batch, differentiable."""


class PaperPair:
    """The paper's two networks."""

    alignment = 1

    def levels(self, model: Model) -> Levels:
        """See Architecture."""
        assert isinstance(model, FullModel)
        return model.config.levels

    def start(self, seed: int) -> Model:
        """See Architecture."""
        model = FullModel()
        initialise_conditioned(model, seed)
        return model

    def prepare(self, model: Model) -> None:
        """See Architecture."""
        assert isinstance(model, FullModel)
        condition(model)

    def plain(self, model: Model) -> Model:
        """See Architecture."""
        assert isinstance(model, FullModel)
        return plain_copy(model)

    def predict(self, model: Model, batch: Batch, autocast: Autocast) -> Prediction:
        """See Architecture."""
        assert isinstance(model, FullModel)
        places = _places(batch)
        lumas = [sweep_luminance(place.images, model.config) for place in places]
        features = torch.cat(
            [
                plane_sweep(luma, offsets, model.config.levels.moved(-group.shift), place.window)
                for luma, offsets, group, place in zip(lumas, batch.offsets, batch.groups, places, strict=True)
            ]
        )  # (sum of B, 2 L, P, P)
        with autocast():
            disparity = model.disparity(features.contiguous(memory_format=torch.channels_last))  # (., 1, P - 12, P - 12)
        pieces = disparity.split(batch.sizes)
        warped = torch.cat(
            [
                warp_inputs(place.images, piece - group.shift, offsets, (place.window.top + BORDER, place.window.left + BORDER))
                for place, piece, offsets, group in zip(places, pieces, batch.offsets, batch.groups, strict=True)
            ]
        )
        h = colour_features(disparity, warped, batch.positions)
        with autocast():
            image = model.colour(h.contiguous(memory_format=torch.channels_last))  # (., 3, P - 24, P - 24)
        return Prediction(image, 2 * BORDER, disparity, BORDER)


class CompactPair:
    """The small pair. Its convolutions fill up with zeros at the edge of a patch, so a rim of the picture is not scored."""

    RIM = 8
    alignment = ALIGNMENT

    def levels(self, model: Model) -> Levels:
        """See Architecture."""
        assert isinstance(model, CompactModel)
        return model.config.levels

    def start(self, seed: int) -> Model:
        """See Architecture."""
        model = CompactModel()
        initialise_compact(model, seed)
        return model

    def prepare(self, model: Model) -> None:
        """See Architecture."""

    def plain(self, model: Model) -> Model:
        """See Architecture."""
        assert isinstance(model, CompactModel)
        return _copied(model, CompactModel(model.config))

    def predict(self, model: Model, batch: Batch, autocast: Autocast) -> Prediction:
        """See Architecture."""
        assert isinstance(model, CompactModel)
        places = _places(batch)
        disparity = self._disparity(model, batch, places, autocast)
        warped = _toned_and_warped(places, batch, disparity)
        with autocast():
            image = model.colour(warped, disparity, batch.positions)  # (., 3, P, P)
        inside = slice(self.RIM, -self.RIM)
        return Prediction(image[:, :, inside, inside], self.RIM, disparity, 0)

    def disparity(self, model: CompactModel, batch: Batch, autocast: Autocast) -> Tensor:
        """The disparity alone, (sum of B, 1, P, P): what another model can be taught."""
        return self._disparity(model, batch, _places(batch), autocast)

    def _disparity(self, model: CompactModel, batch: Batch, places: Sequence[_Place], autocast: Autocast) -> Tensor:
        deviations = _half_sweep(places, batch, model.config.levels)
        with autocast():
            disparity: Tensor = model.disparity(deviations)  # (., 1, P, P)
        return _aligned(places, batch, disparity)


class SingleNetwork:
    """The paper's ablation."""

    alignment = 1

    def levels(self, model: Model) -> None:
        """See Architecture."""
        return

    def start(self, seed: int) -> Model:
        """See Architecture."""
        model = SingleModel()
        initialise(model, seed)
        return model

    def prepare(self, model: Model) -> None:
        """See Architecture."""

    def plain(self, model: Model) -> Model:
        """See Architecture."""
        return _copied(model, SingleModel())

    def predict(self, model: Model, batch: Batch, autocast: Autocast) -> Prediction:
        """See Architecture."""
        assert isinstance(model, SingleModel)
        inputs = torch.cat(
            [
                images[..., w.top : w.bottom, w.left : w.right].transpose(0, 1).flatten(1, 2)
                for images, w in zip(batch.inputs, (group.window for group in batch.groups), strict=True)
            ]
        )  # (sum of B, 12, P, P)
        with autocast():
            image = model.colour(
                single_features(inputs, batch.positions).contiguous(memory_format=torch.channels_last)
            )  # (., 3, P - 12, P - 12)
        return Prediction(image, BORDER, None, 0)


_ARCHITECTURES: dict[str, Architecture] = {
    "full": PaperPair(),
    "realtime": CompactPair(),
    "single": SingleNetwork(),
}


def architecture(name: str) -> Architecture:
    """By the name of a model, one of lfcore.models.TRAINABLE."""
    return _ARCHITECTURES[name]


def _copied(model: Model, onto: Model) -> Model:
    """`onto` with the weights of `model`, float32, on the CPU."""
    onto.load_state_dict({name: value.float().cpu() for name, value in model.state_dict().items()})
    return onto


def warp_inputs(inputs: Tensor, disparity: Tensor, offsets: Tensor, origin: tuple[int, int]) -> Tensor:
    """The four inputs (4, B, 3, H, W) of a group warped to its novel view by (B, 1, h, w): (B, 12, h, w)."""
    n, b, c, height, width = inputs.shape
    spread = disparity.expand(n, *disparity.shape).flatten(0, 1)  # (4 B, 1, h, w)
    offset = offsets.to(disparity.device).repeat_interleave(b, 0)  # (4 B, 2)
    warped = backward_warp(inputs.reshape(n * b, c, height, width), spread, offset, origin)
    return warped.view(n, b, c, *warped.shape[2:]).transpose(0, 1).flatten(1, 2)


def _half_sweep(places: Sequence[_Place], batch: Batch, levels: Levels) -> Tensor:
    """What the small pair's disparity network takes, at half the resolution: (sum of B, L, P / 2, P / 2)."""
    return torch.cat(
        [
            deviation_sweep(
                half_luma(place.images), offsets, half_resolution(levels.moved(-group.shift)), _halved(place.window)
            )
            for place, offsets, group in zip(places, batch.offsets, batch.groups, strict=True)
        ]
    )


def _aligned(places: Sequence[_Place], batch: Batch, disparity: Tensor) -> Tensor:
    """A disparity (sum of B, 1, P, P), moved to where the inputs agree best."""
    pieces = zip(places, disparity.split(batch.sizes), batch.offsets, batch.groups, strict=True)
    aligned = []
    for place, piece, offsets, group in pieces:
        luma = root_tone(luminance(place.images)).unsqueeze(2)  # (4, B, 1, H, W)
        warped = _quick_warp_inputs(luma, piece - group.shift, offsets, place.window)  # (B, 4, P, P)
        aligned.append(piece + alignment_step(warped.transpose(0, 1), offsets, MOST))
    return torch.cat(aligned)


def _toned_and_warped(places: Sequence[_Place], batch: Batch, disparity: Tensor) -> Tensor:
    """The inputs of all groups in the root tone, warped by (sum of B, 1, P, P): (sum of B, 12, P, P)."""
    pieces = zip(places, disparity.split(batch.sizes), batch.offsets, batch.groups, strict=True)
    return torch.cat(
        [
            _quick_warp_inputs(root_tone(place.images), piece - group.shift, offsets, place.window)
            for place, piece, offsets, group in pieces
        ]
    )


def _quick_warp_inputs(inputs: Tensor, disparity: Tensor, offsets: Tensor, window: Window) -> Tensor:
    """As `warp_inputs`, by the warp of the compact models, of inputs with any number of channels: (B, 4 C, h, w)."""
    n, b, c, height, width = inputs.shape
    warped = quick_warp(
        inputs.reshape(n * b, c, height, width),
        disparity.expand(n, *disparity.shape).flatten(0, 1),
        offsets.to(disparity.device).repeat_interleave(b, 0),
        (window.top, window.left),
    )
    return warped.view(n, b, c, *warped.shape[2:]).transpose(0, 1).flatten(1, 2)


@dataclass(frozen=True)
class _Place:
    """Inputs of a group, and where in them its patches lie."""

    images: Tensor  # (4, B, 3, H, W)
    window: Window


def _places(batch: Batch) -> list[_Place]:
    return [_continued(images, group.window) for images, group in zip(batch.inputs, batch.groups, strict=True)]


def _continued(inputs: Tensor, window: Window) -> _Place:
    """Inputs (4, B, 3, H, W) whose window reaches an edge of the picture, continued beyond it as the synthesizer does."""
    height, width = inputs.shape[-2:]
    if min(window.top, window.left, height - window.bottom, width - window.right) > 0:
        return _Place(inputs, window)  # the margin holds every sample
    padded = F.pad(inputs.flatten(0, 1), (REACH,) * 4, mode="replicate").unflatten(0, inputs.shape[:2])
    moved = Window(window.top + REACH, window.bottom + REACH, window.left + REACH, window.right + REACH)
    return _Place(padded, moved)


def _halved(window: Window) -> Window:
    if (window.top | window.bottom | window.left | window.right) % 2:
        raise ValueError("patches of a half-resolution model begin and end at even pixels")
    return Window(window.top // 2, window.bottom // 2, window.left // 2, window.right // 2)
