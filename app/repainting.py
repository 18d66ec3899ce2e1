"""What of a painted window has changed since it was painted last: only that is painted again, most of the panels never.

The window is divided into cells. Of each a number is kept, its mark, which follows from everything that is painted in it. Where
marks differ, so do pictures; that two pictures have the same one will not happen (one of 2**64).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
import numpy.typing as npt

from app import painting
from app.geometry import Size
from app.painting import Box
from app.panel_painting import Piece
from lfcore.synthesis import ByteArray

CELL = 32  # pixels
Marks = npt.NDArray[np.uint64]
_STEP = np.uint64(0x9E3779B97F4A7C15)


class Layer(Protocol):
    """What fills a rectangle of the window beneath the panels. mark: the same only as long as it looks the same."""

    @property
    def box(self) -> Box: ...

    @property
    def mark(self) -> int: ...

    def paint(self, sheet: ByteArray, box: Box) -> None:
        """Set these pixels of the sheet, (H, W, 4), which lie in its own box."""


class Repainting:
    """Knows what is in a window, whose sheet keeps what has been painted."""

    def __init__(self) -> None:
        self._size: Size = (0, 0)
        self._marks: Marks | None = None

    def forget(self) -> None:
        """The sheet has been used otherwise: all of the next one is to be painted."""
        self._marks = None

    def outdated(self, size: Size, layers: Sequence[Layer], pieces: Sequence[Piece]) -> list[Box]:
        """Where a window (width, height) of these layers, and these pieces over them, looks otherwise than the one before:
        boxes of which no two share a pixel. It counts as painted from now on."""
        marks = _marks_of(size, layers, pieces)
        changed = np.ones(marks.shape, np.bool_)
        if self._marks is not None and size == self._size:
            changed = marks != self._marks
        self._size, self._marks = size, marks
        return _boxes(changed, size)


def paint(sheet: ByteArray, boxes: Sequence[Box], layers: Sequence[Layer], pieces: Sequence[Piece]) -> None:
    """Paint these boxes of the sheet, of which no two may share a pixel: layers, and the pieces over them."""
    for layer in layers:
        for box in _parts(layer.box, boxes):
            layer.paint(sheet, box)
    for piece in pieces:
        seen = _parts(piece.box, boxes)
        if seen:
            painting.triangles(sheet, seen, piece.texture, piece.corners, piece.indices)


def _parts(whole: Box, boxes: Sequence[Box]) -> list[Box]:
    """What of a box lies in others."""
    return [part for box in boxes if (part := whole.within(box)) is not None]


def _marks_of(size: Size, layers: Sequence[Layer], pieces: Sequence[Piece]) -> Marks:
    """The marks of all cells: (rows, columns)."""
    marks = np.zeros((-(-size[1] // CELL), -(-size[0] // CELL)), np.uint64)
    whole = Box(0, 0, *size)
    for layer in layers:
        seen = layer.box.within(whole)
        if seen is not None:
            cells = marks[seen.top // CELL : -(-seen.bottom // CELL), seen.left // CELL : -(-seen.right // CELL)]
            cells ^= _number(layer.mark, seen)
            cells *= _STEP
    for piece in pieces:
        painting.marked(marks, CELL, piece.box, int(_number(piece.number, piece.box)), piece.corners, piece.indices)
    return marks


def _number(*of: object) -> np.uint64:
    return np.uint64(hash(of) % 2**64)


def _boxes(changed: npt.NDArray[np.bool_], size: Size) -> list[Box]:
    """Boxes of all cells (rows, columns) that are true: runs of each row, and equal ones below one another as one."""
    columns = changed.shape[1] + 2
    lined_up = np.zeros((changed.shape[0], columns), np.bool_)  # so that no run goes on in the next row
    lined_up[:, 1:-1] = changed
    edges = np.flatnonzero(lined_up.ravel()[1:] != lined_up.ravel()[:-1]).tolist()
    boxes: list[list[int]] = []
    latest: dict[tuple[int, int], list[int]] = {}  # of runs, which box is theirs
    for start, end in zip(edges[::2], edges[1::2], strict=True):
        row, run = start // columns, (start % columns, end % columns)
        above = latest.get(run)
        if above is not None and above[3] == row:
            above[3] = row + 1
        else:
            latest[run] = [run[0], row, run[1], row + 1]
            boxes.append(latest[run])
    return [
        Box(left * CELL, top * CELL, min(right * CELL, size[0]), min(bottom * CELL, size[1]))
        for left, top, right, bottom in boxes
    ]
