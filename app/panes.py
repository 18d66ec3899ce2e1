"""Several pictures in the window at once: which lies where, all of them magnified alike."""

from __future__ import annotations

from dataclasses import dataclass

from app.comparison import Arrangement, Comparison
from app.geometry import Placement, Point, Rect, Size, Zoom, place
from app.state import ViewState

GAP = 2.0  # window units between two pictures side by side


@dataclass(frozen=True)
class Pane:
    """A picture in the window. `frame` is the rectangle in which it is placed, `clip` the part of that which shows it."""

    frame: Rect
    clip: Rect
    partner: bool  # whether it shows what the picture is compared with

    def placement(self, zoom: Zoom, picture: Size) -> Placement:
        """Where a picture of that size lies: at the same place in every pane, since they share the zoom."""
        return place(zoom, picture, self.frame)


def arrange(state: ViewState, area: Rect) -> tuple[Pane, ...]:
    """The panes of this area. What belongs to the picture itself comes first; a sheet of several pictures stands alone."""
    comparison = state.comparison
    if state.look.tiles != (1, 1):
        return (Pane(area, area, False),)
    if state.flipped:
        return (Pane(area, area, True),)
    if comparison.arrangement is Arrangement.SIDE_BY_SIDE:
        width = (area.width - GAP) / 2
        left = Rect(area.x, area.y, width, area.height)
        right = Rect(area.x + width + GAP, area.y, width, area.height)
        return Pane(left, left, False), Pane(right, right, True)
    if comparison.arrangement is Arrangement.WIPE:
        x = handle(comparison, area)
        left = Rect(area.x, area.y, x - area.x, area.height)
        right = Rect(x, area.y, area.x + area.width - x, area.height)
        return Pane(area, left, False), Pane(area, right, True)
    return (Pane(area, area, False),)


def handle(comparison: Comparison, area: Rect) -> float:
    """Where the wipe's handle lies across the window."""
    return round(area.x + comparison.wipe * area.width)


def under(panes: tuple[Pane, ...], point: Point) -> Pane:
    """The pane at a point of the window; beside all of them the first."""
    return next((pane for pane in panes if pane.clip.contains(point)), panes[0])
