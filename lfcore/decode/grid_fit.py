"""Find the grid of microlenses in a white image or a capture.

The pictures of the microlenses are a pattern that repeats in three directions at once. Of a capture only the dark rims between
them are looked at, since they hold little of the scene. How strong and where in its period each of the three waves is, tile by
tile, tells where the microlenses lie, without any of them being looked at alone: noise and the scene average out. The waves'
rough lengths come from a spectrum of the sensor's middle; a grid with six free numbers (place, pitch, rotation, stretch, skew)
is then fitted to the tiles, from the middle outwards, outliers weighing little.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import torch

from lfcore.decode.grid import Float64Array, LensGrid, regular_grid

PITCH_RANGE = 0.04  # the pitch found may differ from the one told by this share
ROTATION_RANGE = 0.21  # radians
_TILE_PITCHES = 6  # side of a tile in pitches
_SPECTRUM_SIDE = 768  # px of the sensor's middle whose spectrum is looked at
_FIRST_ROWS, _TILE_ROWS = 6, 12  # of tiles, spread over the sensor; more tell hardly more
_ROUNDS = 6  # of reweighting
_PEAK = 3 * math.log(4)  # the three waves together must stand out by this much, in natural logarithms
# Of a capture only the darkest quarter, by share of the local mean, counts: the rims. In a white image nothing misleads.
_RIM_SHARE = 0.25
_NO_CUT = 4.0


class GridNotFound(Exception):
    """No regular pattern of microlenses near the expected pitch is in the picture."""


@dataclass(frozen=True)
class GridFit:
    """The grid found, and how well: `residual` is the median distance in px of tiles from it, `share` the tiles that agree."""

    grid: LensGrid
    residual: float
    share: float


def grid_of_white_image(mosaic: npt.NDArray[np.generic], black: float, pitch: float, row_scale: float = 1.0) -> GridFit:
    """The grid of microlenses in the raw mosaic (H, W) of a white wall, near the given pitch in px.

    `black` is the level without light, `row_scale` that of LensGrid to 1%. Rotations up to ROTATION_RANGE are found whatever
    the metadata says. Raises GridNotFound.
    """
    return _fit(mosaic, black, pitch, row_scale, _NO_CUT)


def grid_of_capture(mosaic: npt.NDArray[np.generic], black: float, pitch: float, row_scale: float = 1.0) -> GridFit:
    """The same by the dark rims between the microlenses in a capture of anything."""
    first, *_ = _middle_planes(mosaic, black)
    cut = float(np.quantile(_rims(first, pitch, _NO_CUT), _RIM_SHARE))
    return _fit(mosaic, black, pitch, row_scale, cut)


def _fit(mosaic: npt.NDArray[np.generic], black: float, pitch: float, row_scale: float, cut: float) -> GridFit:
    start = _from_spectrum(mosaic, black, pitch, row_scale, cut)
    fit = _fit_tiles(_measure(mosaic, black, start, cut, _FIRST_ROWS), start)
    # The tiles' waves were those of the rough grid; once more with the waves of the fitted one.
    return _fit_tiles(_measure(mosaic, black, fit.grid, cut, _TILE_ROWS), fit.grid)


def _waves(grid: LensGrid) -> Float64Array:
    """The three waves of a grid, (3, 2) in cycles per px: the shortest vectors of its reciprocal lattice."""
    slanted = np.asarray(grid.down) + np.asarray(grid.along) / 2
    reciprocal = np.linalg.inv(np.column_stack([grid.along, slanted]))  # rows: dual to `along` and `slanted`
    return np.stack([reciprocal[0], reciprocal[1], reciprocal[0] + reciprocal[1]])


def _from_spectrum(mosaic: npt.NDArray[np.generic], black: float, pitch: float, row_scale: float, cut: float) -> LensGrid:
    """A first grid, by the strongest three waves of the picture's middle; its origin is arbitrary."""
    planes = [_rims(plane, pitch, cut) for plane in _middle_planes(mosaic, black)]
    height, width = (2 * side for side in planes[0].shape)
    balanced = np.empty((height, width), np.float32)
    for index, plane in enumerate(planes):
        y, x = divmod(index, 2)
        balanced[y::2, x::2] = plane
    balanced -= balanced.mean()
    window = (np.hanning(height)[:, None] * np.hanning(width)[None]).astype(np.float32)
    strength = torch.fft.fft2(torch.from_numpy(balanced * window), s=(2 * height, 2 * width)).abs().numpy()
    step = 0.2 * pitch / max(height, width)  # a fifth of the spectrum's resolution
    pitches = pitch * np.arange(1 - PITCH_RANGE, 1 + PITCH_RANGE, step)
    angles = np.arange(-ROTATION_RANGE, ROTATION_RANGE, step)
    score = np.zeros((len(pitches), len(angles)))
    for wave_x, wave_y in _waves(regular_grid((0.0, 0.0), 1.0, 0.0, (1.0, row_scale))):
        x = (wave_x * np.cos(angles) - wave_y * np.sin(angles)) / pitches[:, None]
        y = (wave_x * np.sin(angles) + wave_y * np.cos(angles)) / pitches[:, None]
        row, column = np.rint(y * 2 * height).astype(int) % (2 * height), np.rint(x * 2 * width).astype(int) % (2 * width)
        score += np.log(strength[row, column] + 1e-9)
    best = np.unravel_index(np.argmax(score), score.shape)
    if score[best] - np.median(score) < _PEAK:
        raise GridNotFound
    centre = (mosaic.shape[1] - 1) / 2, (mosaic.shape[0] - 1) / 2
    return regular_grid(centre, float(pitches[best[0]]), float(angles[best[1]]), (1.0, row_scale))


