"""Synthesis of novel views: expensive once per light field, cheap many times.

`reference_synthesis` is the paper in float32, written to be read next to it. `NetworkSynthesizer` computes the same in tiles
and in the number type that is fastest on this machine; `MeanSynthesizer` is the plain average that all are measured against.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Protocol

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor

from lfcore.allocator import keep_freed_memory
from lfcore.errors import Cancelled, InputError
from lfcore.lightfield import CORNERS, FloatArray, LightField, check_viewpoint
from lfcore.models import Model
from lfcore.networks import BORDER, FullModel, PaperStack, SingleModel, colour_features, sweep_luminance
from lfcore.planesweep import Window, plane_sweep
from lfcore.warp import backward_warp, source_offset

# Features of one tile take (2 L) values a pixel: 200 x 288 px in bfloat16 are 23 MB.
TILE = (200, 288)

# How far beyond the edge the edge is continued, px: more than 21 px of disparity need at a viewpoint 0.25 outside.
FARTHEST_SAMPLE = 64


@dataclass(frozen=True)
class Synthesis:
    """All that one query yields. Arrays are float32; disparity in px over the full corner-to-corner baseline."""

    u: float
    v: float
    model: str
    image: FloatArray  # (H, W, 3), 0 to 1
    disparity: FloatArray | None  # (H, W); None where the model has none
    warped: FloatArray | None  # (4, H, W, 3) in the order of CORNERS
    timings: Mapping[str, float]  # seconds by stage: features, disparity, warp, colour, total


def never() -> bool:
    """Is not cancelled."""
    return False


class Synthesizer(Protocol):
    """What the viewer, the command line and the evaluation ask of a model."""

    @property
    def name(self) -> str:
        """The model's name, for people."""

    @property
    def key(self) -> str:
        """Hex digest of model and weights, for caches."""

    def set_light_field(self, light_field: LightField) -> None:
        """Take over the corner views; what does not depend on (u, v) is computed here."""

    def synthesize(self, u: float, v: float, cancelled: Callable[[], bool] = never) -> Synthesis:
        """The view at (u, v). Raises InputError outside the allowed range, Cancelled once `cancelled()` holds."""


def corner_tensor(light_field: LightField) -> Tensor:
    """The corner views as (4, 3, H, W) float32: the one crossing from numpy to torch."""
    return torch.from_numpy(light_field.corners()).permute(0, 3, 1, 2).contiguous()


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
        warped = backward_warp(corners, disparity.expand(4, -1, -1, -1), offsets, (BORDER, BORDER))
        # Eq. 6: L_q = g_c(H) with H = {warped inputs, D_q, q}.
        h = colour_features(disparity, warped.reshape(1, 12, *warped.shape[2:]), torch.tensor([[u, v]]))
        image = model.colour(h)  # (1, 3, H - 24, W - 24)
    return image[0], disparity[0, 0], warped


class NetworkSynthesizer:
    """The paper's two networks in tiles. The whole picture comes out: each network's input is continued by its mirror image.

    The mirrored border is only seen by pixels less than 12 px from the edge; inside, the result is that of the reference.
    Memory: the corner views and the results in float32, and one tile's features and activations (about 100 MB).
    """

    def __init__(
        self,
        model: FullModel,
        key: str,
        dtype: torch.dtype | None = None,
        tile: tuple[int, int] = TILE,
    ) -> None:
        self.name = model.config.name
        self.key = key
        self._model = model.eval()
        self._dtype = dtype or fastest_dtype()
        self._tile = tile
        self._corners: Tensor | None = None  # (4, 3, H, W)
        self._luma: Tensor | None = None  # (4, 1, H, W)
        for stack in (model.disparity, model.colour):
            stack.hidden.to(dtype=self._dtype, memory_format=torch.channels_last)  # type: ignore[call-overload]
        keep_freed_memory()

    @property
    def dtype(self) -> torch.dtype:
        """The number type of the convolutions."""
        return self._dtype

    def set_light_field(self, light_field: LightField) -> None:
        """See Synthesizer."""
        self._corners = corner_tensor(light_field)
        self._luma = sweep_luminance(self._corners, self._model.config).unsqueeze(1)

    def synthesize(self, u: float, v: float, cancelled: Callable[[], bool] = never) -> Synthesis:
        if self._corners is None or self._luma is None:
            raise InputError("No light field is set; call set_light_field first.")
        check_viewpoint(u, v)
        corners, luma = self._corners, self._luma
        _, _, height, width = corners.shape
        offsets = corner_offsets(u, v)
        clock = Clock()
        disparity = torch.empty(1, 1, height, width)
        image = torch.empty(1, 3, height, width)
        with torch.inference_mode():
            for tile, source in tiles(height, width, self._tile):
                check_cancelled(cancelled)
                h, w = source.shape
                features = torch.empty(1, 2 * self._model.config.levels.count, h, w, dtype=self._dtype)
                plane_sweep(luma, offsets, self._model.config.levels, source, features)
                clock.lap("features")
                check_cancelled(cancelled)
                put(disparity, tile, apply_stack(self._model.disparity, features, tile, source))
                clock.lap("disparity")
            check_cancelled(cancelled)
            warped = backward_warp(corners, disparity.expand(4, -1, -1, -1), offsets)  # (4, 3, H, W)
            continued = _continued_at_edges(corners, disparity, offsets, warped)
            h_features = colour_features(disparity, continued.reshape(1, 12, height, width), torch.tensor([[u, v]]))
            clock.lap("warp")
            for tile, source in tiles(height, width, self._tile):
                check_cancelled(cancelled)
                piece = h_features[:, :, source.top : source.bottom, source.left : source.right].to(self._dtype)
                put(image, tile, apply_stack(self._model.colour, piece, tile, source))
            clock.lap("colour")
        return Synthesis(
            u, v, self.name, picture(image[0].clamp_(0, 1)), disparity[0, 0].numpy(), picture(warped), clock.timings()
        )


