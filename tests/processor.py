"""What the system says of the processor: a test that is skipped for want of an instruction is so only where there is none."""

from __future__ import annotations

import ctypes
import platform
import sys
from pathlib import Path

_ARCH_PRCTL = 158  # of x86-64
_REQUEST_PERMISSION = 0x1023  # ARCH_REQ_XCOMP_PERM, of Linux 5.16
_TILE_DATA = 18


def processor_flags() -> set[str]:
    """What Linux says of the processor, empty elsewhere."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return set()
    return next((set(line.split()) for line in lines if line.startswith("flags")), set())


def tiles_are_granted() -> bool:
    """Whether this system lets a program keep the matrix unit's tiles; a processor may have one whose system does not."""
    if sys.platform != "linux" or platform.machine() != "x86_64":
        return False
    return ctypes.CDLL(None).syscall(_ARCH_PRCTL, _REQUEST_PERMISSION, _TILE_DATA) == 0
