"""The colours of a picture in the coarse: what is left of it when all that is finer than a block is averaged away."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lfcore.lightfield import FloatArray

BLOCK = 32  # px; much more than neighbouring captured views move


class CoarseColours:
    """Pictures of one size (H, W, 3) to coarse ones and back.

    Each view by lfcore.nearest_inputs is brought there and back, in 3 ms: OpenImageIO's resizing takes 50, and products of
    matrices by numpy take threads, which would wait for cores that networks hold.
    """

    def __init__(self, height: int, width: int) -> None:
        self._down, self._across = _Axis.of(height), _Axis.of(width)

    def of(self, picture: FloatArray) -> FloatArray:
        """(H, W, 3) -> (H / BLOCK, W / BLOCK, 3), about: the means of blocks."""
        lines = np.add.reduceat(picture, self._down.starts, 0)  # (h, W, 3)
        sums = np.add.reduceat(lines, self._across.starts, 1)
        return np.divide(sums, self._down.sizes[:, None, None] * self._across.sizes[:, None], dtype=np.float32)

    def spread(self, coarse: FloatArray) -> FloatArray:
        """(h, w, 3) -> (H, W, 3), linear between the middles of blocks."""
        lines = self._across.between(coarse.swapaxes(0, 1)).swapaxes(0, 1)  # (h, W, 3)
        return self._down.between(np.ascontiguousarray(lines))


@dataclass(frozen=True)
class _Axis:
    """How an axis of a picture is divided into blocks."""

    starts: npt.NDArray[np.intp]  # (blocks,)
    sizes: FloatArray  # (blocks,)
    before: npt.NDArray[np.intp]  # (length,), the block whose middle lies before each pixel
    after: npt.NDArray[np.intp]  # (length,)
    share: FloatArray  # (length, 1, 1), of the latter

    @staticmethod
    def of(length: int) -> _Axis:
        blocks = max(round(length / BLOCK), 1)
        starts = np.arange(blocks) * length // blocks
        sizes = np.diff(starts, append=length).astype(np.float32)
        places = np.interp(np.arange(length), starts + (sizes - 1) / 2, np.arange(blocks))
        before = places.astype(np.intp)
        share = (places - before).astype(np.float32)[:, None, None]
        return _Axis(starts, sizes, before, np.minimum(before + 1, blocks - 1), share)

    def between(self, values: FloatArray) -> FloatArray:
        """(blocks, n, 3) -> (length, n, 3)."""
        found = values[self.after]
        found -= values[self.before]
        found *= self.share
        found += values[self.before]
        return found
