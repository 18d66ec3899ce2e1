"""Where a window goes that was closed on other monitors, perhaps."""

from __future__ import annotations

from collections.abc import Sequence

from app.geometry import Rect
from app.settings import WindowPlace

_LEAST_IN_SIGHT = 0.5  # of the window's area


def fitted(place: WindowPlace, monitors: Sequence[Rect]) -> tuple[int, int, int, int]:
    """x, y, width and height for the window: as it was where half of it would be in sight, else in the middle of the first
    monitor, no larger than that; as it was where there is no monitor. `monitors`: the free area of each."""
    window = Rect(place.x, place.y, place.width, place.height)
    in_sight = sum(_overlap(window, monitor) for monitor in monitors)
    if not monitors or in_sight >= _LEAST_IN_SIGHT * window.width * window.height:
        return place.x, place.y, place.width, place.height
    first = monitors[0]
    width, height = min(place.width, round(first.width)), min(place.height, round(first.height))
    return round(first.x + (first.width - width) / 2), round(first.y + (first.height - height) / 2), width, height


def _overlap(a: Rect, b: Rect) -> float:
    width = min(a.x + a.width, b.x + b.width) - max(a.x, b.x)
    height = min(a.y + a.height, b.y + b.height) - max(a.y, b.y)
    return max(width, 0.0) * max(height, 0.0)
