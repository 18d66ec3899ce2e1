"""The export queue: in order, one at a time, cancelled or failed without harm, giving way to the hand."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from app.export_jobs import Polite, Source, free_name, picture_job, sweep_job
from app.exporting import Cancel, Done, ExportQueue, Job, Phase, Status
from lfcore.errors import Cancelled, OutputError
from lfcore.key_frames import Stop
from lfcore.sweep_frames import SweepFrames
from lfcore.sweep_plan import KeyFramePath, SweepPlan
from lfcore.sweep_target import Kind, Target
from tests.moving_scene import TruthSynthesizer, light_field, truth
from tests.virtual_screen import PATIENCE, wait_until

PLAN = SweepPlan(KeyFramePath((Stop(0, 0.5), Stop(1, 0.5))), 6)


@pytest.fixture
def queue() -> Iterator[ExportQueue]:
    made = ExportQueue(lambda: None)
    yield made
    assert made.stop(PATIENCE)


def job(write: Callable[[Done, Cancel], None], total: int = 3) -> Job:
    return Job("a job", Path("nowhere"), total, write)


def finish(queue: ExportQueue) -> tuple[Status, ...]:
    wait_until(lambda: not queue.busy, "the queue")
    return queue.statuses


def test_jobs_run_one_at_a_time_in_their_order(queue: ExportQueue) -> None:
    seen: list[int] = []
    running = threading.Semaphore(1)

    def work(number: int) -> Callable[[Done, Cancel], None]:
        def write(done: Done, cancelled: Cancel) -> None:
            assert running.acquire(blocking=False)
            for count in range(1, 4):
                time.sleep(0.002)
                done(count)
            seen.append(number)
            running.release()

        return write

    numbers = [queue.add(job(work(number))) for number in range(4)]
    statuses = finish(queue)
    assert seen == [0, 1, 2, 3]
    assert [status.number for status in statuses] == numbers
    assert all(status.phase is Phase.DONE and status.done == 3 and status.seconds > 0 for status in statuses)


def test_progress_tells_rate_and_time_left(queue: ExportQueue) -> None:
    go_on = threading.Event()

    def write(done: Done, cancelled: Cancel) -> None:
        time.sleep(0.1)
        done(2)
        go_on.wait(PATIENCE)

    queue.add(job(write, total=10))
    wait_until(lambda: queue.statuses[0].done == 2, "two pieces")
    status = queue.statuses[0]
    assert status.phase is Phase.RUNNING
    assert status.rate is not None and status.rate <= 20
    assert status.seconds_left == pytest.approx(8 / status.rate)
    go_on.set()
    assert finish(queue)[0].seconds_left is None


def test_faults_are_told_and_the_queue_goes_on(queue: ExportQueue) -> None:
    def refuse(done: Done, cancelled: Cancel) -> None:
        raise OutputError("The disk is full.")

    def break_down(done: Done, cancelled: Cancel) -> None:
        raise RuntimeError("what?")

    def run_out(done: Done, cancelled: Cancel) -> None:
        raise MemoryError

    for write in (refuse, break_down, run_out, lambda done, cancelled: done(3)):
        queue.add(job(write))
    statuses = finish(queue)
    assert [status.phase for status in statuses] == [Phase.FAILED] * 3 + [Phase.DONE]
    assert [status.message for status in statuses][:2] == [
        "The disk is full.",
        "Unexpected fault in the program: RuntimeError: what?",
    ]
    assert "memory" in statuses[2].message
    queue.clear()
    assert queue.statuses == ()


def test_what_waits_and_what_runs_can_be_cancelled(queue: ExportQueue) -> None:
    def endless(done: Done, cancelled: Cancel) -> None:
        while not cancelled():
            time.sleep(0.002)
        raise Cancelled

    first, second, third = (queue.add(job(write)) for write in (endless, endless, lambda done, cancelled: None))
    wait_until(lambda: queue.statuses[0].phase is Phase.RUNNING, "the first")
    queue.cancel(second)
    assert queue.statuses[1].phase is Phase.CANCELLED
    queue.clear()
    assert [status.number for status in queue.statuses] == [first, third]
    queue.cancel(first)
    assert [status.phase for status in finish(queue)] == [Phase.CANCELLED, Phase.DONE]
    queue.cancel(third)
    assert queue.statuses[1].phase is Phase.DONE


def test_stopping_ends_what_runs() -> None:
    queue = ExportQueue(lambda: None)
    started = threading.Event()

    def endless(done: Done, cancelled: Cancel) -> None:
        started.set()
        while not cancelled():
            time.sleep(0.002)
        raise Cancelled

    queue.add(job(endless))
    queue.add(job(endless))
    assert started.wait(PATIENCE)
    assert queue.stop(PATIENCE)


def source(synthesizer: TruthSynthesizer, hand_waits: Callable[[], bool] = lambda: False) -> Source:
    return Source(light_field(), "truth", lambda: synthesizer, hand_waits)


def test_an_exported_sweep_is_that_of_the_library(queue: ExportQueue, tmp_path: Path) -> None:
    woken: list[int] = []
    queue = ExportQueue(lambda: woken.append(1))
    queue.add(sweep_job(PLAN, Target(tmp_path / "window", Kind.PNG), source(TruthSynthesizer())))
    status = finish(queue)[0]
    assert (status.phase, status.done, status.message) == (Phase.DONE, 6, "")
    assert woken
    from lfcore.sweep_export import export_sweep

    scene = light_field()
    export_sweep(SweepFrames(PLAN, scene, TruthSynthesizer().synthesize), Target(tmp_path / "library", Kind.PNG))
    names = sorted(path.name for path in (tmp_path / "window").iterdir())
    assert len(names) == 6
    assert all((tmp_path / "window" / n).read_bytes() == (tmp_path / "library" / n).read_bytes() for n in names)
    assert queue.stop(PATIENCE)


@pytest.mark.parametrize("name", ["a.mp4", "frames"])
def test_a_cancelled_sweep_leaves_nothing(queue: ExportQueue, tmp_path: Path, name: str) -> None:
    kind = Kind.VIDEO if name.endswith("mp4") else Kind.PNG
    number = queue.add(sweep_job(PLAN, Target(tmp_path / name, kind), source(TruthSynthesizer(0.2))))
    wait_until(lambda: queue.statuses[0].done >= 1, "the first frame")
    queue.cancel(number)
    assert finish(queue)[0].phase is Phase.CANCELLED
    assert list(tmp_path.iterdir()) == []


def test_a_target_that_cannot_be_written_is_told_before_the_model_is_made(queue: ExportQueue, tmp_path: Path) -> None:
    def make() -> TruthSynthesizer:
        raise AssertionError("the model was loaded")

    asked = Source(light_field(), "truth", make, lambda: False)
    queue.add(sweep_job(PLAN, Target(tmp_path / "missing" / "a.mp4", Kind.VIDEO), asked))
    status = finish(queue)[0]
    assert status.phase is Phase.FAILED
    assert "does not exist" in status.message


def test_the_hand_comes_first() -> None:
    hand, noticed = threading.Event(), threading.Event()

    def hand_waits() -> bool:
        waits = hand.is_set()
        if waits:
            noticed.set()
        return waits

    synthesizer = TruthSynthesizer(60.0)
    polite = Polite(synthesizer, hand_waits, lambda: False)
    polite.set_light_field(light_field())
    results: list[np.ndarray] = []
    hand.set()
    thread = threading.Thread(target=lambda: results.append(polite.synthesize(0.5, 0.5).image))
    thread.start()
    assert noticed.wait(PATIENCE)
    time.sleep(0.1)
    assert synthesizer.asked == []  # it waits
    hand.clear()
    wait_until(lambda: len(synthesizer.asked) == 1, "the first attempt")
    synthesizer.seconds = 0.0  # of the next attempt
    noticed.clear()
    hand.set()  # the hand moves: what was begun is given up, and begun again later
    assert noticed.wait(PATIENCE)
    time.sleep(0.1)
    assert results == [] and len(synthesizer.asked) == 1
    hand.clear()
    thread.join(PATIENCE)
    assert len(synthesizer.asked) == 2
    assert np.array_equal(results[0], truth(0.5, 0.5))


def test_a_cancelled_export_does_not_wait_for_the_hand() -> None:
    cancelled = threading.Event()
    polite = Polite(TruthSynthesizer(), lambda: True, cancelled.is_set)
    threading.Timer(0.05, cancelled.set).start()
    with pytest.raises(Cancelled):
        polite.synthesize(0.5, 0.5)


def test_pictures_take_a_name_that_is_free(queue: ExportQueue, tmp_path: Path) -> None:
    assert free_name(tmp_path, "view", ".png") == tmp_path / "view.png"
    (tmp_path / "view.png").write_bytes(b"")
    assert free_name(tmp_path, "view", ".png") == tmp_path / "view 2.png"
    others = {tmp_path / "view 2.png"}  # of jobs that wait
    queue.add(picture_job(np.zeros((4, 5, 3), np.uint8), tmp_path, "view", others))
    assert finish(queue)[0].target == tmp_path / "view 3.png"
    assert (tmp_path / "view 3.png").stat().st_size > 0
