"""The light field: a grid of views and their viewpoints. Axis order and the sense of (u, v) are defined here alone."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt

from lfcore.errors import InputError

FloatArray = npt.NDArray[np.float32]

# Corner views in the order in which the colour network reads them (the authors' code: the row varies fastest):
# top-left, bottom-left, top-right, bottom-right, as (u, v).
CORNERS: tuple[tuple[float, float], ...] = ((0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (1.0, 1.0))

# How far beyond the corners a viewpoint may lie, in units of the corner-to-corner baseline.
EXTRAPOLATION_LIMIT = 0.25


@dataclass(frozen=True)
class LightField:
    """A grid of V x U sub-aperture views.

    `views` is (V, U, H, W, 3), uint8 or uint16 as stored in the file, or float32 in units where 1 is white. Row v grows
    downwards, column u to the right; captured view (row, column) sits at u = column / (U - 1), v = row / (V - 1), so that
    the four corner views span [0, 1]^2. `dark` names the views too dark to be used (outer views of an Illum). `aperture`: how
    much of an Illum's aperture the grid spans, 1 = the middle 8 x 8 views of its ESLF; 0 where it is not known to be of one
    (lfcore.illum).
    """

    views: npt.NDArray[np.generic]  # (V, U, H, W, 3)
    name: str
    source: str
    kind: str
    facts: Mapping[str, str] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    dark: frozenset[tuple[int, int]] = frozenset()
    aperture: float = 0.0

    def __post_init__(self) -> None:
        if self.views.ndim != 5 or self.views.shape[-1] != 3:
            raise ValueError(f"views must be (V, U, H, W, 3), not {self.views.shape}")
        if self.views.dtype not in (np.uint8, np.uint16, np.float32):
            raise ValueError(f"views must be uint8, uint16 or float32, not {self.views.dtype}")
        if min(self.views.shape[:2]) < 2:
            rows, columns = self.views.shape[:2]
            raise InputError(
                f"{self.name}: found {rows} x {columns} views, but a light field needs at least 2 x 2 (its four corners)."
            )

    @property
    def rows(self) -> int:
        """V, the number of rows of views."""
        return int(self.views.shape[0])

    @property
    def columns(self) -> int:
        """U, the number of columns of views."""
        return int(self.views.shape[1])

    @property
    def height(self) -> int:
        """Height of one view in pixels."""
        return int(self.views.shape[2])

    @property
    def width(self) -> int:
        """Width of one view in pixels."""
        return int(self.views.shape[3])

    def view(self, row: int, column: int) -> FloatArray:
        """Captured view as float32 (H, W, 3), 1 = white."""
        return as_float(self.views[row, column])

    def position(self, row: int, column: int) -> tuple[float, float]:
        """(u, v) of the captured view in that row and column."""
        return column / (self.columns - 1), row / (self.rows - 1)

    def corners(self) -> FloatArray:
        """The four corner views in the order of CORNERS, float32 (4, H, W, 3)."""
        return as_float(np.stack([self.views[-int(v), -int(u)] for u, v in CORNERS]))

    def nearest(self, u: float, v: float) -> tuple[int, int]:
        """(row, column) of the captured view nearest to (u, v)."""
        row = min(max(round(v * (self.rows - 1)), 0), self.rows - 1)
        column = min(max(round(u * (self.columns - 1)), 0), self.columns - 1)
        return row, column

    def at(self, u: float, v: float, tolerance: float = 1e-3) -> tuple[int, int] | None:
        """(row, column) of the captured view that sits at (u, v), or None; `tolerance` in units of the baseline."""
        row, column = self.nearest(u, v)
        captured_u, captured_v = self.position(row, column)
        return (row, column) if math.hypot(u - captured_u, v - captured_v) <= tolerance else None

    @cached_property
    def content_key(self) -> str:
        """Hex digest of the pixels, their arrangement and their aperture: all that a synthesis depends on, whatever file it
        came from."""
        digest = hashlib.blake2b(repr((self.views.shape, str(self.views.dtype))).encode(), digest_size=16)
        if self.aperture:
            digest.update(repr(self.aperture).encode())
        for row in self.views:
            digest.update(np.ascontiguousarray(row).data)
        return digest.hexdigest()


def as_float(stored: npt.NDArray[np.generic]) -> FloatArray:
    """Stored values to float32 with 1 = white: uint8 / 255, uint16 / 65535, floats as they are."""
    if stored.dtype == np.uint8:
        return np.multiply(stored, np.float32(1 / 255), dtype=np.float32)
    if stored.dtype == np.uint16:
        return np.multiply(stored, np.float32(1 / 65535), dtype=np.float32)
    return stored.astype(np.float32, copy=False)


def check_viewpoint(u: float, v: float) -> None:
    """Raise InputError unless (u, v) is finite and at most EXTRAPOLATION_LIMIT beyond the corners."""
    low, high = -EXTRAPOLATION_LIMIT, 1 + EXTRAPOLATION_LIMIT
    for name, value in (("u", u), ("v", v)):
        if not math.isfinite(value):
            raise InputError(f"The viewpoint's {name} is {value}; it must be a number from {low} to {high}.")
        if not low <= value <= high:
            raise InputError(f"The viewpoint's {name} is {value:g}; it must lie from {low} to {high} (corners at 0 and 1).")


def is_extrapolated(u: float, v: float) -> bool:
    """Whether (u, v) lies outside the square spanned by the corner views."""
    return not (0 <= u <= 1 and 0 <= v <= 1)
