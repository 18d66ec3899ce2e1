"""Glances at many light fields, for lists with pictures: looked at in a thread of its own, the wanted ones first."""

from __future__ import annotations

import itertools
import logging
import time
from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from queue import SimpleQueue
from typing import TYPE_CHECKING

from app.faults import is_unexpected, sentence
from app.worker import Cancel, LatestWorker
from lfcore.errors import Cancelled, OutputError

if TYPE_CHECKING:  # the readers of files are loaded in the thread, when the first glance is wanted
    from lfcore.formats.glance import Glance
    from lfcore.thumbnails import ThumbnailStore

HELD = 400  # glances in memory; at most 110 kB each, 60 kB as a rule
NICENESS = 10  # whatever the hand waits for comes first
_BURST_SECONDS = 0.03  # between two wakings of the frame loop, where glances come fast

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Seen:
    """What was seen at a path, or why nothing could be."""

    glance: Glance | None
    reason: str = ""
    number: int = field(default_factory=itertools.count().__next__)  # no other has it


class Gallery:
    """All methods belong to the main thread, and none waits. `open_store`: where glances are kept; None keeps none."""

    def __init__(self, open_store: Callable[[], ThumbnailStore] | None, wake: Callable[[], None]) -> None:
        self._open_store = open_store
        self._store: ThumbnailStore | None = None  # belongs to the thread, as does what opens it
        self._worker: LatestWorker[None] = LatestWorker("thumbnails", wake, NICENESS)
        self._found: SimpleQueue[tuple[int, Path, Seen]] = SimpleQueue()
        self._seen: OrderedDict[Path, Seen] = OrderedDict()  # the one asked for longest ago first
        self._round = 0  # counts how often all was forgotten
        self._asked: frozenset[Path] = frozenset()  # what the worker has been given
        self.complete = False  # all that was wanted last has been seen

    def seen(self, path: Path) -> Seen | None:
        """What is known of this path; None where it has not been looked at yet."""
        found = self._seen.get(path)
        if found is not None:
            self._seen.move_to_end(path)
        return found

    def want(self, paths: Sequence[Path]) -> None:
        """Once a frame: look at these next, the first ones first, and at no others any more."""
        self._collect()
        missing = [path for path in paths[:HELD] if path not in self._seen]
        self.complete = bool(paths) and not missing
        if self._asked and not self._asked.intersection(missing):
            self._worker.cancel_all()
            self._asked = frozenset()
        if missing and not self._worker.busy:
            self._asked = frozenset(missing)
            self._worker.submit(self._job(tuple(missing), self._round))

    def forget(self) -> None:
        """Look at everything anew."""
        self._worker.cancel_all()
        self._seen.clear()
        self._asked = frozenset()
        self._round += 1

    def stop(self, timeout: float) -> None:
        """End the thread, waiting at most so many seconds."""
        self._worker.stop(timeout)

    def _collect(self) -> None:
        while not self._found.empty():
            looked_in, path, seen = self._found.get()
            if looked_in == self._round:
                self._seen[path] = seen
        while not self._worker.outcomes.empty():
            self._worker.outcomes.get()
        while len(self._seen) > HELD:
            self._seen.popitem(last=False)

    def _job(self, paths: tuple[Path, ...], looked_in: int) -> Callable[[Cancel], None]:
        def job(cancelled: Cancel) -> None:
            """Look at as many as a short while allows: then others may be wanted more."""
            started = time.monotonic()
            for path in paths:
                if cancelled():
                    raise Cancelled
                self._found.put((looked_in, path, self._look(path, cancelled)))
                if time.monotonic() - started > _BURST_SECONDS:
                    return

        return job

    def _look(self, path: Path, cancelled: Cancel) -> Seen:
        from lfcore.formats.glance import glance
        from lfcore.thumbnails import key_of

        try:
            key = key_of(path)
            if self._open_store is not None:
                self._store, self._open_store = self._open_store(), None
            kept = self._store.get(key) if self._store is not None else None
            if kept is not None:
                return Seen(kept)
            found = glance(path, cancelled)
            self._keep(key, found)
            return Seen(found)
        except Cancelled:
            raise
        except Exception as error:  # one odd file must not keep the others from being seen
            if is_unexpected(error):
                _log.exception("looking at %s failed", path)
            return Seen(None, sentence(error))

    def _keep(self, key: str, found: Glance) -> None:
        if self._store is None:
            return
        try:
            self._store.put(key, found)
        except OutputError:
            self._store = None  # thumbnails are made again; the stores of views tell of a disk that is full
