"""A made-up light field with a known truth: a smooth pattern, all of it at one disparity, so that any view is a formula."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from lfcore.errors import Cancelled
from lfcore.lightfield import FloatArray, LightField
from lfcore.synthesizer import Synthesis

DISPARITY = -6.0  # px over the baseline; near content, which moves to the left as u grows
SIZE = (96, 128)  # (H, W)


def truth(u: float, v: float, size: tuple[int, int] = SIZE, disparity: float = DISPARITY) -> FloatArray:
    """The view at (u, v), float32 (H, W, 3)."""
    height, width = size
    y, x = np.mgrid[:height, :width].astype(np.float64)
    x, y = x - disparity * u, y - disparity * v
    channels = (
        0.5 + 0.3 * np.sin(x / 9) * np.cos(y / 11),
        0.5 + 0.3 * np.cos(x / 13 + y / 17),
        0.4 + 0.3 * np.sin(x / 7 - y / 19),
    )
    return np.stack(channels, axis=-1).astype(np.float32)


def light_field(rows: int = 3, columns: int = 3, size: tuple[int, int] = SIZE) -> LightField:
    """The scene captured in 8 bits."""
    views = [[truth(c / (columns - 1), r / (rows - 1), size) for c in range(columns)] for r in range(rows)]
    return LightField(np.round(np.array(views) * 255).astype(np.uint8), "moving", "tests", "made up")


class TruthSynthesizer:
    """Answers with the formula itself, after `seconds` of work that can be cancelled."""

    name = "truth"
    key = "truth"

    def __init__(self, seconds: float = 0.0) -> None:
        self.seconds = seconds
        self.asked: list[tuple[float, float]] = []
        self._size = SIZE

    def set_light_field(self, light_field: LightField) -> None:
        self._size = (light_field.height, light_field.width)

    def synthesize(self, u: float, v: float, cancelled: Callable[[], bool] = lambda: False) -> Synthesis:
        end = time.monotonic() + self.seconds
        self.asked.append((u, v))  # from here on a test may choose how long the next one takes
        while time.monotonic() < end:
            if cancelled():
                raise Cancelled
            time.sleep(0.005)
        disparity = np.full(self._size, DISPARITY, np.float32)
        return Synthesis(u, v, self.name, truth(u, v, self._size), disparity, None, {"total": self.seconds})
