"""What runs in the process for synthesis (lfcore.remote): it answers one request after the other until the pipe breaks."""

from __future__ import annotations

import contextlib
import logging
import os
import signal
import sys
from collections.abc import Callable
from multiprocessing.connection import Connection
from multiprocessing.shared_memory import SharedMemory
from pathlib import Path

import numpy as np

from lfcore.errors import Cancelled, LfviewError
from lfcore.lightfield import LightField
from lfcore.patience import wait_shortly
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
from lfcore.synthesis import Synthesizer, WeighingSynthesizer, weighs

_log = logging.getLogger(__name__)


def shipped_models(model: str) -> Synthesizer:
    """lfcore.synthesizer.make_synthesizer, which loads torch."""
    from lfcore.synthesizer import make_synthesizer

    return make_synthesizer(model)


def serve(connection: Connection, make: MakeSynthesizer, niceness: int) -> None:
    """The whole life of the process. Ctrl-C, which the terminal sends to it too, is the program's to handle.

    Until its first synthesis, for which everything else waits, it stands back half as far.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _stand_back(niceness // 2)
    wait_shortly()  # before torch is loaded
    if make is shipped_models:
        import torch  # noqa: F401  # now, while the program opens its window and its file
    server = _Server(connection, make)
    awaited = True
    with contextlib.suppress(EOFError, OSError):  # the program has ended
        while True:
            request: Request = connection.recv()
            if isinstance(request, Cancel):  # one that came too late
                continue
            reply = server.reply(request)
            if awaited and isinstance(reply, Finished):
                _stand_back(niceness - niceness // 2)
                awaited = False
            connection.send(reply)


def _stand_back(further: int) -> None:
    """Have this process give way to others by so much more, where the system knows priorities. On Linux each thread has its
    own."""
    if not hasattr(os, "setpriority"):
        return
    threads = [int(task.name) for task in Path("/proc/self/task").iterdir()] if sys.platform == "linux" else [0]
    for thread in threads:
        with contextlib.suppress(ProcessLookupError):  # it has just ended
            os.setpriority(os.PRIO_PROCESS, thread, os.getpriority(os.PRIO_PROCESS, thread) + further)


class _Server:
    """The models that have been loaded and the light field that they are asked about."""

    def __init__(self, connection: Connection, make: MakeSynthesizer) -> None:
        self._connection = connection
        self._make = make
        self._synthesizers: dict[str, Synthesizer] = {}
        self._light_field: LightField | None = None
        self._exchange: Exchange | None = None
        self._prepared: set[str] = set()  # models that have taken the light field over

    def reply(self, request: Request) -> Reply:
        """The answer; whatever is raised becomes Failed, so that the process outlives any fault of a query."""
        try:
            return self._answer(request)
        except (LfviewError, Cancelled, MemoryError) as error:
            return Failed(error)
        except Exception as error:  # others need not survive the way to the program
            _log.exception("a synthesis failed")
            return Failed(RuntimeError(f"{type(error).__name__}: {error}"))

    def _answer(self, request: Request) -> Reply:
        if isinstance(request, Make):
            synthesizer = self._make(request.model)
            self._synthesizers[request.model] = synthesizer
            return Made(synthesizer.name, synthesizer.key, weighs(synthesizer))
        if isinstance(request, Take):
            self._take(request)
            return Taken()
        assert isinstance(request, Synthesize)
        return self._synthesize(request)

    def _take(self, request: Take) -> None:
        if self._exchange is not None:
            self._exchange.close()
            self._exchange = None
        self._prepared.clear()
        exchange = Exchange(SharedMemory(request.memory), request.shape, request.dtype)
        # The results of queries will take their place; in the order of CORNERS, columns of the grid come first.
        views = exchange.corners.copy().reshape(2, 2, *request.shape, 3).swapaxes(0, 1)
        self._light_field = LightField(np.ascontiguousarray(views), "handed over", "", "", aperture=request.aperture)
        self._exchange = exchange

    def _synthesize(self, request: Synthesize) -> Finished:
        synthesizer, exchange = self._synthesizers[request.model], self._exchange
        assert exchange is not None and self._light_field is not None
        if request.model not in self._prepared:
            synthesizer.set_light_field(self._light_field)
            self._prepared.add(request.model)
        ask = synthesizer.synthesize
        if request.weighed and isinstance(synthesizer, WeighingSynthesizer):
            ask = synthesizer.synthesize_weighed
        synthesis = ask(request.u, request.v, self._cancelled(request.number))
        exchange.image[:] = synthesis.image
        if synthesis.disparity is not None:
            exchange.disparity[:] = synthesis.disparity
        if synthesis.weights is not None:
            exchange.weights[:] = synthesis.weights
        return Finished(synthesis.disparity is not None, synthesis.weights is not None, dict(synthesis.timings))

    def _cancelled(self, number: int) -> Callable[[], bool]:
        """Whether the program has taken its query back."""
        told = False

        def cancelled() -> bool:
            nonlocal told
            try:
                while not told and self._connection.poll():
                    message: Request = self._connection.recv()
                    told = isinstance(message, Cancel) and message.number == number
            except (EOFError, OSError):
                sys.exit(0)  # the program has ended
            return told

        return cancelled
