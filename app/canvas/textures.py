"""The textures of one light field, and what passes draw into. Pictures lie in textures with their first row first."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import cached_property
from typing import Generic, TypeVar

import moderngl
import numpy as np
import numpy.typing as npt

from app.geometry import Point, Size
from lfcore.lightfield import CORNERS, FloatArray
from lfcore.synthesis import ByteArray

_AnyTexture = TypeVar("_AnyTexture", moderngl.Texture, moderngl.TextureArray)

TEXTURE_TYPES = {"uint8": "f1", "uint16": "nu2", "float32": "f4"}  # numpy type to moderngl's normalised texture type


class Made(ABC):
    """A picture at the light field's own size, and what it was last made for."""

    def __init__(self, owner: Textures) -> None:
        self._owner = owner

    @property
    @abstractmethod
    def texture(self) -> moderngl.Texture:
        """What the graphics sample."""

    def outdated(self, *made_for: object) -> bool:
        """Whether the picture was last made for something else; it counts as made for this from now on."""
        return self._owner.outdated(self, *made_for)

    @property
    def made_for(self) -> tuple[object, ...]:
        """What it was last made for."""
        return self._owner.current.get(self, ())

    @property
    def number(self) -> int:
        """Another one each time that it is made, and no other picture's of the same owner."""
        return self._owner.numbers.get(self, 0)


class Picture(Made):
    """A texture that a pass draws into, and what it was last drawn for. Its memory is taken when it is first used: most looks
    need few of them, and taking all at once would hold up the frame in which a light field appears."""

    def __init__(self, context: moderngl.Context, size: Size, dtype: str, owner: Textures, components: int = 4) -> None:
        super().__init__(owner)
        self._context, self._size, self._dtype, self._components = context, size, dtype, components

    @cached_property
    def texture(self) -> moderngl.Texture:
        """What is sampled."""
        return make_texture(self._context, self._size, self._components, self._dtype)

    @cached_property
    def target(self) -> moderngl.Framebuffer:
        """What is drawn into."""
        return self._context.framebuffer([self.texture])

    def release(self) -> None:
        """Give the memory of the graphics back."""
        for made in ("target", "texture"):
            if made in vars(self):
                vars(self).pop(made).release()


class Handed(Generic[_AnyTexture]):
    """A texture to which what has come is handed when it is next sampled: most looks need little of it."""

    def __init__(self, texture: _AnyTexture) -> None:
        self._texture: _AnyTexture = texture
        self._waiting: dict[int, Callable[[_AnyTexture], None]] = {}  # by layer

    def take(self, write: Callable[[_AnyTexture], None], layer: int = 0) -> None:
        """`write` is to be called with the texture, in place of what was to write this layer before."""
        self._waiting[layer] = write

    @property
    def texture(self) -> _AnyTexture:
        """What is sampled."""
        for write in self._waiting.values():
            write(self._texture)
        self._waiting.clear()
        return self._texture

    def release(self) -> None:
        """Give the memory of the graphics back."""
        self._texture.release()


