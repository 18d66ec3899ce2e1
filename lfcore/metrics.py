"""How far a synthesized picture is from the captured one: PSNR, SSIM, error maps, the paper's scoring protocol K16."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lfcore.errors import InputError
from lfcore.lightfield import CORNERS, FloatArray, LightField

AnyArray = npt.NDArray[np.generic]
DoubleArray = npt.NDArray[np.float64]
ByteArray = npt.NDArray[np.uint8]

K16_CROP = 22  # pixels left out on each side
_SSIM_RADIUS = 5  # 11 taps
_SSIM_SIGMA = 1.5
_SSIM_K1, _SSIM_K2 = 0.01, 0.03


@dataclass(frozen=True)
class Score:
    """PSNR in dB (infinite for equal pictures) and SSIM (at most 1) of one picture by one protocol."""

    psnr: float
    ssim: float


def to_uint8(image: FloatArray) -> ByteArray:
    """Float picture with 1 = white to 8 bits: clipped, halves rounded up."""
    return np.floor(np.clip(image, 0, 1) * np.float32(255) + np.float32(0.5)).astype(np.uint8)


def psnr(a: AnyArray, b: AnyArray) -> float:
    """Peak signal-to-noise ratio in dB over all values of two arrays of one shape and type.

    The peak is 255 for uint8, 65535 for uint16 and 1 for floats. Infinite where the arrays are equal.
    """
    first, second, peak = _as_doubles(a, b)
    mean_square = float(np.mean((first - second) ** 2))
    return math.inf if mean_square == 0 else 10 * math.log10(peak**2 / mean_square)


def ssim(a: AnyArray, b: AnyArray) -> float:
    """Mean structural similarity of two pictures (H, W) or (H, W, 3) of one type; 1 where they are equal.

    Wang, Bovik, Sheikh and Simoncelli 2004: Gaussian window of 11 taps with sigma 1.5, K1 = 0.01, K2 = 0.03, variances
    with N. A colour picture is a volume, as for MATLAB's `ssim(a, b)`, by which the paper's scores were made: the
    window is 11 x 11 x 11 and reaches across the channels, the edges of all three axes repeat the outermost values, and
    the mean is taken over all positions. This differs from the mean of three SSIMs of single channels.
    """
    x, y, peak = _as_doubles(a, b)
    c1, c2 = (_SSIM_K1 * peak) ** 2, (_SSIM_K2 * peak) ** 2
    mean_x, mean_y = _gaussian(x), _gaussian(y)
    variance_x = _gaussian(x * x) - mean_x**2
    variance_y = _gaussian(y * y) - mean_y**2
    covariance = _gaussian(x * y) - mean_x * mean_y
    similarity = ((2 * mean_x * mean_y + c1) * (2 * covariance + c2)) / (
        (mean_x**2 + mean_y**2 + c1) * (variance_x + variance_y + c2)
    )
    return float(np.mean(similarity))


def absolute_error(a: FloatArray, b: FloatArray) -> FloatArray:
    """|a - b| of two pictures (H, W, 3), mean over the channels: float32 (H, W), in units where 1 is white."""
    return np.abs(a - b).mean(axis=2, dtype=np.float32)


def squared_error(a: FloatArray, b: FloatArray) -> FloatArray:
    """(a - b)^2 of two pictures (H, W, 3), mean over the channels: float32 (H, W)."""
    return np.square(a - b).mean(axis=2, dtype=np.float32)


def k16(synthesized: FloatArray, truth: FloatArray) -> Score:
    """Score two float pictures (H, W, 3), 1 = white, by the paper's protocol: 8 bits first, 22 px cropped per side."""
    height, width = truth.shape[:2]
    if min(height, width) <= 2 * K16_CROP:
        raise InputError(
            f"The views are {width} x {height} px, but the K16 protocol crops {K16_CROP} px on each side; "
            f"score views larger than {2 * K16_CROP} px."
        )
    inside = (slice(K16_CROP, height - K16_CROP), slice(K16_CROP, width - K16_CROP))
    a, b = to_uint8(synthesized)[inside], to_uint8(truth)[inside]
    return Score(psnr(a, b), ssim(a, b))


def k16_view(light_field: LightField) -> tuple[int, int]:
    """(row, column), from 0, of the view that K16 scores: (4, 4) of 8 x 8, the middle one of 7 x 7.

    Raises InputError where that view is itself one of the four inputs.
    """
    row, column = light_field.rows // 2, light_field.columns // 2
    if light_field.position(row, column) in CORNERS:
        raise InputError(
            f"{light_field.name}: found only the four corner views, which are the input; a score needs a captured view "
            f"in between (at least 3 x 3 views)."
        )
    return row, column


def _as_doubles(a: AnyArray, b: AnyArray) -> tuple[DoubleArray, DoubleArray, float]:
    if a.shape != b.shape or a.dtype != b.dtype:
        raise ValueError(f"the pictures must be alike, not {a.shape} {a.dtype} and {b.shape} {b.dtype}")
    peak = {"uint8": 255.0, "uint16": 65535.0}.get(a.dtype.name, 1.0)
    return a.astype(np.float64), b.astype(np.float64), peak


def _gaussian(values: DoubleArray) -> DoubleArray:
    """Gaussian filter along every axis, the outermost values repeated."""
    offsets = np.arange(-_SSIM_RADIUS, _SSIM_RADIUS + 1)
    taps = np.exp(-(offsets**2) / (2 * _SSIM_SIGMA**2))
    taps /= taps.sum()
    for axis in range(values.ndim):
        width = [(_SSIM_RADIUS, _SSIM_RADIUS) if a == axis else (0, 0) for a in range(values.ndim)]
        padded = np.moveaxis(np.pad(values, width, mode="edge"), axis, 0)
        length = values.shape[axis]
        total = sum(tap * padded[i : i + length] for i, tap in enumerate(taps))
        values = np.moveaxis(np.asarray(total), 0, axis)
    return values
