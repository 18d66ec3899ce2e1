"""Pictures of the processor into a window that the processor draws as well: copied, not drawn.

A software rasteriser keeps its windows in the processor's memory. A picture that has been enlarged already (app.painting), in
the window's own order of colours and of rows, it only copies, in a twentieth of the time that drawing it would take. moderngl
offers neither that order nor copies upside down, so OpenGL is called directly.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from app.canvas.frame import Target
from app.canvas.placing import Pixels, sampling, visible
from app.geometry import Placement, Rect, Size
from app.painting import Box, Places, enlarged
from lfcore.synthesis import ByteArray

_TEXTURE_2D, _READ_FRAMEBUFFER, _DRAW_FRAMEBUFFER, _COLOR_ATTACHMENT = 0x0DE1, 0x8CA8, 0x8CA9, 0x8CE0
_RGBA, _BGRA, _UNSIGNED_BYTE = 0x1908, 0x80E1, 0x1401
_UNPACK_ALIGNMENT, _UNPACK_ROW_LENGTH = 0x0CF5, 0x0CF2
_COLOR_BUFFER_BIT, _NEAREST, _SCISSOR_TEST = 0x4000, 0x2600, 0x0C11

_INT, _UNSIGNED, _POINTER = ctypes.c_int, ctypes.c_uint, ctypes.c_void_p
_FUNCTIONS: Mapping[str, tuple[Any, ...]] = {
    "glBindFramebuffer": (_UNSIGNED, _UNSIGNED),
    "glBindTexture": (_UNSIGNED, _UNSIGNED),
    "glBlitFramebuffer": (*(8 * (_INT,)), _UNSIGNED, _UNSIGNED),
    "glDeleteFramebuffers": (_INT, _POINTER),
    "glDeleteTextures": (_INT, _POINTER),
    "glDisable": (_UNSIGNED,),
    "glFramebufferTexture2D": (_UNSIGNED, _UNSIGNED, _UNSIGNED, _UNSIGNED, _INT),
    "glGenFramebuffers": (_INT, _POINTER),
    "glGenTextures": (_INT, _POINTER),
    "glPixelStorei": (_UNSIGNED, _INT),
    "glTexImage2D": (_UNSIGNED, _INT, _INT, _INT, _INT, _INT, _UNSIGNED, _UNSIGNED, _POINTER),
    "glTexSubImage2D": (_UNSIGNED, _INT, _INT, _INT, _INT, _INT, _UNSIGNED, _UNSIGNED, _POINTER),
}
_SAMPLED: Mapping[str, Callable[[npt.NDArray[np.floating], int], Places]] = {
    "sample_pixels.glsl": Places.at,
    "sample_linear.glsl": Places.between,
}


class Sheets(Protocol):
    """Memory in which a whole window is painted, and the way from there into the window."""

    def keeps(self, size: Size) -> bool:
        """Whether there is still in the next sheet what was shown last, which had this (width, height)."""

    def sheet(self, size: Size) -> ByteArray:
        """Pixels (H, W, 4), blue first, that `show` takes."""

    def show(self, sheet: ByteArray, boxes: Sequence[Box]) -> None:
        """The sheet that was asked for last into the window. boxes: where it is another one than what it `keeps`; all of it
        where it keeps nothing."""


class WindowCopy:
    """Puts pictures into windows. The window's GL context must be current.

    load: the addresses of OpenGL's functions by name.
    """

    def __init__(self, load: Callable[[str], int]) -> None:
        self._gl = {name: ctypes.CFUNCTYPE(None, *types)(load(name)) for name, types in _FUNCTIONS.items()}
        self._size: Size = (0, 0)  # that there is room for
        self._shown: Size | None = None  # of the sheet that is in it
        self._room: ByteArray = np.empty(0, np.uint8)
        self._texture, self._framebuffer = _UNSIGNED(), _UNSIGNED()

    @staticmethod
    def suits(placement: Placement) -> bool:
        """Whether pictures can be put there: those made much smaller are not."""
        return sampling(placement.scale) in _SAMPLED

    def image(self, picture: ByteArray, target: Target, area: Rect, placement: Placement) -> None:
        """A picture (H, W, 4) into its place in the window, as Magnifier.image draws it."""
        inside = visible((picture.shape[1], picture.shape[0]), area, placement)
        if min(inside.width, inside.height) > 0:
            size = inside.width, inside.height
            seen = self.sheet(size)
            enlarge(picture, inside, placement, seen)
            self._hand_over(seen, Box(0, 0, *size))
            self._copy(target, (inside.x, inside.y), size)
            self._shown = None

    def into(self, target: Target) -> Sheets:
        """Sheets for the window that the target is."""
        return _Into(self, target)

    def keeps(self, size: Size) -> bool:
        """See Sheets."""
        return self._shown == size

    def sheet(self, size: Size) -> ByteArray:
        """Memory for pixels (H, W, 4), blue first; whatever was in it before."""
        self._make_room(size)
        return self._room[: 4 * size[0] * size[1]].reshape(size[1], size[0], 4)

    def show(self, sheet: ByteArray, boxes: Sequence[Box], target: Target) -> None:
        """See Sheets."""
        for box in boxes:
            self._hand_over(sheet, box)
        self._shown = sheet.shape[1], sheet.shape[0]
        self._copy(target, (0, 0), self._shown)

    def _hand_over(self, pixels: ByteArray, box: Box) -> None:
        first = pixels[box.top :, box.left :]
        size = box.right - box.left, box.bottom - box.top
        self._gl["glBindTexture"](_TEXTURE_2D, self._texture)
        self._gl["glPixelStorei"](_UNPACK_ALIGNMENT, 4)
        self._gl["glPixelStorei"](_UNPACK_ROW_LENGTH, pixels.shape[1])
        self._gl["glTexSubImage2D"](_TEXTURE_2D, 0, box.left, box.top, *size, _BGRA, _UNSIGNED_BYTE, first.ctypes.data)
        self._gl["glPixelStorei"](_UNPACK_ROW_LENGTH, 0)

    def _make_room(self, size: Size) -> None:
        """For pictures of this size: memory, and a texture that is kept as windows are, blue first. Where no order is asked
        for, Mesa takes that in which pixels come."""
        if size[0] <= self._size[0] and size[1] <= self._size[1]:
            return
        size = max(size[0], self._size[0]), max(size[1], self._size[1])
        self._gl["glDeleteFramebuffers"](1, ctypes.byref(self._framebuffer))
        self._gl["glDeleteTextures"](1, ctypes.byref(self._texture))
        self._room = np.empty(4 * size[0] * size[1], np.uint8)
        self._gl["glGenTextures"](1, ctypes.byref(self._texture))
        self._gl["glBindTexture"](_TEXTURE_2D, self._texture)
        self._gl["glTexImage2D"](_TEXTURE_2D, 0, _RGBA, *size, 0, _BGRA, _UNSIGNED_BYTE, None)
        self._gl["glGenFramebuffers"](1, ctypes.byref(self._framebuffer))
        self._gl["glBindFramebuffer"](_READ_FRAMEBUFFER, self._framebuffer)
        self._gl["glFramebufferTexture2D"](_READ_FRAMEBUFFER, _COLOR_ATTACHMENT, _TEXTURE_2D, self._texture, 0)
        self._size = size

    def _copy(self, target: Target, corner: Size, size: Size) -> None:
        """The first pixels of the texture to that corner of the window. The first row of both is the highest, but GL counts a
        window's from below."""
        (left, top), (width, height), lowest = corner, size, target.size[1]
        self._gl["glBindFramebuffer"](_READ_FRAMEBUFFER, self._framebuffer)
        self._gl["glBindFramebuffer"](_DRAW_FRAMEBUFFER, target.framebuffer.glo)
        self._gl["glDisable"](_SCISSOR_TEST)  # within one, pixels are drawn
        places = (0, 0, width, height, left, lowest - top, left + width, lowest - top - height)
        self._gl["glBlitFramebuffer"](*places, _COLOR_BUFFER_BIT, _NEAREST)
        target.framebuffer.use()  # as moderngl believes it to be


@dataclass(frozen=True)
class _Into:
    """Sheets that OpenGL copies into one window."""

    copy: WindowCopy
    target: Target

    def keeps(self, size: Size) -> bool:
        """See Sheets."""
        return self.copy.keeps(size)

    def sheet(self, size: Size) -> ByteArray:
        """See Sheets."""
        return self.copy.sheet(size)

    def show(self, sheet: ByteArray, boxes: Sequence[Box]) -> None:
        """See Sheets."""
        self.copy.show(sheet, boxes, self.target)


def enlarge(picture: ByteArray, inside: Pixels, placement: Placement, out: ByteArray) -> None:
    """These pixels of the window of a picture (H, W, 4) that lies at the placement, which WindowCopy.suits: set in `out`."""
    height, width = picture.shape[:2]
    sampled = _SAMPLED[sampling(placement.scale)]
    along_x = (np.arange(inside.x, inside.x + inside.width) + (0.5 - placement.origin[0])) / placement.scale
    along_y = (np.arange(inside.y, inside.y + inside.height) + (0.5 - placement.origin[1])) / placement.scale
    enlarged(picture, sampled(along_y, height), sampled(along_x, width), out)
