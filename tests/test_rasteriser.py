"""Where the processor draws, each thread of the rasteriser has a core of its own."""

from __future__ import annotations

import os
import sys
import threading
from pathlib import Path

import moderngl
import pytest

from app.canvas import draws_in_software, spread_rasteriser

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="threads are given cores on Linux only")


def _threads() -> list[int]:
    tasks = Path("/proc/self/task").iterdir()
    return [int(task.name) for task in tasks if (task / "comm").read_text().startswith("llvmpipe")]


def test_threads_of_the_rasteriser_share_no_core_while_there_are_enough(gl: moderngl.Context) -> None:
    threads = _threads()
    if not draws_in_software(gl) or not threads:
        # In CI Mesa has been installed, and draws with threads where there is more than one core.
        assert not os.environ.get("CI") or len(os.sched_getaffinity(0)) == 1
        pytest.skip("these graphics have no threads of llvmpipe")
    before = {thread: os.sched_getaffinity(thread) for thread in threads}
    mine = os.sched_getaffinity(0)
    try:
        assert spread_rasteriser() == len(threads)
        cores = [os.sched_getaffinity(thread) for thread in threads]
        assert all(len(core) == 1 and core <= mine for core in cores)
        assert len(set.union(*cores)) == min(len(threads), len(mine))
        assert os.sched_getaffinity(0) == mine  # no other thread is bound
    finally:
        for thread, allowed in before.items():
            os.sched_setaffinity(thread, allowed)


def test_threads_that_end_meanwhile_do_no_harm() -> None:
    over = threading.Event()

    def come_and_go() -> None:
        while not over.is_set():
            threading.Thread(target=lambda: None).start()

    busy = [threading.Thread(target=come_and_go) for _ in range(2)]
    for thread in busy:
        thread.start()
    try:
        for _ in range(300):
            spread_rasteriser()
    finally:
        over.set()
        for thread in busy:
            thread.join()
