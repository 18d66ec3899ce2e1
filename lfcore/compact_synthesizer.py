"""Synthesis with the compact networks (lfcore.compact): whole pictures, no tiles."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from functools import cached_property
from typing import cast

import torch
import torch.nn.functional as F
from torch import Tensor

from lfcore.allocator import keep_freed_memory
from lfcore.compact import ALIGNMENT, CompactModel
from lfcore.compact_inference import CompactInference, full_size, sweep_input
from lfcore.errors import InputError
from lfcore.lightfield import FloatArray, LightField, check_viewpoint
from lfcore.planesweep import Levels, Window, luminance, plane_sweep
from lfcore.synthesizer import Clock, Synthesis, check_cancelled, corner_offsets, corner_tensor, never, picture
from lfcore.tone import root_tone, stored_from_root
from lfcore.tuning import machine_tuning
from lfcore.warp import quick_sample

# How far the inputs are continued beyond their edges, px: 21 px of disparity at a viewpoint 0.25 outside, and the taps.
REACH = 32


def half_resolution(levels: Levels) -> Levels:
    """The same disparities in pixels twice as large."""
    return Levels(levels.count, levels.low / 2, levels.high / 2)


def half_luma(images: Tensor) -> Tensor:
    """(..., 3, H, W) stored values -> (..., H / 2, W / 2) luminance in the root tone, from which the sweep is made."""
    luma = root_tone(luminance(images))
    return F.avg_pool2d(luma.flatten(0, -3), 2).view(*luma.shape[:-2], luma.shape[-2] // 2, luma.shape[-1] // 2)


def continued(corners: Tensor) -> Tensor:
    """Corner views (4, 3, H, W) continued beyond their edges by REACH, and to whole blocks of ALIGNMENT px."""
    height, width = corners.shape[2:]
    filled = [-size % ALIGNMENT for size in (height, width)]
    return F.pad(corners, (REACH, REACH + filled[1], REACH, REACH + filled[0]), mode="replicate")


class CompactSynthesizer:
    """See lfcore.synthesizer.Synthesizer. Memory while it works: about 600 bytes a pixel.

    The warped inputs of its syntheses are put together when first asked for: that would take as long as a network.
    """

    def __init__(self, model: CompactModel, key: str, dtype: torch.dtype | None = None) -> None:
        self.name = model.config.name
        self.key = key
        self.config = model.config
        self.dtype = dtype or machine_tuning().dtype
        self._networks = CompactInference(model, self.dtype)
        self._size = 0, 0
        self._shifted: Tensor | None = None  # (4, 3, H' + 2 REACH, W' + 2 REACH), root tone less 0.5
        self._luma: Tensor | None = None  # (4, 1, H' / 2 + REACH, W' / 2 + REACH), as the sweep wants it
        keep_freed_memory()

    def set_light_field(self, light_field: LightField) -> None:
        padded = continued(corner_tensor(light_field))
        self._size = light_field.height, light_field.width
        self._shifted = root_tone(padded).sub_(0.5)
        self._luma = sweep_input(half_luma(padded).unsqueeze(1))

    @property
    def weighs(self) -> bool:
        """See WeighingSynthesizer."""
        return True

    def synthesize(self, u: float, v: float, cancelled: Callable[[], bool] = never) -> Synthesis:
        synthesis, warped, _ = self._computed(u, v, cancelled)
        inside = slice(self._size[0]), slice(self._size[1])
        return synthesis.with_warped(lambda: _picture_of_warped(warped, inside))

    def synthesize_weighed(self, u: float, v: float, cancelled: Callable[[], bool] = never) -> Synthesis:
        """See WeighingSynthesizer; it is put together without the warped inputs."""
        synthesis, _, weights = self._computed(u, v, cancelled)
        height, width = self._size
        with torch.inference_mode():
            shares = full_size(weights)[:, :height, :width].mul_(255).round_().to(torch.uint8)
        return dataclasses.replace(synthesis, weights=shares.contiguous().numpy())

    def _computed(self, u: float, v: float, cancelled: Callable[[], bool]) -> tuple[LateSynthesis, Tensor, Tensor]:
        """The synthesis without warped inputs, the phases of these (4, 3, 4, h, w), and of the weights (4, 4, h, w)."""
        if self._shifted is None or self._luma is None:
            raise InputError("No light field is set; call set_light_field first.")
        check_viewpoint(u, v)
        offsets, levels = corner_offsets(u, v), half_resolution(self.config.levels)
        h, w = ((size - 2 * REACH) // 2 for size in self._shifted.shape[2:])
        half = Window(REACH // 2, REACH // 2 + h, REACH // 2, REACH // 2 + w)
        clock = Clock()
        with torch.inference_mode():
            check_cancelled(cancelled)
            features = torch.empty(1, 2 * levels.count, h, w, dtype=self.dtype, memory_format=torch.channels_last)
            plane_sweep(self._luma, offsets, levels, half, features)
            clock.lap("features")
            check_cancelled(cancelled)
            disparity = self._networks.disparity(features)  # (4, h, w), phases
            clock.lap("disparity")
            check_cancelled(cancelled)
            warped = _warped_phases(self._shifted, disparity, offsets)  # (4, 3, 4, h, w)
            clock.lap("warp")
            check_cancelled(cancelled)
            image, weights = self._networks.weighed_colour(warped, disparity, torch.tensor([[u, v]]))
            image = image.clamp_(0, 1)  # (3, 4, h, w)
            clock.lap("colour")
            inside = slice(self._size[0]), slice(self._size[1])
            synthesis = LateSynthesis(
                u,
                v,
                self.name,
                picture(full_size(image)[:, *inside]),
                full_size(disparity)[inside].contiguous().numpy(),
                None,
                clock.timings(),
            )
        return synthesis, warped, weights


class LateSynthesis(Synthesis):
    """A Synthesis whose warped inputs are computed when they are first asked for."""

    def with_warped(self, compute: Callable[[], FloatArray]) -> LateSynthesis:
        """Itself, with a way to the warped inputs in place of the field."""
        self.__dict__["_compute"] = compute
        del self.__dict__["warped"]  # so that the property below is asked, once
        return self

    @cached_property
    def warped(self) -> FloatArray:
        """(4, H, W, 3)."""
        return cast(FloatArray, self.__dict__["_compute"]())


def _warped_phases(shifted: Tensor, disparity: Tensor, offsets: Tensor) -> Tensor:
    """The inputs (4, 3, ., .), continued by REACH, warped by the phases (4, h, w) of a disparity: (4, 3, 4, h, w)."""
    _, h, w = disparity.shape
    phase = torch.arange(4).view(4, 1, 1)
    rows = (2 * torch.arange(h).view(1, h, 1) + phase // 2 + REACH).float()  # (4, h, 1)
    columns = (2 * torch.arange(w).view(1, 1, w) + phase % 2 + REACH).float()
    du, dv = offsets.view(4, 2, 1, 1, 1).unbind(1)
    x = torch.addcmul(columns, du, disparity).view(4, 4 * h, w)
    y = torch.addcmul(rows, dv, disparity).view(4, 4 * h, w)
    return quick_sample(shifted, x, y).view(4, 3, 4, h, w)


def _picture_of_warped(warped: Tensor, inside: tuple[slice, slice]) -> FloatArray:
    with torch.inference_mode():
        return picture(stored_from_root(full_size(warped)[:, :, *inside] + 0.5).clamp_(0, 1))
