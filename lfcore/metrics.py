"""How far a synthesized picture is from the captured one: PSNR, SSIM, error maps, and the rules of three scoring protocols.

`k16`, `luma_score` and `channel_score` score one pair of pictures as the protocols of `lfcore.protocols` ask for it. Their
numbers must never stand in one column: 7x7-Y alone is 1.3 dB above PSNR over the full range, because its Y ends at 219 steps.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lfcore.errors import InputError
from lfcore.lightfield import FloatArray, LightField

AnyArray = npt.NDArray[np.generic]
DoubleArray = npt.NDArray[np.float64]
ByteArray = npt.NDArray[np.uint8]

K16_CROP = 22  # pixels left out on each side, also by the other two protocols
SSIM_RADIUS = 5  # 11 taps
_FLAT_WINDOW = 7  # pixels
FLAT_RADIUS = _FLAT_WINDOW // 2
_SSIM_SIGMA = 1.5
_SSIM_K1, _SSIM_K2 = 0.01, 0.03
_SSIM_TAPS = np.exp(-(np.arange(-SSIM_RADIUS, SSIM_RADIUS + 1) ** 2) / (2 * _SSIM_SIGMA**2))
_SSIM_TAPS /= _SSIM_TAPS.sum()
_BLOCK_ROWS = 64  # a block of the filter's matrix this high has few zeros, and lies in the processor's cache
PSNR_BLOCK = 16  # pixels
_WINDOWS = {"K16": 1, "7x7-Y": 2 * SSIM_RADIUS + 1, "8x8-BGR": _FLAT_WINDOW}  # px that a protocol's crop must leave


@dataclass(frozen=True)
class Score:
    """PSNR in dB (infinite for equal pictures) and SSIM (at most 1) of one picture by one protocol."""

    psnr: float
    ssim: float


def to_uint8(image: FloatArray) -> ByteArray:
    """Float picture with 1 = white to 8 bits: clipped, halves rounded up."""
    values = np.clip(image, 0, 1)
    values *= np.float32(255)  # in place: a third of the time
    values += np.float32(0.5)
    return values.astype(np.uint8)


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
    return float(np.mean(_similarity(*_as_doubles(a, b), _gaussian)))


def similarity_map(a: AnyArray, b: AnyArray) -> FloatArray:
    """SSIM around each pixel of two colour pictures (H, W, 3), mean over the channels: float32 (H, W), whose mean is
    `ssim(a, b)`."""
    return _similarity(*_as_doubles(a, b), _gaussian).mean(axis=2).astype(np.float32)


def block_psnr(a: AnyArray, b: AnyArray) -> FloatArray:
    """PSNR in dB of each block of PSNR_BLOCK x PSNR_BLOCK pixels of two pictures (H, W, 3): float32 (rows, columns).

    The peak is that of `psnr`. The last row and column of blocks may hold fewer pixels. Infinite where a block is equal.
    """
    first, second, peak = _as_doubles(a, b)
    return block_psnr_of(np.square(first - second).mean(axis=2), peak)


def block_psnr_of(squares: DoubleArray, peak: float) -> FloatArray:
    """The same from squared differences (H, W)."""
    height, width = squares.shape
    tops, lefts = np.arange(0, height, PSNR_BLOCK), np.arange(0, width, PSNR_BLOCK)
    sums = np.add.reduceat(np.add.reduceat(squares, tops, axis=0), lefts, axis=1)
    counts = np.outer(np.diff(np.append(tops, height)), np.diff(np.append(lefts, width)))
    with np.errstate(divide="ignore"):
        return (10 * np.log10(peak**2 * counts / sums)).astype(np.float32)


def absolute_error(a: FloatArray, b: FloatArray) -> FloatArray:
    """|a - b| of two pictures (H, W, 3), mean over the channels: float32 (H, W), in units where 1 is white."""
    return np.abs(a - b).mean(axis=2, dtype=np.float32)


def squared_error(a: FloatArray, b: FloatArray) -> FloatArray:
    """(a - b)^2 of two pictures (H, W, 3), mean over the channels: float32 (H, W)."""
    return np.square(a - b).mean(axis=2, dtype=np.float32)


def k16(synthesized: FloatArray, truth: FloatArray) -> Score:
    """Score two float pictures (H, W, 3), 1 = white, by the paper's protocol: 8 bits first, 22 px cropped per side."""
    inside = _inside(truth, "K16")
    a, b = to_uint8(synthesized)[inside], to_uint8(truth)[inside]
    return Score(psnr(a, b), ssim(a, b))


