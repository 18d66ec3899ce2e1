"""The picture of a viewpoint: the newest synthesis, the one before it and the corner views, carried and mixed."""

from __future__ import annotations

import math
from collections.abc import Mapping

import moderngl

from app.canvas.carrying import carrying
from app.canvas.passes import AnyTexture, Passes, Uniform
from app.canvas.textures import Made, Picture, Textures
from app.geometry import Point
from app.state import Reach, carried_share
from app.tone import Tone


class Synthesized:
    """Makes the picture of a viewpoint at the light field's own size. Each part is made anew only if what it shows has
    changed."""

    def __init__(self, passes: Passes, textures: Textures, reach: Reach) -> None:
        self._passes = passes
        self._textures = textures
        self._reach = reach

    def release(self) -> None:
        """Give memory of the graphics beside that of the textures back."""

    def picture(self, viewpoint: Point, share: float, tone: Tone) -> Made:
        """The best picture of this viewpoint that can be made. share: how far the newest synthesis has been faded in."""
        textures = self._textures
        newest, older = textures.newest_at, textures.older_at if share < 1.0 else None
        if newest is None:
            return self._corners(viewpoint, False, tone)
        if newest == viewpoint and older in (viewpoint, None):
            after = self._newest(tone)
            if share >= 1.0:
                return after
            if older is not None:
                return self._mixed(self._older(tone), after, share)
            return self._mixed(self._corners(viewpoint, False, tone), after, share)
        if textures.made_at != newest:  # it has come without a disparity map, and so cannot be carried
            return self._corners(viewpoint, textures.made_at is not None, tone)
        near = carried_share(math.dist(newest, viewpoint), self._reach)
        if near <= 0.0:
            return self._corners(viewpoint, True, tone)
        after = self._carried(viewpoint, older, share, tone)
        if share < 1.0 and older is None:
            return self._mixed(self._corners(viewpoint, False, tone), after, share * near)
        return after if near >= 1.0 else self._mixed(self._corners(viewpoint, True, tone), after, near)

    def copied(self, result: Picture, source: moderngl.TextureArray, layer: int, tone: Tone) -> Picture:
        """A layer of these pictures, pixel by pixel."""
        if result.outdated("copy of", source, layer, tone):
            result.target.use()
            self._passes.toned("exact.frag", tone).render({"pictures": source}, {"layer": layer})
        return result

    def instant(self, result: Picture, viewpoint: Point, tone: Tone) -> Picture:
        """The four corner views, warped by the newest disparity, of which there must be one."""
        textures = self._textures
        if result.outdated("instant", viewpoint, tone):
            result.target.use()
            sampled: Mapping[str, AnyTexture] = {
                "corner_views": textures.corner_views,
                "disparity_map": textures.disparity_map,
            }
            self._passes.toned("instant.frag", tone).render(sampled, carrying(self._textures, viewpoint))
        return result

    def carry_disparity(self, viewpoint: Point) -> moderngl.Texture:
        """The newest disparity map, carried to the viewpoint: px over the baseline."""
        textures = self._textures
        if textures.made_at is not None and textures.outdated("disparity", viewpoint):
            textures.disparity_target.use()
            self._passes.get("carry.frag").render(
                {"disparity_map": textures.disparity_map}, carrying(self._textures, viewpoint)
            )
        return textures.disparity

    def _newest(self, tone: Tone) -> Made:
        """The newest synthesis as it is."""
        return self.copied(self._textures.after, self._textures.exact, 0, tone)

    def _older(self, tone: Tone) -> Made:
        """The one before."""
        return self.copied(self._textures.before, self._textures.syntheses, 1 - self._textures.newest, tone)

    def _carried(self, viewpoint: Point, older: Point | None, share: float, tone: Tone) -> Made:
        """The newest synthesis, and where `older` is given also that one, carried to the viewpoint."""
        textures = self._textures
        result = textures.after
        if not result.outdated("carried", viewpoint, older, share, tone):
            return result
        uniforms: dict[str, Uniform] = {**carrying(self._textures, viewpoint), "newest": textures.newest}
        fade = "fade_none.glsl"
        if older is not None:
            fade = "fade_older.glsl"
            uniforms |= {"older_at": older, "share": share}
        result.target.use()
        sampled: Mapping[str, AnyTexture] = {"syntheses": textures.syntheses, "disparity_map": textures.disparity_map}
        self._passes.toned("carried.frag", tone, fade=fade).render(sampled, uniforms)
        return result

    def _corners(self, viewpoint: Point, warped: bool, tone: Tone) -> Picture:
        """The four corner views, blended as they are or warped by the newest disparity."""
        textures = self._textures
        result = textures.before
        if warped:
            return self.instant(result, viewpoint, tone)
        if result.outdated("blend", viewpoint, tone):
            result.target.use()
            views = {"corner_views": textures.corner_views}
            self._passes.toned("blend.frag", tone).render(views, {"viewpoint": viewpoint})
        return result

    def _mixed(self, before: Made, after: Made, share: float) -> Made:
        result = self._textures.picture
        if result.outdated("mixed", before.made_for, after.made_for, share):
            result.target.use()
            self._passes.get("fade.frag").render({"before": before.texture, "after": after.texture}, {"share": share})
        return result
