"""From the mosaic under one microlens to the colours of all views there, in one linear step.

Under a microlens the light changes smoothly from pixel to pixel, since neighbouring pixels see the same place of the scene from
neighbouring places of the aperture. So the red, green and blue of a view are estimated from all pixels under the microlens at
once, as the most likely values under a Gaussian model of that change (kriging), and never from a neighbouring microlens,
where a demosaicking of the whole picture would look. This also places the views between the pixels, so that nothing is
interpolated twice. The weights depend on where the microlens's centre lies within a pixel, and on the mosaic there: they
are computed for each sixth of a pixel.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np
import numpy.typing as npt
import torch

from lfcore.decode.grid import Float64Array

Integers = npt.NDArray[np.int64]

STEPS = 6  # places of a centre within a pixel, along x and along y, that have weights of their own
_MARGIN = 0.5  # px beyond half a pitch at which pixels still count as being under the microlens
_NEIGHBOURHOOD = 3.5  # px from the outermost view beyond which pixels tell nothing

# How the light under a microlens changes: the sum of changes over these lengths (in pitches), each with its variance (white of
# a mid-toned scene has 1) and the correlation between colours. Chosen on the model of the camera at several depths of scene.
_CHANGES = ((1.0, 0.6, 0.9), (0.4, 0.2, 0.97), (0.2, 0.1, 0.99), (0.12, 0.1, 0.995))
_LEVEL_VARIANCE = 10.0  # of each colour's mean: free, so that plain colours come out exactly
_NOISE_VARIANCE = 5e-3
_OUTSIDE = 1e4  # noise of pixels that belong to another microlens
_DIMMEST = 0.05  # pixels get no less light than this share of the centre's, for the sake of division


@dataclass(frozen=True)
class LensProfile:
    """Light under a microlens over that at its centre, by distance from it in shares of half a pitch."""

    radii: tuple[float, ...]
    light: tuple[float, ...]

    def at(self, radius: npt.ArrayLike) -> Float64Array:
        """Linear between the radii, constant beyond them."""
        return np.interp(np.asarray(radius, np.float64), self.radii, self.light)

    @property
    def edge(self) -> float:
        """The radius at which a sixth of the centre's light is left: farther out nothing is seen."""
        lit = [radius for radius, light in zip(self.radii, self.light, strict=True) if light >= 1 / 6]
        return max(lit, default=1.0)


@dataclass(frozen=True)
class Weights:
    """What to multiply the pixels under a microlens with: `values` (phases, outputs, pixels), `places` (pixels, 2) as (x, y)
    from the pixel nearest to the centre."""

    values: torch.Tensor
    places: Integers

    @property
    def reach(self) -> int:
        """How far the pixels lie from the nearest one at most."""
        return int(np.abs(self.places).max())


@dataclass(frozen=True)
class ViewPlaces:
    """Where on the pixels under a microlens the views lie: `count` x `count` places, `spacing` px apart, `rotation` radians."""

    count: int
    spacing: float
    rotation: float

    @property
    def offsets(self) -> Float64Array:
        """(V, U, 2) as (x, y) in px from the microlens's centre; rows and columns along those of the grid."""
        steps = (np.arange(self.count) - (self.count - 1) / 2) * self.spacing
        v, u = np.meshgrid(steps, steps, indexing="ij")
        cos, sin = math.cos(self.rotation), math.sin(self.rotation)
        return np.stack([u * cos - v * sin, u * sin + v * cos], axis=-1)


@lru_cache(maxsize=2)
def weights(
    pitch: float,
    places: ViewPlaces,
    cfa: str,
    profile: LensProfile,
    matrix: tuple[tuple[float, ...], ...],
    undo_profile: bool,
) -> Weights:
    """Weights for each phase; outputs are view by view, row-major, the three colours of `matrix` times camera RGB.

    `cfa` are the colours of the mosaic's pixels [0, 0], [0, 1], [1, 0], [1, 1]. Pixels are weighted by the light that
    `profile` says they got; where `undo_profile` the pixels have not been divided by a white image, and are by the profile.
    Views outside the aperture (beyond the profile's edge) get weights of 0: black.
    """
    offsets = places.offsets.reshape(-1, 2)
    radius = min(pitch / 2 + _MARGIN, np.hypot(*offsets.T).max() + _NEIGHBOURHOOD)
    y, x = np.mgrid[-math.ceil(radius) : math.ceil(radius) + 1, -math.ceil(radius) : math.ceil(radius) + 1].reshape(2, -1)
    footprint = np.column_stack([x, y])[np.hypot(x, y) <= radius]
    seen = 2 * np.hypot(*offsets.T) / pitch <= profile.edge
    values = np.zeros((4 * STEPS**2, len(offsets), 3, len(footprint)), np.float32)
    for phase in range(len(values)):
        colours, centre = _phase(phase, footprint, cfa)
        solved = _kriging(footprint - centre, colours, offsets[seen], pitch, places.rotation, profile)  # (3, seen, pixels)
        if undo_profile:
            solved /= np.maximum(profile.at(2 * np.hypot(*(footprint - centre).T) / pitch), _DIMMEST)
        values[phase, seen] = np.einsum("kc,csp->skp", np.asarray(matrix), solved)
    return Weights(torch.from_numpy(values.reshape(len(values), -1, len(footprint))), footprint)


