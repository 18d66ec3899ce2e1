"""Synthesis with the compact networks (lfcore.compact): whole pictures, no tiles."""

from __future__ import annotations

from collections.abc import Callable

import torch
import torch.nn.functional as F
from torch import Tensor

from lfcore.allocator import keep_freed_memory
from lfcore.compact import ALIGNMENT, CompactModel
from lfcore.errors import InputError
from lfcore.lightfield import LightField, check_viewpoint
from lfcore.planesweep import Levels, Window, luminance, plane_sweep
from lfcore.synthesizer import Clock, Synthesis, check_cancelled, corner_offsets, corner_tensor, never, picture
from lfcore.tone import root_tone, stored_from_root
from lfcore.tuning import machine_tuning
from lfcore.warp import quick_warp

# How far the inputs are continued beyond their edges, px: 21 px of disparity at a viewpoint 0.25 outside, and the taps.
REACH = 32


def half_resolution(levels: Levels) -> Levels:
    """The same disparities in pixels twice as large."""
    return Levels(levels.count, levels.low / 2, levels.high / 2)


def half_luma(images: Tensor) -> Tensor:
    """(..., 3, H, W) stored values -> (..., H / 2, W / 2) luminance in the root tone, from which the sweep is made."""
    luma = root_tone(luminance(images))
    return F.avg_pool2d(luma.flatten(0, -3), 2).view(*luma.shape[:-2], luma.shape[-2] // 2, luma.shape[-1] // 2)


class CompactSynthesizer:
    """See lfcore.synthesizer.Synthesizer. Memory while it works: about 600 bytes a pixel."""

    def __init__(self, model: CompactModel, key: str, dtype: torch.dtype | None = None) -> None:
        self.name = model.config.name
        self.key = key
        self.config = model.config
        self.dtype = dtype or machine_tuning().dtype
        self._model = model.eval().to(memory_format=torch.channels_last)  # type: ignore[call-overload]
        self._size = 0, 0
        self._toned: Tensor | None = None  # (4, 3, H' + 2 REACH, W' + 2 REACH), root tone
        self._luma: Tensor | None = None  # (4, 1, H' / 2 + REACH, W' / 2 + REACH), root tone
        keep_freed_memory()

    def set_light_field(self, light_field: LightField) -> None:
        corners = corner_tensor(light_field)  # (4, 3, H, W)
        height, width = corners.shape[2:]
        filled = [-size % ALIGNMENT for size in (height, width)]
        padded = F.pad(corners, (REACH, REACH + filled[1], REACH, REACH + filled[0]), mode="replicate")
        self._size = height, width
        self._toned = root_tone(padded)
        self._luma = half_luma(padded).unsqueeze(1)

    def synthesize(self, u: float, v: float, cancelled: Callable[[], bool] = never) -> Synthesis:
        if self._toned is None or self._luma is None:
            raise InputError("No light field is set; call set_light_field first.")
        check_viewpoint(u, v)
        offsets, levels = corner_offsets(u, v), half_resolution(self.config.levels)
        height, width = (size - 2 * REACH for size in self._toned.shape[2:])
        half = Window(REACH // 2, (REACH + height) // 2, REACH // 2, (REACH + width) // 2)
        clock = Clock()
        with torch.inference_mode(), torch.autocast("cpu", dtype=torch.bfloat16, enabled=self.dtype == torch.bfloat16):
            check_cancelled(cancelled)
            features = plane_sweep(self._luma, offsets, levels, half)  # (1, 2 L, H' / 2, W' / 2)
            clock.lap("features")
            check_cancelled(cancelled)
            disparity = self._model.disparity(features)  # (1, 1, H', W')
            clock.lap("disparity")
            check_cancelled(cancelled)
            warped = quick_warp(self._toned, disparity, offsets, (REACH, REACH))  # (4, 3, H', W')
            clock.lap("warp")
            check_cancelled(cancelled)
            image = self._model.colour(warped.reshape(1, 12, height, width), disparity, torch.tensor([[u, v]]))
            clock.lap("colour")
            inside = slice(self._size[0]), slice(self._size[1])
            return Synthesis(
                u,
                v,
                self.name,
                picture(image[0][:, *inside].clamp(0, 1)),
                disparity[0, 0][inside].contiguous().numpy(),
                picture(stored_from_root(warped[:, :, *inside]).clamp_(0, 1)),
                clock.timings(),
            )
