"""Synthesis with the compact networks (lfcore.compact): whole pictures, no tiles."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import torch
import torch.nn.functional as F
from torch import Tensor

from lfcore.alignment import MOST
from lfcore.allocator import keep_freed_memory
from lfcore.compact import ALIGNMENT, CompactModel
from lfcore.compact_inference import Coloured, CompactInference
from lfcore.compact_parts import Gathered, Places, full_size, phases_of
from lfcore.errors import InputError
from lfcore.illum_correction import IllumCorrection
from lfcore.lightfield import FloatArray, LightField, check_viewpoint
from lfcore.planesweep import Levels, Window, deviation_sweep, luminance
from lfcore.span import Span, continued_by_others, made_larger, made_smaller, span_of
from lfcore.synthesis import LateSynthesis
from lfcore.synthesizer import Clock, Synthesis, check_cancelled, corner_offsets, corner_tensor, never, picture
from lfcore.tone import root_tone, stored_from_root
from lfcore.tuned_stack import Tuning
from lfcore.tuning import machine_tuning

# How far the inputs are continued beyond their edges, px: 21 px of disparity at a viewpoint 0.25 outside, and the taps. A span
# asks for more.
REACH = 32


def half_resolution(levels: Levels) -> Levels:
    """The same disparities in pixels twice as large."""
    return Levels(levels.count, levels.low / 2, levels.high / 2)


def half_luma(images: Tensor) -> Tensor:
    """(..., 3, H, W) stored values -> (..., H / 2, W / 2) luminance in the root tone, from which the sweep is made."""
    luma = root_tone(luminance(images))
    return F.avg_pool2d(luma.flatten(0, -3), 2).view(*luma.shape[:-2], luma.shape[-2] // 2, luma.shape[-1] // 2)


class CompactSynthesizer:
    """See lfcore.synthesizer.Synthesizer. Memory while it works: about 640 bytes a pixel.

    The warped inputs of its syntheses are put together when first asked for: that would take as long as a network.
    """

    def __init__(self, model: CompactModel, key: str, tuning: Tuning | None = None) -> None:
        self.name = model.config.name
        self.key = key
        self.config = model.config
        tuning = tuning or machine_tuning()
        self.dtype = tuning.dtype
        self._networks = CompactInference(model, tuning)
        self._size = 0, 0
        self._correction = IllumCorrection()
        self._span = Span()
        self._edge = self._swept_edge = REACH  # by which the inputs of the warp are continued, and those of the sweep
        self._corners: Tensor | None = None  # prepared for the warp
        self._luma: Tensor | None = None  # (4, H + 2 edge, W + 2 edge): to see where the warped ones agree
        self._half_luma: Tensor | None = None  # (4, 1, h + edge, w + edge): swept; smaller where the span says so
        keep_freed_memory()

    def set_light_field(self, light_field: LightField) -> None:
        self._correction = IllumCorrection(light_field.aperture)
        corners = self._correction.true(corner_tensor(light_field))
        self._size = light_field.height, light_field.width
        self._span = span = span_of(corners, self.config.levels)
        self._edge, self._swept_edge = span.edges(REACH, self.config.levels)
        padded = continued_by_others(corners, self._edge, span.shift, ALIGNMENT)
        self._corners = self._networks.prepared(root_tone(padded))
        self._luma = root_tone(luminance(padded))
        if span.scale > 1:
            small = made_smaller(corners, span.scale)
            padded = continued_by_others(small, self._swept_edge, span.in_small, ALIGNMENT)
        self._half_luma = half_luma(padded).unsqueeze(1)
        with torch.inference_mode():
            self._networks.expect(self._swept(self._half_luma, corner_offsets(0.5, 0.5)))

    @property
    def weighs(self) -> bool:
        """See WeighingSynthesizer."""
        return True

    def synthesize(self, u: float, v: float, cancelled: Callable[[], bool] = never) -> Synthesis:
        synthesis, gathered, _ = self._computed(u, v, cancelled)
        correction = self._correction
        return synthesis.with_warped(lambda: correction.stored_of_corners(self._picture_of_warped(gathered)))

    def synthesize_weighed(self, u: float, v: float, cancelled: Callable[[], bool] = never) -> Synthesis:
        """See WeighingSynthesizer; it is put together without the warped inputs."""
        synthesis, _, coloured = self._computed(u, v, cancelled)
        height, width = self._size
        with torch.inference_mode():
            shares = full_size(coloured.shares())[:, :height, :width].mul_(255).round_().to(torch.uint8)
        return dataclasses.replace(synthesis, weights=shares.contiguous().numpy())

    def _computed(self, u: float, v: float, cancelled: Callable[[], bool]) -> tuple[LateSynthesis, Gathered, Coloured]:
        """The synthesis without warped inputs, these, and what came out of the colour network."""
        if self._corners is None or self._luma is None or self._half_luma is None:
            raise InputError("No light field is set; call set_light_field first.")
        check_viewpoint(u, v)
        offsets = corner_offsets(u, v)
        clock = Clock()
        with torch.inference_mode():
            check_cancelled(cancelled)
            deviations = self._swept(self._half_luma, offsets)
            clock.lap("features")
            check_cancelled(cancelled)
            disparity = self._as_large(self._networks.disparity(deviations))  # (4, h, w), phases, px of the network
            moves = self._span.shift * offsets + torch.tensor(self._correction.moves(u, v))
            places = Places(self._span.scale * offsets, moves, self._edge)
            disparity = self._networks.aligned(self._luma, disparity, places, MOST / self._span.scale)
            clock.lap("disparity")
            check_cancelled(cancelled)
            gathered = self._networks.warp(self._corners, disparity, places, (u, v))
            clock.lap("warp")
            check_cancelled(cancelled)
            coloured = self._networks.colour(gathered, (u, v), self._size)
            clock.lap("colour")
            height, width = self._size
            whole = self._span.disparity(full_size(disparity)[:height, :width].contiguous()).numpy()
            image = self._correction.stored(coloured.image.numpy(), u, v)
            synthesis = LateSynthesis(u, v, self.name, image, whole, None, clock.timings())
        return synthesis, gathered, coloured

    def _swept(self, luma: Tensor, offsets: Tensor) -> Tensor:
        """What the disparity network takes, (1, L, h, w); offsets: (4, 2), p_i - q."""
        levels, edge = half_resolution(self.config.levels.moved(self._span.in_small)), self._swept_edge
        h, w = (size - edge for size in luma.shape[2:])
        half = Window(edge // 2, edge // 2 + h, edge // 2, edge // 2 + w)
        deviations = torch.empty(1, levels.count, h, w, dtype=self.dtype, memory_format=torch.channels_last)
        deviation_sweep(luma, offsets, levels, half, deviations)
        return deviations

    def _as_large(self, phases: Tensor) -> Tensor:
        """The phases of a map made smaller, as the span says, as those of one of the picture's size."""
        if self._span.scale == 1:
            return phases
        height, width = (-(-size // ALIGNMENT) * ALIGNMENT for size in self._size)
        whole = made_larger(full_size(phases)[None, None], self._span.scale)
        return phases_of(whole[0, 0, :height, :width])

    def _picture_of_warped(self, gathered: Gathered) -> FloatArray:
        """(4, H, W, 3)."""
        height, width = self._size
        with torch.inference_mode():
            inputs = self._networks.warped_pictures(gathered)[..., :height, :width]
            return picture(stored_from_root(inputs).clamp_(0, 1))
