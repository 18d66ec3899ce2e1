"""The tone in which the paper's authors show dark captures. Only for looking: nothing is computed in it."""

from __future__ import annotations

import numpy as np

from lfcore.lightfield import FloatArray

_EXPONENT = 1 / 1.5
_SATURATION = 1.5


def brightened(image: FloatArray) -> FloatArray:
    """A picture (H, W, 3), 1 = white, to the power of 1/1.5, then with 1.5 times the saturation (HSV, at most 1): float32."""
    value = np.clip(image, 0, 1) ** np.float32(_EXPONENT)
    largest = value.max(axis=2, keepdims=True)
    saturation = (largest - value.min(axis=2, keepdims=True)) / np.maximum(largest, 1e-6)
    more = np.minimum(_SATURATION, 1 / np.maximum(saturation, 1e-6))
    return (largest - (largest - value) * more).astype(np.float32)