def _rims(plane: npt.NDArray[np.float32], pitch: float, cut: float) -> npt.NDArray[np.float32]:
    """Light of one colour over the mean of a pitch around, cut off above `cut`. The plane has every second pixel."""
    size = 2 * round(pitch / 4) + 1
    light = torch.from_numpy(plane).clamp(min=0)
    padded = torch.nn.functional.pad(light[None], (size // 2,) * 4, mode="replicate")
    rows = torch.nn.functional.avg_pool2d(padded, (1, size), 1)
    mean = torch.nn.functional.avg_pool2d(rows, (size, 1), 1)[0]
    # Where there is hardly any light, noise must not look like rims.
    return torch.clamp(light / (mean + 0.05 * mean.mean() + 1e-3), max=cut).numpy()


def _middle_planes(mosaic: npt.NDArray[np.generic], black: float) -> list[npt.NDArray[np.float32]]:
    """The four colours of the picture's middle, light above black."""
    top, left = ((side - min(side, _SPECTRUM_SIDE) // 2 * 2) // 4 * 2 for side in mosaic.shape)
    bottom, right = (begin + min(side, _SPECTRUM_SIDE) // 2 * 2 for begin, side in zip((top, left), mosaic.shape, strict=True))
    middle = mosaic[top:bottom, left:right].astype(np.float32) - np.float32(black)
    return [np.ascontiguousarray(middle[y::2, x::2]) for y in (0, 1) for x in (0, 1)]


@dataclass(frozen=True)
class _Tiles:
    """What was measured: tile centres (N, 2) px, phases of the three waves there (N, 3) in cycles, weights (N, 3)."""

    centres: Float64Array
    phases: Float64Array
    weights: Float64Array


def _measure(mosaic: npt.NDArray[np.generic], black: float, grid: LensGrid, cut: float, most_rows: int) -> _Tiles:
    """The waves of `grid` in the tiles of at most `most_rows` rows over the whole mosaic."""
    side = min(round(_TILE_PITCHES * grid.pitch / 2) * 2, min(mosaic.shape) // 6 * 2)
    across = mosaic.shape[1] // side
    left = (mosaic.shape[1] - across * side) // 4 * 2
    down = min(mosaic.shape[0] // side, most_rows)
    tops = np.linspace(0, mosaic.shape[0] - side, down).astype(int) // 2 * 2
    waves = _waves(grid)
    # One wave period more or less in the window's width must not show: the tile is weighted down to nothing at its edges.
    taper = 0.5 - 0.5 * np.cos(2 * np.pi * (np.arange(side) + 0.5) / side)
    place = np.arange(side) - (side - 1) / 2
    total = np.zeros((down, across, 3), np.complex128)
    light = np.full((down, across), np.inf)
    halo = 2 * math.ceil(grid.pitch / 2)  # even: colours of the mosaic alternate
    for plane in range(4):
        y, x = divmod(plane, 2)
        along_x = (taper[x::2, None] * np.exp(-2j * np.pi * place[x::2, None] * waves[None, :, 0])).astype(np.complex64)
        along_y = (taper[y::2, None] * np.exp(-2j * np.pi * place[y::2, None] * waves[None, :, 1])).astype(np.complex64)
        basis = np.column_stack([along_x.real, along_x.imag])  # (side / 2, 6)
        for j in range(down):
            begin = int(tops[j])
            above = min(begin // 2, halo // 2)  # rows of this plane
            band = mosaic[begin - 2 * above + y : begin + side + halo + y : 2, x::2].astype(np.float32) - black
            rows = slice(above, above + side // 2), slice(left // 2, (left + across * side) // 2)
            lines = _rims(band, grid.pitch, cut)[rows].reshape(side // 2, across, side // 2) @ basis  # (side / 2, across, 6)
            total[j] += np.einsum("ytm,ym->tm", lines[..., :3] + 1j * lines[..., 3:], along_y)
            mean = band[rows].reshape(side // 2, across, side // 2).mean(axis=(0, 2))
            light[j] = np.minimum(light[j], mean)
    centres = np.stack(
        np.meshgrid(left + side * (np.arange(across) + 0.5) - 0.5, tops + side / 2 - 0.5), -1
    )  # (down, across, 2)
    strength = np.abs(total)
    # Nearly dark tiles are noise; of the others, those with a stronger pattern tell more.
    lit = light > 0.02 * np.median(light)
    weights = np.where(lit[..., None], np.minimum(strength, 2 * np.median(strength)), 0)
    return _Tiles(centres.reshape(-1, 2), np.angle(total).reshape(-1, 3) / (2 * np.pi), weights.reshape(-1, 3))


def _fit_tiles(tiles: _Tiles, start: LensGrid) -> GridFit:
    """The grid whose waves have the measured phases. A tile at x has phase w . (x - origin) in cycles, up to whole ones."""
    waves = _waves(start)[:2]
    middle = tiles.centres.mean(axis=0)
    away = np.hypot(*(tiles.centres - middle).T)
    # Only the middle tiles are sure to lie within half a period of the rough grid.
    phase = _middle_phase(tiles, waves, middle, away)
    reach = 3 * np.sort(away)[min(16, len(away) - 1)]
    unknowns = np.concatenate([waves, phase[:, None]], axis=1)  # (2, 3): wave x, wave y, phase at the middle
    while True:
        used = away <= reach
        unknowns = _refine(tiles, unknowns, middle, used)
        if used.all():
            break
        reach *= 1.6
    misfit = _misfit(tiles, unknowns, middle)  # (N, 3) cycles
    to_px = 1 / np.hypot(*waves.T).mean()
    sure = tiles.weights.min(axis=1) > 0
    distances = np.sqrt(2 / 3) * np.hypot(np.hypot(misfit[sure, 0], misfit[sure, 1]), misfit[sure, 2]) * to_px
    if not len(distances):
        raise GridNotFound
    grid = _grid_of(unknowns, middle).numbered_from(*middle)
    return GridFit(grid, float(np.median(distances)), float(np.mean(distances < 0.1 * start.pitch)))


def _middle_phase(tiles: _Tiles, waves: Float64Array, middle: Float64Array, away: Float64Array) -> Float64Array:
    near = np.argsort(away)[:9]
    turned = tiles.phases[near, :2] - (tiles.centres[near] - middle) @ waves.T
    summed = (tiles.weights[near, :2] * np.exp(2j * np.pi * turned)).sum(axis=0)
    return np.angle(summed) / (2 * np.pi)


def _misfit(tiles: _Tiles, unknowns: Float64Array, middle: Float64Array) -> Float64Array:
    """Measured minus expected phases, (N, 3) in cycles, -0.5 to 0.5."""
    expected = (tiles.centres - middle) @ unknowns[:, :2].T + unknowns[:, 2]  # (N, 2)
    expected = np.column_stack([expected, expected.sum(axis=1)])
    difference = tiles.phases - expected
    return difference - np.rint(difference)


def _refine(tiles: _Tiles, unknowns: Float64Array, middle: Float64Array, used: npt.NDArray[np.bool_]) -> Float64Array:
    """Reweighted least squares over the tiles in use."""
    design = np.column_stack([(tiles.centres - middle)[used], np.ones(int(used.sum()))])  # (n, 3)
    # Third wave = first + second: its rows repeat the design for both.
    zero = np.zeros_like(design)
    rows = np.concatenate([np.hstack([design, zero]), np.hstack([zero, design]), np.hstack([design, design])])  # (3n, 6)
    scale = np.array([1 / np.abs(design[:, 0]).max(), 1 / np.abs(design[:, 1]).max(), 1.0])
    rows = rows * np.tile(scale, 2)
    for _ in range(_ROUNDS):
        misfit = _misfit(tiles, unknowns, middle)[used].T.ravel()
        weights = tiles.weights[used].T.ravel()
        spread = max(1.5 * float(np.median(np.abs(misfit[weights > 0]))) if (weights > 0).any() else 0.1, 1e-4)
        weights = weights / (1 + (misfit / (2 * spread)) ** 2) ** 2
        change = np.linalg.lstsq(rows * weights[:, None], misfit * weights, rcond=None)[0]
        unknowns = unknowns + (change.reshape(2, 3) * scale)
    return unknowns


def _grid_of(unknowns: Float64Array, middle: Float64Array) -> LensGrid:
    """The grid with these waves. At a microlens's centre all phases are whole."""
    basis = np.linalg.inv(unknowns[:, :2])  # columns: `along` and `slanted`
    along, slanted = basis[:, 0], basis[:, 1]
    # A wave e^(2 pi i w (x - c)) that is summed against e^(-2 pi i w x) leaves e^(-2 pi i w c) at x = 0; measured from the
    # tile's centre t it leaves e^(2 pi i w (t - c)), so that the phase at the middle m is w (m - c).
    origin = middle - basis @ unknowns[:, 2]
    down = slanted - along / 2
    return LensGrid((float(origin[0]), float(origin[1])), (float(along[0]), float(along[1])), (float(down[0]), float(down[1])))
