"""Small light fields of known disparity, drawn from functions of continuous position: the truth that tests compare with."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from lfcore.lightfield import FloatArray, LightField


def smooth_texture(x: FloatArray, y: FloatArray) -> FloatArray:
    """A picture without end (..., 3), 0 to 1, smooth enough for bicubic interpolation to be nearly exact."""
    waves = [(0.11, 0.07, 0.3), (-0.05, 0.13, 1.1), (0.17, -0.04, 2.0), (0.23, 0.19, 0.7)]
    channels = [sum(np.sin(2 * np.pi * (fx * x + fy * y) / 2.6 + phase * (k + 1)) for fx, fy, phase in waves) for k in range(3)]
    return (0.5 + 0.11 * np.stack(channels, -1)).astype(np.float32)


def plane(
    disparity: float,
    grid: tuple[int, int] = (3, 3),
    size: tuple[int, int] = (40, 48),
    texture: Callable[[FloatArray, FloatArray], FloatArray] = smooth_texture,
) -> LightField:
    """A plane of one disparity (px over the full baseline): content moves to larger x as u grows, where it is positive."""
    rows, columns = grid
    y, x = np.mgrid[: size[0], : size[1]].astype(np.float32)
    views = [
        [texture(x - disparity * c / (columns - 1), y - disparity * r / (rows - 1)) for c in range(columns)]
        for r in range(rows)
    ]
    return LightField(np.array(views, np.float32), "plane", "generated", "generated")