class Textures:
    """The textures of one light field, and the framebuffers of the passes at its size."""

    def __init__(self, context: moderngl.Context, corners: npt.NDArray[np.generic], picture_type: str) -> None:
        height, width = corners.shape[1:3]
        stored = TEXTURE_TYPES[corners.dtype.name]
        self.context = context
        self.picture_type = picture_type
        self.size: Size = (width, height)
        self.corner_views = make_layers(context, self.size, len(CORNERS), 3, stored, np.ascontiguousarray(corners).tobytes())
        self.captured = make_layers(context, self.size, 1, 3, stored)
        self._exact = Handed(make_layers(context, self.size, 1, 3, "f4"))
        self._syntheses = Handed(make_layers(context, self.size, 2, 4, "f1"))
        self.pixels: list[ByteArray | None] = [None, None]  # by layer of `syntheses`
        self.newest = 0  # layer of `syntheses`
        self.newest_at: Point | None = None  # viewpoint of the newest synthesis
        self.older_at: Point | None = None
        disparity_map = make_texture(context, self.size, 1, "f4")
        disparity_map.filter = _AT_PIXELS
        self._disparity_map = Handed(disparity_map)
        self.disparities: FloatArray | None = None  # of disparity_map
        self.made_at: Point | None = None  # viewpoint of disparity_map
        self.disparity_range = 0.0, 0.0  # the smallest and the greatest of the map
        self.weighed = False  # whether these are of the newest synthesis
        self.disparity = make_texture(context, self.size, 1, "f4")
        self.disparity_target = context.framebuffer([self.disparity])
        self.before = Picture(context, self.size, picture_type, self)
        self.after = Picture(context, self.size, picture_type, self)
        self.picture = Picture(context, self.size, picture_type, self)
        self.sheet = Picture(context, (2 * width, 2 * height), picture_type, self)
        self.precise = Picture(context, self.size, "f4", self)
        self.made = 0  # how often a target was made
        self.numbers: dict[object, int] = {}  # that of each target's last making
        self.current: dict[object, tuple[object, ...]] = {}  # what each target was last made for

    def take_synthesis(
        self,
        image: FloatArray,
        pixels: ByteArray,
        disparity: FloatArray | None,
        viewpoint: Point,
        weights: ByteArray | None,
    ) -> None:
        """Take the newest synthesis as `Canvas.set_synthesis` does; none of it may be changed afterwards."""
        self.older_at, self.newest_at = self.newest_at, viewpoint
        self.newest = 1 - self.newest
        place = (0, 0, self.newest, *self.size, 1)
        self.pixels[self.newest] = pixels = np.ascontiguousarray(pixels)
        self._syntheses.take(lambda texture: texture.write(pixels, place), self.newest)
        self._exact.take(lambda texture: texture.write(np.ascontiguousarray(image, np.float32)))
        if disparity is not None:
            self.disparities = values = np.ascontiguousarray(disparity, np.float32)
            self._disparity_map.take(lambda texture: texture.write(values))
            self.disparity_range = float(values.min()), float(values.max())
            self.made_at = viewpoint
        self.weighed = weights is not None and disparity is not None
        if weights is not None:
            self._weights.take(lambda texture: texture.write(np.ascontiguousarray(np.moveaxis(weights, 0, 2))))
        self.current.clear()

    @property
    def exact(self) -> moderngl.TextureArray:
        """The newest synthesis."""
        return self._exact.texture

    @property
    def syntheses(self) -> moderngl.TextureArray:
        """The newest one and the one before, in 8 bits."""
        return self._syntheses.texture

    @property
    def disparity_map(self) -> moderngl.Texture:
        """The newest map, px over the baseline, made at `made_at`."""
        return self._disparity_map.texture

    # What only looking inside needs is made when it is first asked for.

    @cached_property
    def _weights(self) -> Handed[moderngl.Texture]:
        return Handed(make_texture(self.context, self.size, 4, "f1"))

    @property
    def weights(self) -> moderngl.Texture:
        """The weights of the inputs in the newest synthesis, where `weighed`."""
        return self._weights.texture

    @cached_property
    def inner(self) -> Picture:
        """A picture of what is inside the synthesis."""
        return Picture(self.context, self.size, self.picture_type, self)

    @cached_property
    def distances(self) -> Picture:
        """How far the picture is from each warped input, for every second pixel of every second row."""
        width, height = self.size
        return Picture(self.context, ((width + 1) // 2, (height + 1) // 2), "f4", self)

    @cached_property
    def deviation(self) -> Picture:
        """A map of deviations."""
        return Picture(self.context, self.size, "f4", self, components=1)

    def outdated(self, target: object, *made_for: object) -> bool:
        """Whether the target was last made for something else; it counts as made for this from now on."""
        if self.current.get(target) == made_for:
            return False
        self.current[target] = made_for
        self.made += 1
        self.numbers[target] = self.made
        return True

    def release(self) -> None:
        """Give the memory of the graphics back."""
        for value in vars(self).values():
            if isinstance(value, moderngl.Framebuffer | moderngl.Texture | moderngl.TextureArray | Handed | Picture):
                value.release()


_AT_PIXELS = (moderngl.NEAREST, moderngl.NEAREST)


def make_layers(
    context: moderngl.Context, size: Size, layers: int, components: int, dtype: str, pixels: bytes | None = None
) -> moderngl.TextureArray:
    """Pictures of one size that are sampled at pixels, as bicubic.glsl does, and not repeated."""
    made = context.texture_array((*size, layers), components, pixels, alignment=1, dtype=dtype)
    made.filter = _AT_PIXELS
    made.repeat_x = made.repeat_y = False
    return made


def make_texture(context: moderngl.Context, size: Size, components: int, dtype: str) -> moderngl.Texture:
    """An empty texture that is sampled linearly and not repeated."""
    texture = context.texture(size, components, alignment=1, dtype=dtype)
    texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
    texture.repeat_x = texture.repeat_y = False
    return texture
