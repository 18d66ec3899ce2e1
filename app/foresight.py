"""Which viewpoints the hand will want next, as far as one can tell from where it has gone."""

from __future__ import annotations

import math
from collections.abc import Iterator

from app.commands import NUDGE
from app.geometry import Point
from app.state import Grid

STEPS_ALONG = 4
_JUMP = 0.75 * NUDGE  # movements at least this long are steps of their own; shorter ones are parts of a drag
_MEMORY = 0.7  # of the direction so far, where a drag goes on


def heading(before: Point, movement: Point) -> Point:
    """The direction of travel after one more movement, not normalised."""
    if math.hypot(*movement) >= _JUMP:
        return movement
    return _MEMORY * before[0] + movement[0], _MEMORY * before[1] + movement[1]


def viewpoints_ahead(here: Point, direction: Point, grid: Grid) -> Iterator[Point]:
    """First along the direction of travel, in steps of the arrow keys, as far as the corner views span; then the captured
    viewpoints, the nearest first. A drag that comes to rest beside one of them goes there (see controller.MAGNET_RADIUS)."""
    length = math.hypot(*direction)
    if length > 0:
        for step in range(1, STEPS_ALONG + 1):
            u = here[0] + step * NUDGE * direction[0] / length
            v = here[1] + step * NUDGE * direction[1] / length
            if 0 <= u <= 1 and 0 <= v <= 1:
                yield u, v
    yield from sorted(captured_viewpoints(grid), key=lambda point: math.dist(point, here))


def captured_viewpoints(grid: Grid) -> list[Point]:
    """(u, v) of the captured views that are not dark."""
    count = grid.rows * grid.columns
    return [grid.position(index) for index in range(count) if divmod(index, grid.columns) not in grid.dark]
