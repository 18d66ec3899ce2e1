"""Pictures for the report: crops of one scene where the models differ most near occlusions, each as PNG bytes.

The crops are cut while the scene's pictures are at hand and only they are kept, so that a report of many scenes stays small.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from lfcore import colormaps
from lfcore.evaluation import SceneResult
from lfcore.export import write_picture
from lfcore.lightfield import FloatArray
from lfcore.metrics import K16_CROP, absolute_error, squared_error, to_uint8

CROP_SIDE = 96  # px
CROPS = 3  # per scene at most
_EDGE_REACH = 5  # px around a jump of disparity that count as its neighbourhood
_EDGE_JUMP = 0.5  # px over the full baseline, from one pixel to the next
_DARK_MEAN = 0.25  # below, pictures are brightened for looking

BoolArray = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Crop:
    """One crop of a scene: its place, and by model the synthesis, its error and its disparity (None where it has none)."""

    top: int
    left: int
    side: int
    truth: bytes  # PNG, as all pictures here
    synthesis: Mapping[str, bytes]
    error: Mapping[str, bytes]
    disparity: Mapping[str, bytes | None]
    rms: Mapping[str, float]  # root of the mean squared error in the crop, steps of 8 bits


@dataclass(frozen=True)
class ScenePanels:
    """What the report shows of one scene."""

    name: str
    view: tuple[int, int]  # (row, column), from 0
    grid: tuple[int, int]
    size: tuple[int, int]  # (width, height) of a view
    brightened: bool  # whether the pictures (not the errors) are brightened for looking
    overview: bytes
    crops: tuple[Crop, ...]
    near_occlusions: bool  # whether the crops were looked for near jumps of disparity
    error_scale: float  # the error that is shown as white, steps of 8 bits
    disparity_scale: tuple[float, float] | None  # px over the full baseline that the colours' ends stand for


def scene_panels(results: Mapping[str, SceneResult]) -> ScenePanels:
    """Choose and cut the crops of one scene from all models' results."""
    first = next(iter(results.values()))
    truth = first.truth
    reference = _reference_disparity(results)
    edges = None if reference is None else _near_jumps(reference)
    if edges is not None and not edges.any():
        edges = None
    errors = {label: absolute_error(result.synthesis.image, truth) for label, result in results.items()}
    squares = {label: squared_error(result.synthesis.image, truth) for label, result in results.items()}
    places = _worst_places(_error_to_show(results, squares), edges)
    scale = _error_scale([errors[label] for label in _knowing_depth(results)])
    disparity_scale = None if reference is None else _outermost(reference)
    gain = _brightening(truth)
    side = min(CROP_SIDE, *truth.shape[:2])
    crops = []
    for top, left in places:
        window = (slice(top, top + side), slice(left, left + side))
        crops.append(
            Crop(
                top,
                left,
                side,
                _png(_shown(truth[window], gain)),
                {label: _png(_shown(result.synthesis.image[window], gain)) for label, result in results.items()},
                {label: _png(_error_picture(error[window], scale)) for label, error in errors.items()},
                {
                    label: _disparity_png(result.synthesis.disparity, window, disparity_scale)
                    for label, result in results.items()
                },
                {label: 255 * float(np.sqrt(square[window].mean())) for label, square in squares.items()},
            )
        )
    return ScenePanels(
        first.score.name,
        first.view,
        first.score.grid,
        (truth.shape[1], truth.shape[0]),
        gain is not None,
        _png(_shown(truth, gain)),
        tuple(crops),
        edges is not None,
        scale,
        disparity_scale,
    )


def _reference_disparity(results: Mapping[str, SceneResult]) -> FloatArray | None:
    """The disparity of the best model that has one."""
    with_disparity = [result for result in results.values() if result.synthesis.disparity is not None]
    return max(with_disparity, key=lambda result: result.score.psnr).synthesis.disparity if with_disparity else None


def _error_to_show(results: Mapping[str, SceneResult], squares: Mapping[str, FloatArray]) -> FloatArray:
    """Mean squared error over the models that know depth, so that a plain average does not decide what is looked at."""
    mean: FloatArray = np.mean(np.stack([squares[label] for label in _knowing_depth(results)]), axis=0)
    return mean


def _knowing_depth(results: Mapping[str, SceneResult]) -> list[str]:
    """The models that have a disparity, or all where none has."""
    return [label for label, result in results.items() if result.synthesis.disparity is not None] or list(results)


