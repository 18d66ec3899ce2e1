"""Where the parts of the window lie, for any size of it and any scale of its text."""

from __future__ import annotations

from dataclasses import dataclass, replace

from app.geometry import Rect

PANEL_WIDTH = 296.0
STATUS_HEIGHT = 30.0
PICTURE_LEAST = 320.0  # narrower than this beside the panel, the picture takes the panel's room
STRIP = 96.0  # extent of an epipolar slice
STRIP_GAP = 2.0


@dataclass(frozen=True)
class Strips:
    """Where epipolar slices lie: below the picture and beside it."""

    below: Rect
    beside: Rect


@dataclass(frozen=True)
class Layout:
    """The parts of the window, in its units; the panel and the strips are None where they are not wanted or have no room."""

    picture: Rect
    panel: Rect | None
    status: Rect
    strips: Strips | None = None


def lay_out(width: float, height: float, scale: float, panel_wanted: bool) -> Layout:
    """Divide a window of that size; `scale` multiplies every length that holds text."""
    status_height = min(round(STATUS_HEIGHT * scale), height / 2)
    panel_width = round(PANEL_WIDTH * scale)
    upper = height - status_height
    status = Rect(0, upper, width, status_height)
    if not panel_wanted or width < panel_width + PICTURE_LEAST * scale or upper < PICTURE_LEAST / 2 * scale:
        return Layout(Rect(0, 0, width, upper), None, status)
    return Layout(Rect(0, 0, width - panel_width, upper), Rect(width - panel_width, 0, panel_width, upper), status)


def with_strips(layout: Layout, scale: float) -> Layout:
    """The same with room for epipolar slices taken from the picture's, where there is enough of it."""
    area = layout.picture
    extent, gap = round(STRIP * scale), STRIP_GAP
    width, height = area.width - extent - gap, area.height - extent - gap
    if min(width, height) < 2 * extent:
        return layout
    strips = Strips(Rect(area.x, area.y + height + gap, width, extent), Rect(area.x + width + gap, area.y, extent, height))
    return replace(layout, picture=Rect(area.x, area.y, width, height), strips=strips)
