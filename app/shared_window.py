"""A window of X11 whose pixels the processor paints itself, in memory that it shares with the X server (MIT-SHM).

By OpenGL the same pixels are copied twice before they come to the server. Where the server cannot share memory with the program
(it runs elsewhere, or in a container of its own), that way is left. Xlib is called directly, on the connection that glfw and
Mesa use too, so that all of them come to the window in turn.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from ctypes import POINTER, c_char_p, c_int, c_uint, c_ulong, c_void_p
from typing import Any

import numpy as np

from app.geometry import Size
from app.painting import CHANNELS, Box
from lfcore.synthesis import ByteArray

_IPC_PRIVATE, _IPC_CREAT, _IPC_RMID, _OWNER_ALONE = 0, 0o1000, 0, 0o600
_ZPIXMAP, _ALL_PLANES = 2, 2**64 - 1 if ctypes.sizeof(c_ulong) == 8 else 2**32 - 1
_RED, _GREEN, _BLUE, _LEAST_FIRST = 0xFF0000, 0x00FF00, 0x0000FF, 0  # how pixels of a sheet look to X
_FAILED = c_void_p(-1).value


class _Attributes(ctypes.Structure):
    """The beginning of an XWindowAttributes; the rest is room for what Xlib writes."""

    _fields_ = [("place", c_int * 5), ("depth", c_int), ("visual", c_void_p), ("rest", c_ulong * 32)]


class _Image(ctypes.Structure):
    """The beginning of an XImage."""

    _fields_ = [
        ("width", c_int),
        ("height", c_int),
        ("xoffset", c_int),
        ("format", c_int),
        ("data", c_void_p),
        ("byte_order", c_int),
        ("bitmap", c_int * 3),
        ("depth", c_int),
        ("bytes_per_line", c_int),
        ("bits_per_pixel", c_int),
        ("red_mask", c_ulong),
        ("green_mask", c_ulong),
        ("blue_mask", c_ulong),
    ]


class _Segment(ctypes.Structure):
    """An XShmSegmentInfo."""

    _fields_ = [("segment", c_ulong), ("number", c_int), ("address", c_void_p), ("read_only", c_int)]


_Handler = ctypes.CFUNCTYPE(c_int, c_void_p, c_void_p)


class SharedWindow:
    """Shows sheets as WindowCopy does. Belongs to the thread of the window, which must outlive it."""

    def __init__(self, display: int, window: int) -> None:
        """Raises OSError where the server does not share memory, or the window's pixels are kept in another order."""
        self._x, self._ext, self._c = _library("X11"), _library("Xext"), ctypes.CDLL(None, use_errno=True)
        _declare(self._x, self._ext, self._c)
        self._display, self._window = c_void_p(display), c_ulong(window)
        attributes = _Attributes()
        if not self._ext.XShmQueryExtension(self._display):
            raise OSError("the X server shares no memory")
        if not self._x.XGetWindowAttributes(self._display, self._window, ctypes.byref(attributes)):
            raise OSError("the window has gone")
        self._depth, self._visual = attributes.depth, c_void_p(attributes.visual)
        self._context = c_void_p(self._x.XCreateGC(self._display, self._window, 0, None))
        self._segment, self._capacity = _Segment(), 0
        self._image: Any = None
        self._room: ByteArray = np.empty(0, np.uint8)
        self._size: Size = (0, 0)
        try:
            self.sheet((1, 1))
            self._try_out()
        except OSError:
            self.close()
            raise

    def keeps(self, size: Size) -> bool:
        """Whether there is still in the next sheet what was in the last one, which had this (width, height)."""
        return size == self._size

    def sheet(self, size: Size) -> ByteArray:
        """Memory for pixels (H, W, 4), blue first, that `show` takes. Raises OSError where there is none."""
        if size != self._size:
            self._make_room(size)
        return self._room

    def show(self, sheet: ByteArray, boxes: Sequence[Box]) -> None:
        """These boxes of the sheet that was asked for last into the window, until the server has taken them."""
        if not boxes:
            return  # without asking the server for anything
        for box in boxes:
            size = box.right - box.left, box.bottom - box.top
            places = box.left, box.top, box.left, box.top, *size
            self._ext.XShmPutImage(self._display, self._window, self._context, self._image, *places, 0)
        self._x.XSync(self._display, 0)

    def close(self) -> None:
        """Give the memory back; the window is not touched."""
        self._let_go()
        self._x.XFreeGC(self._display, self._context)

    def _make_room(self, size: Size) -> None:
        """Memory for sheets of this size, and how the server is to read it."""
        width, height = size
        if width * height * CHANNELS > self._capacity:
            self._let_go()
            self._share(width * height * CHANNELS)
        elif self._image is not None:
            self._x.XFree(self._image)
        self._image = self._ext.XShmCreateImage(
            self._display, self._visual, self._depth, _ZPIXMAP, None, ctypes.byref(self._segment), width, height
        )
        if not self._image:
            raise OSError("Xlib has no memory for a picture")
        image = self._image.contents
        image.data = self._segment.address
        masks = image.red_mask, image.green_mask, image.blue_mask
        if (*masks, image.byte_order, image.bytes_per_line) != (_RED, _GREEN, _BLUE, _LEAST_FIRST, CHANNELS * width):
            raise OSError("the window's pixels are kept in another order")
        memory = (ctypes.c_uint8 * (CHANNELS * width * height)).from_address(self._segment.address)
        self._room = np.ctypeslib.as_array(memory).reshape(height, width, CHANNELS)
        self._size = size

    def _share(self, size: int) -> None:
        """Memory of so many bytes that the server knows too."""
        segment = self._segment
        segment.number = self._c.shmget(_IPC_PRIVATE, size, _IPC_CREAT | _OWNER_ALONE)
        if segment.number < 0:
            raise OSError(ctypes.get_errno(), "no memory that could be shared")
        segment.address = self._c.shmat(segment.number, None, 0)
        segment.read_only = 0
        attached = segment.address != _FAILED and self._attach()
        self._c.shmctl(segment.number, _IPC_RMID, None)  # it goes when both have let it go, be it by dying
        if not attached:
            if segment.address != _FAILED:
                self._c.shmdt(c_void_p(segment.address))
            raise OSError("the X server does not take the memory")
        self._capacity = size

    def _attach(self) -> bool:
        faults = 0

        def note(*_: object) -> int:  # otherwise Xlib ends the program
            nonlocal faults
            faults += 1
            return 0

        handler = _Handler(note)
        self._x.XSync(self._display, 0)
        before = self._x.XSetErrorHandler(ctypes.cast(handler, c_void_p))
        attached = self._ext.XShmAttach(self._display, ctypes.byref(self._segment))
        self._x.XSync(self._display, 0)
        self._x.XSetErrorHandler(c_void_p(before))
        return bool(attached) and not faults

    def _let_go(self) -> None:
        self._size, self._room = (0, 0), np.empty(0, np.uint8)
        if self._image is not None:
            self._x.XFree(self._image)
            self._image = None
        if self._capacity:
            self._ext.XShmDetach(self._display, ctypes.byref(self._segment))
            self._x.XSync(self._display, 0)
            self._c.shmdt(c_void_p(self._segment.address))
            self._capacity = 0

    def _try_out(self) -> None:
        """Raise OSError where the server takes other memory for ours: the same number may name another piece where it lives."""
        colour = 0x5AC33C
        pixmap = self._x.XCreatePixmap(self._display, self._window, 1, 1, self._depth)
        self._x.XSetForeground(self._display, self._context, colour)
        self._x.XFillRectangle(self._display, c_ulong(pixmap), self._context, 0, 0, 1, 1)
        self._room[...] = 0
        self._ext.XShmGetImage(self._display, c_ulong(pixmap), self._image, 0, 0, _ALL_PLANES)
        self._x.XFreePixmap(self._display, c_ulong(pixmap))
        if tuple(self._room[0, 0, :3]) != tuple(colour.to_bytes(3, "little")):
            raise OSError("the X server shares no memory with this program")


