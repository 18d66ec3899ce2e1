"""Synthesis in a process of its own: the same results and errors as here, whatever becomes of either process."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from multiprocessing.context import SpawnProcess
from multiprocessing.shared_memory import SharedMemory
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import numpy.typing as npt
import pytest
from remote_models import PATIENT_SECONDS, blend, make

from lfcore import remote
from lfcore.errors import Cancelled, InputError, LfviewError, WeightsError
from lfcore.lightfield import LightField
from lfcore.remote import RemoteSynthesizer, SynthesisProcess
from lfcore.synthesizer import MeanSynthesizer, make_synthesizer
from lfcore.weights_header import Stated

PATIENCE = 60.0
ROOT = Path(__file__).parents[1]


def light_field(
    height: int = 20, width: int = 30, dtype: npt.DTypeLike = np.uint8, grid: tuple[int, int] = (3, 2)
) -> LightField:
    values = np.random.default_rng(height).random((*grid, height, width, 3))
    scale = 1 if np.dtype(dtype) == np.float32 else np.iinfo(dtype).max
    return LightField((values * scale).astype(dtype), "noise", "tests", "made up")


class Began:
    """A query to a model that has much patience, and a file that is there once it has begun."""

    def __init__(self, process: SynthesisProcess, folder: Path) -> None:
        self._file = folder / "began"
        self.synthesizer = RemoteSynthesizer(process, f"patient {self._file}")
        self.synthesizer.set_light_field(light_field())

    def wait(self) -> None:
        wait_until(self._file.exists, "the query to begin")


@pytest.fixture(scope="module")
def process() -> Iterator[SynthesisProcess]:
    with SynthesisProcess(make) as started:
        yield started


def asked(process: SynthesisProcess, model: str, field: LightField, u: float = 0.5, v: float = 0.5) -> remote.Synthesis:
    synthesizer = RemoteSynthesizer(process, model)
    synthesizer.set_light_field(field)
    return synthesizer.synthesize(u, v)


def pid_of(process: SynthesisProcess) -> int:
    assert process.pid is not None
    return process.pid


def wait_until(condition: Callable[[], bool], what: str) -> None:
    deadline = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < deadline, f"waited for {what}"
        time.sleep(0.02)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
def test_a_synthesis_is_what_it_would_be_here(process: SynthesisProcess, dtype: npt.DTypeLike) -> None:
    field = light_field(dtype=dtype)
    found = asked(process, "blender", field, 0.25, 0.125)
    assert np.array_equal(found.image, blend(field.corners(), 0.25, 0.125))
    assert found.disparity is not None and np.all(found.disparity == np.float32(0.125))
    assert (found.u, found.v, found.model, found.timings) == (0.25, 0.125, "blender", {"total": 0.5})


def test_a_model_has_its_own_name_and_key(process: SynthesisProcess) -> None:
    synthesizer = RemoteSynthesizer(process, "blender")
    assert (synthesizer.name, synthesizer.key) == ("blender", "key of blender")


def test_a_model_may_have_no_disparity(process: SynthesisProcess) -> None:
    assert asked(process, "flat", light_field()).disparity is None


def test_results_are_not_overwritten_by_later_ones(process: SynthesisProcess) -> None:
    field = light_field()
    first = asked(process, "blender", field, 0.0, 0.0)
    asked(process, "blender", field, 1.0, 1.0)
    assert np.array_equal(first.image, field.corners()[0])


def test_models_are_asked_in_turn_about_light_fields_of_any_size(process: SynthesisProcess) -> None:
    small, large = light_field(8, 9), light_field(200, 301, grid=(2, 4))
    first, second = RemoteSynthesizer(process, "blender"), RemoteSynthesizer(process, "flat")
    first.set_light_field(small)
    second.set_light_field(large)
    for _ in range(2):
        assert np.array_equal(first.synthesize(0, 1).image, small.corners()[1])
        assert np.array_equal(second.synthesize(1, 0).image, large.corners()[2])


def test_a_model_whose_name_and_key_are_stated_is_loaded_with_its_first_query() -> None:
    with SynthesisProcess(make) as process:
        synthesizer = RemoteSynthesizer(process, "weigher", stated=Stated("told", "key of weigher"))
        assert (synthesizer.name, synthesizer.key, synthesizer.weighs) == ("told", "key of weigher", False)
        assert process.pid is None
        field = light_field()
        synthesizer.set_light_field(field)
        assert np.array_equal(synthesizer.synthesize(1, 0).image, field.corners()[2])
        assert synthesizer.weighs
        absent = RemoteSynthesizer(process, "missing", stated=Stated("told", "key told"))
        absent.set_light_field(field)
        with pytest.raises(InputError, match=r"^There is no such model\.$"):
            absent.synthesize(1, 0)


def test_views_of_a_file_that_has_been_replaced_are_not_taken_for_those_of_the_one_before(process: SynthesisProcess) -> None:
    synthesizer = RemoteSynthesizer(process, "blender", stated=Stated("blender", "key of the file before"))
    synthesizer.set_light_field(light_field())
    with pytest.raises(WeightsError, match="has been replaced"):
        synthesizer.synthesize(1, 0)


def test_a_process_that_could_not_be_started_once_is_started_later(monkeypatch: pytest.MonkeyPatch) -> None:
    refusing: list[BaseException] = [OSError(errno.EAGAIN, "not now")]
    start = SpawnProcess.start

    def started(process: SpawnProcess) -> None:
        if refusing:
            raise refusing.pop()
        start(process)

    monkeypatch.setattr(SpawnProcess, "start", started)
    with SynthesisProcess(make) as process:
        with pytest.raises(LfviewError, match=r"could not be started .*not now"):
            process.start()
        assert RemoteSynthesizer(process, "blender").key == "key of blender"


def test_errors_surface_as_they_are(process: SynthesisProcess) -> None:
    before = pid_of(process)
    with pytest.raises(InputError, match=r"^There is no such model\.$"):
        RemoteSynthesizer(process, "missing")
    with pytest.raises(InputError, match=r"^One sentence\.$"):
        asked(process, "wrong input", light_field())
    with pytest.raises(RuntimeError, match="ZeroDivisionError: of the model"):
        asked(process, "faulty", light_field())
    with pytest.raises(InputError, match="No light field"):
        RemoteSynthesizer(process, "blender").synthesize(0.5, 0.5)
    asked(process, "blender", light_field())
    assert pid_of(process) == before


def test_a_query_is_given_up_at_once(process: SynthesisProcess) -> None:
    synthesizer = RemoteSynthesizer(process, "patient")
    synthesizer.set_light_field(light_field())
    began = time.monotonic()
    with pytest.raises(Cancelled):
        synthesizer.synthesize(0.5, 0.5, lambda: time.monotonic() > began + 0.1)
    assert time.monotonic() - began < PATIENT_SECONDS / 3
    asked(process, "blender", light_field())


def test_threads_wait_for_each_other(process: SynthesisProcess) -> None:
    fields = [light_field(10 + size, 12) for size in range(3)]
    found: dict[int, bool] = {}

    def work(number: int) -> None:
        results = [asked(process, "blender", fields[number], 0.0, 0.0).image for _ in range(5)]
        found[number] = all(np.array_equal(result, fields[number].corners()[0]) for result in results)

    threads = [threading.Thread(target=work, args=(number,)) for number in range(len(fields))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(PATIENCE)
    assert found == {0: True, 1: True, 2: True}


@pytest.mark.skipif(sys.platform != "linux", reason="priorities of threads are Linux's")
def test_it_stands_back_half_as_far_until_its_first_synthesis_and_then_with_all_its_threads() -> None:
    own = os.getpriority(os.PRIO_PROCESS, 0)
    half, whole = (min(own + niceness, 19) for niceness in (2, 5))  # Linux knows no more than 19

    def priorities(process: SynthesisProcess) -> set[int]:
        threads = Path(f"/proc/{pid_of(process)}/task").iterdir()
        return {os.getpriority(os.PRIO_PROCESS, int(thread.name)) for thread in threads}

    with SynthesisProcess(make, niceness=5) as process:
        process.start()
        wait_until(lambda: priorities(process) == {half}, "the process to begin")
        synthesizer = RemoteSynthesizer(process, "threaded")
        synthesizer.set_light_field(light_field(8, 8))
        synthesizer.synthesize(0.5, 0.5)
        assert priorities(process) == {whole} and len(list(Path(f"/proc/{pid_of(process)}/task").iterdir())) > 1
        synthesizer.synthesize(0.5, 0.5)
        assert priorities(process) == {whole}


def test_whoever_waits_for_another_query_can_give_up(process: SynthesisProcess, tmp_path: Path) -> None:
    stop, held = threading.Event(), Began(process, tmp_path)
    other = RemoteSynthesizer(process, "blender")
    other.set_light_field(light_field())
    cancelled: list[bool] = []

    def hold() -> None:
        with pytest.raises(Cancelled):
            held.synthesizer.synthesize(0.5, 0.5, stop.is_set)
        cancelled.append(True)

    holder = threading.Thread(target=hold)
    holder.start()
    try:
        held.wait()
        began = time.monotonic()
        with pytest.raises(Cancelled):
            other.synthesize(0.5, 0.5, lambda: True)
        assert time.monotonic() - began < PATIENT_SECONDS / 3  # long before the other's end
    finally:
        stop.set()
        holder.join(PATIENCE)
    assert cancelled == [True]


def test_a_process_that_ends_by_itself_is_started_anew() -> None:
    with SynthesisProcess(make) as process:
        field = light_field()
        blender = RemoteSynthesizer(process, "blender")
        blender.set_light_field(field)
        with pytest.raises(LfviewError, match=r"ended with code 3\. The next view starts it anew\.$"):
            asked(process, "dying", field)
        assert np.array_equal(blender.synthesize(0, 0).image, field.corners()[0])


@pytest.mark.skipif(os.name != "posix", reason="signals")
def test_a_killed_process_is_told_of_and_started_anew(tmp_path: Path) -> None:
    with SynthesisProcess(make) as process:
        query = Began(process, tmp_path)
        killed = pid_of(process)

        def kill() -> None:
            query.wait()
            os.kill(killed, signal.SIGKILL)

        killing = threading.Thread(target=kill)
        killing.start()
        with pytest.raises(LfviewError, match="SIGKILL; if memory ran out"):
            query.synthesizer.synthesize(0.5, 0.5)
        killing.join(PATIENCE)
        asked(process, "blender", light_field())
        assert pid_of(process) != killed


@pytest.mark.skipif(os.name != "posix", reason="signals")
def test_a_process_that_died_unnoticed_is_started_anew_in_silence() -> None:
    with SynthesisProcess(make) as process:
        field = light_field()
        asked(process, "blender", field)
        killed = pid_of(process)
        os.kill(killed, signal.SIGKILL)
        wait_until(lambda: process.pid is None, "the process to end")
        assert np.array_equal(asked(process, "blender", field, 0, 0).image, field.corners()[0])


def test_closing_ends_the_process_and_frees_the_memory() -> None:
    process = SynthesisProcess(make)
    asked(process, "blender", light_field())
    pid, memory = pid_of(process), process.shared_memory_name
    assert memory is not None
    process.close()
    assert process.pid is None
    with pytest.raises(FileNotFoundError):
        SharedMemory(memory)
    with pytest.raises(ProcessLookupError):
        os.kill(pid, 0)


def test_closing_does_not_wait_for_a_query(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(remote, "_END_SECONDS", 0.2)
    process = SynthesisProcess(make)
    query = Began(process, tmp_path)
    failed: list[LfviewError] = []

    def ask() -> None:
        with pytest.raises(LfviewError) as error:
            query.synthesizer.synthesize(0.5, 0.5)
        failed.append(error.value)

    asking = threading.Thread(target=ask)
    asking.start()
    query.wait()
    process.close()
    asking.join(PATIENCE)
    assert len(failed) == 1 and process.pid is None


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_it_ends_with_a_program_that_is_killed() -> None:
    code = (
        "import sys, time; sys.path.insert(0, 'tests')\n"
        "from remote_models import make; from lfcore.remote import RemoteSynthesizer, SynthesisProcess\n"
        "if __name__ == '__main__':\n"
        "    process = SynthesisProcess(make); RemoteSynthesizer(process, 'blender')\n"
        "    print(process.pid, flush=True); time.sleep(600)"
    )
    program = subprocess.Popen([sys.executable, "-c", code], cwd=ROOT, stdout=subprocess.PIPE, text=True)
    try:
        assert program.stdout is not None
        child = Path("/proc") / program.stdout.readline().strip()

        def has_ended() -> bool:
            try:
                return "(zombie)" in (child / "status").read_text()
            except OSError:  # it is no longer there
                return True

        assert not has_ended()
        program.kill()
        wait_until(has_ended, "the process to end")
    finally:
        program.kill()
        program.wait(PATIENCE)
        if program.stdout is not None:
            program.stdout.close()


def test_too_little_shared_memory_is_said(monkeypatch: pytest.MonkeyPatch, process: SynthesisProcess) -> None:
    if not Path("/dev/shm").is_dir():
        pytest.skip("this system keeps shared memory elsewhere")
    monkeypatch.setattr(remote.shutil, "disk_usage", lambda path: SimpleNamespace(free=2**20))
    with pytest.raises(LfviewError, match=r"1 MiB left, but this light field needs 6 MiB"):
        asked(process, "blender", light_field(500, 600))
    monkeypatch.undo()
    asked(process, "blender", light_field())


def test_a_shipped_model_gives_the_same_there_and_here() -> None:
    field = light_field()
    here = MeanSynthesizer()
    here.set_light_field(field)
    with SynthesisProcess() as process:
        process.start()
        assert np.array_equal(asked(process, "mean", field).image, here.synthesize(0.5, 0.5).image)


def test_how_pale_corners_are_is_known_there_too() -> None:
    field = replace(light_field(), aperture=1.0)
    here = make_synthesizer("planesweep")
    here.set_light_field(field)
    expected = here.synthesize(0.5, 0.5).image
    with SynthesisProcess() as process:
        process.start()
        np.testing.assert_allclose(asked(process, "planesweep", field).image, expected, atol=1e-4)
        told_nothing = asked(process, "planesweep", replace(field, aperture=0.0)).image
    assert np.abs(told_nothing - expected).max() > 1e-2


def test_a_program_that_asks_does_not_load_torch() -> None:
    code = "import sys, app.opening, app.engine; sys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], cwd=ROOT, timeout=PATIENCE).returncode == 0
