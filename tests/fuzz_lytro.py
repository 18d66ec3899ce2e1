"""Damaged Lytro files by the hundred thousand: each must be read, or refused in one sentence, in time and memory.

`python -m tests.fuzz_lytro --count 100000` makes that many damaged files out of small ones written as the cameras write
them, and puts each through all that the program does with such a file. Every case follows from the seed and its number, so
`--first 4711 --count 1` makes case 4711 again and prints what became of it. With real files in `--real FOLDER`, every
hundredth case is one of these.
"""

from __future__ import annotations

import argparse
import contextlib
import faulthandler
import json
import os
import random
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from unittest import mock

from lfcore.decode.calibration import choose_white_image
from lfcore.decode.unpack import unpack
from lfcore.errors import InputError
from lfcore.formats import open_light_field
from lfcore.formats.lytro import report
from lfcore.formats.lytro.container import Container, open_container
from lfcore.formats.lytro.contents import Kind, read_contents
from lfcore.formats.lytro.extras import read_extras
from lfcore.formats.lytro.metadata import Capture
from tests.lytro_damage import mutate
from tests.lytro_seeds import Seed, make_seeds, real_seeds

SECONDS = 1.0  # of processor time for one file
ROOM = 64 * 2**20  # bytes beyond four times the file
HANG = 60  # seconds after which a file counts as hung, whatever else the machine does


@dataclass(frozen=True)
class Outcome:
    """What became of one case."""

    number: int
    seed: str
    mutation: str
    size: int
    message: str | None  # of the refusal; None where the file was read
    seconds: float
    peak: int  # bytes above the process's level before the first case
    failure: str | None = None


# What is done with each file


def exercise(path: Path, capture: Path, calibration: Path, is_calibration: bool) -> None:
    """All that the program does with a file that somebody gives it, the decoding of views apart. Raises InputError."""
    if is_calibration:
        container = open_container(capture)
        found = read_contents(container)
        assert found.capture is not None
        choice = choose_white_image(container, found.capture, path)
        if choice.white is not None:
            choice.white.mosaic()
        return
    container = open_container(path)
    contents = read_contents(container)
    choice = None
    if contents.capture is not None:
        choice = choose_white_image(container, contents.capture, calibration)
    facts = report.as_facts(container, contents, choice)
    assert all(text.isprintable() for text in (*facts, *facts.values())), "a text that cannot be printed"
    json.dumps(report.as_json(container, contents, choice), allow_nan=False)
    refused = _refusal(lambda: read_extras(container, contents))
    _read_mosaic(container, contents.capture)
    if contents.kind is not Kind.CAPTURE:
        open_light_field(path)
    if refused is not None:
        raise InputError(refused)


def _refusal(action: Callable[[], object]) -> str | None:
    """The sentence of a refusal; the error itself would keep what it was about in memory."""
    try:
        action()
    except InputError as error:
        return str(error)
    return None


def _read_mosaic(container: Container, capture: Capture | None) -> None:
    if capture is not None and capture.image is not None:
        unpack(container.data(capture.image), capture.raw.packing, capture.raw.width, capture.raw.height)


class Fuzzer:
    """Makes cases by their numbers, and judges what becomes of them."""

    def __init__(self, folder: Path, seed: int, real: Path | None = None) -> None:
        self._seed = seed
        (folder / "seeds").mkdir()
        (folder / "empty").mkdir()
        self._seeds = make_seeds(folder / "seeds")
        self._real = [] if real is None else real_seeds(real)
        self._capture = folder / "empty" / "whole.LFR"
        self._capture.write_bytes(self._seeds[0].data)
        self._calibration = folder / "seeds" / "caldata-1.tar"
        self._folder = folder
        # Once through with whole files, so that what is loaded once counts for none of the damaged ones.
        self._level = 2**62
        for whole in (*self._seeds, *self._real):
            self._run(Outcome(-1, whole.name, "none", len(whole.data), None, 0.0, 0), whole, whole.data)
        self._level = _status("VmRSS")

    def case(self, number: int) -> Outcome:
        """Make case `number`, put it through, judge it."""
        chance = random.Random(f"{self._seed} {number}")
        pool = self._real if self._real and number % 100 == 0 else self._seeds
        seed = chance.choice(pool)
        mutation, data = mutate(seed, chance)
        return self._run(Outcome(number, seed.name, mutation, len(data), None, 0.0, 0), seed, data)

    def _run(self, outcome: Outcome, seed: Seed, data: bytes) -> Outcome:
        # Bare names, since the backups are found by theirs.
        path = self._folder / "empty" / f"case-{seed.name}"
        path.write_bytes(data)
        _reset_peak()
        begin = time.process_time()
        message, failure = None, None
        try:
            exercise(path, self._capture, self._calibration, seed.is_calibration)
        except InputError as error:
            message = str(error)
            failure = _ill_worded(message)
        except Exception as error:  # whatever else comes is what this program looks for
            failure = f"{type(error).__name__}: {error}"[:300]
        finally:
            path.unlink()
        seconds = time.process_time() - begin
        peak = max(_status("VmHWM") - self._level, 0)
        if failure is None and seconds > SECONDS:
            failure = f"took {seconds:.2f} s"
        if failure is None and peak > 4 * len(data) + ROOM:
            failure = f"took {peak / 2**20:.0f} MiB for a file of {len(data)} bytes"
        return replace(outcome, message=message, seconds=seconds, peak=peak, failure=failure)