def luma_score(synthesized: FloatArray, truth: FloatArray) -> Score:
    """Score two float pictures (H, W, 3), 1 = white, on the luminance Y alone, 22 px cropped per side (protocol 7x7-Y).

    As in the published tests (LFASR-FS-GAF, 2020): Y by BT.601 in studio range, 16 to 235 (MATLAB's `rgb2ycbcr`); that of
    the captured view from its 8 bits and rounded to 8 bits, that of the synthesis as it is; the peak is 255 although Y
    spans 219. SSIM is that of one channel with a Gaussian window of 11 x 11, its outermost 5 px left out of the mean.
    """
    inside = _inside(truth, "7x7-Y")
    found, captured = (picture[inside] for picture in luma_pair(synthesized, truth))
    mean_square = float(np.mean((captured - found) ** 2))
    similarity = luma_similarity(found, captured).mean()
    return Score(math.inf if mean_square == 0 else 10 * math.log10(255**2 / mean_square), float(similarity))


def channel_score(synthesized: FloatArray, truth: FloatArray) -> Score:
    """Score two float pictures (H, W, 3), 1 = white, channel by channel, 22 px cropped per side (protocol 8x8-BGR).

    As in the published test (SADenseNet, 2021): both in 8 bits; the mean over the channels of each one's PSNR in dB, and of
    each one's SSIM with a flat window of 7 x 7 and variances with N - 1, the outermost 3 px left out of its mean.
    """
    inside = _inside(truth, "8x8-BGR")
    a, b = to_uint8(synthesized)[inside], to_uint8(truth)[inside]
    pairs = [(a[..., channel], b[..., channel]) for channel in range(3)]
    return Score(
        sum(psnr(found, captured) for found, captured in pairs) / 3,
        sum(float(flat_similarity(found, captured).mean()) for found, captured in pairs) / 3,
    )


def luma_pair(synthesized: FloatArray, truth: FloatArray) -> tuple[DoubleArray, DoubleArray]:
    """What 7x7-Y compares, before its crop: Y of two float pictures (H, W, 3), that of the captured view in whole steps."""
    return studio_luma(np.clip(synthesized, 0, 1)), np.floor(studio_luma(to_uint8(truth) / 255) + 0.5)


def luma_similarity(found: DoubleArray, captured: DoubleArray) -> DoubleArray:
    """SSIM of Y around each pixel but the SSIM_RADIUS outermost: (H, W) -> (H - 10, W - 10)."""
    return _similarity(captured, found, 255.0, _gaussian)[SSIM_RADIUS:-SSIM_RADIUS, SSIM_RADIUS:-SSIM_RADIUS]


def flat_similarity(a: ByteArray, b: ByteArray) -> DoubleArray:
    """SSIM of one channel in the flat window around each pixel but the FLAT_RADIUS outermost: (H, W) -> (H - 6, W - 6)."""
    count = _FLAT_WINDOW**2
    return _similarity(a.astype(np.float64), b.astype(np.float64), 255.0, _flat, count / (count - 1))


def studio_luma(image: AnyArray) -> DoubleArray:
    """Y of BT.601 in studio range, 16 (black) to 235 (white), of a picture (H, W, 3) with 1 = white: float64 (H, W)."""
    return 16 + image.astype(np.float64) @ np.array([65.481, 128.553, 24.966])


def k16_view(light_field: LightField) -> tuple[int, int]:
    """(row, column), from 0, of the view that K16 scores: (4, 4) of 8 x 8, the middle one of 7 x 7.

    Raises InputError where no view lies between the corners along both axes.
    """
    rows, columns = light_field.rows, light_field.columns
    if min(rows, columns) < 3:
        found = "only the four corner views, which are the input" if rows == columns else f"{rows} x {columns} views"
        raise InputError(f"{light_field.name}: found {found}; a score needs a captured view in between (at least 3 x 3 views).")
    return rows // 2, columns // 2


