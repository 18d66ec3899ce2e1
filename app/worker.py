"""One thread with one slot: the latest job wins, and results come back through a queue that the main thread empties."""

from __future__ import annotations

import logging
import os
import queue
import sys
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

from app.faults import is_unexpected, sentence
from lfcore.errors import Cancelled

Result = TypeVar("Result")
Cancel = Callable[[], bool]
Job = Callable[[Cancel], Result]

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Done(Generic[Result]):
    """The result of the job with that ticket."""

    ticket: int
    value: Result


@dataclass(frozen=True)
class Failed:
    """The job with that ticket raised; `message` is a sentence for the person at the screen."""

    ticket: int
    message: str


class LatestWorker(Generic[Result]):
    """Runs jobs one at a time in a thread of its own; a job that waits is replaced by a newer one and never runs.

    A job is a function of `cancelled`, which it should ask now and then, and after which it may raise errors.Cancelled:
    such a job leaves no result. Any other exception becomes a Failed, so the thread outlives every job. `wake` is called
    from the thread after each outcome; the outcomes are in `outcomes`. `niceness` lowers the thread's priority, and that
    of threads it starts, where the system knows priorities of threads.
    """

    def __init__(self, name: str, wake: Callable[[], None], niceness: int = 0) -> None:
        self.outcomes: queue.SimpleQueue[Done[Result] | Failed] = queue.SimpleQueue()
        self._wake = wake
        self._niceness = niceness
        self._changed = threading.Condition()
        self._waiting: tuple[int, Job[Result]] | None = None
        self._running: int | None = None
        self._last_ticket = 0
        self._cancelled_up_to = 0
        self._stopping = False
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)

    def submit(self, job: Job[Result]) -> int:
        """Put a job into the slot, in place of one that waits there; the running one goes on. Returns the job's ticket."""
        with self._changed:
            self._last_ticket += 1
            self._waiting = (self._last_ticket, job)
            if not self._thread.is_alive() and not self._stopping:
                self._thread.start()
            self._changed.notify()
            return self._last_ticket

    def cancel_before(self, ticket: int) -> None:
        """Tell jobs older than this ticket that nobody wants their result."""
        with self._changed:
            self._cancelled_up_to = max(self._cancelled_up_to, ticket - 1)
            if self._waiting is not None and self._waiting[0] < ticket:
                self._waiting = None

    def cancel_all(self) -> None:
        """Tell every job so far that nobody wants its result."""
        self.cancel_before(self._last_ticket + 1)

    @property
    def running(self) -> int | None:
        """Ticket of the job that runs now, or None."""
        return self._running

    @property
    def busy(self) -> bool:
        """Whether a job runs or waits."""
        with self._changed:
            return self._running is not None or self._waiting is not None

    def stop(self, timeout: float) -> bool:
        """Cancel everything and wait up to `timeout` seconds for the thread to end; whether it did."""
        with self._changed:
            self._stopping = True
            self._cancelled_up_to = self._last_ticket
            self._waiting = None
            self._changed.notify()
        if self._thread.is_alive():
            self._thread.join(timeout)
        return not self._thread.is_alive()

    def _run(self) -> None:
        if self._niceness and sys.platform == "linux":
            os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), self._niceness)
        while True:
            with self._changed:
                while self._waiting is None and not self._stopping:
                    self._changed.wait()
                if self._waiting is None:
                    return
                ticket, job = self._waiting
                self._waiting = None
                self._running = ticket
            outcome = self._outcome(ticket, job)
            with self._changed:
                self._running = None
            if outcome is not None:
                self.outcomes.put(outcome)
            self._wake()

    def _outcome(self, ticket: int, job: Job[Result]) -> Done[Result] | Failed | None:
        try:
            return Done(ticket, job(lambda: ticket <= self._cancelled_up_to))
        except Cancelled:
            return None
        except Exception as error:  # the thread must outlive any fault of a job, and the fault must be seen
            if is_unexpected(error):
                _log.exception("a job failed")
            return Failed(ticket, sentence(error))
