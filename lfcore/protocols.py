"""Scoring protocols: which views of a light field are synthesized from which corners, and how each is scored.

Scores by different protocols cannot be compared: a table holds one of them, and says which.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from lfcore.errors import InputError
from lfcore.illum import aperture_of_part
from lfcore.lightfield import CORNERS, FloatArray, LightField
from lfcore.metrics import Score, channel_score, k16, k16_view, luma_score


@dataclass(frozen=True)
class Protocol:
    """A rule of scoring that names itself.

    `side` is the side of the square grid of views that is synthesized, or None where any grid from 3 x 3 on will do and
    one view is scored. `score` takes the synthesis and the captured view, float32 (H, W, 3), 1 = white.
    """

    name: str
    says: str  # what it means, for people: after the name and a colon
    side: int | None
    score: Callable[[FloatArray, FloatArray], Score]

    def grid(self, light_field: LightField) -> LightField:
        """The part of the light field that the protocol is about: the middle `side` x `side` views.

        Of 8 x 8 views a grid of 7 x 7 takes the first seven rows and columns, as the published tests do; of 9 x 9 it drops
        one on each side. Raises InputError where there are too few views.
        """
        if self.side is None:
            return light_field
        rows, columns, side = light_field.rows, light_field.columns, self.side
        if min(rows, columns) < side:
            raise InputError(
                f"{light_field.name}: found {rows} x {columns} views, but the protocol {self.name} is about {side} x {side}; "
                f"use {K16.name} for it."
            )
        if (rows, columns) == (side, side):
            return light_field
        top, left = (rows - side) // 2, (columns - side) // 2
        dark = {(row - top, column - left) for row, column in light_field.dark}
        return replace(
            light_field,
            views=light_field.views[top : top + side, left : left + side],
            dark=frozenset((row, column) for row, column in dark if 0 <= row < side and 0 <= column < side),
            aperture=aperture_of_part(light_field, side - 1),
        )

    def views(self, grid: LightField) -> list[tuple[int, int]]:
        """(row, column), from 0, of the views in `grid` whose mean is the score. InputError where there is none."""
        return [k16_view(grid)] if self.side is None else novel_views(grid)

    def shown_view(self, grid: LightField) -> tuple[int, int]:
        """The one of those views that figures show: near the middle."""
        return grid.rows // 2, grid.columns // 2


def novel_views(grid: LightField) -> list[tuple[int, int]]:
    """(row, column) of every view that is not one of the four corners, row by row."""
    places = [(row, column) for row in range(grid.rows) for column in range(grid.columns)]
    return [(row, column) for row, column in places if grid.position(row, column) not in CORNERS]


K16 = Protocol("K16", "one view near the middle, 8 bits, RGB, 22 px cropped on each side (Kalantari 2016)", None, k16)
SEVEN_Y = Protocol(
    "7x7-Y", "mean over the 45 novel views of 7 x 7, luminance Y (BT.601, 16 to 235), 22 px cropped on each side", 7, luma_score
)
EIGHT_BGR = Protocol(
    "8x8-BGR", "mean over the 60 novel views of 8 x 8 and three channels, 8 bits, 22 px cropped on each side", 8, channel_score
)
PROTOCOLS = {protocol.name.lower(): protocol for protocol in (K16, SEVEN_Y, EIGHT_BGR)}
