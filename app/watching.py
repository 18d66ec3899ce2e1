"""Whether the file or folder that is shown is still what it was when it was opened; looked at now and then, in a thread."""

from __future__ import annotations

import threading
from collections.abc import Callable
from enum import Enum
from pathlib import Path
from queue import SimpleQueue

from lfcore.errors import InputError

INTERVAL = 3.0  # seconds


class Change(Enum):
    """What has become of it; the value completes the sentence that begins with its path."""

    CHANGED = "has changed on disk; what is shown is what was opened. Ctrl+R opens it again."
    GONE = "is no longer there; what is shown stays in memory until another light field is opened."


class Watching:
    """All methods belong to the main thread; `wake` is called from the other one when there is news."""

    def __init__(self, wake: Callable[[], None], interval: float = INTERVAL) -> None:
        self._wake = wake
        self._interval = interval
        self._news: SimpleQueue[tuple[Path, Change]] = SimpleQueue()
        self._changed = threading.Condition()
        self._path: Path | None = None
        self._round = 0
        self._stopping = False
        self._thread = threading.Thread(target=self._run, name="watching", daemon=True)

    def follow(self, path: Path | None) -> None:
        """Look after this file or folder from now on, and after no other."""
        with self._changed:
            self._path = path
            self._round += 1
            if path is not None and not self._thread.is_alive() and not self._stopping:
                self._thread.start()
            self._changed.notify()

    def news(self) -> str | None:
        """A sentence where what is followed has changed since the last time, or None."""
        sentence = None
        while not self._news.empty():
            path, change = self._news.get()
            if path == self._path:
                sentence = f"{path} {change.value}"
        return sentence

    def stop(self, timeout: float) -> None:
        """End the thread."""
        with self._changed:
            self._stopping = True
            self._changed.notify()
        if self._thread.is_alive():
            self._thread.join(timeout)

    def _run(self) -> None:
        known: tuple[int, str | None] = (0, None)  # the round, and how it was at the last look
        while True:
            with self._changed:
                if not self._stopping and known[0] == self._round:
                    self._changed.wait(self._interval if self._path is not None else None)
                if self._stopping:
                    return
                path, now = self._path, self._round
            if path is None:
                known = (now, None)
                continue
            state = _state(path)
            if now == known[0] and state != known[1]:
                self._news.put((path, Change.CHANGED if state is not None else Change.GONE))
                self._wake()
            known = (now, state)


def _state(path: Path) -> str | None:
    """Another one whenever the files have changed; None where they are gone."""
    from lfcore.thumbnails import key_of

    try:
        return key_of(path)
    except InputError:
        return None
