"""From the hexagonal grid of microlenses to the square pixels of the views.

The picture's axes are those of the grid, its pixels as far apart along x as along y. Odd rows of microlenses lie half a pitch
beside even ones. Were even rows taken as they are and only odd ones interpolated, the picture would show a comb: every other
row softer. So the pixels are placed a quarter of a pitch from both: each row is interpolated by as much, once along x and
once along y, and no row is sharper than its neighbour.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import torch

from lfcore.decode.grid import Float64Array, LensGrid

HALF_ROW = math.sqrt(3) / 2  # rows of microlenses are this many pitches apart
_LOBES = 3  # of the windowed sinc
_BLOCK = 48  # columns resampled at a time, by one small matrix


@dataclass(frozen=True)
class PictureGrid:
    """Where the pixels of the views lie among the microlenses.

    Pixel (x, y) is at column `first_column` + x `step` and row `first_row` + y `step` / HALF_ROW of the grid, columns counted
    along even rows. `step` is the distance between pixels in pitches.
    """

    grid: LensGrid
    width: int
    height: int
    step: float
    first_column: float
    first_row: float

    @property
    def positions(self) -> Float64Array:
        """(H, W, 2) as (x, y) in px of the sensor of the views' pixels."""
        columns = self.first_column + self.step * np.arange(self.width)
        rows = self.first_row + self.step / HALF_ROW * np.arange(self.height)
        along, down = np.asarray(self.grid.along), np.asarray(self.grid.down)
        return np.asarray(self.grid.origin) + columns[None, :, None] * along + rows[:, None, None] * down


def picture_grid(grid: LensGrid, sensor: tuple[int, int], step: float) -> PictureGrid:
    """Pixels over the whole sensor of (height, width) px, centred to half a pitch. `step` in pitches: 1 as in the ESLF,
    HALF_ROW to keep every row of microlenses."""
    height, width = sensor
    centred = grid.numbered_from((width - 1) / 2, (height - 1) / 2)
    columns = max(round(width / (grid.pitch * step)), 2)
    rows = max(round(height / (grid.pitch * step)), 2)
    # A quarter of a pitch from the microlenses of even and of odd rows; where rows are kept, on the rows.
    first_column = _quarter(-(columns - 1) / 2 * step, step)
    first_row = -(rows - 1) / 2 * step / HALF_ROW
    if step == HALF_ROW:
        first_row = float(round(first_row))
    return PictureGrid(centred, columns, rows, step, first_column, first_row)


def _quarter(column: float, step: float) -> float:
    """The column nearest to this one that is a quarter off; with other steps than 1 the phase changes anyway."""
    return math.floor(column) + 0.25 if step == 1 else column


def lens_rows(picture: PictureGrid, begin: int, end: int) -> tuple[int, int]:
    """The rows of microlenses, first and one past the last, that pixel rows begin..end-1 are made of."""
    reach = _LOBES * _stretch(picture.step / HALF_ROW)
    first = picture.first_row + begin * picture.step / HALF_ROW
    last = picture.first_row + (end - 1) * picture.step / HALF_ROW
    return math.ceil(first - reach), math.floor(last + reach) + 1


def lens_columns(picture: PictureGrid) -> tuple[int, int]:
    """The columns of microlenses, first and one past the last, that the pixels are made of, in even and odd rows alike."""
    reach = _LOBES * _stretch(picture.step)
    last = picture.first_column + (picture.width - 1) * picture.step
    return math.ceil(picture.first_column - 0.5 - reach), math.floor(last + reach) + 1


def centres_inside(
    picture: PictureGrid, rows: tuple[int, int], columns: tuple[int, int], sensor: tuple[int, int], margin: float
) -> Float64Array:
    """Centres (rows, columns, 2) of these microlenses; those within `margin` px of the sensor's edge or beyond it are replaced
    by the nearest in their row, or in the nearest row of the same parity, that are not."""
    j, i = np.meshgrid(np.arange(*rows), np.arange(*columns), indexing="ij")
    height, width = sensor
    centres = picture.grid.centres(j, i)
    # The grid may be turned, so that the nearest inside is found step by step; usually one to three steps.
    for _ in range(2 * max(len(j), len(j[0]))):
        x, y = centres[..., 0], centres[..., 1]
        move_x = (x < margin).astype(np.int64) - (x > width - 1 - margin)
        move_y = (y < margin).astype(np.int64) - (y > height - 1 - margin)
        if not (move_x.any() or move_y.any()):
            break
        j, i = j + 2 * move_y, i + move_x
        centres = picture.grid.centres(j, i)
    return centres


def resample(
    lenses: torch.Tensor, rows: tuple[int, int], columns: tuple[int, int], picture: PictureGrid, begin: int, end: int
) -> torch.Tensor:
    """Pixel rows begin..end-1 of everything that was measured at the microlenses: (rows, columns, K) -> (end - begin, W, K)."""
    count, values = len(lenses), lenses.shape[2]
    across = torch.empty(count, picture.width, values)
    for parity in (0, 1):
        part = slice((parity - rows[0]) % 2, None, 2)
        places = picture.first_column - parity / 2 + picture.step * np.arange(picture.width, dtype=np.float64) - columns[0]
        for first in range(0, picture.width, _BLOCK):
            block = places[first : first + _BLOCK]
            matrix, start = _taps(block, picture.step, lenses.shape[1])
            source = lenses[part, start : start + matrix.shape[1]]
            across[part, first : first + len(block)] = torch.matmul(matrix, source)
    steps = picture.first_row + picture.step / HALF_ROW * np.arange(begin, end, dtype=np.float64) - rows[0]
    matrix, start = _taps(steps, picture.step / HALF_ROW, count)
    return (matrix @ across[start : start + matrix.shape[1]].reshape(matrix.shape[1], -1)).reshape(end - begin, -1, values)


def _stretch(step: float) -> float:
    """How much wider than its usual six samples the filter is, so that what finer pixels hold does not alias."""
    return max(step, 1.0)


def _taps(places: Float64Array, step: float, count: int) -> tuple[torch.Tensor, int]:
    """Matrix (places, samples) that interpolates samples numbered from the returned start on, at these places.

    A windowed sinc whose weights sum to 1; samples beyond the first and the last of `count` count as those.
    """
    stretch = _stretch(step)
    first = max(math.ceil(places[0] - _LOBES * stretch), 0)
    last = min(math.floor(places[-1] + _LOBES * stretch), count - 1)
    samples = np.arange(math.ceil(places[0] - _LOBES * stretch), math.floor(places[-1] + _LOBES * stretch) + 1)
    distance = (places[:, None] - samples) / stretch
    taps: npt.NDArray[np.float64] = np.where(np.abs(distance) < _LOBES, np.sinc(distance) * np.sinc(distance / _LOBES), 0)
    taps /= taps.sum(axis=1, keepdims=True)
    matrix = np.zeros((len(places), last - first + 1))
    for sample, weight in zip(np.clip(samples, first, last) - first, taps.T, strict=True):
        matrix[:, sample] += weight
    return torch.from_numpy(matrix.astype(np.float32)), first