def check_size(light_field: LightField, protocol: str) -> None:
    """Raise InputError, which names the light field, where its views are too small for a protocol (K16, 7x7-Y, 8x8-BGR)."""
    small = _too_small(light_field.height, light_field.width, protocol)
    if small:
        raise InputError(f"{light_field.name}: the {small}")


def _too_small(height: int, width: int, protocol: str) -> str:
    """What to say of views too small for the protocol's crop and window; nothing where they are not."""
    least = 2 * K16_CROP + _WINDOWS[protocol]
    if min(height, width) >= least:
        return ""
    return (
        f"views are {width} x {height} px, but the {protocol} protocol crops {K16_CROP} px on each side; "
        f"score views of at least {least} x {least} px."
    )


def _inside(truth: FloatArray, protocol: str) -> tuple[slice, slice]:
    """What is left of a picture after the crop; it must hold SSIM's window."""
    height, width = truth.shape[:2]
    small = _too_small(height, width, protocol)
    if small:
        raise InputError(f"The {small}")
    return slice(K16_CROP, height - K16_CROP), slice(K16_CROP, width - K16_CROP)


def _similarity(
    x: DoubleArray, y: DoubleArray, peak: float, average: Callable[[DoubleArray], DoubleArray], unbiased: float = 1.0
) -> DoubleArray:
    """SSIM at each place; `average` is the window's weighted mean, `unbiased` turns variances with N into others."""
    c1, c2 = (_SSIM_K1 * peak) ** 2, (_SSIM_K2 * peak) ** 2
    mean_x, mean_y = average(x), average(y)
    variances = unbiased * (average(x * x) - mean_x**2 + average(y * y) - mean_y**2)
    covariance = unbiased * (average(x * y) - mean_x * mean_y)
    similarity: DoubleArray = ((2 * mean_x * mean_y + c1) * (2 * covariance + c2)) / (
        (mean_x**2 + mean_y**2 + c1) * (variances + c2)
    )
    return similarity


def _flat(values: DoubleArray) -> DoubleArray:
    """Mean over each window of 7 x 7 that lies within the picture: (H, W) -> (H - 6, W - 6)."""
    windows = np.lib.stride_tricks.sliding_window_view(values, _FLAT_WINDOW, axis=0).mean(-1)
    means: DoubleArray = np.lib.stride_tricks.sliding_window_view(windows, _FLAT_WINDOW, axis=1).mean(-1)
    return means


def _as_doubles(a: AnyArray, b: AnyArray) -> tuple[DoubleArray, DoubleArray, float]:
    if a.shape != b.shape or a.dtype != b.dtype:
        raise ValueError(f"the pictures must be alike, not {a.shape} {a.dtype} and {b.shape} {b.dtype}")
    peak = {"uint8": 255.0, "uint16": 65535.0}.get(a.dtype.name, 1.0)
    return a.astype(np.float64), b.astype(np.float64), peak


def _gaussian(values: DoubleArray) -> DoubleArray:
    """Gaussian filter along every axis, the outermost values repeated."""
    for axis in range(values.ndim):
        values = _gaussian_along(values, axis)
    return values


def _gaussian_along(values: DoubleArray, axis: int) -> DoubleArray:
    """The same along one axis, as products with blocks of the filter's matrix, in a quarter of the time of tap by tap."""
    ahead = np.moveaxis(values, axis, 0)
    length = ahead.shape[0]
    rows = np.ascontiguousarray(ahead).reshape(length, -1)  # (length, all else)
    filtered = np.empty_like(rows)
    for start in range(0, length, _BLOCK_ROWS):
        stop = min(start + _BLOCK_ROWS, length)
        low, high = max(start - SSIM_RADIUS, 0), min(stop + SSIM_RADIUS, length)
        places = np.arange(start, stop)
        matrix = np.zeros((stop - start, high - low))
        for offset, tap in zip(range(-SSIM_RADIUS, SSIM_RADIUS + 1), _SSIM_TAPS, strict=True):
            matrix[places - start, np.clip(places + offset, 0, length - 1) - low] += tap
        np.matmul(matrix, rows[low:high], out=filtered[start:stop])
    return np.moveaxis(filtered.reshape(ahead.shape), 0, axis)
