"""Synthesis with the paper's two networks, in tiles and in the number type that suit this machine (lfcore.tuning)."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import torch
import torch.nn.functional as F
from torch import Tensor

from lfcore.allocator import keep_freed_memory
from lfcore.errors import InputError
from lfcore.fewer_means import kept_levels, with_fewer_means
from lfcore.lightfield import LightField, check_viewpoint
from lfcore.networks import BORDER, FullModel, colour_features, sweep_luminance
from lfcore.planesweep import Window, sparse_sweep
from lfcore.synthesis import LateSynthesis
from lfcore.synthesizer import Clock, Synthesis, check_cancelled, corner_offsets, corner_tensor, never, picture, put
from lfcore.tuned_stack import TunedStack, Tuning
from lfcore.tuning import machine_tuning
from lfcore.warp import backward_warp

# How far beyond the edge the edge is continued, px: more than 21 px of disparity need at a viewpoint 0.25 outside.
FARTHEST_SAMPLE = 64


class NetworkSynthesizer:
    """See lfcore.synthesizer.Synthesizer. The whole picture comes out: each network's input is continued by its mirror image.

    The mirrored border is only seen by pixels less than 12 px from the edge; inside, the result is that of
    `reference_synthesis`. Memory while it works: about 600 bytes a pixel of the picture, and for the tile in work
    110 MB, by Fourier transforms 160 to 180 MB with their weights; in float32 twice that.
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
        self._luma: Tensor | None = None  # (4, 1, H, W)
        keep_freed_memory()

    @property
    def dtype(self) -> torch.dtype:
        """The number type of the convolutions."""
        return self._tuning.dtype

    def set_light_field(self, light_field: LightField) -> None:
        """See Synthesizer."""
        self._corners = corner_tensor(light_field)
        self._luma = sweep_luminance(self._corners, self.config).unsqueeze(1)

    def synthesize(self, u: float, v: float, cancelled: Callable[[], bool] = never) -> Synthesis:
        if self._corners is None or self._luma is None:
            raise InputError("No light field is set; call set_light_field first.")
        check_viewpoint(u, v)
        corners, luma, levels = self._corners, self._luma, self.config.levels
        _, _, height, width = corners.shape
        offsets = corner_offsets(u, v)
        channels = len(self._means) + levels.count
        clock, check = Clock(), partial(check_cancelled, cancelled)
        disparity = torch.empty(1, 1, height, width)
        image = torch.empty(1, 3, height, width)
        with torch.inference_mode():
            for tile in self._tuning.tiles(height, width):
                check()
                features = self._disparity.empty_input(*tile.shape)
                sparse_sweep(luma, offsets, levels, self._means, tile.source, tile.inner(features)[:, :channels])
                tile.mirror(features)
                clock.lap("features")
                put(disparity, tile.window, self._disparity(features, check))
                clock.lap("disparity")
            check()
            warped = backward_warp(corners, disparity, offsets)  # (4, 3, H, W)
            continued = _continued_at_edges(corners, disparity, offsets, warped).view(1, 12, height, width)
            h = colour_features(disparity, continued, torch.tensor([[u, v]]))  # (1, 15, H, W)
            clock.lap("warp")
            for tile in self._tuning.tiles(height, width):
                put(image, tile.window, self._colour(self._colour.tile_input(h, tile), check))
            clock.lap("colour")
        seen = picture(image[0].clamp_(0, 1))
        synthesis = LateSynthesis(u, v, self.name, seen, disparity[0, 0].numpy(), None, clock.timings())
        return synthesis.with_warped(lambda: picture(warped))


def _continued_at_edges(corners: Tensor, disparity: Tensor, offsets: Tensor, warped: Tensor) -> Tensor:
    """The warped inputs (4, 3, H, W) with, in the outermost BORDER pixels, the edge of an input where it had no sample.

    There the colour network would see the black of "outside" and leave a dark fringe. Its output 2 BORDER px from the edge
    and further in does not depend on these pixels.
    """
    height, width = warped.shape[-2:]
    reach = min(math.ceil(float(disparity.abs().max()) * float(offsets.abs().max())) + 3, FARTHEST_SAMPLE)
    padded = F.pad(corners, (reach,) * 4, mode="replicate")
    result = warped.clone()
    for window in (
        Window(0, BORDER, 0, width),
        Window(height - BORDER, height, 0, width),
        Window(0, height, 0, BORDER),
        Window(0, height, width - BORDER, width),
    ):
        rows, columns = slice(window.top, window.bottom), slice(window.left, window.right)
        # As much of the padded inputs as the window's samples can reach.
        near = padded[..., window.top : window.bottom + 2 * reach, window.left : window.right + 2 * reach]
        result[..., rows, columns] = backward_warp(near, disparity[..., rows, columns], offsets, (reach, reach))
    return result
