"""What the program and its process for synthesis (lfcore.remote) say to each other, and the memory that both see.

Messages go through a pipe between the two, as they are few and small. Pixels lie in shared memory: in a pipe, which holds
little, they would wait for the other side dozens of times.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from multiprocessing.shared_memory import SharedMemory

import numpy as np
import numpy.typing as npt

from lfcore.lightfield import CORNERS, FloatArray
from lfcore.synthesis import ByteArray, Synthesizer

MakeSynthesizer = Callable[[str], Synthesizer]


@dataclass(frozen=True)
class Make:
    """Load the model of that name; answered by Made."""

    model: str


@dataclass(frozen=True)
class Take:
    """Take the corner views from the shared memory of that name; answered by Taken."""

    memory: str
    shape: tuple[int, int]  # (H, W)
    dtype: str
    aperture: float  # see LightField


@dataclass(frozen=True)
class Synthesize:
    """Synthesize a view; answered by Finished."""

    number: int
    model: str
    u: float
    v: float
    weighed: bool = False


@dataclass(frozen=True)
class Cancel:
    """Nobody wants the view of that number any more; not answered."""

    number: int


@dataclass(frozen=True)
class Made:
    """See Synthesizer."""

    name: str
    key: str
    weighs: bool


@dataclass(frozen=True)
class Taken:
    """The corner views have been copied."""


@dataclass(frozen=True)
class Finished:
    """The view lies in the shared memory."""

    has_disparity: bool
    has_weights: bool
    timings: Mapping[str, float]


@dataclass(frozen=True)
class Failed:
    """In place of any other answer: what was raised."""

    error: Exception


Request = Make | Take | Synthesize | Cancel
Reply = Made | Taken | Finished | Failed


class Exchange:
    """Arrays in shared memory: first the corner views (4, H, W, 3), as stored, then image, disparity and weights of one
    view."""

    def __init__(self, memory: SharedMemory, shape: tuple[int, int], dtype: npt.DTypeLike) -> None:
        self._memory = memory
        height, width = shape
        self.corners: npt.NDArray[np.generic] = np.ndarray((len(CORNERS), height, width, 3), dtype, memory.buf)
        self.image: FloatArray = np.ndarray((height, width, 3), np.float32, memory.buf)
        self.disparity: FloatArray = np.ndarray((height, width), np.float32, memory.buf, self.image.nbytes)
        before = self.image.nbytes + self.disparity.nbytes
        self.weights: ByteArray = np.ndarray((len(CORNERS), height, width), np.uint8, memory.buf, before)

    @staticmethod
    def size(shape: tuple[int, int], dtype: npt.DTypeLike) -> int:
        """Bytes needed for pictures of this (H, W)."""
        pixels = shape[0] * shape[1]
        return max(3 * len(CORNERS) * np.dtype(dtype).itemsize, 4 * 4 + len(CORNERS)) * pixels

    def close(self) -> None:
        """Let go of the memory; the arrays must not be used any more."""
        del self.corners, self.image, self.disparity, self.weights
        self._memory.close()
