"""What the synthesis is made of: the four warped inputs, singly and on one sheet."""

from __future__ import annotations

import moderngl

from app.canvas.passes import Passes
from app.canvas.synthesized import Synthesized
from app.canvas.textures import Textures
from app.geometry import Point
from app.tone import Tone
from lfcore.lightfield import CORNERS

# Corner (index into CORNERS) to its place (column, row) on the sheet of all four.
_SHEET_PLACES = tuple((int(u), int(v)) for u, v in CORNERS)


class Inside:
    """Makes the inner pictures of a viewpoint at the light field's own size."""

    def __init__(self, passes: Passes, textures: Textures, synthesized: Synthesized) -> None:
        self._passes = passes
        self._textures = textures
        self._synthesized = synthesized

    def warped(self, corner: int, viewpoint: Point, tone: Tone) -> moderngl.Texture:
        """One corner view, warped."""
        result = self._textures.picture
        if result.outdated("warped", viewpoint, corner, tone):
            self._warp_into(result.target, corner, (0, 0), viewpoint, tone)
        return result.texture

    def sheet(self, viewpoint: Point, tone: Tone) -> moderngl.Texture:
        """All four on one picture of twice the size."""
        result = self._textures.sheet
        if result.outdated("sheet", viewpoint, tone):
            width, height = self._textures.size
            for corner, (column, row) in enumerate(_SHEET_PLACES):
                self._warp_into(result.target, corner, (column * width, row * height), viewpoint, tone)
        return result.texture

    def _warp_into(
        self, target: moderngl.Framebuffer, corner: int, tile: tuple[int, int], viewpoint: Point, tone: Tone
    ) -> None:
        textures = self._textures
        disparity = self._synthesized.carry_disparity(viewpoint)
        target.viewport = (*tile, *textures.size)
        target.use()
        self._passes.toned("warped.frag", tone).render(
            {"corner_views": textures.corner_views, "disparity": disparity},
            {"viewpoint": viewpoint, "corner": corner, "tile": tile},
        )
