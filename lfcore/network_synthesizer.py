"""Synthesis with the paper's two networks, in tiles and in the number type that suit this machine (lfcore.tuning)."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import torch
from torch import Tensor

from lfcore.allocator import keep_freed_memory
from lfcore.errors import InputError
from lfcore.fewer_means import kept_levels, with_fewer_means
from lfcore.illum_correction import IllumCorrection
from lfcore.lightfield import FloatArray, LightField, check_viewpoint
from lfcore.networks import BORDER, FullModel, colour_features, sweep_luminance
from lfcore.planesweep import Window, sparse_sweep
from lfcore.span import Span, continued_by_others, made_larger, made_smaller, span_of
from lfcore.synthesis import LateSynthesis
from lfcore.synthesizer import (
    Clock,
    Synthesis,
    check_cancelled,
    corner_offsets,
    corner_tensor,
    never,
    picture,
    put,
)
from lfcore.tuned_stack import TunedStack, Tuning
from lfcore.tuning import machine_tuning
from lfcore.warp import backward_warp

# How far the inputs are continued beyond their edges, px: 21 px of disparity and more at a viewpoint 0.25 outside, from the
# borders of both networks. A span asks for more.
REACH = 64


class NetworkSynthesizer:
    """See lfcore.synthesizer.Synthesizer. The whole picture comes out: it is the inner part of `reference_synthesis` of corner
    views whose edges are repeated beyond them.

    Memory while it works: about 400 bytes a pixel of the picture, and what the tile in work takes. In bfloat16, by Fourier
    transforms, a process that does nothing else came to 422 MiB with views of 541 x 376 px, to 986 with nine times as many.
    """

    def __init__(self, model: FullModel, key: str, tuning: Tuning | None = None) -> None:
        self.name = model.config.name
        self.key = key
        self.config = model.config
        self._tuning = tuning or machine_tuning()
        self._means = kept_levels(self.config.levels, self._tuning.means)
        stack = with_fewer_means(model.disparity, self.config.levels, self._means)
        self._disparity = TunedStack(stack, self._tuning)
        self._colour = TunedStack(model.colour, self._tuning)
        self._span = Span()
        self._edge = self._swept_edge = REACH  # by which the inputs of the warp are continued, and those of the sweep
        self._correction = IllumCorrection()
        self._corners: Tensor | None = None  # (4, 3, H, W)
        self._continued: Tensor | None = None  # (4, 3, H + 2 edge, W + 2 edge)
        self._luma: Tensor | None = None  # (4, 1, h + 2 edge, w + 2 edge), what is swept; made smaller where the span says so
        keep_freed_memory()

    @property
    def dtype(self) -> torch.dtype:
        """The number type of the convolutions."""
        return self._tuning.dtype

    def set_light_field(self, light_field: LightField) -> None:
        """See Synthesizer."""
        self._correction = IllumCorrection(light_field.aperture)
        self._corners = corners = self._correction.true(corner_tensor(light_field))
        self._span = span = span_of(corners, self.config.levels)
        self._edge, self._swept_edge = span.edges(REACH, self.config.levels)
        self._continued = swept = continued_by_others(corners, self._edge, span.shift)
        if span.scale > 1:
            swept = continued_by_others(made_smaller(corners, span.scale), self._swept_edge, span.in_small)
        self._luma = sweep_luminance(swept, self.config).unsqueeze(1)

    def synthesize(self, u: float, v: float, cancelled: Callable[[], bool] = never) -> Synthesis:
        if self._corners is None or self._continued is None or self._luma is None:
            raise InputError("No light field is set; call set_light_field first.")
        check_viewpoint(u, v)
        corners, span, correction = self._corners, self._span, self._correction
        height, width = corners.shape[2:]
        offsets = corner_offsets(u, v)
        clock, check = Clock(), partial(check_cancelled, cancelled)
        image = torch.empty(1, 3, height, width)
        with torch.inference_mode():
            found = self._found(self._luma, offsets, clock, check)  # (1, 1, *wide), px of the network
            check()
            wide, disparity, inside = found.shape[2:], span.disparity(found), self._edge - BORDER
            x, y = correction.moves(u, v)
            warped = backward_warp(self._continued, disparity, offsets, (inside + y, inside + x))  # (4, 3, *wide)
            h = colour_features(found, warped.view(1, 12, *wide), torch.tensor([[u, v]]))  # (1, 15, *wide)
            clock.lap("warp")
            for tile in self._tuning.tiles(height, width):
                put(image, tile.window, self._colour(self._colour.tile_input(h, tile), check))
            clock.lap("colour")
            own = disparity[:, :, BORDER:-BORDER, BORDER:-BORDER].contiguous()
        seen = correction.stored(picture(image[0].clamp_(0, 1)), u, v)
        synthesis = LateSynthesis(u, v, self.name, seen, own[0, 0].numpy(), None, clock.timings())
        return synthesis.with_warped(lambda: correction.stored_of_corners(_warped(corners, own, offsets, (y, x))))

    def _found(self, luma: Tensor, offsets: Tensor, clock: Clock, check: Callable[[], None]) -> Tensor:
        """What the disparity network finds, (1, 1, H + 2 BORDER, W + 2 BORDER): as far as the colour network sees."""
        levels, edge = self.config.levels.moved(self._span.in_small), self._swept_edge
        small = Window(0, luma.shape[2] - 2 * (edge - BORDER), 0, luma.shape[3] - 2 * (edge - BORDER))
        channels = len(self._means) + levels.count
        found = torch.empty(1, 1, *small.shape)
        for tile in self._tuning.tiles(*small.shape):
            check()
            source = tile.source.moved(edge - 2 * BORDER)
            features = self._disparity.empty_input(*source.shape)
            sparse_sweep(luma, offsets, levels, self._means, source, features[:, :channels])
            clock.lap("features")
            put(found, tile.window, self._disparity(features, check))
            clock.lap("disparity")
        return self._as_large(found)

    def _as_large(self, found: Tensor) -> Tensor:
        """A map made smaller, as the span says, as one of the picture's size; both with BORDER px around."""
        scale = self._span.scale
        if scale == 1 or self._corners is None:
            return found
        height, width = self._corners.shape[2:]
        beyond = (scale - 1) * BORDER
        large = made_larger(found, scale)
        return large[:, :, beyond : beyond + height + 2 * BORDER, beyond : beyond + width + 2 * BORDER].contiguous()


def _warped(corners: Tensor, disparity: Tensor, offsets: Tensor, origin: tuple[float, float]) -> FloatArray:
    """The warped inputs as they are shown, 0 where they have no sample: (4, H, W, 3)."""
    with torch.inference_mode():
        return picture(backward_warp(corners, disparity, offsets, origin))
