"""Synthesis of novel views: expensive once per light field, cheap many times.

`reference_synthesis` is the paper in float32, written to be read next to it; lfcore.network_synthesizer computes the same
faster. `MeanSynthesizer` is the plain average that all are measured against.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor

from lfcore.errors import Cancelled, InputError
from lfcore.lightfield import CORNERS, FloatArray, LightField, check_viewpoint
from lfcore.models import Model
from lfcore.nearest_inputs import NEIGHBOURS, NearestInputs
from lfcore.networks import BORDER, FullModel, SingleModel, colour_features, sweep_luminance
from lfcore.planesweep import Window, plane_sweep
from lfcore.synthesis import Synthesis, Synthesizer, never
from lfcore.warp import backward_warp, source_offset


def corner_tensor(light_field: LightField) -> Tensor:
    """The corner views as (4, 3, H, W) float32: the one crossing from numpy to torch."""
    return torch.from_numpy(light_field.corners()).permute(0, 3, 1, 2).contiguous()


def continued(pictures: Tensor, by: int, alignment: int = 1) -> Tensor:
    """(N, C, H, W) with their edges repeated for so many px beyond them, and below and on the right to whole blocks."""
    height, width = pictures.shape[2:]
    return F.pad(pictures, (by, by + -width % alignment, by, by + -height % alignment), mode="replicate")


def corner_offsets(u: float, v: float) -> Tensor:
    """p_i - q of the four corners and the viewpoint (u, v): (4, 2), ordered (u, v)."""
    return source_offset(torch.tensor(CORNERS), torch.tensor((u, v)))


def reference_synthesis(model: FullModel, corners: Tensor, u: float, v: float) -> tuple[Tensor, Tensor, Tensor]:
    """The paper, Section 3, step by step in float32 and in one piece. Slow; the rest of this module is measured against it.

    corners: (4, 3, H, W). Returns image (3, H - 24, W - 24), disparity (H - 12, W - 12) and warped inputs
    (4, 3, H - 12, W - 12): what comes out without any padding.
    """
    _, _, height, width = corners.shape
    offsets = corner_offsets(u, v)  # p_i - q
    whole = Window(0, height, 0, width)
    with torch.no_grad():
        # Eqs. 4 and 5: the features K.
        luma = sweep_luminance(corners, model.config).unsqueeze(1)  # (4, 1, H, W)
        features = plane_sweep(luma, offsets, model.config.levels, whole)  # (1, 2 L, H, W)
        # Eq. 2: D_q = g_d(K).
        disparity = model.disparity(features)  # (1, 1, H - 12, W - 12)
        # Eq. 3: the inputs, warped by D_q.
        warped = backward_warp(corners, disparity, offsets, (BORDER, BORDER))
        # Eq. 6: L_q = g_c(H) with H = {warped inputs, D_q, q}.
        h = colour_features(disparity, warped.reshape(1, 12, *warped.shape[2:]), torch.tensor([[u, v]]))
        image = model.colour(h)  # (1, 3, H - 24, W - 24)
    return image[0], disparity[0, 0], warped


class MeanSynthesizer:
    """The plain average of the four corners: what any real synthesis has to beat."""

    name = "mean"
    key = "mean"

    def __init__(self) -> None:
        self._corners: FloatArray | None = None

    def set_light_field(self, light_field: LightField) -> None:
        self._corners = light_field.corners()

    def synthesize(self, u: float, v: float, cancelled: Callable[[], bool] = never) -> Synthesis:
        if self._corners is None:
            raise InputError("No light field is set; call set_light_field first.")
        check_viewpoint(u, v)
        check_cancelled(cancelled)
        start = time.perf_counter()
        image = np.clip(self._corners.mean(0), 0, 1)
        return Synthesis(u, v, self.name, image, None, None, {"total": time.perf_counter() - start})


MODEL_NAMES = ("full", "realtime", "single", "planesweep", "mean")  # by the four corners; NEIGHBOURS has other inputs


def make_synthesizer(model: str | Path = "full") -> Synthesizer:
    """The synthesizer of a shipped model (one of MODEL_NAMES, or NEIGHBOURS) or of a weight file.

    Raises InputError for an unknown name, WeightsError for a damaged or foreign file.
    """
    from assets import weights_path
    from lfcore.weights import load_weights

    if model == "mean":
        return MeanSynthesizer()
    if model == NEIGHBOURS:
        return NearestInputs(make_synthesizer("realtime"))
    if model == "planesweep":
        from lfcore.classical import PlaneSweepSynthesizer

        return PlaneSweepSynthesizer()
    if isinstance(model, str) and model in MODEL_NAMES:
        path = weights_path(model)
    elif str(model).endswith(".safetensors"):
        path = Path(model)
    else:
        raise InputError(
            f"Unknown model {str(model)!r}: choose one of {', '.join((*MODEL_NAMES, NEIGHBOURS))}, or the path of a "
            ".safetensors file."
        )
    weights = load_weights(path)
    return synthesizer_of(weights.model, weights.digest)


def synthesizer_of(model: Model, key: str) -> Synthesizer:
    """The synthesizer that runs a model; `key` names its weights in caches."""
    from lfcore.compact_synthesizer import CompactSynthesizer
    from lfcore.network_synthesizer import NetworkSynthesizer
    from lfcore.single_synthesizer import SingleSynthesizer

    if isinstance(model, FullModel):
        return NetworkSynthesizer(model, key)
    if isinstance(model, SingleModel):
        return SingleSynthesizer(model, key)
    return CompactSynthesizer(model, key)


class Clock:
    """Adds up the seconds between laps by stage."""

    def __init__(self) -> None:
        self._start = self._last = time.perf_counter()
        self._seconds: dict[str, float] = {}

    def lap(self, stage: str) -> None:
        now = time.perf_counter()
        self._seconds[stage] = self._seconds.get(stage, 0.0) + now - self._last
        self._last = now

    def timings(self) -> dict[str, float]:
        return {**self._seconds, "total": time.perf_counter() - self._start}


def check_cancelled(cancelled: Callable[[], bool]) -> None:
    """Raise Cancelled once `cancelled()` holds."""
    if cancelled():
        raise Cancelled


def put(target: Tensor, tile: Window, values: Tensor) -> None:
    """Write the values of a tile (N, C, h, w) into a picture (N, C, H, W)."""
    target[:, :, tile.top : tile.bottom, tile.left : tile.right] = values


def picture(channels_first: Tensor) -> FloatArray:
    """(..., 3, H, W) tensor -> (..., H, W, 3) array: the one crossing from torch to numpy."""
    return np.ascontiguousarray(channels_first.movedim(-3, -1).numpy())
