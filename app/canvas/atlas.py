"""Many small pictures in one texture, for lists with pictures: those shown last stay."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Hashable

import moderngl
import numpy as np
import numpy.typing as npt

from app.desk import Placed

PLACE = 192  # px a side: room for the largest glance (lfcore.formats.glance)
_ACROSS = 16  # 256 pictures, 28 MB
_UPLOADS = 12  # a frame: each takes a tenth of a millisecond


class Atlas:
    """A texture of square places, made when the first picture comes. The GL context must be current in all methods."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._texture: moderngl.Texture | None = None
        self._across = 0  # places a side
        self._placed: OrderedDict[Hashable, tuple[int, Placed]] = OrderedDict()  # the one shown longest ago first
        self._uploads = 0

    def begin(self) -> None:
        """A frame begins."""
        self._uploads = 0

    def place(self, name: Hashable, picture: npt.NDArray[np.uint8]) -> Placed | None:
        """Where the picture (h, w, 3) of this name lies; None where it has to wait for a later frame."""
        if name in self._placed:
            self._placed.move_to_end(name)
            return self._placed[name][1]
        if self._uploads >= _UPLOADS:
            return None
        self._uploads += 1
        texture = self._texture if self._texture is not None else self._make()
        index = self._free_place()
        row, column = divmod(index, self._across)
        x, y = column * PLACE, row * PLACE
        height, width = picture.shape[:2]
        texture.write(np.ascontiguousarray(picture), viewport=(x, y, width, height))
        # Half a pixel inside, so that nothing of the neighbours is mixed in.
        first = ((x + 0.5) / texture.width, (y + 0.5) / texture.height)
        last = ((x + width - 0.5) / texture.width, (y + height - 0.5) / texture.height)
        placed = Placed(texture.glo, first, last, width, height)
        self._placed[name] = (index, placed)
        return placed

    def release(self) -> None:
        """Give the memory of the graphics back, and forget all pictures."""
        if self._texture is not None:
            self._texture.release()
            self._texture = None
        self._placed.clear()

    def _free_place(self) -> int:
        if len(self._placed) < self._across**2:
            return len(self._placed)
        return self._placed.popitem(last=False)[1][0]

    def _make(self) -> moderngl.Texture:
        largest = int(self._context.info["GL_MAX_TEXTURE_SIZE"])
        self._across = min(_ACROSS, largest // PLACE)
        side = self._across * PLACE
        self._texture = self._context.texture((side, side), 3, alignment=1)
        self._texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
        return self._texture
