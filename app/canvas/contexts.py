"""GL contexts: a window's, and one without any window."""

from __future__ import annotations

import ctypes
from collections.abc import Callable

import moderngl

from lfcore.errors import LfviewError

GL_VERSION = 330
_SOFTWARE = ("llvmpipe", "softpipe", "swrast", "swiftshader", "software")  # in names of renderers that have no GPU


def windowed_context(load_function: object) -> moderngl.Context:
    """The GL context that is current on this thread; `load_function` has a method load_opengl_function(name) -> address."""
    moderngl.init_context(load_function)
    return moderngl.get_context()


def draws_in_software(context: moderngl.Context) -> bool:
    """Whether the processor does the graphics' work."""
    renderer = str(context.info["GL_RENDERER"]).lower()
    return any(name in renderer for name in _SOFTWARE)


def standalone_context() -> moderngl.Context:
    """A GL context without any window, through EGL; raises LfviewError where there is none."""
    try:
        return moderngl.create_standalone_context(require=GL_VERSION, backend="egl")  # type: ignore[arg-type]  # its stub is wrong
    except Exception as error:  # moderngl and glcontext raise bare Exceptions here
        raise LfviewError(
            f"Found no OpenGL 3.3 for drawing off screen ({error}); install EGL and a driver "
            f"(on Debian: libegl1 and libgl1-mesa-dri)."
        ) from error


def standalone_functions() -> Callable[[str], int] | None:
    """The addresses of OpenGL's functions by name, for contexts of `standalone_context`; None where EGL has another name."""
    try:
        address_of = ctypes.CDLL("libEGL.so.1").eglGetProcAddress
    except OSError:
        return None
    address_of.argtypes, address_of.restype = (ctypes.c_char_p,), ctypes.c_void_p
    return lambda name: address_of(name.encode()) or 0
