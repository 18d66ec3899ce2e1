"""Exports in a thread of their own, one after the other: how far each is, how fast, and what became of it."""

from __future__ import annotations

import logging
import os
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum
from pathlib import Path

from app.faults import is_unexpected, sentence
from lfcore.errors import Cancelled

_log = logging.getLogger(__name__)

Cancel = Callable[[], bool]
Done = Callable[[int], None]
NICENESS = 10  # below the hand's own syntheses, which are below the frame loop
_TELL_SECONDS = 0.15  # each telling costs a frame
_KEPT = 50  # finished ones; the oldest are forgotten


@dataclass(frozen=True)
class Job:
    """Something to be exported: `total` pieces, of which `write` tells how many are done; it raises errors.Cancelled soon after
    it has been told so. `target` is the file or folder that it makes."""

    title: str
    target: Path
    total: int
    write: Callable[[Done, Cancel], None]


class Phase(Enum):
    """What has become of a job."""

    WAITING = "waiting"
    RUNNING = "running"
    DONE = "done"
    FAILED = "failed"
    CANCELLED = "cancelled"

    @property
    def over(self) -> bool:
        """Whether nothing more will happen."""
        return self in (Phase.DONE, Phase.FAILED, Phase.CANCELLED)


@dataclass(frozen=True)
class Status:
    """How far a job is. `number` names it; `seconds`: since it began, or what it took; `message`: why it failed;
    `ended`: when it was over."""

    number: int
    title: str
    target: Path
    total: int
    phase: Phase = Phase.WAITING
    done: int = 0
    seconds: float = 0.0
    message: str = ""
    ended: float = 0.0  # monotonic seconds

    @property
    def rate(self) -> float | None:
        """Pieces a second, None before the first is done."""
        return self.done / self.seconds if self.done and self.seconds > 0 else None

    @property
    def seconds_left(self) -> float | None:
        """How long it will still take at this rate, None where that is not known."""
        return (self.total - self.done) / self.rate if self.rate is not None and self.phase is Phase.RUNNING else None


class ExportQueue:
    """Runs jobs one at a time in the order in which they came. All methods may be used from any thread; `wake` is called from
    the queue's own, now and then while a job goes on and after each."""

    def __init__(self, wake: Callable[[], None]) -> None:
        self._wake = wake
        self._changed = threading.Condition()
        self._jobs: dict[int, Job] = {}  # that wait or run, by number
        self._statuses: dict[int, Status] = {}
        self._cancelled: set[int] = set()
        self._last = 0
        self._stopping = False
        self._thread = threading.Thread(target=self._run, name="export", daemon=True)

    def add(self, job: Job) -> int:
        """Put a job at the end of the queue; returns its number."""
        with self._changed:
            self._last += 1
            self._jobs[self._last] = job
            self._statuses[self._last] = Status(self._last, job.title, job.target, job.total)
            self._forget_oldest()
            if not self._thread.is_alive() and not self._stopping:
                self._thread.start()
            self._changed.notify()
            return self._last

    def cancel(self, number: int) -> None:
        """Give a job up, whether it waits or runs; nothing of it stays. One that is over stays as it is."""
        with self._changed:
            if number in self._jobs:
                self._cancelled.add(number)
                if self._statuses[number].phase is Phase.WAITING:
                    self._end(number, Phase.CANCELLED)
        self._wake()

    def clear(self) -> None:
        """Forget the jobs that are over."""
        with self._changed:
            self._statuses = {number: status for number, status in self._statuses.items() if not status.phase.over}

    @property
    def statuses(self) -> tuple[Status, ...]:
        """All jobs that are known, in the order in which they came."""
        with self._changed:
            return tuple(self._statuses.values())

    @property
    def busy(self) -> bool:
        """Whether a job runs or waits."""
        with self._changed:
            return bool(self._jobs)

    def stop(self, timeout: float) -> bool:
        """Cancel everything and wait up to `timeout` seconds for the thread to end; whether it did."""
        with self._changed:
            self._stopping = True
            self._cancelled.update(self._jobs)
            self._changed.notify()
        if self._thread.is_alive():
            self._thread.join(timeout)
        return not self._thread.is_alive()

    def _run(self) -> None:
        if sys.platform == "linux":
            os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), NICENESS)
        while True:
            with self._changed:
                while not self._jobs and not self._stopping:
                    self._changed.wait()
                if self._stopping:
                    return
                number, job = next(iter(self._jobs.items()))
                self._change(number, phase=Phase.RUNNING)
            phase, message = self._outcome(number, job)
            with self._changed:
                self._end(number, phase, message)
            self._wake()

    def _outcome(self, number: int, job: Job) -> tuple[Phase, str]:
        """Run the job; what became of it, and what is to be said about that."""
        started = told = time.monotonic()

        def done(count: int) -> None:
            nonlocal told
            now = time.monotonic()
            with self._changed:
                self._change(number, done=count, seconds=now - started)
            if now - told >= _TELL_SECONDS:
                told = now
                self._wake()

        try:
            job.write(done, lambda: number in self._cancelled)
        except Cancelled:
            return Phase.CANCELLED, ""
        except Exception as error:  # the thread must outlive any fault of a job, and the fault must be seen
            if is_unexpected(error):
                _log.exception("an export failed")
            return Phase.FAILED, sentence(error)
        return Phase.DONE, ""

    def _change(self, number: int, **changes: object) -> None:
        """The lock is held by the caller."""
        self._statuses[number] = replace(self._statuses[number], **changes)  # type: ignore[arg-type]

    def _end(self, number: int, phase: Phase, message: str = "") -> None:
        """The lock is held by the caller."""
        del self._jobs[number]
        self._cancelled.discard(number)
        self._change(number, phase=phase, message=message, ended=time.monotonic())

    def _forget_oldest(self) -> None:
        over = [number for number, status in self._statuses.items() if status.phase.over]
        for number in over[: max(len(over) - _KEPT, 0)]:
            del self._statuses[number]
