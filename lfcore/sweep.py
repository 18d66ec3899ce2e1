"""Ways through the viewpoints: equal steps along a path inside the square [0, 1]^2 of the corner views.

All are centred on (0.5, 0.5) and reach `radius` from it along u and v; 0.5 reaches the edge of the square. Closed paths
(circle, horizontal, vertical, spiral) do not repeat their first viewpoint at the end, so that a looped video runs on
evenly; the lawnmower is open.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from lfcore.errors import InputError
from lfcore.key_frames import walk

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
    return _viewpoints(walk(np.array([(-1.0, 0.0), (1.0, 0.0), (-1.0, 0.0)]), frames, closed=True), radius)


def vertical(frames: int, radius: float = 0.5) -> Viewpoints:
    """From top to bottom and back."""
    _check(frames, radius)
    return _viewpoints(walk(np.array([(0.0, -1.0), (0.0, 1.0), (0.0, -1.0)]), frames, closed=True), radius)


def lawnmower(frames: int, radius: float = 0.5) -> Viewpoints:
    """Row by row from the top left, alternately to the right and to the left, over eight rows."""
    _check(frames, radius)
    corners: list[tuple[float, float]] = []
    for index, v in enumerate(np.linspace(-1, 1, _LAWNMOWER_ROWS)):
        ends = [(-1.0, float(v)), (1.0, float(v))]
        corners += ends if index % 2 == 0 else ends[::-1]
    return _viewpoints(walk(np.array(corners), frames, closed=False), radius)


def spiral(frames: int, radius: float = 0.5) -> Viewpoints:
    """From the centre outwards in three turns, then inwards in three more."""
    _check(frames, radius)
    time = np.linspace(0, 1, _SPIRAL_SAMPLES + 1)
    distance = 1 - np.abs(2 * time - 1)
    angle = 2 * math.pi * 2 * _SPIRAL_TURNS * time
    points = np.stack([distance * np.cos(angle), distance * np.sin(angle)], axis=1)
    return _viewpoints(walk(points, frames, closed=True), radius)


PATHS: dict[str, Callable[..., Viewpoints]] = {
    "circle": circle,
    "horizontal": horizontal,
    "vertical": vertical,
    "lawnmower": lawnmower,
    "spiral": spiral,
}
OPEN_PATHS = frozenset(("lawnmower",))


def check_frames(frames: int) -> None:
    """Raise InputError unless a path may have so many frames."""
    if not 1 <= frames <= MAX_FRAMES:
        raise InputError(f"The number of frames is {frames}; it must be from 1 to {MAX_FRAMES}.")


def _check(frames: int, radius: float) -> None:
    check_frames(frames)
    if not 0 < radius <= MAX_RADIUS:
        raise InputError(f"The radius is {radius:g}; it must be above 0 and at most {MAX_RADIUS} (the corner views).")


def _viewpoints(offsets: DoubleArray, radius: float) -> Viewpoints:
    """Offsets in [-1, 1]^2 from the centre to (u, v), clipped since rounding may overstep the square by 1e-16."""
    placed = np.clip(0.5 + radius * offsets, 0, 1)
    return [(float(u), float(v)) for u, v in placed]
