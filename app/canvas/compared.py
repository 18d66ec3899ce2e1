"""The picture of a viewpoint and its partner: the partner's picture, their difference, and maps of how far they are apart."""

from __future__ import annotations

from functools import cached_property

import moderngl
import numpy as np

from app.canvas.passes import Passes
from app.canvas.synthesized import Synthesized
from app.canvas.textures import Made, Picture, Textures, make_layers, make_texture
from app.comparison import BLOCK_RANGE, Difference, Source
from app.geometry import Point
from app.tone import Tone
from lfcore import colormaps
from lfcore.lightfield import FloatArray

_DIFFERENCES = {
    Difference.ABSOLUTE: "error_absolute.glsl",
    Difference.SIGNED: "error_signed.glsl",
    Difference.SQUARED: "error_squared.glsl",
    Difference.FALSE_COLOUR: "error_coloured.glsl",
}
_NO_VALUE = -1e9  # in the texture of a map, in place of nan, which not every driver keeps
_LARGEST = 1e9


class Compared:
    """Makes pictures of partners and differences at the light field's own size. What only comparing needs is made when it
    is first asked for."""

    def __init__(self, passes: Passes, textures: Textures, synthesized: Synthesized) -> None:
        self._passes = passes
        self._textures = textures
        self._synthesized = synthesized
        self._partners: dict[Source, Picture] = {}

    def set_partner(self, image: FloatArray) -> None:
        """Take the synthesis by another model, (H, W, 3)."""
        self._model_image.write(np.ascontiguousarray(image, np.float32))
        self._forget()

    def set_map(self, values: FloatArray) -> None:
        """Take a map, (H, W); nan where there is no value."""
        finite = np.clip(np.nan_to_num(values, nan=_NO_VALUE, posinf=_LARGEST), _NO_VALUE, _LARGEST)
        self._map.write(np.ascontiguousarray(finite, np.float32))
        self._forget()

    def partner(self, source: Source, viewpoint: Point, tone: Tone) -> Picture:
        """The partner as it is looked at."""
        if source not in self._partners:
            self._partners[source] = self._new_picture(self._textures.picture_type)
        return self._made(self._partners[source], source, viewpoint, tone)

    def difference(
        self, viewpoint: Point, share: float, source: Source, difference: Difference, gain: float
    ) -> moderngl.Texture:
        """The picture on screen minus its partner, or the map of how far they are apart, as colours."""
        result = self._difference
        if difference.measured:
            self._colour_map(result, difference, gain)
            return result.texture
        if not result.outdated("difference", viewpoint, share, source, difference, gain):
            return result.texture
        textures = self._textures
        if textures.newest_at == viewpoint and share >= 1.0:
            # In float32, since the steps of 8 bits would be seen when they are multiplied by the gain.
            shown: Made = self._synthesized.copied(textures.precise, textures.exact, 0, Tone())
        else:
            shown = self._synthesized.picture(viewpoint, share, Tone())
        partner = self._made(self._precise_partner, source, viewpoint, Tone())
        sampled = {"picture": shown.texture, "partner": partner.texture}
        if difference is Difference.FALSE_COLOUR:
            sampled["colours"] = self._colours
        result.target.use()
        self._passes.get("error.frag", difference=_DIFFERENCES[difference]).render(sampled, {"gain": gain})
        return result.texture

    def release(self) -> None:
        """Give the memory of the graphics back."""
        for value in (*vars(self).values(), *self._partners.values()):
            if isinstance(value, moderngl.Texture | moderngl.TextureArray | Picture):
                value.release()

    def _forget(self) -> None:
        """What has been made here is out of date; other pictures are not."""
        for value in (*vars(self).values(), *self._partners.values()):
            if isinstance(value, Picture):
                self._textures.current.pop(value, None)

    def _made(self, result: Picture, source: Source, viewpoint: Point, tone: Tone) -> Picture:
        if source is Source.INSTANT:
            return self._synthesized.instant(result, viewpoint, tone)
        pictures = self._textures.captured if source is Source.CAPTURED else self._model_image
        return self._synthesized.copied(result, pictures, 0, tone)

    def _colour_map(self, result: Picture, difference: Difference, gain: float) -> None:
        values = BLOCK_RANGE if difference is Difference.BLOCKS else (1.0, 1.0 - 1.0 / gain)
        if result.outdated("map", values):
            result.target.use()
            self._passes.get("error_map.frag").render(
                {"values": self._map, "colours": self._colours}, {"range": values, "no_value": _NO_VALUE}
            )

    @cached_property
    def _model_image(self) -> moderngl.TextureArray:
        return make_layers(self._textures.context, self._textures.size, 1, 3, "f4")

    @cached_property
    def _map(self) -> moderngl.Texture:
        return make_texture(self._textures.context, self._textures.size, 1, "f4")

    @cached_property
    def _difference(self) -> Picture:
        return self._new_picture(self._textures.picture_type)

    @cached_property
    def _precise_partner(self) -> Picture:
        return self._new_picture("f4")

    def _new_picture(self, dtype: str) -> Picture:
        return Picture(self._textures.context, self._textures.size, dtype, self._textures)

    @cached_property
    def _colours(self) -> moderngl.Texture:
        table = colormaps.error_colours()  # (256, 3)
        texture = self._textures.context.texture((len(table), 1), 3, table.tobytes(), alignment=1)
        texture.repeat_x = texture.repeat_y = False
        return texture
