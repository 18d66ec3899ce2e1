"""How the C library hands memory back, set once for programs that synthesize or train."""

from __future__ import annotations

import ctypes
import sys

_M_TRIM_THRESHOLD = -1
_M_MMAP_THRESHOLD = -3


def keep_freed_memory(limit_bytes: int = 1 << 30) -> bool:
    """Ask glibc to keep up to `limit_bytes` of freed memory for the next allocation instead of returning it to the kernel.

    Without it every temporary of more than 32 MiB is mapped, zeroed page by page and unmapped again: a warp of four inputs
    of 541 x 376 takes 0.28 s in place of 0.09 s. Returns whether it took effect; other C libraries are left alone.
    """
    if not sys.platform.startswith("linux"):
        return False
    try:
        mallopt = ctypes.CDLL("libc.so.6").mallopt
    except (OSError, AttributeError):
        return False
    limit = min(limit_bytes, 2**31 - 1)  # mallopt takes an int
    return bool(mallopt(_M_MMAP_THRESHOLD, limit)) and bool(mallopt(_M_TRIM_THRESHOLD, limit))
