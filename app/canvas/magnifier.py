"""The last pass: a picture at its own size, or a map in colours, into its place in the window."""

from __future__ import annotations

import moderngl

from app.canvas.frame import Target
from app.canvas.passes import Passes, Uniform
from app.canvas.placing import sampling, visible
from app.geometry import Placement, Rect
from lfcore import colormaps


class Magnifier:
    """Draws textures into targets."""

    def __init__(self, context: moderngl.Context, passes: Passes) -> None:
        self._passes = passes
        colours = colormaps.disparity_colours()  # (256, 3)
        self._colours = context.texture((len(colours), 1), 3, colours.tobytes(), alignment=1)
        self._colours.repeat_x = self._colours.repeat_y = False

    def image(self, texture: moderngl.Texture, dim: float, target: Target, area: Rect, placement: Placement) -> None:
        """A picture, its brightness multiplied by `dim`."""
        placed = self._place(texture, target, area, placement)
        show = self._passes.get("show_image.frag", sampled=sampling(placement.scale))
        show.render({"picture": texture}, {**placed, "dim": dim})
        self._finish(target)

    def map(
        self, texture: moderngl.Texture, values: tuple[float, float], target: Target, area: Rect, placement: Placement
    ) -> None:
        """A map of one value in colours; `values` are those of the first and the last colour."""
        placed = self._place(texture, target, area, placement)
        show = self._passes.get("show_disparity.frag", sampled=sampling(placement.scale))
        show.render({"disparity": texture, "colours": self._colours}, {**placed, "range": values})
        self._finish(target)

    def _place(
        self, texture: moderngl.Texture, target: Target, area: Rect, placement: Placement
    ) -> dict[str, Uniform]:
        framebuffer, (width, height) = target.framebuffer, target.size
        inside = visible(texture.size, area, placement)
        framebuffer.viewport = (0, 0, width, height)
        framebuffer.scissor = (inside.x, height - inside.y - inside.height, inside.width, inside.height)
        framebuffer.use()
        return {"origin": placement.origin, "scale": placement.scale, "window_height": float(height)}

    def _finish(self, target: Target) -> None:
        target.framebuffer.scissor = (0, 0, *target.size)
