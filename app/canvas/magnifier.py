"""The last pass: a picture at its own size, or a map in colours, into its place in the window."""

from __future__ import annotations

from dataclasses import dataclass

import moderngl

from app.canvas.frame import Target
from app.canvas.passes import Passes, Uniform
from app.canvas.placing import sampling, visible
from app.geometry import Placement, Rect
from lfcore import colormaps
from lfcore.colormaps import ColourMap


@dataclass(frozen=True)
class Colours:
    """A colour map, and the values of its first and its last colour."""

    map: ColourMap
    values: tuple[float, float]


class Magnifier:
    """Draws textures into targets."""

    def __init__(self, context: moderngl.Context, passes: Passes) -> None:
        self._passes = passes
        self._context = context
        self._colours: dict[ColourMap, moderngl.Texture] = {}  # that have been used

    def image(self, texture: moderngl.Texture, dim: float, target: Target, area: Rect, placement: Placement) -> None:
        """A picture, its brightness multiplied by `dim`."""
        placed = self._place(texture, target, area, placement)
        show = self._passes.get("show_image.frag", sampled=sampling(placement.scale))
        show.render({"picture": texture}, {**placed, "dim": dim})
        self._finish(target)

    def map(self, texture: moderngl.Texture, colours: Colours, target: Target, area: Rect, placement: Placement) -> None:
        """A map of one value in colours."""
        placed = self._place(texture, target, area, placement)
        show = self._passes.get("show_disparity.frag", sampled=sampling(placement.scale))
        show.render({"disparity": texture, "colours": self._table(colours.map)}, {**placed, "range": colours.values})
        self._finish(target)

    def _table(self, chosen: ColourMap) -> moderngl.Texture:
        if chosen not in self._colours:
            colours = colormaps.colours(chosen)  # (256, 3)
            table = self._context.texture((len(colours), 1), 3, colours.tobytes(), alignment=1)
            table.repeat_x = table.repeat_y = False
            self._colours[chosen] = table
        return self._colours[chosen]

    def _place(self, texture: moderngl.Texture, target: Target, area: Rect, placement: Placement) -> dict[str, Uniform]:
        framebuffer, (width, height) = target.framebuffer, target.size
        inside = visible(texture.size, area, placement)
        framebuffer.viewport = (0, 0, width, height)
        framebuffer.scissor = (inside.x, height - inside.y - inside.height, inside.width, inside.height)
        framebuffer.use()
        return {"origin": placement.origin, "scale": placement.scale, "window_size": (float(width), float(height))}

    def _finish(self, target: Target) -> None:
        target.framebuffer.scissor = (0, 0, *target.size)
