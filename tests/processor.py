"""What the system says of the processor: a test that is skipped for want of an instruction is so only where there is none."""

from __future__ import annotations

from pathlib import Path


def processor_flags() -> set[str]:
    """What Linux says of the processor, empty elsewhere."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return set()
    return next((set(line.split()) for line in lines if line.startswith("flags")), set())
