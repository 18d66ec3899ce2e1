"""The viewpoint moving by itself, slowly, on a small circle about where it was: what parallax there is, is seen at rest."""

from __future__ import annotations

import math

from app.geometry import Point
from app.state import ViewState, clamp_viewpoint

RADIUS = 0.1  # of the baseline
PERIOD = 6.0  # seconds
_OPENING = 1.5  # seconds until the circle has its size


class Sway:
    """Moves the viewpoint while the state says so, and stops when anything else has moved it."""

    def __init__(self) -> None:
        self._began: float | None = None
        self._centre: Point = (0.0, 0.0)
        self._placed: Point = (0.0, 0.0)  # where it has put the viewpoint

    def move(self, state: ViewState, now: float) -> None:
        """Put the viewpoint where it is to be at that time (seconds)."""
        if not state.swaying:
            self._began = None
            return
        here = state.u, state.v
        if self._began is None:
            self._began, self._centre = now, here
        elif state.dragging or here != self._placed:
            state.swaying, self._began = False, None
            return
        self._placed = clamp_viewpoint(*_on_circle(self._centre, now - self._began))
        state.move_to(*self._placed)


def _on_circle(centre: Point, seconds: float) -> Point:
    opened = min(seconds / _OPENING, 1.0)
    radius = RADIUS * opened * opened * (3 - 2 * opened)
    angle = 2 * math.pi * seconds / PERIOD
    return centre[0] + radius * math.cos(angle), centre[1] + radius * math.sin(angle)
