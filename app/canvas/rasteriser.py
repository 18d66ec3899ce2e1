"""The threads of Mesa's software rasteriser, which draw where there is no GPU."""

from __future__ import annotations

import contextlib
import os
import sys
from pathlib import Path

_NAME = "llvmpipe-"  # and a number from 0


def spread_rasteriser() -> int:
    """Give each of its threads in this program a core of its own, as far as there are enough; how many threads there are.

    Linux wakes a thread where it ran last. While the networks keep all cores busy that is often one core for all of them,
    and a frame then takes as long as if there were but one thread. Elsewhere than on Linux nothing is done.
    """
    if sys.platform != "linux":
        return 0
    cores = sorted(os.sched_getaffinity(0))
    threads = _threads()
    for thread, number in threads.items():
        with contextlib.suppress(ProcessLookupError):  # it has just ended
            os.sched_setaffinity(thread, {cores[number % len(cores)]})
    return len(threads)


def _threads() -> dict[int, int]:
    """The rasteriser's number of each of its threads, by the system's number of the thread."""
    found = {}
    for task in Path("/proc/self/task").iterdir():
        try:
            name = (task / "comm").read_text().strip()
        except OSError:  # a thread of the program that has just ended
            continue
        number = name.removeprefix(_NAME)
        if name.startswith(_NAME) and number.isdecimal():
            found[int(task.name)] = int(number)
    return found
