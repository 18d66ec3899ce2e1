"""The quilt of Looking Glass displays: views from left to right as tiles of one picture, told by the end of its name."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from lfcore.errors import InputError
from lfcore.key_frames import MAX_FOCUS

MAX_VIEWS = 64  # along one side of a grid or a quilt
_ENDING = re.compile(r"_qs\d+x\d+a[\d.]+$")


@dataclass(frozen=True)
class Quilt:
    """`columns` x `rows` views from left to right along u, at `v`; `focus` (px of disparity over the baseline) is what lies in
    the plane of the screen."""

    columns: int
    rows: int
    v: float = 0.5
    focus: float = 0.0

    def __post_init__(self) -> None:
        if not (1 <= self.columns <= MAX_VIEWS and 1 <= self.rows <= MAX_VIEWS and self.columns * self.rows >= 2):
            raise InputError(
                f"A quilt of {self.columns} x {self.rows} views was asked for; give from 1 x 2 to {MAX_VIEWS} x {MAX_VIEWS}."
            )

        if not abs(self.focus) <= MAX_FOCUS:  # as it stands, NaN is caught too
            raise InputError(f"The focus is {self.focus:g}; it must lie from {-MAX_FOCUS:g} to {MAX_FOCUS:g} px of disparity.")

    def place(self, number: int) -> tuple[int, int]:
        """(row from the top, column) of view `number`, from 0 at the left of the scene: the bottom left comes first."""
        up, column = divmod(number, self.columns)
        return self.rows - 1 - up, column


def quilt_path(path: Path, quilt: Quilt, view: tuple[int, int]) -> Path:
    """The file's name with the ending by which players of quilts know columns, rows and a view's aspect, from its (width,
    height): name_qs8x6a1.439.png."""
    aspect = f"{view[0] / view[1]:.4g}"
    stem = path.stem if path.suffix.lower() == ".png" else path.name
    return path.with_name(f"{_ENDING.sub('', stem)}_qs{quilt.columns}x{quilt.rows}a{aspect}.png")
