"""The thread with one slot: the latest job wins, faults surface, cancelled work leaves nothing."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator

import pytest

from app.worker import Cancel, Done, Failed, Job, LatestWorker
from lfcore.errors import Cancelled, InputError

PATIENCE = 60.0


@pytest.fixture
def worker() -> Iterator[LatestWorker[str]]:
    made: LatestWorker[str] = LatestWorker("test", lambda: None)
    yield made
    assert made.stop(PATIENCE)


def saying(word: str) -> Job[str]:
    return lambda cancelled: word


def blocking(started: threading.Event, release: threading.Event, word: str) -> Job[str]:
    def job(cancelled: Cancel) -> str:
        started.set()
        assert release.wait(PATIENCE)
        return word

    return job


def wait_until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.002)


def test_result_comes_through_the_queue_with_its_ticket(worker: LatestWorker[str]) -> None:
    ticket = worker.submit(saying("a"))
    assert worker.outcomes.get(timeout=PATIENCE) == Done(ticket, "a")


def test_latest_of_the_waiting_jobs_wins_and_the_running_one_goes_on(worker: LatestWorker[str]) -> None:
    started, release = threading.Event(), threading.Event()
    first = worker.submit(blocking(started, release, "running"))
    assert started.wait(PATIENCE)
    ran: list[int] = []

    def numbered(number: int) -> Job[str]:
        def job(cancelled: Cancel) -> str:
            ran.append(number)
            return str(number)

        return job

    tickets = [worker.submit(numbered(number)) for number in range(10)]
    release.set()
    assert worker.outcomes.get(timeout=PATIENCE) == Done(first, "running")
    assert worker.outcomes.get(timeout=PATIENCE) == Done(tickets[-1], "9")
    assert ran == [9]


def test_a_fault_surfaces_as_a_message_and_the_thread_lives_on(worker: LatestWorker[str]) -> None:
    def known(cancelled: Cancel) -> str:
        raise InputError("The file is empty; choose another.")

    def unknown(cancelled: Cancel) -> str:
        raise ZeroDivisionError("by accident")

    worker.submit(known)
    outcome = worker.outcomes.get(timeout=PATIENCE)
    assert isinstance(outcome, Failed)
    assert outcome.message == "The file is empty; choose another."
    worker.submit(unknown)
    outcome = worker.outcomes.get(timeout=PATIENCE)
    assert isinstance(outcome, Failed)
    assert "ZeroDivisionError" in outcome.message
    assert "by accident" in outcome.message
    ticket = worker.submit(saying("still here"))
    assert worker.outcomes.get(timeout=PATIENCE) == Done(ticket, "still here")


def test_cancelled_work_leaves_no_outcome(worker: LatestWorker[str]) -> None:
    started = threading.Event()

    def until_cancelled(cancelled: Cancel) -> str:
        started.set()
        wait_until(cancelled)
        raise Cancelled

    worker.submit(until_cancelled)
    assert started.wait(PATIENCE)
    worker.cancel_all()
    wait_until(lambda: not worker.busy)
    assert worker.outcomes.empty()


def test_cancelling_older_jobs_spares_the_newer_one(worker: LatestWorker[str]) -> None:
    started = threading.Event()

    def until_cancelled(cancelled: Cancel) -> str:
        started.set()
        wait_until(cancelled)
        raise Cancelled

    worker.submit(until_cancelled)
    assert started.wait(PATIENCE)
    ticket = worker.submit(saying("newer"))
    worker.cancel_before(ticket)
    assert worker.outcomes.get(timeout=PATIENCE) == Done(ticket, "newer")


def test_the_loop_is_woken_after_each_outcome() -> None:
    woken = threading.Semaphore(0)
    worker: LatestWorker[str] = LatestWorker("test", woken.release)
    worker.submit(saying("a"))
    assert woken.acquire(timeout=PATIENCE)
    assert not worker.outcomes.empty()
    assert worker.stop(PATIENCE)


def test_stop_ends_the_thread_in_the_middle_of_a_job() -> None:
    worker: LatestWorker[str] = LatestWorker("test", lambda: None)
    started = threading.Event()

    def until_cancelled(cancelled: Cancel) -> str:
        started.set()
        wait_until(cancelled)
        raise Cancelled

    worker.submit(until_cancelled)
    assert started.wait(PATIENCE)
    assert worker.stop(PATIENCE)


def test_stop_before_any_job_is_no_wait() -> None:
    worker: LatestWorker[str] = LatestWorker("test", lambda: None)
    assert worker.stop(0.0)
