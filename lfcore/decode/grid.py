"""The microlenses on the sensor: a hexagonal grid, told by the metadata, found in the picture."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Float64Array = npt.NDArray[np.float64]

_HALF_ROW = math.sqrt(3) / 2  # distance between rows, in pitches


@dataclass(frozen=True)
class LensGrid:
    """Centres of the pictures that the microlenses throw on the sensor, px; pixel (x, y) has its centre at (x, y).

    The centre in row j, column i is `origin` + (i + (j % 2) / 2) `along` + j `down`: odd rows are shifted by half a step.
    """

    origin: tuple[float, float]
    along: tuple[float, float]
    down: tuple[float, float]

    @property
    def pitch(self) -> float:
        """Distance between neighbours in a row, px."""
        return math.hypot(*self.along)

    @property
    def rotation(self) -> float:
        """Angle of the rows, radians; positive where they fall to the right on screen (y grows with x)."""
        return math.atan2(self.along[1], self.along[0])

    @property
    def row_scale(self) -> float:
        """Distance between rows over what a regular hexagonal grid would have."""
        return math.hypot(*self.down) / (_HALF_ROW * self.pitch)

    def centres(self, rows: npt.ArrayLike, columns: npt.ArrayLike) -> Float64Array:
        """Centres (..., 2) as (x, y) of microlenses by row and column, broadcast against each other."""
        j = np.asarray(rows, np.float64)
        i = np.asarray(columns, np.float64) + np.mod(j, 2) / 2
        return np.asarray(self.origin) + i[..., None] * np.asarray(self.along) + j[..., None] * np.asarray(self.down)

    def numbered_from(self, x: float, y: float) -> LensGrid:
        """The same grid, with row 0, column 0 at the microlens nearest to (x, y)."""
        row, column = self.nearest(np.array([x]), np.array([y]))
        origin = self.centres(row, column)[0]
        return LensGrid((float(origin[0]), float(origin[1])), self.along, self.down)

    def nearest(self, x: Float64Array, y: Float64Array) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
        """(row, column) of the microlens nearest to each place (x, y) in px."""
        to_steps = np.linalg.inv(np.column_stack([self.along, self.down]))
        dx, dy = x - self.origin[0], y - self.origin[1]
        across = to_steps[0, 0] * dx + to_steps[0, 1] * dy
        down = to_steps[1, 0] * dx + to_steps[1, 1] * dy
        found = []
        for row in (np.floor(down).astype(np.int64), np.floor(down).astype(np.int64) + 1):
            column = np.rint(across - np.mod(row, 2) / 2).astype(np.int64)
            away = self.centres(row, column) - np.stack([x, y], axis=-1)
            found.append((row, column, np.hypot(away[..., 0], away[..., 1])))
        (row, column, distance), (next_row, next_column, next_distance) = found
        upper = distance <= next_distance
        return np.where(upper, row, next_row), np.where(upper, column, next_column)


def regular_grid(
    origin: tuple[float, float], pitch: float, rotation: float = 0.0, scale: tuple[float, float] = (1.0, 1.0)
) -> LensGrid:
    """A hexagonal grid of this pitch (px), stretched by `scale` (x, y), then turned by `rotation` (radians)."""
    cos, sin = math.cos(rotation), math.sin(rotation)
    step_x, step_y = pitch * scale[0], pitch * scale[1] * _HALF_ROW
    return LensGrid(origin, (cos * step_x, sin * step_x), (-sin * step_y, cos * step_y))
