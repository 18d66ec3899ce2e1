"""Where a picture lies in the window: rectangles, magnification, the way from window points to picture points and back."""

from __future__ import annotations

from dataclasses import dataclass

from app.limits import within

Point = tuple[float, float]
Size = tuple[int, int]

ZOOM_LIMITS = (1 / 16, 64.0)


@dataclass(frozen=True)
class Rect:
    """A rectangle of the window in its pixels, y downwards."""

    x: float
    y: float
    width: float
    height: float

    def contains(self, point: Point) -> bool:
        """Whether the point lies inside."""
        return self.x <= point[0] < self.x + self.width and self.y <= point[1] < self.y + self.height

    def holds(self, other: Rect) -> bool:
        """Whether all of another rectangle lies inside."""
        across = self.x <= other.x and other.x + other.width <= self.x + self.width
        return across and self.y <= other.y and other.y + other.height <= self.y + self.height


@dataclass(frozen=True)
class Placement:
    """Where a picture lies in the window: `scale` window pixels per picture pixel, `origin` the picture's top left corner."""

    scale: float
    origin: Point

    def to_picture(self, point: Point) -> Point:
        """Window point to picture point, in pixels, where pixel (column x, row y) covers [x, x + 1) x [y, y + 1)."""
        return (point[0] - self.origin[0]) / self.scale, (point[1] - self.origin[1]) / self.scale

    def to_window(self, point: Point) -> Point:
        """Picture point to window point: the inverse of `to_picture`."""
        return self.origin[0] + point[0] * self.scale, self.origin[1] + point[1] * self.scale


@dataclass(frozen=True)
class Zoom:
    """How the picture is magnified: `scale` window pixels per picture pixel (None: fit), `centre` the picture point, as a
    fraction of its size, in the middle of the area."""

    scale: float | None = None
    centre: Point = (0.5, 0.5)


def place(zoom: Zoom, picture: Size, area: Rect) -> Placement:
    """The placement of a picture of that size (width, height) in the area under the zoom."""
    scale = zoom.scale if zoom.scale is not None else fit_scale(picture, area)
    origin_x = area.x + area.width / 2 - zoom.centre[0] * picture[0] * scale
    origin_y = area.y + area.height / 2 - zoom.centre[1] * picture[1] * scale
    return Placement(scale, (round(origin_x), round(origin_y)))


def visible(placement: Placement, picture: Size, area: Rect) -> Rect:
    """The part of the area that a picture of that size covers."""
    left, top = placement.to_window((0, 0))
    right, bottom = placement.to_window(picture)
    left, top = max(left, area.x), max(top, area.y)
    width, height = min(right, area.x + area.width) - left, min(bottom, area.y + area.height) - top
    return Rect(left, top, max(width, 0), max(height, 0))


def fit_scale(picture: Size, area: Rect) -> float:
    """The largest scale at which the whole picture lies inside the area."""
    return max(min(area.width / picture[0], area.height / picture[1]), 1e-3)


def zoom_about(zoom: Zoom, factor: float, point: Point, picture: Size, area: Rect) -> Zoom:
    """Magnify by `factor` while the picture point under the window point `point` stays there."""
    before = place(zoom, picture, area)
    scale = within(before.scale * factor, ZOOM_LIMITS)
    fixed = before.to_picture(point)
    centre_x = (fixed[0] + (area.x + area.width / 2 - point[0]) / scale) / picture[0]
    centre_y = (fixed[1] + (area.y + area.height / 2 - point[1]) / scale) / picture[1]
    return Zoom(scale, _inside_picture((centre_x, centre_y)))


def pan_by(zoom: Zoom, delta: Point, picture: Size, area: Rect) -> Zoom:
    """Move the picture by `delta` window pixels; its middle part stays in the area."""
    scale = place(zoom, picture, area).scale
    centre = (zoom.centre[0] - delta[0] / (scale * picture[0]), zoom.centre[1] - delta[1] / (scale * picture[1]))
    return Zoom(scale, _inside_picture(centre))


def _inside_picture(centre: Point) -> Point:
    return within(centre[0], (0.0, 1.0)), within(centre[1], (0.0, 1.0))
