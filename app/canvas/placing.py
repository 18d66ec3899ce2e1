"""Where in the target a picture is drawn, and how it is sampled there."""

from __future__ import annotations

import math
from dataclasses import dataclass

from app.geometry import Placement, Rect, Size
from app.state import Look


def shown_size(size: Size, look: Look) -> Size:
    """(width, height) of what this look shows of a light field of that size."""
    return look.tiles[0] * size[0], look.tiles[1] * size[1]


def sampling(scale: float) -> str:
    """The shader file with the way of sampling that suits a scale; one program each, since software runs every branch."""
    if scale == 1.0 or scale >= 4.0:
        return "sample_pixels.glsl"
    return "sample_linear.glsl" if scale >= 0.75 else "sample_area.glsl"


@dataclass(frozen=True)
class Pixels:
    """A rectangle of whole pixels, y downwards."""

    x: int
    y: int
    width: int
    height: int

    def surroundings(self, size: Size) -> list[Rect]:
        """What lies around it in a target of that size (width, height): above, below, to the left and to the right."""
        width, height = size
        right, bottom = self.x + self.width, self.y + self.height
        return [
            Rect(0, 0, width, self.y),
            Rect(0, bottom, width, height - bottom),
            Rect(0, self.y, self.x, self.height),
            Rect(right, self.y, width - right, self.height),
        ]


def visible(picture: Size, area: Rect, placement: Placement) -> Pixels:
    """The whole window pixels that lie on the picture and inside the area."""
    left, top = placement.origin
    right, bottom = placement.to_window((float(picture[0]), float(picture[1])))
    x0, y0 = math.ceil(max(area.x, left)), math.ceil(max(area.y, top))
    x1, y1 = math.floor(min(area.x + area.width, right)), math.floor(min(area.y + area.height, bottom))
    return Pixels(x0, y0, max(x1 - x0, 0), max(y1 - y0, 0))
