"""Paths through key frames: a spline through viewpoints set by hand, each with a focus if the path sweeps it, at even speed."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lfcore.errors import InputError
from lfcore.lightfield import check_viewpoint

DoubleArray = npt.NDArray[np.float64]

MAX_FOCUS = 512.0  # px of disparity over the baseline, to either side
_SAMPLES = 128  # of the spline from one key frame to the next


@dataclass(frozen=True)
class Stop:
    """A place on a path: the viewpoint and, where the picture is refocused, the disparity in focus (px over the baseline)."""

    u: float
    v: float
    focus: float | None = None


def check_stop(stop: Stop) -> None:
    """Raise InputError unless viewpoint and focus are finite and within their limits."""
    check_viewpoint(stop.u, stop.v)
    if stop.focus is not None and not abs(stop.focus) <= MAX_FOCUS:  # as it stands, NaN is caught too
        raise InputError(f"The focus is {stop.focus:g}; it must lie from {-MAX_FOCUS:g} to {MAX_FOCUS:g} px of disparity.")


def through(keys: Sequence[Stop], frames: int, closed: bool) -> list[Stop]:
    """`frames` stops at even speed along a smooth curve through the key frames, in their order.

    An open path begins at the first and ends at the last key frame; a closed one goes on to the first, which is not repeated at
    the end. The curve is the centripetal Catmull-Rom spline (Barry and Goldman 1988; Yuksel et al. 2011), which has neither
    cusps nor loops between two key frames. It leaves the square of the corner views no farther than the key frames do. Speed
    is that in (u, v) and focus together, the whole range of focus counting as one baseline. Raises InputError where some key
    frames have a focus and others none, where one is out of range, or where there is none.
    """
    if not keys:
        raise InputError("The path has no key frame; set at least one.")
    for key in keys:
        check_stop(key)
    focused = [key.focus is not None for key in keys]
    if any(focused) and not all(focused):
        raise InputError(f"Key frame {focused.index(False) + 1} has no focus, but others have one; give it to all or to none.")
    places = np.array([(key.u, key.v, key.focus or 0.0) for key in keys])  # (K, 3)
    unit = np.array([1.0, 1.0, np.ptp(places[:, 2]) or 1.0])
    curve = spline(places / unit, closed)
    viewpoints = places[:, :2]
    curve[:, :2] = np.clip(curve[:, :2], np.minimum(viewpoints.min(0), 0), np.maximum(viewpoints.max(0), 1))
    return [
        Stop(float(u), float(v), float(focus) if focused[0] else None) for u, v, focus in walk(curve, frames, closed) * unit
    ]


def spline(points: DoubleArray, closed: bool) -> DoubleArray:
    """A dense polyline (N, D) along the centripetal Catmull-Rom spline through points (K, D); a closed one ends where it
    began. Points that repeat the one before are passed over."""
    kept = [points[0], *(b for a, b in itertools.pairwise(points) if not np.array_equal(a, b))]
    if closed and len(kept) > 1 and not np.array_equal(kept[0], kept[-1]):
        kept.append(kept[0])
    if len(kept) < 2:
        return np.array(kept)
    if np.array_equal(kept[0], kept[-1]):
        before, after = kept[-2], kept[1]
    else:
        before, after = 2 * kept[0] - kept[1], 2 * kept[-1] - kept[-2]
    knots = [before, *kept, after]
    pieces = [_piece(*knots[first : first + 4]) for first in range(len(kept) - 1)]
    return np.concatenate([*pieces, [kept[-1]]])


def _piece(p0: DoubleArray, p1: DoubleArray, p2: DoubleArray, p3: DoubleArray) -> DoubleArray:
    """The curve from p1 to p2, without p2: (_SAMPLES, D), by Barry and Goldman's pyramid of linear interpolations."""
    gaps = [math.sqrt(float(np.linalg.norm(b - a))) for a, b in ((p0, p1), (p1, p2), (p2, p3))]
    t0, t1, t2, t3 = np.concatenate([[0.0], np.cumsum(gaps)])
    t = np.linspace(t1, t2, _SAMPLES, endpoint=False)[:, None]

    def between(a: DoubleArray, b: DoubleArray, start: float, end: float) -> DoubleArray:
        blend: DoubleArray = ((end - t) * a + (t - start) * b) / (end - start)
        return blend

    a1, a2, a3 = between(p0, p1, t0, t1), between(p1, p2, t1, t2), between(p2, p3, t2, t3)
    return between(between(a1, a2, t0, t2), between(a2, a3, t1, t3), t1, t2)


def walk(polyline: DoubleArray, frames: int, closed: bool) -> DoubleArray:
    """`frames` points (frames, D) evenly along the polyline (N, D); the last point of a closed one is left out."""
    lengths = np.linalg.norm(np.diff(polyline, axis=0), axis=1)
    travelled = np.concatenate([[0.0], np.cumsum(lengths)])
    stops = np.linspace(0, travelled[-1], frames, endpoint=not closed)
    return np.stack([np.interp(stops, travelled, along) for along in polyline.T], axis=1)
