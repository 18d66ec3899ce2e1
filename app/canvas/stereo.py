"""Stereo: what two eyes beside the viewpoint see, side by side or in one picture for red and cyan glasses."""

from __future__ import annotations

from collections.abc import Mapping

import moderngl
import numpy as np
import numpy.typing as npt

from app.canvas.elsewhere import draw_elsewhere
from app.canvas.passes import Passes
from app.canvas.textures import Picture, Textures, make_layers
from app.focusing import Focusing
from app.geometry import Point
from app.tone import Tone

_Held = tuple[Point, npt.NDArray[np.uint8]]


class Stereo:
    """Makes stereo pictures: from syntheses for the eyes' own viewpoints where they are there, else from the newest
    synthesis, or the corner views, and its disparity."""

    def __init__(self, context: moderngl.Context, passes: Passes, textures: Textures) -> None:
        self._context = context
        self._passes = passes
        self._textures = textures
        self._pair: Picture | None = None
        self._exact: moderngl.TextureArray | None = None  # syntheses for the eyes' own viewpoints
        self._held: dict[int, _Held] = {}  # what its layers hold
        self._revision = 0  # grows when that changes

    def set_eyes(self, eyes: Mapping[Point, npt.NDArray[np.uint8]]) -> None:
        """Take the syntheses (H, W, 4) for at most two viewpoints, in place of those before; what is held stays."""
        wanted = dict(enumerate(eyes.items()))
        if all(_same(self._held.get(layer), wanted.get(layer)) for layer in range(2)):
            return
        width, height = self._textures.size
        if self._exact is None:
            self._exact = make_layers(self._context, self._textures.size, 2, 4, "f1")
        for layer, each in wanted.items():
            if not _same(self._held.get(layer), each):
                self._exact.write(each[1], viewport=(0, 0, layer, width, height, 1))
        self._held = wanted
        self._revision += 1

    def pair(self, viewpoint: Point, focusing: Focusing, crossed: bool, tone: Tone) -> moderngl.Texture:
        """Both pictures, twice as wide: the left eye's at the left, or at the right to be looked at with crossed eyes."""
        textures = self._textures
        width, height = textures.size
        if self._pair is None:
            self._pair = Picture(self._context, (2 * width, height), textures.picture_type, textures)
        result, baseline, convergence = self._pair, focusing.baseline, focusing.convergence
        if result.outdated("pair", self._revision, viewpoint, baseline, convergence, crossed, tone):
            eyes = focusing.eyes(viewpoint)
            for place, eye in enumerate(reversed(eyes) if crossed else eyes):
                self._draw(result.target, (place * width, 0), eye, ((eye[0] - viewpoint[0]) * convergence, 0.0), tone)
        return result.texture

    def anaglyph(self, viewpoint: Point, focusing: Focusing, tone: Tone) -> moderngl.Texture:
        """One picture for a red filter before the left eye and a cyan one before the right."""
        pair = self.pair(viewpoint, focusing, False, tone)
        result = self._textures.picture
        if result.outdated("anaglyph", self._revision, viewpoint, focusing.baseline, focusing.convergence, tone):
            result.target.use()
            self._passes.get("anaglyph.frag").render({"pair": pair}, {})
        return result.texture

    def release(self) -> None:
        """Give the memory of the graphics back."""
        for each in (self._pair, self._exact):
            if each is not None:
                each.release()

    def _draw(self, target: moderngl.Framebuffer, tile: tuple[int, int], eye: Point, shift: Point, tone: Tone) -> None:
        layer = next((layer for layer, (at, _) in self._held.items() if at == eye), None)
        if layer is None or self._exact is None:
            draw_elsewhere(self._passes, self._textures, target, tile, eye, tone, shift)
            return
        target.viewport = (*tile, *self._textures.size)
        target.use()
        self._passes.toned("elsewhere.frag", tone, seen="seen_exact.glsl").render(
            {"pictures": self._exact}, {"layer": layer, "tile": tile, "shift": shift}
        )


def _same(a: _Held | None, b: _Held | None) -> bool:
    if a is None or b is None:
        return a is b
    return a[0] == b[0] and a[1] is b[1]
