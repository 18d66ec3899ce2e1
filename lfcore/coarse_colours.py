"""The colours of a picture in the coarse: what is left of it when all that is finer than a block is averaged away."""

from __future__ import annotations

import numpy as np

from lfcore.lightfield import FloatArray

BLOCK = 16  # px; much more than neighbouring captured views move


class CoarseColours:
    """Pictures of one size (H, W, 3) to coarse ones and back."""

    def __init__(self, height: int, width: int) -> None:
        self._down, self._across = _hats(height), _hats(width)

    def of(self, picture: FloatArray) -> FloatArray:
        """(H, W, 3) -> (H / BLOCK, W / BLOCK, 3), about: means around the middles of blocks."""
        lines = np.tensordot(self._down / self._down.sum(0), picture, (0, 0))  # (h, W, 3)
        return np.tensordot(lines, self._across / self._across.sum(0), (1, 0)).swapaxes(1, 2)

    def spread(self, coarse: FloatArray) -> FloatArray:
        """(h, w, 3) -> (H, W, 3), linear between the middles of blocks."""
        lines = np.tensordot(coarse, self._across, (1, 1)).swapaxes(1, 2)  # (h, W, 3)
        return np.tensordot(self._down, lines, (1, 0))


def _hats(length: int) -> FloatArray:
    """Shares of each block in the pixels along an axis, linear between the blocks' middles: (length, blocks)."""
    blocks = max(round(length / BLOCK), 1)
    places = np.clip((np.arange(length) + 0.5) * blocks / length - 0.5, 0, blocks - 1)
    return np.maximum(1 - np.abs(places[:, None] - np.arange(blocks)), 0).astype(np.float32)
