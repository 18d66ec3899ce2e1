"""Independent slow computations that the library's fast ones are compared with. Pixel by pixel, in float64, by definition."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def keys_kernel(x: float, a: float = -0.5) -> float:
    """The cubic convolution kernel of Keys (1981)."""
    x = abs(x)
    if x < 1:
        return (a + 2) * x**3 - (a + 3) * x**2 + 1
    if x < 2:
        return a * x**3 - 5 * a * x**2 + 8 * a * x - 4 * a
    return 0.0


def sample(image: Array, x: float, y: float) -> float | None:
    """Bicubic sample of (H, W) at (x, y), its edges repeated; None outside the picture."""
    height, width = image.shape
    if not (0 <= x <= width - 1 and 0 <= y <= height - 1):
        return None
    total = 0.0
    for j in range(math.floor(y) - 1, math.floor(y) + 3):
        for i in range(math.floor(x) - 1, math.floor(x) + 3):
            weight = keys_kernel(x - i) * keys_kernel(y - j)
            total += weight * image[min(max(j, 0), height - 1), min(max(i, 0), width - 1)]
    return total


def features(lumas: Array, positions: Array, u: float, v: float, disparity: float) -> tuple[Array, Array]:
    """Mean and standard deviation (N - 1) over the inputs (N, H, W) warped at one disparity, over those that are inside."""
    _, height, width = lumas.shape
    mean, deviation = np.zeros((height, width)), np.zeros((height, width))
    for y in range(height):
        for x in range(width):
            samples = [
                sample(luma, x + (pu - u) * disparity, y + (pv - v) * disparity)
                for luma, (pu, pv) in zip(lumas, positions, strict=True)
            ]
            inside = [value for value in samples if value is not None]
            if inside:
                mean[y, x] = sum(inside) / len(inside)
            if len(inside) > 1:
                deviation[y, x] = math.sqrt(sum((value - mean[y, x]) ** 2 for value in inside) / (len(inside) - 1))
    return mean, deviation
