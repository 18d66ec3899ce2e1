"""Synthesis in a process of its own, so that the networks and the frame loop do not wait for each other's turn in Python.

One process serves all models, one query at a time. It ends with the program, however that ends, since the pipe between them
then breaks. If it ends by itself, the query at hand fails with one sentence and the next one starts another.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import shutil
import signal
import sys
import threading
from collections.abc import Callable
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from multiprocessing.shared_memory import SharedMemory
from pathlib import Path
from types import TracebackType
from typing import TypeVar

import numpy as np

from lfcore.errors import Cancelled, InputError, LfviewError, WeightsError
from lfcore.lightfield import CORNERS, LightField
from lfcore.remote_messages import (
    Cancel,
    Exchange,
    Failed,
    Finished,
    Made,
    Make,
    MakeSynthesizer,
    Reply,
    Request,
    Synthesize,
    Take,
    Taken,
)
from lfcore.remote_server import serve, shipped_models
from lfcore.synthesis import Synthesis, never
from lfcore.weights_header import Stated

_CANCEL_SECONDS = 0.01  # how often a waiting query looks whether it is still wanted
_END_SECONDS = 3.0  # for the process to end by itself, before it is made to
_SHARED_MEMORY = Path("/dev/shm")  # where Linux keeps it; writing more than fits there would kill both programs

_Answer = TypeVar("_Answer", Made, Taken, Finished)


class SynthesisProcess:
    """A process in which synthesizers run. Safe to use from threads, which wait for each other.

    make: what loads models there, a function of a module. niceness: how far it stands back behind this program, where the
    system knows that (0 to 19), from its first synthesis on; before, half as far. Memory: the corner views and one synthesis,
    20 to 48 bytes a pixel, are shared; what the networks need is the process's own.
    """

    def __init__(self, make: MakeSynthesizer = shipped_models, niceness: int = 0) -> None:
        self._make = make
        self._niceness = niceness
        self._lock = threading.Lock()
        self._process: BaseProcess | None = None
        self._connection: Connection | None = None
        self._memory: SharedMemory | None = None
        self._exchange: Exchange | None = None
        self._made: dict[str, Made] = {}  # models that the running process has loaded
        self._light_field: LightField | None = None  # what it has taken
        self._number = 0  # of the latest query

    def __enter__(self) -> SynthesisProcess:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def start(self) -> None:
        """Start the process now, where that has not been done: it loads torch at once. The first query would do it else."""
        with self._lock:
            self._running()

    def close(self) -> None:
        """End the process; a query that another thread waits for fails. The next query would start another."""
        if not self._lock.acquire(timeout=_END_SECONDS):
            process = self._process
            if process is not None:
                with contextlib.suppress(ValueError):  # the query has just ended it
                    process.kill()
            self._lock.acquire()
        try:
            self._end()
        finally:
            self._lock.release()

    @property
    def pid(self) -> int | None:
        """The number that the system gave to the process; None while it does not run."""
        process = self._process
        try:
            return process.pid if process is not None and process.is_alive() else None
        except ValueError:  # another thread has just ended it
            return None

    @property
    def shared_memory_name(self) -> str | None:
        """By which other programs would find the shared memory; None before a light field has been handed over."""
        memory = self._memory
        return memory.name if memory is not None else None

    def load(self, model: str) -> Made:
        """Load the model of that name. Raises what loading raises."""
        with self._lock:
            return self._loaded(model)

    def weighs(self, model: str) -> bool:
        """Whether a model that has been loaded can tell weights."""
        made = self._made.get(model)
        return made is not None and made.weighs

    def synthesize(
        self,
        model: str,
        key: str,
        light_field: LightField,
        at: tuple[float, float],
        cancelled: Callable[[], bool],
        *,
        weighed: bool,
    ) -> Synthesis:
        """The view at (u, v) by the model of that name and key, with weights where that is wished and it has them; see
        WeighingSynthesizer.

        Raises what the synthesizer raises, LfviewError if the process has ended by itself, and WeightsError where the model's
        file is another than that of this key: its views would be taken for those of the other.
        """
        u, v = at
        while not self._lock.acquire(timeout=_CANCEL_SECONDS):
            if cancelled():
                raise Cancelled
        try:
            made = self._loaded(model)
            if made.key != key:
                raise WeightsError(f"{made.name} has been replaced since it was chosen; choose the model again, or start anew.")
            exchange = self._handed_over(light_field)
            self._number += 1
            finished = self._ask(Synthesize(self._number, model, u, v, weighed), Finished, cancelled)
            disparity = exchange.disparity.copy() if finished.has_disparity else None
            weights = exchange.weights.copy() if finished.has_weights else None
            return Synthesis(u, v, made.name, exchange.image.copy(), disparity, None, finished.timings, weights)
        finally:
            self._lock.release()

    # All of the following is called with the lock held.

    def _loaded(self, model: str) -> Made:
        if self._process is not None and not self._process.is_alive():
            self._end()  # since the last query; nobody has missed it
        if model not in self._made:
            self._made[model] = self._ask(Make(model), Made)
        return self._made[model]

    def _handed_over(self, light_field: LightField) -> Exchange:
        if self._exchange is not None and self._light_field is light_field:
            return self._exchange
        self._forget_light_field()
        shape, dtype = (light_field.height, light_field.width), light_field.views.dtype
        memory = _shared_memory(Exchange.size(shape, dtype))
        self._memory = memory
        self._exchange = Exchange(memory, shape, dtype)
        for corner, (u, v) in zip(self._exchange.corners, CORNERS, strict=True):
            np.copyto(corner, light_field.views[-int(v), -int(u)])
        self._ask(Take(memory.name, shape, str(dtype), light_field.aperture), Taken)
        self._light_field = light_field
        return self._exchange

    def _forget_light_field(self) -> None:
        self._light_field = None
        if self._exchange is not None:
            self._exchange.close()
            self._exchange = None
        if self._memory is not None:
            self._memory.unlink()
            self._memory = None

    def _ask(self, request: Request, kind: type[_Answer], cancelled: Callable[[], bool] = never) -> _Answer:
        """The answer to a request. Raises what was raised there."""
        connection = self._running()
        try:
            connection.send(request)
            told = False
            while not connection.poll(_CANCEL_SECONDS):
                if not told and isinstance(request, Synthesize) and cancelled():
                    connection.send(Cancel(request.number))
                    told = True
            reply: Reply = connection.recv()
        except (EOFError, OSError) as error:
            raise LfviewError(self._why_ended()) from error
        except BaseException:
            self._end()  # its answer would be taken for that of the next request
            raise
        if isinstance(reply, Failed):
            raise reply.error
        assert isinstance(reply, kind)
        return reply

    def _running(self) -> Connection:
        if self._connection is not None:
            return self._connection
        context = multiprocessing.get_context("spawn")
        ours, theirs = context.Pipe()
        process = context.Process(target=serve, args=(theirs, self._make, self._niceness), name="lfview synthesis", daemon=True)
        try:
            process.start()
        except OSError as error:
            ours.close()
            reason = error.strerror or error
            raise LfviewError(
                f"The process that synthesizes views could not be started ({reason}); close other programs."
            ) from error
        finally:
            theirs.close()  # so that the pipe breaks when the process ends
        self._process, self._connection = process, ours
        return ours

    def _why_ended(self) -> str:
        """Take note that the process has ended by itself; a sentence for the person at the screen."""
        process = self._process
        assert process is not None
        process.join(_END_SECONDS)
        code = process.exitcode
        self._end()
        how = "stopped answering" if code is None else f"ended with code {code}"
        if code is not None and code < 0:
            with contextlib.suppress(ValueError):
                how = f"was ended by {signal.Signals(-code).name}"
        hint = "; if memory ran out, close other programs or open a smaller light field" if code == -9 else ""
        return f"The process that synthesizes views {how}{hint}. The next view starts it anew."

    def _end(self) -> None:
        if self._connection is not None:
            self._connection.close()
            self._connection = None
        if self._process is not None:
            self._process.join(_END_SECONDS)
            if self._process.is_alive():
                self._process.kill()
                self._process.join()
            self._process.close()
            self._process = None
        self._forget_light_field()
        self._made.clear()


class RemoteSynthesizer:
    """A model in a SynthesisProcess; see lfcore.synthesis.Synthesizer. The warped inputs stay in the process.

    stated: what is known of the model beforehand; then it is loaded with the first query. InputError or WeightsError is raised
    where the model cannot be loaded.
    """

    def __init__(self, process: SynthesisProcess, model: str, stated: Stated | None = None) -> None:
        self._process = process
        self._model = model
        known = stated or process.load(model)
        self.name, self.key = known.name, known.key
        self._light_field: LightField | None = None

    @property
    def weighs(self) -> bool:
        """See WeighingSynthesizer; not before the model has been loaded."""
        return self._process.weighs(self._model)

    def set_light_field(self, light_field: LightField) -> None:
        """See Synthesizer. It is handed over, and what does not depend on (u, v) is computed, with the first query."""
        self._light_field = light_field

    def synthesize(self, u: float, v: float, cancelled: Callable[[], bool] = never) -> Synthesis:
        """See Synthesizer."""
        return self._asked((u, v), cancelled, weighed=False)

    def synthesize_weighed(self, u: float, v: float, cancelled: Callable[[], bool] = never) -> Synthesis:
        """See WeighingSynthesizer."""
        return self._asked((u, v), cancelled, weighed=True)

    def _asked(self, at: tuple[float, float], cancelled: Callable[[], bool], weighed: bool) -> Synthesis:
        if self._light_field is None:
            raise InputError("No light field is set; call set_light_field first.")
        return self._process.synthesize(self._model, self.key, self._light_field, at, cancelled, weighed=weighed)


def _shared_memory(size: int) -> SharedMemory:
    if sys.platform == "linux" and _SHARED_MEMORY.is_dir():
        free = shutil.disk_usage(_SHARED_MEMORY).free
        if free < size:
            raise LfviewError(
                f"The memory that programs share ({_SHARED_MEMORY}) has {free // 2**20} MiB left, but this light field needs "
                f"{-(-size // 2**20)} MiB of it; free some, or open a smaller light field."
            )
    return SharedMemory(create=True, size=size)