def _ill_worded(message: str) -> str | None:
    if not message.isprintable() or not message.endswith(".") or len(message) > 600:
        return f"not one clear sentence: {message[:300]!a}"
    return None


def _reset_peak() -> None:
    """Make the kernel count the most memory of this process anew."""
    Path("/proc/self/clear_refs").write_text("5")


def _status(field: str) -> int:
    """VmRSS, the memory of this process, or VmHWM, the most of it, in bytes."""
    text = Path("/proc/self/status").read_text()
    found = re.search(rf"{field}:\s+(\d+) kB", text)
    assert found is not None
    return int(found[1]) * 1024


@contextlib.contextmanager
def fuzzer(seed: int, real: Path | None = None) -> Iterator[Fuzzer]:
    """A fuzzer with a folder of its own, in which the user's remembered calibration is not seen."""
    with tempfile.TemporaryDirectory() as folder:
        configuration = str(Path(folder, "configuration"))
        with mock.patch.dict(os.environ, XDG_CONFIG_HOME=configuration):
            yield Fuzzer(Path(folder), seed, real)


# Many cases, in processes of their own so that a crash is noticed


@dataclass
class Total:
    """Sums over many cases."""

    read: int = 0
    refused: int = 0
    failures: int = 0
    seconds: float = 0.0  # of the slowest
    peak: int = 0  # of the largest, bytes

    def add(self, outcome: Outcome) -> None:
        self.read += outcome.message is None
        self.refused += outcome.message is not None
        self.failures += outcome.failure is not None
        self.seconds, self.peak = max(self.seconds, outcome.seconds), max(self.peak, outcome.peak)

    def merge(self, other: Total) -> None:
        self.read += other.read
        self.refused += other.refused
        self.failures += other.failures
        self.seconds, self.peak = max(self.seconds, other.seconds), max(self.peak, other.peak)


def _run_here(options: argparse.Namespace) -> Total:
    """Put the cases through in this process; the number of the latest goes to a file, for when there is no more to tell."""
    total = Total()
    with fuzzer(options.seed, options.real) as cases:
        for number in range(options.first, options.first + options.count):
            if options.latest is not None:
                options.latest.write_text(str(number))
            faulthandler.dump_traceback_later(HANG, exit=True)
            outcome = cases.case(number)
            faulthandler.cancel_dump_traceback_later()
            total.add(outcome)
            if outcome.failure is not None or options.count == 1:
                print(outcome, flush=True)
    return total


def _run_apart(options: argparse.Namespace) -> Total:
    """Put the cases through in processes of `options.chunk` cases each."""
    total = Total()
    end = options.first + options.count
    with tempfile.TemporaryDirectory() as folder:
        latest = Path(folder, "latest")
        for first in range(options.first, end, options.chunk):
            count = min(options.chunk, end - first)
            command = [sys.executable, "-m", "tests.fuzz_lytro", f"--latest={latest}", f"--first={first}", f"--count={count}"]
            command += [f"--seed={options.seed}", *([f"--real={options.real}"] if options.real else [])]
            child = subprocess.run(command, capture_output=True, text=True, check=False)
            *found, last = child.stdout.splitlines() or [""]
            if child.returncode != 0:
                total.failures += 1
                found.append(f"case {latest.read_text()} ended the process with {child.returncode}: {child.stderr[-3000:]}")
            else:
                total.merge(Total(**json.loads(last)))
            print("\n".join([*found, f"{first + count - options.first:,} done, {total.failures} failures"]), flush=True)
    return total


def main() -> int:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=100_000, help="damaged files to make (default: 100000)")
    parser.add_argument("--first", type=int, default=0, help="number of the first (default: 0)")
    parser.add_argument("--seed", type=int, default=2016, help="of all randomness (default: 2016)")
    parser.add_argument("--real", type=Path, help="folder with real files, for every hundredth case")
    parser.add_argument("--chunk", type=int, default=5_000, help="cases per process (default: 5000)")
    parser.add_argument("--latest", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.latest is not None:
        print(json.dumps(asdict(_run_here(options))))
        return 0
    begin = time.monotonic()
    total = _run_here(options) if options.count == 1 else _run_apart(options)
    print(
        f"{total.read + total.refused:,} files: {total.read:,} read, {total.refused:,} refused in a sentence, "
        f"{total.failures} failures; slowest {total.seconds:.2f} s, most memory {total.peak / 2**20:.0f} MiB; "
        f"{time.monotonic() - begin:.0f} s in all"
    )
    return int(total.failures > 0)


if __name__ == "__main__":
    sys.exit(main())