def apply_stack(stack: PaperStack, piece: Tensor, tile: Window, source: Window) -> Tensor:
    """A stack's output over `tile`, from its input over `source`, mirrored where the picture ends."""
    padding = (
        BORDER - (tile.left - source.left),
        BORDER - (source.right - tile.right),
        BORDER - (tile.top - source.top),
        BORDER - (source.bottom - tile.bottom),
    )
    if any(padding):
        piece = F.pad(piece, padding, mode="reflect")
    result: Tensor = stack(piece.contiguous(memory_format=torch.channels_last))
    return result


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
        piece = disparity[..., rows, columns].expand(4, -1, -1, -1)
        result[..., rows, columns] = backward_warp(near, piece, offsets, (reach, reach))
    return result


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
        image = self._corners.mean(0)
        return Synthesis(u, v, self.name, image, None, None, {"total": time.perf_counter() - start})


MODEL_NAMES = ("full", "mean", "planesweep")


def make_synthesizer(model: str | Path = "full") -> Synthesizer:
    """The synthesizer of a shipped model (one of MODEL_NAMES) or of a weight file.

    Raises InputError for an unknown name, WeightsError for a damaged or foreign file.
    """
    from assets import weights_path
    from lfcore.weights import load_weights

    if model == "mean":
        return MeanSynthesizer()
    if model == "planesweep":
        from lfcore.classical import PlaneSweepSynthesizer

        return PlaneSweepSynthesizer()
    if isinstance(model, str) and model in MODEL_NAMES:
        path = weights_path(model)
    elif str(model).endswith(".safetensors"):
        path = Path(model)
    else:
        raise InputError(
            f"Unknown model {str(model)!r}: choose one of {', '.join(MODEL_NAMES)}, or the path of a .safetensors file."
        )
    weights = load_weights(path)
    return synthesizer_of(weights.model, weights.digest)


def synthesizer_of(model: Model, key: str) -> Synthesizer:
    """The synthesizer that runs a model; `key` names its weights in caches."""
    from lfcore.compact_synthesizer import CompactSynthesizer
    from lfcore.single_synthesizer import SingleSynthesizer

    if isinstance(model, FullModel):
        return NetworkSynthesizer(model, key)
    if isinstance(model, SingleModel):
        return SingleSynthesizer(model, key)
    return CompactSynthesizer(model, key)


def tiles(height: int, width: int, tile: tuple[int, int]) -> Iterator[tuple[Window, Window]]:
    """Cover the picture with tiles of about equal size, each with the window its networks read: BORDER more on each side,
    as far as the picture goes."""
    for top, bottom in _spans(height, tile[0]):
        for left, right in _spans(width, tile[1]):
            yield (
                Window(top, bottom, left, right),
                Window(
                    max(top - BORDER, 0),
                    min(bottom + BORDER, height),
                    max(left - BORDER, 0),
                    min(right + BORDER, width),
                ),
            )


def _spans(size: int, most: int) -> list[tuple[int, int]]:
    count = -(-size // most)
    edges = [size * k // count for k in range(count + 1)]
    return list(pairwise(edges))


@cache
def fastest_dtype() -> torch.dtype:
    """bfloat16 where a convolution gains from it on this machine, else float32: measured once per process, in about 0.1 s."""
    timers = {dtype: _convolution_timer(dtype) for dtype in (torch.float32, torch.bfloat16)}
    seconds = dict.fromkeys(timers, float("inf"))
    for _ in range(8):  # in turn, and the best of each, so that a busy moment of the machine does not decide
        for dtype, timer in timers.items():
            seconds[dtype] = min(seconds[dtype], timer())
    # Less than a fifth gained is not worth the lost digits.
    return torch.bfloat16 if seconds[torch.bfloat16] < 0.8 * seconds[torch.float32] else torch.float32


def _convolution_timer(dtype: torch.dtype) -> Callable[[], float]:
    layer = torch.nn.Conv2d(64, 64, 5).to(dtype=dtype, memory_format=torch.channels_last)  # type: ignore[call-overload]
    x = torch.zeros(1, 64, 68, 68, dtype=dtype).contiguous(memory_format=torch.channels_last)

    def timer() -> float:
        with torch.inference_mode():
            start = time.perf_counter()
            layer(x)
            return time.perf_counter() - start

    return timer


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
