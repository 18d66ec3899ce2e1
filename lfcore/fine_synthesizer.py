"""Synthesis with the larger pair of networks (lfcore.fine): whole pictures, no tiles."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from lfcore.allocator import keep_freed_memory
from lfcore.compact_synthesizer import REACH, LateSynthesis, continued, half_luma, half_resolution
from lfcore.errors import InputError
from lfcore.fine import SURFACES, FineModel, FineResult
from lfcore.lightfield import FloatArray, LightField, check_viewpoint
from lfcore.planesweep import Window, luminance, plane_sweep
from lfcore.synthesizer import Clock, Synthesis, check_cancelled, corner_offsets, corner_tensor, never, picture
from lfcore.tone import root_tone, stored_from_root
from lfcore.tuning import machine_tuning
from lfcore.warp import quick_warp


class FineSynthesizer:
    """See lfcore.synthesizer.Synthesizer. Memory: about 1700 bytes a pixel, with what is kept of the corners."""

    def __init__(self, model: FineModel, key: str, dtype: torch.dtype | None = None) -> None:
        self.name = model.config.name
        self.key = key
        self.config = model.config
        self.dtype = dtype or machine_tuning().dtype
        self._model = model.eval().to(memory_format=torch.channels_last)  # type: ignore[call-overload]
        self._size = 0, 0
        self._toned: Tensor | None = None  # (4, 3, H' + 2 REACH, W' + 2 REACH), root tone
        self._luma: Tensor | None = None  # (4, 1, H' + 2 REACH, W' + 2 REACH), root tone of the luminance
        self._half_luma: Tensor | None = None  # (4, 1, H' / 2 + REACH, W' / 2 + REACH)
        keep_freed_memory()

    def set_light_field(self, light_field: LightField) -> None:
        padded = continued(corner_tensor(light_field))
        self._size = light_field.height, light_field.width
        self._toned = root_tone(padded)
        self._luma = root_tone(luminance(padded)).unsqueeze(1)
        self._half_luma = half_luma(padded).unsqueeze(1)

    @property
    def weighs(self) -> bool:
        """See WeighingSynthesizer."""
        return True

    def synthesize(self, u: float, v: float, cancelled: Callable[[], bool] = never) -> Synthesis:
        synthesis, result = self._computed(u, v, cancelled)
        return synthesis.with_warped(lambda: self._picture_of_warped(result.warped))

    def synthesize_weighed(self, u: float, v: float, cancelled: Callable[[], bool] = never) -> Synthesis:
        """See WeighingSynthesizer: an input's share is that of both its warped pictures, which are not put together."""
        synthesis, result = self._computed(u, v, cancelled)
        height, width = self._size
        shares = result.weights[0, :, :height, :width].unflatten(0, (SURFACES, -1)).sum(0)  # (4, H, W)
        return replace(synthesis, weights=(255 * shares).round().to(torch.uint8).contiguous().numpy())

    def _computed(self, u: float, v: float, cancelled: Callable[[], bool]) -> tuple[LateSynthesis, FineResult]:
        """The synthesis without warped inputs, and all that came out of the networks, in whole blocks of pixels."""
        if self._toned is None or self._luma is None or self._half_luma is None:
            raise InputError("No light field is set; call set_light_field first.")
        check_viewpoint(u, v)
        offsets = corner_offsets(u, v)
        h, w = (size // 2 - REACH for size in self._toned.shape[2:])
        window = Window(REACH // 2, REACH // 2 + h, REACH // 2, REACH // 2 + w)
        clock = Clock()

        def passed(stage: str) -> None:
            clock.lap(stage)
            check_cancelled(cancelled)

        with torch.inference_mode():
            check_cancelled(cancelled)
            features = plane_sweep(self._half_luma, offsets, half_resolution(self.config.levels), window)
            passed("features")
            warp = _CornerWarp(self._toned, self._luma, offsets)
            result = self._model(features, warp, torch.tensor([[u, v]]), self._autocast, passed)
            height, width = self._size
            synthesis = LateSynthesis(
                u,
                v,
                self.name,
                picture(result.image[0, :, :height, :width].clamp_(0, 1)),
                result.disparities[0, 0, :height, :width].contiguous().numpy(),
                None,
                clock.timings(),
            )
        return synthesis, result

    def _picture_of_warped(self, warped: Tensor) -> FloatArray:
        """The inputs as the pixel's own disparity warps them, (4, H, W, 3)."""
        height, width = self._size
        with torch.inference_mode():
            inputs = warped[0, :12, :height, :width].reshape(4, 3, height, width)
            return picture(stored_from_root(inputs).clamp_(0, 1))

    def _autocast(self) -> torch.autocast:
        return torch.autocast("cpu", torch.bfloat16, enabled=self.dtype == torch.bfloat16)


@dataclass(frozen=True)
class _CornerWarp:
    """See lfcore.fine.Warp: the corner views, continued by REACH."""

    toned: Tensor  # (4, 3, ., .)
    luma: Tensor  # (4, 1, ., .)
    offsets: Tensor  # (4, 2)

    def pictures(self, disparity: Tensor) -> Tensor:
        """See Warp."""
        return self._warped(self.toned, disparity).flatten(0, 1).unsqueeze(0)

    def luminances(self, disparity: Tensor) -> list[Tensor]:
        """See Warp."""
        return list(self._warped(self.luma, disparity).split(1))

    def _warped(self, images: Tensor, disparity: Tensor) -> Tensor:
        return quick_warp(images, disparity.expand(4, -1, -1, -1), self.offsets, (REACH, REACH))