def estimate(mosaic: torch.Tensor, centres: Float64Array, kernel: Weights) -> torch.Tensor:
    """The views' colours at each microlens: mosaic (H, W) float32, centres (N, 2) px -> (N, outputs) float32.

    Centres must lie at least `kernel.reach` + 1 px inside the mosaic.
    """
    nearest = np.floor(centres + 0.5)
    within = np.floor((centres - nearest + 0.5) * STEPS).astype(np.int64).clip(0, STEPS - 1)
    nearest = nearest.astype(np.int64)
    phases = _number(nearest[:, 0] % 2, nearest[:, 1] % 2, within[:, 0], within[:, 1])
    width = mosaic.shape[1]
    flat = mosaic.reshape(-1)
    base = torch.from_numpy(nearest[:, 1] * width + nearest[:, 0])
    steps = torch.from_numpy(kernel.places[:, 1] * width + kernel.places[:, 0])
    out = torch.empty(len(centres), kernel.values.shape[1])
    order = np.argsort(phases, kind="stable")
    ends = np.searchsorted(phases[order], np.arange(len(kernel.values) + 1))
    for phase, (begin, end) in enumerate(pairwise(ends)):
        if begin == end:
            continue
        members = torch.from_numpy(order[begin:end])
        pixels = flat[base[members, None] + steps]  # (n, pixels)
        out[members] = pixels @ kernel.values[phase].T
    return out


def _number(x: Integers, y: Integers, step_x: Integers, step_y: Integers) -> Integers:
    """Number of a phase: the nearest pixel's place in the mosaic, the centre's place in that pixel."""
    return ((y * 2 + x) * STEPS + step_y) * STEPS + step_x


def _phase(number: int, footprint: Integers, cfa: str) -> tuple[Integers, Float64Array]:
    """The inverse of `_number`: colours (0 to 2) of the pixels, and the centre from the nearest pixel."""
    mosaic, place = divmod(number, STEPS**2)
    corner_y, corner_x = divmod(mosaic, 2)
    step_y, step_x = divmod(place, STEPS)
    colours = np.array(["RGB".index(colour) for colour in cfa])
    pixel_colours = colours[2 * ((footprint[:, 1] + corner_y) % 2) + (footprint[:, 0] + corner_x) % 2]
    return pixel_colours, (np.array([step_x, step_y]) + 0.5) / STEPS - 0.5


def _kriging(
    pixels: Float64Array,
    colours: Integers,
    wanted: Float64Array,
    pitch: float,
    rotation: float,
    profile: LensProfile,
) -> Float64Array:
    """Weights (3, wanted, pixels) of the most likely colours at `wanted`, given pixels at these places (x, y) in px."""
    between_pixels = _squared_distances(pixels, pixels)
    to_wanted = _squared_distances(wanted, pixels)
    same = colours[:, None] == colours
    covariance = _LEVEL_VARIANCE * same.astype(np.float64)
    cross = np.stack([_LEVEL_VARIANCE * np.broadcast_to(colours == colour, to_wanted.shape) for colour in range(3)])
    for length, variance, correlation in _CHANGES:
        scale = -0.5 / (length * pitch) ** 2
        covariance += variance * np.where(same, 1, correlation) * np.exp(scale * between_pixels)
        change = variance * np.exp(scale * to_wanted)
        for colour in range(3):
            cross[colour] += change * np.where(colours == colour, 1, correlation)
    light = np.maximum(profile.at(2 * np.hypot(*pixels.T) / pitch), _DIMMEST)
    noise = np.where(_is_outside(pixels, pitch, rotation), _OUTSIDE, _NOISE_VARIANCE / light**2)
    covariance[np.diag_indices_from(covariance)] += noise
    solved = np.linalg.solve(covariance, cross.reshape(-1, len(pixels)).T)
    return np.asarray(solved.T.reshape(cross.shape))


def _is_outside(pixels: Float64Array, pitch: float, rotation: float) -> npt.NDArray[np.bool_]:
    """Whether pixels are nearer to one of the six neighbouring microlenses."""
    angles = rotation + np.arange(6) * math.pi / 3
    return np.asarray((pixels @ np.stack([np.cos(angles), np.sin(angles)]) > pitch / 2).any(axis=1))


def _squared_distances(a: Float64Array, b: Float64Array) -> Float64Array:
    return np.asarray(((a[:, None] - b[None]) ** 2).sum(axis=-1))
