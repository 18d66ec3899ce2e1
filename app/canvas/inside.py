"""What the synthesis is made of: the warped inputs, where they disagree, which of them it is most like, the plane sweep."""

from __future__ import annotations

import moderngl

from app.canvas.carrying import carrying
from app.canvas.passes import Pass, Passes
from app.canvas.synthesized import Synthesized
from app.canvas.textures import Textures
from app.geometry import Point
from app.looking import CORNER_COLOURS, LEAN_REACH, LEAN_TOLERANCE
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

    def disagreement(self, viewpoint: Point) -> moderngl.Texture:
        """Deviation of the four warped inputs, as a map."""
        textures = self._textures
        result = textures.deviation
        if result.outdated("disagreement", viewpoint):
            disparity = self._synthesized.carry_disparity(viewpoint)
            result.target.use()
            self._passes.get("disagreement.frag").render(
                {"corner_views": textures.corner_views, "disparity": disparity}, {"viewpoint": viewpoint}
            )
        return result.texture

    def lean(self, viewpoint: Point, share: float, contrast: float) -> moderngl.Texture:
        """Which warped input the picture leans on, in the colours CORNER_COLOURS: by the weights of the newest synthesis, or
        where it has none by likeness. contrast: to this power weights are raised."""
        textures = self._textures
        result = textures.inner
        if not result.outdated("lean", viewpoint, share, contrast):
            return result.texture
        if textures.weighed:
            result.target.use()
            self._passes.get("lean_weights.frag").render(
                {"weights": textures.weights, "disparity_map": textures.disparity_map},
                {**carrying(self._textures, viewpoint), "corner_colours": CORNER_COLOURS, "contrast": contrast},
            )
        else:
            disparity = self._synthesized.carry_disparity(viewpoint)
            picture = self._synthesized.picture(viewpoint, share, Tone())
            textures.distances.target.use()
            self._passes.get("lean_distances.frag").render(
                {"corner_views": textures.corner_views, "disparity": disparity, "picture": picture.texture},
                {"viewpoint": viewpoint},
            )
            result.target.use()
            self._passes.get("lean_nearest.frag").render(
                {"distances": textures.distances.texture},
                {"corner_colours": CORNER_COLOURS, "reach": LEAN_REACH, "tolerance": LEAN_TOLERANCE},
            )
        return result.texture

    def sweep_mean(self, viewpoint: Point, level: float, tone: Tone) -> moderngl.Texture:
        """The mean of the plane sweep at a level (px over the baseline)."""
        result = self._textures.inner
        if result.outdated("sweep mean", viewpoint, level, tone):
            self._sweep_into(result.target, self._passes.toned("sweep_mean.frag", tone), viewpoint, level)
        return result.texture

    def sweep_deviation(self, viewpoint: Point, level: float) -> moderngl.Texture:
        """Its standard deviation, as a map."""
        result = self._textures.deviation
        if result.outdated("sweep deviation", viewpoint, level):
            self._sweep_into(result.target, self._passes.get("sweep_deviation.frag"), viewpoint, level)
        return result.texture

    def _sweep_into(self, target: moderngl.Framebuffer, sweep: Pass, viewpoint: Point, level: float) -> None:
        target.use()
        sweep.render({"corner_views": self._textures.corner_views}, {"viewpoint": viewpoint, "level": level})

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
