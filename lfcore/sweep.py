"""Ways through the viewpoints: equal steps along a path inside the square [0, 1]^2 of the corner views.

All are centred on (0.5, 0.5) and reach `radius` from it along u and v; 0.5 reaches the edge of the square. Closed paths
(circle, horizontal, vertical, spiral) do not repeat their first viewpoint at the end, so that a looped video runs on
evenly; the lawnmower is open.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from lfcore.cache import SynthesisCache, cache_key
from lfcore.errors import InputError
from lfcore.lightfield import LightField
from lfcore.metrics import to_uint8

if TYPE_CHECKING:
    from lfcore.synthesizer import Synthesizer

Viewpoints = list[tuple[float, float]]
DoubleArray = npt.NDArray[np.float64]

MAX_RADIUS = 0.5
MAX_FRAMES = 100_000
_SPIRAL_TURNS = 3
_SPIRAL_SAMPLES = 20_000
_LAWNMOWER_ROWS = 8


def circle(frames: int, radius: float = 0.3) -> Viewpoints:
    """Once round, starting at the right; the default keeps clear of the views at the rim of the aperture."""
    _check(frames, radius)
    angles = 2 * math.pi * np.arange(frames) / frames
    return _viewpoints(np.stack([np.cos(angles), np.sin(angles)], axis=1), radius)


def horizontal(frames: int, radius: float = 0.5) -> Viewpoints:
    """From left to right and back."""
    _check(frames, radius)
    return _viewpoints(_walk(np.array([(-1.0, 0.0), (1.0, 0.0), (-1.0, 0.0)]), frames, closed=True), radius)


def vertical(frames: int, radius: float = 0.5) -> Viewpoints:
    """From top to bottom and back."""
    _check(frames, radius)
    return _viewpoints(_walk(np.array([(0.0, -1.0), (0.0, 1.0), (0.0, -1.0)]), frames, closed=True), radius)


def lawnmower(frames: int, radius: float = 0.5) -> Viewpoints:
    """Row by row from the top left, alternately to the right and to the left, over eight rows."""
    _check(frames, radius)
    corners: list[tuple[float, float]] = []
    for index, v in enumerate(np.linspace(-1, 1, _LAWNMOWER_ROWS)):
        ends = [(-1.0, float(v)), (1.0, float(v))]
        corners += ends if index % 2 == 0 else ends[::-1]
    return _viewpoints(_walk(np.array(corners), frames, closed=False), radius)


def spiral(frames: int, radius: float = 0.5) -> Viewpoints:
    """From the centre outwards in three turns, then inwards in three more."""
    _check(frames, radius)
    time = np.linspace(0, 1, _SPIRAL_SAMPLES + 1)
    distance = 1 - np.abs(2 * time - 1)
    angle = 2 * math.pi * 2 * _SPIRAL_TURNS * time
    points = np.stack([distance * np.cos(angle), distance * np.sin(angle)], axis=1)
    return _viewpoints(_walk(points, frames, closed=True), radius)


PATHS: dict[str, Callable[..., Viewpoints]] = {
    "circle": circle,
    "horizontal": horizontal,
    "vertical": vertical,
    "lawnmower": lawnmower,
    "spiral": spiral,
}


def rendered(
    viewpoints: Iterable[tuple[float, float]], light_field: LightField, synthesizer: Synthesizer, cache: SynthesisCache
) -> Iterator[npt.NDArray[np.uint8]]:
    """The views along a path as 8-bit frames (H, W, 3), made one by one; what was seen before comes from the cache."""
    synthesizer.set_light_field(light_field)
    for u, v in viewpoints:
        key = cache_key(light_field, synthesizer, u, v)
        synthesis = cache.get(key)
        if synthesis is None:
            synthesis = synthesizer.synthesize(u, v)
            cache.put(key, synthesis)
        yield to_uint8(synthesis.image)


def _check(frames: int, radius: float) -> None:
    if not 1 <= frames <= MAX_FRAMES:
        raise InputError(f"The number of frames is {frames}; it must be from 1 to {MAX_FRAMES}.")
    if not 0 < radius <= MAX_RADIUS:
        raise InputError(f"The radius is {radius:g}; it must be above 0 and at most {MAX_RADIUS} (the corner views).")


def _walk(polyline: DoubleArray, frames: int, closed: bool) -> DoubleArray:
    """`frames` points (frames, 2) evenly along the polyline (N, 2); the last point of a closed one is left out."""
    lengths = np.hypot(*np.diff(polyline, axis=0).T)
    travelled = np.concatenate([[0.0], np.cumsum(lengths)])
    stops = np.linspace(0, travelled[-1], frames, endpoint=not closed)
    return np.stack([np.interp(stops, travelled, polyline[:, axis]) for axis in (0, 1)], axis=1)


def _viewpoints(offsets: DoubleArray, radius: float) -> Viewpoints:
    """Offsets in [-1, 1]^2 from the centre to (u, v), clipped since rounding may overstep the square by 1e-16."""
    placed = np.clip(0.5 + radius * offsets, 0, 1)
    return [(float(u), float(v)) for u, v in placed]
