"""The loss of one step, for any model: squared error of the picture, and for a while the distance from the best match."""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from lfcore.compact import CompactModel
from lfcore.models import Model
from lfcore.networks import BORDER
from lfcore.planesweep import Levels, luminance, matching_disparity
from lfcore.tone import root_tone
from lfcore.training.architectures import Architecture, Batch, CompactPair, Prediction
from lfcore.training.patches import PatchGroup
from lfcore.training.team import ALONE, Team


@dataclass(frozen=True)
class LossConfig:
    """Weights of the parts."""

    matching_steps: int = 1000  # in which the disparity is also drawn to the plane sweep's best match (see matching_disparity)
    matching_weight: float = 0.03
    teacher_weight: float = 0.1  # of the distance to a teacher's disparity, px, where there is a teacher
    balance: float = 0.0  # a patch's squared error is divided by (its variance + 0.005) ** balance; 0 is the paper's loss


class StepLoss(nn.Module):
    """A module around the model, so that PyTorch's DistributedDataParallel sees one forward pass from patches to loss."""

    def __init__(
        self,
        model: Model,
        architecture: Architecture,
        config: LossConfig,
        bfloat16: bool,
        teacher: CompactModel | None = None,
        team: Team = ALONE,
    ) -> None:
        super().__init__()
        self.model = model
        self._architecture = architecture
        self._config = config
        self._bfloat16 = bfloat16
        self._teacher = [teacher] if teacher else []  # in a list, so that it is no part of what is trained
        self._team = team

    def forward(self, batch: Batch, step: int) -> tuple[Tensor, Tensor]:
        """(mean squared error over RGB, loss), both scalars."""
        prediction = self._architecture.predict(self.model, batch, self._autocast)
        inside = slice(prediction.border, -prediction.border)
        inner = batch.targets[:, :, inside, inside]
        errors = (prediction.image - inner).square().mean((1, 2, 3))  # (B,)
        # Dark and flat patches have small errors; balanced, they teach as much as bright ones.
        loss = (errors / (inner.var((1, 2, 3)) + 0.005) ** self._config.balance).mean()
        if step < self._config.matching_steps and prediction.disparity is not None:
            fading = 1 - step / self._config.matching_steps
            loss = loss + self._config.matching_weight * fading * self._matching_loss(batch, prediction)
        if self._teacher and prediction.disparity is not None:
            loss = loss + self._config.teacher_weight * self._teaching_loss(batch, prediction)
        return errors.detach().mean(), loss

    def _matching_loss(self, batch: Batch, prediction: Prediction) -> Tensor:
        """Distance of the disparity from the level at which the inputs match the novel view best, where that is clear, in the
        first group of the whole team that has all samples: one a step is enough, and costs less than all."""
        assert prediction.disparity is not None
        numbers = self._team.numbers(len(batch.groups) * self._team.size)
        whole = [index for index, group in enumerate(batch.groups) if _has_all_samples(group)]
        first = self._team.least(numbers[whole[0]] if whole else math.inf)
        if not whole or numbers[whole[0]] != first:
            return 0 * prediction.disparity.sum()
        # The mean of the gradients of all processes, of which this one alone has the term, shall be that of one process.
        return self._team.size * _matching_error(batch, prediction, whole[0])

    def _teaching_loss(self, batch: Batch, prediction: Prediction) -> Tensor:
        """Distance of the disparity from that of a small model that has been trained already."""
        assert prediction.disparity is not None
        with torch.no_grad():
            wanted = CompactPair().disparity(self._teacher[0], batch, self._autocast)
        return F.smooth_l1_loss(prediction.disparity, cut(wanted, prediction.disparity_border))

    def _autocast(self) -> torch.autocast:
        device = next(self.model.parameters()).device
        return torch.autocast(device.type, dtype=torch.bfloat16, enabled=self._bfloat16)


def _has_all_samples(group: PatchGroup) -> bool:
    """Whether the patches lie away from the edges of the picture, so that all samples of a sweep count."""
    w, (height, width) = group.window, group.inputs.shape[-2:]
    return min(w.top, w.left, height - w.bottom, width - w.right) >= BORDER


def _matching_error(batch: Batch, prediction: Prediction, index: int) -> Tensor:
    """Distance of the disparity of one group from that of the best match, weighted by how clear it is."""
    assert prediction.disparity is not None
    group, border = batch.groups[index], prediction.disparity_border
    target, disparity = (planes.split(batch.sizes)[index] for planes in (batch.targets, prediction.disparity))
    luma, wanted = root_tone(luminance(batch.inputs[index])), root_tone(luminance(target))
    levels = Levels().moved(-group.shift)
    matches = matching_disparity(luma, batch.offsets[index], levels, group.window, wanted)
    found, confidence = (cut(part, border) for part in matches)
    error = F.smooth_l1_loss(disparity, found + group.shift, reduction="none")
    return (confidence * error).mean()


def cut(planes: Tensor, border: int) -> Tensor:
    """(..., H, W) without `border` pixels on each side."""
    return planes[..., border : planes.shape[-2] - border, border : planes.shape[-1] - border]
