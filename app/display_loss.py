"""What happens when the display is lost: the X server ends, or a connection to another computer breaks."""

from __future__ import annotations

import atexit
import contextlib
import ctypes
import ctypes.util
import os
import sys
from collections.abc import Callable

EXIT_CODE = 2

_Handler = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p)


def on_display_loss(tidy_up: Callable[[], None]) -> object | None:
    """Have `tidy_up` called in the main thread when the connection to the X server is lost; then the program says so and ends.

    Xlib ends a program whose display is lost with a line of its own and without a chance to tidy up, unless it is told of a
    function to call before, which must not return to what it was doing. Returns what must be kept as long as this shall hold;
    None on systems without X.
    """
    if sys.platform != "linux":
        return None
    try:
        xlib = ctypes.CDLL(ctypes.util.find_library("X11") or "libX11.so.6")
    except OSError:
        return None

    def lost(_: int) -> int:
        with contextlib.suppress(Exception):
            tidy_up()
        atexit._run_exitfuncs()  # ends the processes that were started
        print("lfview: The display was lost; settings are kept, and the program ends.", file=sys.stderr, flush=True)
        os._exit(EXIT_CODE)

    handler = _Handler(lost)
    xlib.XSetIOErrorHandler.argtypes = (_Handler,)
    xlib.XSetIOErrorHandler.restype = ctypes.c_void_p
    xlib.XSetIOErrorHandler(handler)
    return handler
