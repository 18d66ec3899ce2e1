"""Synthesis with one network straight from the inputs: the paper's ablation, shown beside the others."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import torch
from torch import Tensor

from lfcore.errors import InputError
from lfcore.illum_correction import IllumCorrection
from lfcore.lightfield import LightField, check_viewpoint
from lfcore.networks import BORDER, SingleModel, single_features
from lfcore.synthesizer import Clock, Synthesis, check_cancelled, continued, corner_tensor, never, picture, put
from lfcore.tuned_stack import TunedStack, Tuning
from lfcore.tuning import machine_tuning


class SingleSynthesizer:
    """See lfcore.synthesizer.Synthesizer. There is no disparity and nothing is warped."""

    def __init__(self, model: SingleModel, key: str, tuning: Tuning | None = None) -> None:
        self.name = model.config.name
        self.key = key
        self.config = model.config
        self._tuning = tuning or machine_tuning()
        self._stack = TunedStack(model.colour, self._tuning)
        self._correction = IllumCorrection()
        self._inputs: Tensor | None = None  # (1, 12, H + 2 BORDER, W + 2 BORDER), continued beyond their edges

    @property
    def dtype(self) -> torch.dtype:
        """The number type of the convolutions."""
        return self._tuning.dtype

    def set_light_field(self, light_field: LightField) -> None:
        self._correction = IllumCorrection(light_field.aperture)
        self._inputs = continued(self._correction.true(corner_tensor(light_field)), BORDER).flatten(0, 1).unsqueeze(0)

    def synthesize(self, u: float, v: float, cancelled: Callable[[], bool] = never) -> Synthesis:
        if self._inputs is None:
            raise InputError("No light field is set; call set_light_field first.")
        check_viewpoint(u, v)
        height, width = (size - 2 * BORDER for size in self._inputs.shape[2:])
        clock, check = Clock(), partial(check_cancelled, cancelled)
        image = torch.empty(1, 3, height, width)
        with torch.inference_mode():
            features = single_features(self._inputs, torch.tensor([[u, v]]))  # (1, 14, the same)
            for tile in self._tuning.tiles(height, width):
                put(image, tile.window, self._stack(self._stack.tile_input(features, tile), check))
            clock.lap("colour")
        seen = self._correction.stored(picture(image[0].clamp_(0, 1)), u, v)
        return Synthesis(u, v, self.name, seen, None, None, clock.timings())
