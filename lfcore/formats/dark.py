"""Which views are too dark to be used: the outermost of a Lytro, seen past the edge of the aperture."""

from __future__ import annotations

import numpy as np

from lfcore.formats.images import Pixels

# A view darker than this share of the centre's brightness counts as dark.
DARK_SHARE = 0.5

# Brightness is measured on every eighth pixel in x and y.
_STRIDE = 8


def brightness(views: Pixels) -> np.ndarray:
    """Mean stored value of each view, float64 (V, U), from every eighth pixel of (V, U, H, W, 3)."""
    return views[:, :, ::_STRIDE, ::_STRIDE].mean(axis=(2, 3, 4), dtype=np.float64)


def has_dark_corner(dark: frozenset[tuple[int, int]], rows: int, columns: int) -> bool:
    """Whether one of the views that a synthesis is made from is among the dark ones."""
    return not dark.isdisjoint({(0, 0), (0, columns - 1), (rows - 1, 0), (rows - 1, columns - 1)})


def find_dark_views(views: Pixels) -> frozenset[tuple[int, int]]:
    """(row, column) of the views whose brightness is under half of that of the grid's centre."""
    levels = brightness(views)
    rows, columns = levels.shape
    centre = levels[(rows - 1) // 2 : rows // 2 + 1, (columns - 1) // 2 : columns // 2 + 1].mean()
    return frozenset((int(row), int(column)) for row, column in np.argwhere(levels < DARK_SHARE * centre))
