"""Pictures of a viewpoint that the processor makes (app.painting), where it does the graphics' work anyway."""

from __future__ import annotations

from functools import cached_property

import moderngl
import numpy as np

from app import painting
from app.canvas.carrying import steps_to
from app.canvas.passes import Passes
from app.canvas.synthesized import Synthesized
from app.canvas.textures import Made, Textures, make_texture
from app.geometry import Point
from app.painting import Moved, Spread
from app.state import Reach
from app.tone import Tone
from lfcore.synthesis import ByteArray


class Painted(Made):
    """A picture (H, W, 4) in the processor's memory, and what it was last made for; a texture, too, once that is asked for."""

    def __init__(self, textures: Textures) -> None:
        super().__init__(textures)
        self._pixels: ByteArray | None = None
        self._handed = False  # the texture is of these pixels

    @property
    def pixels(self) -> ByteArray:
        """What it is."""
        assert self._pixels is not None
        return self._pixels

    def take(self, pixels: ByteArray) -> None:
        """It is this from now on."""
        self._pixels, self._handed = pixels, False

    def begin(self) -> ByteArray:
        """Memory of its own, which it becomes as that is filled."""
        self.take(self._room)
        return self._room

    @property
    def texture(self) -> moderngl.Texture:
        """What the graphics sample."""
        if not self._handed:
            self._texture.write(self.pixels)
            self._handed = True
        return self._texture

    def release(self) -> None:
        """Give the memory of the graphics back."""
        if "_texture" in vars(self):
            self._texture.release()

    @cached_property
    def _room(self) -> ByteArray:
        width, height = self._owner.size
        return np.empty((height, width, 4), np.uint8)

    @cached_property
    def _texture(self) -> moderngl.Texture:
        return make_texture(self._owner.context, self._owner.size, 4, "f1")


class PaintedSynthesized(Synthesized):
    """Makes by the processor what it can: the newest synthesis and the one before, as they are, carried and mixed.

    What else there is, and all of it in a tone, is made by shaders, as in any Synthesized.
    """

    def __init__(self, passes: Passes, textures: Textures, reach: Reach) -> None:
        super().__init__(passes, textures, reach)
        width, height = textures.size
        self._spread = Spread((height, width)), Spread((height, width))  # by layer of Textures.syntheses
        self._copies = Painted(textures), Painted(textures)  # of the one before and the newest
        self._moved = Painted(textures)
        self._faded = Painted(textures)

    def release(self) -> None:
        """See Synthesized."""
        for painted in (*self._copies, self._moved, self._faded):
            painted.release()

    def _newest(self, tone: Tone) -> Made:
        return self._copied(1, self._textures.newest) if tone == Tone() else super()._newest(tone)

    def _older(self, tone: Tone) -> Made:
        return self._copied(0, 1 - self._textures.newest) if tone == Tone() else super()._older(tone)

    def _copied(self, copy: int, layer: int) -> Painted:
        result, pixels = self._copies[copy], self._textures.pixels[layer]
        assert pixels is not None
        if result.outdated("copy of", layer):
            result.take(pixels)
        return result

    def _carried(self, viewpoint: Point, older: Point | None, share: float, tone: Tone) -> Made:
        if tone != Tone():
            return super()._carried(viewpoint, older, share, tone)
        textures, result = self._textures, self._moved
        if not result.outdated("carried", viewpoint, older, share):
            return result
        assert textures.made_at is not None and textures.disparities is not None
        newest = self._moved_to(viewpoint, textures.newest, textures.made_at)
        before = self._moved_to(viewpoint, 1 - textures.newest, older) if older is not None else newest
        steps, nearest = steps_to(textures, viewpoint), textures.disparity_range[0]
        share = share if older is not None else 1.0
        painting.carried(newest, before, share, textures.disparities, nearest, steps, result.begin())
        return result

    def _moved_to(self, viewpoint: Point, layer: int, made_at: Point) -> Moved:
        pixels, spread = self._textures.pixels[layer], self._spread[layer]
        assert pixels is not None
        spread.take(pixels)
        return Moved(spread, (made_at[0] - viewpoint[0], made_at[1] - viewpoint[1]))

    def _mixed(self, before: Made, after: Made, share: float) -> Made:
        if not (isinstance(before, Painted) and isinstance(after, Painted)):
            return super()._mixed(before, after, share)
        result = self._faded
        if result.outdated("mixed", before.made_for, after.made_for, share):
            painting.mixed(before.pixels, after.pixels, share, result.begin())
        return result
