"""What a figure was measured on: processor, cores, torch, and whether the kernels are compiled (lfcore.kernels)."""

from __future__ import annotations

import importlib.metadata
import importlib.util
import os
import platform
import subprocess
import sys
from pathlib import Path


def machine() -> str:
    """One line, such as "Intel(R) Core(TM) i7-8700, 12 cores, Linux, torch 2.13.0, kernels compiled"."""
    count = core_count()
    cores = "1 core" if count == 1 else f"{count} cores"
    kernels = "kernels compiled" if importlib.util.find_spec("lfcore._kernels") else "kernels not compiled"
    return f"{_processor()}, {cores}, {platform.system()}, torch {importlib.metadata.version('torch')}, {kernels}"


def core_count() -> int:
    """Processor cores (hardware threads) that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def free_memory() -> int:
    """Bytes of memory that can be taken without pressing others out; a guess of 2 GiB where the system does not say."""
    try:
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
        return next(int(line.split()[1]) * 1024 for line in lines if line.startswith("MemAvailable"))
    except (OSError, StopIteration, ValueError, IndexError):
        return 2**31


def _processor() -> str:
    name = ""
    if sys.platform == "linux":
        name = _linux_processor(Path("/proc/cpuinfo"))
    elif sys.platform == "darwin":
        name = _output_of("sysctl", "-n", "machdep.cpu.brand_string")
    return name or platform.processor() or platform.machine() or "unknown processor"


def _linux_processor(cpuinfo: Path) -> str:
    try:
        lines = cpuinfo.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return ""
    names = [line.partition(":")[2] for line in lines if line.startswith("model name")]
    return " ".join(names[0].split()) if names else ""


def _output_of(*command: str) -> str:
    try:
        return subprocess.run(command, capture_output=True, text=True, timeout=5, check=True).stdout.strip()
    except (OSError, subprocess.SubprocessError):
        return ""
