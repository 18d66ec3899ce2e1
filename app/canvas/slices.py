"""Epipolar slices, drawn into the window below and beside the picture."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from app.canvas.carrying import carrying
from app.canvas.frame import Target
from app.canvas.gathered import Gathered
from app.canvas.passes import AnyTexture, Passes, Uniform
from app.canvas.placing import visible
from app.canvas.refocus import Refocused
from app.canvas.textures import Textures
from app.focusing import SLICE_RANGE
from app.geometry import Placement, Point, Rect
from app.layout import Strips
from app.tone import Tone


@dataclass(frozen=True)
class Slicing:
    """Which slices are drawn: through which picture point, of which viewpoint, from captured views or carried ones."""

    through: Point
    viewpoint: Point
    captured: bool


class Slices:
    """Draws slices of one light field."""

    def __init__(self, passes: Passes, textures: Textures, refocused: Refocused) -> None:
        self._passes = passes
        self._textures = textures
        self._refocused = refocused  # which holds the captured views

    def draw(self, slicing: Slicing, tone: Tone, target: Target, strips: Strips, area: Rect, placement: Placement) -> bool:
        """Both slices into their strips, beside the picture that lies in the area at the placement (all in the target's
        pixels, y downwards). Returns whether views are still to be handed to the graphics."""
        more = False
        if slicing.captured:
            gathered = self._refocused.gathered(True)
            gathered.fill()
            if not gathered.there[_needed(slicing, gathered)].all():
                return True
            more = not gathered.complete
        below, beside = strips.below, strips.beside
        across = Rect(area.x, below.y, area.width, below.height)
        down = Rect(beside.x, area.y, beside.width, area.height)
        self._draw(slicing, tone, target, across, (1.0, 0.0), (below.y, below.height), placement)
        self._draw(slicing, tone, target, down, (0.0, 1.0), (beside.x, beside.width), placement)
        return more

    def _draw(
        self,
        slicing: Slicing,
        tone: Tone,
        target: Target,
        strip: Rect,
        axis: Point,
        reach: tuple[float, float],
        placement: Placement,
    ) -> None:
        framebuffer, (width, height) = target.framebuffer, target.size
        # Along the line only as far as the picture goes; at right angles to it, all of the strip.
        picture = visible(self._textures.size, _unbounded(strip, axis), placement)
        start, end = math.ceil(reach[0]), math.floor(reach[0] + reach[1])
        framebuffer.viewport = (0, 0, width, height)
        if axis[0]:
            framebuffer.scissor = (picture.x, height - end, picture.width, end - start)
        else:
            framebuffer.scissor = (start, height - picture.y - picture.height, end - start, picture.height)
        framebuffer.use()
        sampled, uniforms = self._source(slicing)
        source = "slice_captured.glsl" if slicing.captured else "slice_carried.glsl"
        self._passes.toned("slice.frag", tone, slice_source=source).render(
            sampled,
            {
                "origin": placement.origin,
                "scale": placement.scale,
                "window_size": (float(width), float(height)),
                "through": (math.floor(slicing.through[0]) + 0.5, math.floor(slicing.through[1]) + 0.5),
                "axis": axis,
                "start": reach[0],
                "extent": reach[1],
                "range": SLICE_RANGE,
                **uniforms,
            },
        )
        framebuffer.scissor = (0, 0, width, height)

    def _source(self, slicing: Slicing) -> tuple[dict[str, AnyTexture], dict[str, Uniform]]:
        textures = self._textures
        if not slicing.captured:
            uniforms = {**carrying(textures, slicing.viewpoint, farthest=math.inf), "newest": textures.newest}
            return {"syntheses": textures.syntheses, "disparity_map": textures.disparity_map}, uniforms
        gathered = self._refocused.gathered(True)
        column, row = _nearest(slicing, gathered)
        tiles: dict[str, Uniform] = {
            "size": gathered.size,
            "grid": (len(gathered.columns_at), len(gathered.rows_at)),
            "held": (column, row),
        }
        return {"views": gathered.texture}, tiles


def _needed(slicing: Slicing, gathered: Gathered) -> npt.NDArray[np.bool_]:
    """Which of the views have a line in one of the slices: (N,)."""
    column, row = _nearest(slicing, gathered)
    numbers = np.arange(len(gathered.there))
    columns = len(gathered.columns_at)
    return np.asarray((numbers // columns == row) | (numbers % columns == column))


def _nearest(slicing: Slicing, gathered: Gathered) -> tuple[int, int]:
    """Column and row of the views nearest to the viewpoint."""
    u, v = slicing.viewpoint
    column = int(np.argmin(np.abs(np.subtract(gathered.columns_at, u))))
    return column, int(np.argmin(np.abs(np.subtract(gathered.rows_at, v))))


def _unbounded(strip: Rect, axis: Point) -> Rect:
    """The strip, but without end at right angles to the line."""
    far = 1e6
    return Rect(strip.x, -far, strip.width, 2 * far) if axis[0] else Rect(-far, strip.y, 2 * far, strip.height)
