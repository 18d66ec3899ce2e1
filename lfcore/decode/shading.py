"""How much light falls on each pixel: hot pixels mended, black taken off, divided by the white image, white balanced.

The microlenses throw round pictures that fade towards their rims. A white image shows this pixel by pixel, with the fading
towards the sensor's corners. Without one the mean fading under a microlens is measured in the capture itself; the fading
towards the corners then stays, since it cannot be told from the scene.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import torch

from lfcore.decode.demosaic import LensProfile
from lfcore.decode.grid import Float64Array, LensGrid
from lfcore.decode.unpack import Mosaic
from lfcore.formats.lytro.metadata import Quad, RawImage

# A pixel this much above all four neighbours of its colour is broken: no lens makes such a peak. Dark ones are left alone,
# since between the microlenses whole pixels are dark.
_HOT_RATIO = 1.6
_HOT_MARGIN = 0.03  # of the range from black to white; noise stays below
_DIMMEST = 0.04  # light of the white image, over that of the brightest places, below which it divides no more
_BAND = 256  # rows at a time

_PROFILE_STEPS = 24  # radii of a profile, up to 1.15 of half a pitch
_PROFILE_REACH = 1.15
_PROFILE_SAMPLES = 400_000  # pixels looked at
_CENTRE = 0.45  # radius, in half pitches, within which light falls with the square of the radius
_MIDDLE = 48  # side of the sensor's middle, in pixels of one colour, in which the brightest light is measured


def mend_hot_pixels(mosaic: Mosaic, raw: RawImage) -> int:
    """Replace, in place, pixels that stand alone above their neighbours of the same colour; returns how many."""
    margin = int(_HOT_MARGIN * (max(raw.white) - min(raw.black)))
    black = int(min(raw.black))
    mended = 0
    height = len(mosaic)
    for begin in range(0, height, _BAND):
        end = min(begin + _BAND, height)
        rows = mosaic[max(begin - 2, 0) : min(end + 2, height)]
        top = begin - max(begin - 2, 0)
        above = _shifted(rows, -2)[top : top + end - begin]
        below = _shifted(rows, 2)[top : top + end - begin]
        here = mosaic[begin:end]
        left, right = _shifted(here.T, -2).T, _shifted(here.T, 2).T
        highest = np.maximum(np.maximum(above, below), np.maximum(left, right))
        # Only the few candidates are compared in full precision.
        candidates = np.nonzero(here > highest + np.uint16(margin))
        value, high = here[candidates].astype(np.float64) - black, highest[candidates].astype(np.float64) - black
        broken = value > _HOT_RATIO * high + margin
        place = candidates[0][broken], candidates[1][broken]
        here[place] = np.mean([neighbour[place] for neighbour in (above, below, left, right)], axis=0).astype(np.uint16)
        mended += int(broken.sum())
    return mended


def _shifted(rows: npt.NDArray[np.uint16], by: int) -> npt.NDArray[np.uint16]:
    """Row y of the result is row y + by; at the ends the row on the other side stands in, which has the same colour."""
    result = np.empty_like(rows)
    if by > 0:
        result[:-by], result[-by:] = rows[by:], rows[-2 * by : -by]
    else:
        result[-by:], result[:-by] = rows[:by], rows[-by : -2 * by]
    return result


def lens_profile(mosaic: Mosaic, raw: RawImage, grid: LensGrid) -> LensProfile:
    """The mean light under a microlens by distance from its centre, measured in a white image or in a capture."""
    draw = np.random.default_rng(0)  # the same pixels each time
    height, width = mosaic.shape
    y, x = draw.integers(0, height, _PROFILE_SAMPLES), draw.integers(0, width, _PROFILE_SAMPLES)
    row, column = grid.nearest(x.astype(np.float64), y.astype(np.float64))
    centres = grid.centres(row, column)
    radius = 2 * np.hypot(x - centres[:, 0], y - centres[:, 1]) / grid.pitch
    black = np.asarray(raw.black)[2 * (y % 2) + x % 2]
    light = np.maximum(mosaic[y, x] - black, 0)
    # Each microlens is as bright as the scene there: compare pixels with the centre of their own microlens.
    at_centre = _centre_light(mosaic, raw, centres, x % 2, y % 2)
    known = at_centre > 0.05 * np.mean(at_centre)
    steps = np.linspace(0, _PROFILE_REACH, _PROFILE_STEPS)
    bins = np.rint(radius[known] / steps[1]).astype(int).clip(0, _PROFILE_STEPS - 1)
    total = np.bincount(bins, light[known], _PROFILE_STEPS)
    reference = np.bincount(bins, at_centre[known], _PROFILE_STEPS)
    share = total / np.maximum(reference, 1e-9)
    inner = steps <= _CENTRE
    counts = np.bincount(bins, minlength=_PROFILE_STEPS)[inner]
    centre, fading = _at_centre(steps[inner], share[inner], np.sqrt(counts))
    share = share / centre
    share[inner] = 1 + fading / centre * steps[inner] ** 2
    return LensProfile(tuple(steps.round(4).tolist()), tuple(np.minimum.accumulate(np.minimum(share, 1)).round(4).tolist()))


def _at_centre(radius: Float64Array, light: Float64Array, weights: Float64Array | None = None) -> tuple[float, float]:
    """Light right at the centre, and how it changes with the square of the radius, from pixels around the centre."""
    fading, centre = np.polyfit(radius**2, light, 1, w=weights)
    return max(float(centre), 1e-6), min(float(fading), 0.0)


def _centre_light(
    mosaic: Mosaic, raw: RawImage, centres: Float64Array, parity_x: npt.NDArray[np.int64], parity_y: npt.NDArray[np.int64]
) -> Float64Array:
    """Light, above black, of the two by two pixels of one colour around each centre."""
    height, width = mosaic.shape
    total = np.zeros(len(centres))
    for dy in (0, 2):
        for dx in (0, 2):
            x = (np.floor((centres[:, 0] - parity_x) / 2) * 2 + parity_x + dx).astype(np.int64)
            y = (np.floor((centres[:, 1] - parity_y) / 2) * 2 + parity_y + dy).astype(np.int64)
            x = np.clip(x, parity_x, (width - 2) // 2 * 2 + parity_x)
            y = np.clip(y, parity_y, (height - 2) // 2 * 2 + parity_y)
            total += mosaic[y, x] - np.asarray(raw.black)[2 * (y % 2) + x % 2]
    return np.maximum(total / 4, 0)


def light_on_pixels(mosaic: Mosaic, raw: RawImage, gains: Quad, white: torch.Tensor | None) -> torch.Tensor:
    """Light (H, W) float32 on each pixel, balanced so that grey is the same in all colours: 1 where the sensor burns out.

    `gains` of the pixels [0, 0], [0, 1], [1, 0], [1, 1] of the mosaic, the least of them 1; `white` what to divide by, from
    `relative_light`. Light beyond 1 is cut off: there some colour is burnt out, and the others would give it a tint.
    """
    light = torch.from_numpy(mosaic).to(torch.float32)
    for index in range(4):
        y, x = divmod(index, 2)
        plane = light[y::2, x::2]
        plane.sub_(raw.black[index]).mul_(gains[index] / (raw.white[index] - raw.black[index]))
    if white is not None:
        light.div_(white)
    return light.clamp_(max=1.0)


def relative_light(white: Mosaic, raw: RawImage, grid: LensGrid) -> torch.Tensor:
    """What a white image says of each pixel's light (H, W): 1 in the middle of the microlenses of the brightest region."""
    light = torch.from_numpy(white).to(torch.float32)
    for index in range(4):
        y, x = divmod(index, 2)
        plane = light[y::2, x::2]
        plane.sub_(raw.black[index])
        plane.div_(_brightest(plane.numpy(), grid, x, y))
    return light.clamp_(min=_DIMMEST)


def _brightest(plane: npt.NDArray[np.float32], grid: LensGrid, x: int, y: int) -> float:
    """Light at the centres of microlenses in the sensor's middle, of one colour whose pixels begin at (x, y)."""
    rows, columns = (slice((side - min(side, _MIDDLE)) // 2, (side + min(side, _MIDDLE)) // 2) for side in plane.shape)
    light = plane[rows, columns].astype(np.float64)
    py, px = np.mgrid[rows, columns].astype(np.float64) * 2  # a colour has every second pixel
    px, py = px + x, py + y
    centres = grid.centres(*grid.nearest(px, py))
    radius = 2 * np.hypot(px - centres[..., 0], py - centres[..., 1]) / grid.pitch
    near = radius < _CENTRE
    return max(_at_centre(radius[near], light[near])[0], 1.0)
