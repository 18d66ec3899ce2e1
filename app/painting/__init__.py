"""Pictures made by the processor in C, where it does the graphics' work anyway: a third of what the same shaders cost there.

Optional, as lfcore.kernels is: where nothing was compiled, shaders do all of it. Arrays are C-contiguous, pixels uint8
(H, W, 4), of which the fourth value does not count. With a GPU only `in_bytes` is used. No GL here, and no torch.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from app.geometry import Point
from lfcore.extensions import extension
from lfcore.lightfield import FloatArray
from lfcore.metrics import to_uint8
from lfcore.synthesis import ByteArray

Memory = npt.NDArray[np.generic] | ctypes.Array[ctypes.c_char]  # that lies in one piece

CHANNELS = 4  # bytes of a pixel
MARGIN = 3  # pixels by which a spread picture is continued; as in carried.c
_FUNCTIONS = ("carried", "spread", "in_bytes", "mixed", "enlarged", "triangles", "marked")

_PAINTING = extension("app.painting._painting", _FUNCTIONS)


def compiled() -> bool:
    """Whether the functions below can be called."""
    return _PAINTING is not None


def in_bytes(image: FloatArray) -> ByteArray:
    """A picture (H, W, 3) of 0 to 1 in 8 bits: (H, W, 4). By numpy where nothing was compiled."""
    pixels = np.empty((*image.shape[:2], 4), np.uint8)
    if _PAINTING is not None:
        _PAINTING.in_bytes(np.ascontiguousarray(image, np.float32), pixels)
    else:
        pixels[..., :3] = to_uint8(image)
        pixels[..., 3] = 255
    return pixels


class Spread:
    """A picture as `carried` samples it: float32 (H + 2 MARGIN, W + 2 MARGIN, 4), 0 to 255, its edges repeated.

    size: (H, W). Its memory is used again for the pictures it takes one after the other.
    """

    def __init__(self, size: tuple[int, int]) -> None:
        self.size = height, width = size
        self.values = np.empty((height + 2 * MARGIN, width + 2 * MARGIN, 4), np.float32)
        self._taken: ByteArray | None = None

    def take(self, pixels: ByteArray) -> None:
        """It is this picture from now on, which may not be changed; nothing is done where it is that already."""
        assert _PAINTING is not None
        if pixels is not self._taken:
            _PAINTING.spread(*self.size, np.ascontiguousarray(pixels), self.values)
            self._taken = pixels


@dataclass(frozen=True)
class Moved:
    """A picture, and how far a disparity of 1 px moves what is seen in it, px to the right and down."""

    picture: Spread
    by: Point


def carried(
    newest: Moved, older: Moved, share: float, disparity: FloatArray, nearest: float, steps: int, out: ByteArray
) -> None:
    """What is seen when the newest picture and, for the rest of its `share`, the older one are moved by the newest's disparity.

    disparity: (H, W) float32, px, of the newest picture; nearest: the smallest of it; steps: how often it is looked up again
    where it led to, see shaders/carry.glsl. out: set.
    """
    assert _PAINTING is not None
    height, width = newest.picture.size
    layers = (newest.picture.values, newest.by, older.picture.values, older.by)
    _PAINTING.carried(height, width, *layers, share, disparity, nearest, steps, out)


def mixed(before: ByteArray, after: ByteArray, share: float, out: ByteArray) -> None:
    """The cross-fade between two pictures; share: of `after`. out: set."""
    assert _PAINTING is not None
    _PAINTING.mixed(before, after, share, out)


@dataclass(frozen=True)
class Places:
    """Where along an axis a picture is sampled: after which pixels, and how much of the next one counts."""

    first: npt.NDArray[np.int32]
    share: FloatArray  # 0 to 1

    @staticmethod
    def between(points: npt.NDArray[np.floating], size: int) -> Places:
        """For points in pixels, of which the first covers 0 to 1, between the two nearest; beyond an edge that edge."""
        from_centres = np.clip(points - 0.5, 0, size - 1)
        first = np.floor(from_centres)
        return Places(first.astype(np.int32), (from_centres - first).astype(np.float32))

    @staticmethod
    def at(points: npt.NDArray[np.floating], size: int) -> Places:
        """The same for the pixels in which they lie."""
        first = np.clip(np.floor(points), 0, size - 1)
        return Places(first.astype(np.int32), np.zeros(len(points), np.float32))


def enlarged(picture: ByteArray, rows: Places, columns: Places, out: ByteArray) -> None:
    """The picture at these places, blue first, as windows are kept. out: (rows, columns, 4), set; its rows may lie apart."""
    assert _PAINTING is not None
    height, width = picture.shape[:2]
    _PAINTING.enlarged(height, width, picture, (rows.first, rows.share), (columns.first, columns.share), out)


@dataclass(frozen=True)
class Box:
    """A rectangle of whole pixels, y downwards; right and bottom lie outside."""

    left: int
    top: int
    right: int
    bottom: int

    def within(self, other: Box) -> Box | None:
        """What both share; None where that is nothing."""
        left, top = max(self.left, other.left), max(self.top, other.top)
        right, bottom = min(self.right, other.right), min(self.bottom, other.bottom)
        return Box(left, top, right, bottom) if left < right and top < bottom else None


CORNER_BYTES = 20  # place (x, y) in pixels, place in the texture (u, v) of 0 to 1: float32; colour: red first, then covering


@dataclass(frozen=True)
class Texture:
    """What triangles are filled with. pixels: (h, w, 4), red first; white: they differ only in how much they cover."""

    pixels: ByteArray
    white: bool


def triangles(sheet: ByteArray, boxes: Sequence[Box], texture: Texture, corners: Memory, indices: Memory) -> None:
    """Triangles blended over a sheet within boxes, as graphics draw them: colours times a texture between its pixels.

    sheet: (H, W, 4), blue first, as windows are kept. boxes: no two share a pixel. corners: CORNER_BYTES each. indices: uint32,
    three corners a triangle. Raises ValueError for a corner that is not there.
    """
    assert _PAINTING is not None
    bounds = np.array([(box.left, box.top, box.right, box.bottom) for box in boxes], np.int64)
    filling = texture.pixels
    of_texture = (*filling.shape[:2], filling, texture.white)
    _PAINTING.triangles(*sheet.shape[:2], sheet, len(boxes), bounds, *of_texture, corners, indices)


def marked(marks: npt.NDArray[np.uint64], side: int, box: Box, beneath: int, corners: Memory, indices: Memory) -> None:
    """Let the mark of every cell that triangles touch within a box follow from what they look like, and from what it was.

    marks: (rows, columns), changed; side: of a cell, in pixels; beneath: 0 to 2**64 - 1, stands for whatever else counts;
    corners and indices as for `triangles`. Raises ValueError for a corner that is not there.
    """
    assert _PAINTING is not None
    _PAINTING.marked(*marks.shape, side, marks, (box.left, box.top, box.right, box.bottom), beneath, corners, indices)
