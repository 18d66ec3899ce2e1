"""Synthesis with one network straight from the inputs: the paper's ablation, shown beside the others."""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor

from lfcore.errors import InputError
from lfcore.lightfield import LightField, check_viewpoint
from lfcore.networks import SingleModel, single_features
from lfcore.synthesizer import (
    TILE,
    Clock,
    Synthesis,
    apply_stack,
    check_cancelled,
    corner_tensor,
    fastest_dtype,
    never,
    picture,
    put,
    tiles,
)


class SingleSynthesizer:
    """See lfcore.synthesizer.Synthesizer. There is no disparity and nothing is warped."""

    def __init__(self, model: SingleModel, key: str, dtype: torch.dtype | None = None) -> None:
        self.name = model.config.name
        self.key = key
        self.dtype = dtype or fastest_dtype()
        self._stack = model.eval().colour
        self._stack.hidden.to(dtype=self.dtype, memory_format=torch.channels_last)  # type: ignore[call-overload]
        self._inputs: Tensor | None = None  # (1, 12, H, W)

    def set_light_field(self, light_field: LightField) -> None:
        self._inputs = corner_tensor(light_field).flatten(0, 1).unsqueeze(0)

    def synthesize(self, u: float, v: float, cancelled: Callable[[], bool] = never) -> Synthesis:
        if self._inputs is None:
            raise InputError("No light field is set; call set_light_field first.")
        check_viewpoint(u, v)
        height, width = self._inputs.shape[2:]
        clock = Clock()
        image = torch.empty(1, 3, height, width)
        with torch.inference_mode():
            features = single_features(self._inputs, torch.tensor([[u, v]])).to(self.dtype)
            for tile, source in tiles(height, width, TILE):
                check_cancelled(cancelled)
                piece = features[:, :, source.top : source.bottom, source.left : source.right]
                put(image, tile, apply_stack(self._stack, piece, tile, source))
            clock.lap("colour")
        return Synthesis(u, v, self.name, picture(image[0].clamp_(0, 1)), None, None, clock.timings())