def _library(name: str) -> ctypes.CDLL:
    return ctypes.CDLL(f"lib{name}.so.6")


def _declare(x: ctypes.CDLL, ext: ctypes.CDLL, c: ctypes.CDLL) -> None:
    """What the functions take and return."""
    display, drawable, context, image, segment = c_void_p, c_ulong, c_void_p, POINTER(_Image), POINTER(_Segment)
    functions: Sequence[tuple[ctypes.CDLL, str, Any, tuple[Any, ...]]] = (
        (x, "XGetWindowAttributes", c_int, (display, drawable, POINTER(_Attributes))),
        (x, "XCreateGC", c_void_p, (display, drawable, c_ulong, c_void_p)),
        (x, "XFreeGC", c_int, (display, context)),
        (x, "XSync", c_int, (display, c_int)),
        (x, "XSetErrorHandler", c_void_p, (c_void_p,)),
        (x, "XFree", c_int, (c_void_p,)),
        (x, "XCreatePixmap", c_ulong, (display, drawable, c_uint, c_uint, c_uint)),
        (x, "XFreePixmap", c_int, (display, drawable)),
        (x, "XSetForeground", c_int, (display, context, c_ulong)),
        (x, "XFillRectangle", c_int, (display, drawable, context, c_int, c_int, c_uint, c_uint)),
        (ext, "XShmQueryExtension", c_int, (display,)),
        (ext, "XShmAttach", c_int, (display, segment)),
        (ext, "XShmDetach", c_int, (display, segment)),
        (ext, "XShmCreateImage", image, (display, c_void_p, c_uint, c_int, c_char_p, segment, c_uint, c_uint)),
        (ext, "XShmGetImage", c_int, (display, drawable, image, c_int, c_int, c_ulong)),
        (ext, "XShmPutImage", c_int, (display, drawable, context, image, *(4 * (c_int,)), c_uint, c_uint, c_int)),
        (c, "shmget", c_int, (c_int, ctypes.c_size_t, c_int)),
        (c, "shmat", c_void_p, (c_int, c_void_p, c_int)),
        (c, "shmdt", c_int, (c_void_p,)),
        (c, "shmctl", c_int, (c_int, c_int, c_void_p)),
    )
    for library, name, returned, taken in functions:
        function = getattr(library, name)
        function.restype, function.argtypes = returned, taken
