"""Synthesis with the paper's two networks, in tiles and in the number type that suit this machine (lfcore.tuning)."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import torch
from torch import Tensor

from lfcore.allocator import keep_freed_memory
from lfcore.errors import InputError
from lfcore.fewer_means import kept_levels, with_fewer_means
from lfcore.lightfield import FloatArray, LightField, check_viewpoint
from lfcore.networks import BORDER, FullModel, colour_features, sweep_luminance
from lfcore.planesweep import sparse_sweep
from lfcore.synthesis import LateSynthesis
from lfcore.synthesizer import (
    Clock,
    Synthesis,
    check_cancelled,
    continued,
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
# borders of both networks.
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
        self._corners: Tensor | None = None  # (4, 3, H, W)
        self._continued: Tensor | None = None  # (4, 3, H + 2 REACH, W + 2 REACH)
        self._luma: Tensor | None = None  # (4, 1, the same), what is swept
        keep_freed_memory()

    @property
    def dtype(self) -> torch.dtype:
        """The number type of the convolutions."""
        return self._tuning.dtype

    def set_light_field(self, light_field: LightField) -> None:
        """See Synthesizer."""
        self._corners = corner_tensor(light_field)
        self._continued = continued(self._corners, REACH)
        self._luma = sweep_luminance(self._continued, self.config).unsqueeze(1)

    def synthesize(self, u: float, v: float, cancelled: Callable[[], bool] = never) -> Synthesis:
        if self._corners is None or self._continued is None or self._luma is None:
            raise InputError("No light field is set; call set_light_field first.")
        check_viewpoint(u, v)
        corners, luma, levels = self._corners, self._luma, self.config.levels
        height, width = corners.shape[2:]
        wide = height + 2 * BORDER, width + 2 * BORDER  # what the colour network sees
        offsets = corner_offsets(u, v)
        channels = len(self._means) + levels.count
        clock, check = Clock(), partial(check_cancelled, cancelled)
        disparity = torch.empty(1, 1, *wide)
        image = torch.empty(1, 3, height, width)
        with torch.inference_mode():
            for tile in self._tuning.tiles(*wide):
                check()
                source = tile.source.moved(REACH - 2 * BORDER)
                features = self._disparity.empty_input(*source.shape)
                sparse_sweep(luma, offsets, levels, self._means, source, features[:, :channels])
                clock.lap("features")
                put(disparity, tile.window, self._disparity(features, check))
                clock.lap("disparity")
            check()
            warped = backward_warp(self._continued, disparity, offsets, (REACH - BORDER, REACH - BORDER))  # (4, 3, *wide)
            h = colour_features(disparity, warped.view(1, 12, *wide), torch.tensor([[u, v]]))  # (1, 15, *wide)
            clock.lap("warp")
            for tile in self._tuning.tiles(height, width):
                put(image, tile.window, self._colour(self._colour.tile_input(h, tile), check))
            clock.lap("colour")
            own = disparity[:, :, BORDER:-BORDER, BORDER:-BORDER].contiguous()
        seen = picture(image[0].clamp_(0, 1))
        synthesis = LateSynthesis(u, v, self.name, seen, own[0, 0].numpy(), None, clock.timings())
        return synthesis.with_warped(lambda: _warped(corners, own, offsets))


def _warped(corners: Tensor, disparity: Tensor, offsets: Tensor) -> FloatArray:
    """The warped inputs as they are shown, 0 where they have no sample: (4, H, W, 3)."""
    with torch.inference_mode():
        return picture(backward_warp(corners, disparity, offsets))
