"""Many small pictures in a few textures, for lists with pictures: those shown last stay."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Hashable

import moderngl
import numpy as np
import numpy.typing as npt

from app.desk import Placed

PLACE = 192  # px a side of a place: room for the largest glance (lfcore.formats.glance)
_ACROSS = 4  # places a side of a sheet: one takes 2 MB, and less than a frame to make
_SHEETS = 16  # 256 pictures
_UPLOADS = 12  # a frame: each takes a tenth of a millisecond
# imgui's own texture has four components too: software rasterisers compile its shader once for each kind of texture.
_COMPONENTS = 4


class Atlas:
    """Sheets of square places, made when they are needed. The GL context must be current in all methods."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._sheets: list[moderngl.Texture] = []
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
        index = self._free_place()
        placed = self._put(index, picture)
        self._placed[name] = (index, placed)
        return placed

    def release(self) -> None:
        """Give the memory of the graphics back, and forget all pictures."""
        for sheet in self._sheets:
            sheet.release()
        self._sheets.clear()
        self._placed.clear()

    def _free_place(self) -> int:
        if len(self._placed) < _SHEETS * _ACROSS**2:
            return len(self._placed)
        return self._placed.popitem(last=False)[1][0]

    def _put(self, index: int, picture: npt.NDArray[np.uint8]) -> Placed:
        number, place = divmod(index, _ACROSS**2)
        if number == len(self._sheets):
            side = _ACROSS * PLACE
            self._sheets.append(self._context.texture((side, side), _COMPONENTS))
            self._sheets[-1].filter = (moderngl.LINEAR, moderngl.LINEAR)
        sheet = self._sheets[number]
        row, column = divmod(place, _ACROSS)
        x, y = column * PLACE, row * PLACE
        height, width = picture.shape[:2]
        pixels = np.full((height, width, _COMPONENTS), 255, np.uint8)
        pixels[..., :3] = picture
        sheet.write(pixels, viewport=(x, y, width, height))
        # Half a pixel inside, so that nothing of the neighbours is mixed in.
        first = ((x + 0.5) / sheet.width, (y + 0.5) / sheet.height)
        last = ((x + width - 0.5) / sheet.width, (y + height - 0.5) / sheet.height)
        return Placed(sheet.glo, first, last, width, height)
