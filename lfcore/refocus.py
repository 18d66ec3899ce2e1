"""Refocusing by shift and sum: the picture of a wide aperture, sharp at the disparity in focus, as a mean of views."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import numpy.typing as npt

from lfcore.lightfield import FloatArray

_CUBIC_A = -0.5  # Keys' cubic, as in lfcore.warp
_ENOUGH_VIEWS = 5  # a side: fewer than these leave ghosts when they are summed up
_GHOST = 3.0  # px: neighbouring views this far apart out of focus are seen singly


def refocus(
    views: Iterable[tuple[tuple[float, float], FloatArray, float]], viewpoint: tuple[float, float], disparity: float
) -> FloatArray:
    """The weighted mean over views i of view_i(s + (p_i - q) D): the backward warp of lfcore.warp by one disparity D.

    views: (position p_i, picture (H, W, 3) float32, weight), taken one by one; views of weight 0 cost nothing. viewpoint: the
    (u, v) from which the result is seen, q. disparity: px over the full baseline. Returns float32 (H, W, 3). A view's edge is
    repeated beyond it. Raises ValueError where no view has a weight.
    """
    total: FloatArray | None = None
    weights = 0.0
    for (u, v), view, weight in views:
        if weight == 0:
            continue
        moved = shifted(view, (u - viewpoint[0]) * disparity, (v - viewpoint[1]) * disparity)
        weights += weight
        if total is None:
            total = moved * np.float32(weight)
        else:
            total += moved * np.float32(weight)
    if total is None:
        raise ValueError("no view has a weight")
    return total / np.float32(weights)


def captured_serve(rows: int, columns: int, span: tuple[float, float]) -> bool:
    """Whether a light field's captured views do for refocusing: there are enough of them, and they lie so close that what is
    out of focus is smooth. `span`: least and greatest disparity of the scene, px over the baseline."""
    fewest = min(rows, columns)
    return fewest >= _ENOUGH_VIEWS and (span[1] - span[0]) / (fewest - 1) <= _GHOST


def aperture_weights(
    positions: npt.NDArray[np.float64], viewpoint: tuple[float, float], diameter: float, spacing: float
) -> npt.NDArray[np.float64]:
    """How far each view lies inside a round aperture around the viewpoint: (N, 2) positions (u, v) -> (N,), 0 to 1.

    diameter and spacing (of neighbouring views) in baselines. The rim is soft over one spacing, so that nothing jumps as the
    aperture moves; at diameter 0 the views around the viewpoint are blended by nearness. Where none lies inside, the nearest
    has weight 1.
    """
    distance = np.hypot(*(positions - np.asarray(viewpoint)).T)
    weights = np.clip((diameter / 2 + spacing - distance) / spacing, 0, 1)
    if not weights.any():
        weights[np.argmin(distance)] = 1.0
    return weights


def shifted(picture: FloatArray, dx: float, dy: float) -> FloatArray:
    """The picture (H, W, C) sampled at (x + dx, y + dy), px: float32 (H, W, C), cubic between pixels, its edge repeated."""
    return _shifted_along(_shifted_along(picture, dx, 1), dy, 0)


def _shifted_along(picture: FloatArray, shift: float, axis: int) -> FloatArray:
    size = picture.shape[axis]
    whole = int(np.floor(shift))
    fraction = shift - whole
    places = np.arange(size) + whole
    if fraction == 0:
        return picture if whole == 0 else np.take(picture, np.clip(places, 0, size - 1), axis)
    # One copy with its edges repeated, of which each tap sees a window.
    source = np.take(picture, np.clip(np.arange(-1, size + 2) + whole, 0, size - 1), axis)
    windows = [source[first : first + size] if axis == 0 else source[:, first : first + size] for first in range(4)]
    result = windows[0] * np.float32(_tap(1 + fraction))
    for window, distance in zip(windows[1:], (fraction, 1 - fraction, 2 - fraction), strict=True):
        result += window * np.float32(_tap(distance))
    return result


def _tap(distance: float) -> float:
    """Keys' cubic kernel at a distance from 0 to 2."""
    a = _CUBIC_A
    if distance <= 1:
        return ((a + 2) * distance - (a + 3)) * distance**2 + 1
    return ((a * distance - 5 * a) * distance + 8 * a) * distance - 4 * a