def _error_scale(errors: list[FloatArray]) -> float:
    """The error to show as white, in steps of 8 bits: one that five in a thousand pixels exceed, a multiple of 8."""
    return max(8.0, math.ceil(255 * max(float(np.percentile(error, 99.5)) for error in errors) / 8) * 8.0)


def _near_jumps(disparity: FloatArray) -> BoolArray:
    """Within reach of a place where disparity jumps, which is where something hides something: bool (H, W)."""
    jumps = np.zeros(disparity.shape, bool)
    jumps[:, 1:] |= np.abs(np.diff(disparity, axis=1)) > _EDGE_JUMP
    jumps[1:] |= np.abs(np.diff(disparity, axis=0)) > _EDGE_JUMP
    side = 2 * _EDGE_REACH + 1
    for axis in (0, 1):
        pad = [(_EDGE_REACH, _EDGE_REACH) if a == axis else (0, 0) for a in (0, 1)]
        jumps = np.asarray(np.lib.stride_tricks.sliding_window_view(np.pad(jumps, pad), side, axis=axis).any(-1))
    return jumps


def _worst_places(error: FloatArray, edges: BoolArray | None) -> list[tuple[int, int]]:
    """(top, left) of up to CROPS windows that do not overlap, with the most error (near edges) in them, worst first.

    They lie within the scoring protocols' crop where the view is large enough for that.
    """
    height, width = error.shape
    side = min(CROP_SIDE, height, width)
    counted = np.where(edges, error, 0) if edges is not None else error
    totals = _window_sums(counted, side)
    # What lies in the inner half counts twice, so that the worst is in the middle of its crop.
    quarter = side // 4
    inner = _window_sums(counted, side - 2 * quarter)
    totals += inner[quarter : quarter + totals.shape[0], quarter : quarter + totals.shape[1]]
    if min(totals.shape) > 2 * K16_CROP:
        totals[:K16_CROP] = totals[-K16_CROP:] = -1
        totals[:, :K16_CROP] = totals[:, -K16_CROP:] = -1
    places: list[tuple[int, int]] = []
    for _ in range(CROPS):
        top, left = (int(value) for value in np.unravel_index(int(totals.argmax()), totals.shape))
        if totals[top, left] < 0 or (places and totals[top, left] == 0):
            break
        places.append((top, left))
        totals[max(top - side + 1, 0) : top + side, max(left - side + 1, 0) : left + side] = -1
    return places


def _window_sums(values: FloatArray, side: int) -> npt.NDArray[np.float64]:
    """Sums over the windows of that side, by their top left pixels."""
    sums = np.zeros((values.shape[0] + 1, values.shape[1] + 1))
    sums[1:, 1:] = values.astype(np.float64).cumsum(0).cumsum(1)
    totals: npt.NDArray[np.float64] = sums[side:, side:] - sums[:-side, side:] - sums[side:, :-side] + sums[:-side, :-side]
    return totals


def _outermost(disparity: FloatArray) -> tuple[float, float]:
    low, high = np.percentile(disparity, (1, 99)).tolist()
    return low, max(high, low + 0.1)


def _brightening(truth: FloatArray) -> float | None:
    """What is divided by before a root is taken, or None for pictures that are bright as they are."""
    return None if float(truth.mean()) > _DARK_MEAN else max(float(np.percentile(truth, 99.5)), 1 / 255)


def _shown(image: FloatArray, brightest: float | None) -> npt.NDArray[np.uint8]:
    """For looking: dark linear captures are divided by their brightest tone and raised to 1 / 1.5 (the paper's display)."""
    return to_uint8(image if brightest is None else np.clip(image / brightest, 0, 1) ** np.float32(1 / 1.5))


def _error_picture(error: FloatArray, scale: float) -> npt.NDArray[np.uint8]:
    return colormaps.apply(colormaps.error_colours(), error, 0, scale / 255)


def _disparity_png(
    disparity: FloatArray | None, window: tuple[slice, slice], scale: tuple[float, float] | None
) -> bytes | None:
    if disparity is None or scale is None:
        return None
    return _png(colormaps.apply(colormaps.disparity_colours(), disparity[window], *scale))


def _png(picture: npt.NDArray[np.uint8]) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "picture.png"
        write_picture(path, picture)
        return path.read_bytes()
