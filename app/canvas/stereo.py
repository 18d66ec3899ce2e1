"""Stereo: what two eyes beside the viewpoint see, side by side or in one picture for red and cyan glasses."""

from __future__ import annotations

import moderngl

from app.canvas.elsewhere import draw_elsewhere
from app.canvas.passes import Passes
from app.canvas.textures import Picture, Textures
from app.focusing import Focusing
from app.geometry import Point
from app.tone import Tone


class Stereo:
    """Makes stereo pictures from the newest synthesis, or the corner views, and its disparity."""

    def __init__(self, context: moderngl.Context, passes: Passes, textures: Textures) -> None:
        self._context = context
        self._passes = passes
        self._textures = textures
        self._pair: Picture | None = None

    def pair(self, viewpoint: Point, focusing: Focusing, crossed: bool, tone: Tone) -> moderngl.Texture:
        """Both pictures, twice as wide: the left eye's at the left, or at the right to be looked at with crossed eyes."""
        textures = self._textures
        width, height = textures.size
        if self._pair is None:
            self._pair = Picture(self._context, (2 * width, height), textures.picture_type, textures)
        result, baseline, convergence = self._pair, focusing.baseline, focusing.convergence
        if result.outdated("pair", viewpoint, baseline, convergence, crossed, tone):
            eyes = focusing.eyes(viewpoint)
            for place, eye in enumerate(reversed(eyes) if crossed else eyes):
                shift = ((eye[0] - viewpoint[0]) * convergence, 0.0)
                draw_elsewhere(self._passes, textures, result.target, (place * width, 0), eye, tone, shift)
        return result.texture

    def anaglyph(self, viewpoint: Point, focusing: Focusing, tone: Tone) -> moderngl.Texture:
        """One picture for a red filter before the left eye and a cyan one before the right."""
        pair = self.pair(viewpoint, focusing, False, tone)
        result = self._textures.picture
        if result.outdated("anaglyph", viewpoint, focusing.baseline, focusing.convergence, tone):
            result.target.use()
            self._passes.get("anaglyph.frag").render({"pair": pair}, {})
        return result.texture

    def release(self) -> None:
        """Give the memory of the graphics back."""
        if self._pair is not None:
            self._pair.release()
