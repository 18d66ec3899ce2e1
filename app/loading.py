"""Opening light fields in a thread of its own: the latest path wins, a coarse picture may come before the whole."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue

from app.desk import Folder
from app.exhibits import Exhibition
from app.worker import Cancel, Done, LatestWorker
from lfcore.errors import Cancelled
from lfcore.lightfield import LightField

Progress = Callable[[float], None]
FindPreview = Callable[[Path], LightField | None]
Opened = LightField | Exhibition | Folder
Open = Callable[[Path, Progress, Cancel], Opened]

PROGRESS_SECONDS = 0.15


@dataclass(frozen=True)
class Preview:
    """What stands in for the light field that is being opened."""

    light_field: LightField


@dataclass(frozen=True)
class NotOpened:
    """Why a light field could not be opened, for the person at the screen."""

    message: str


class Loading:
    """The loader and what it is opening. All methods belong to the main thread; `wake` is called from the loader's."""

    def __init__(self, open_light_field: Open, find_preview: FindPreview, wake: Callable[[], None]) -> None:
        self.path: Path | None = None  # of what is being opened
        self.share = 0.0  # how much of it has been read
        self._open = open_light_field
        self._find_preview = find_preview
        self._wake = wake
        self._worker: LatestWorker[Opened] = LatestWorker("loader", wake)
        self._previews: SimpleQueue[tuple[Path, LightField]] = SimpleQueue()
        self._ticket = 0

    def begin(self, path: Path) -> None:
        """Open this one; one that is still being opened is given up."""
        self._worker.cancel_all()
        self.path, self.share = path, 0.0
        self._ticket = self._worker.submit(lambda cancelled: self._load(path, cancelled))

    def cancel(self) -> None:
        """Give up what is being opened."""
        self._worker.cancel_all()
        self.path = None

    def news(self) -> Iterator[Preview | Opened | NotOpened]:
        """What has happened since the last call, of what has not been given up."""
        while not self._previews.empty():
            path, preview = self._previews.get()
            if self.path == path:
                yield Preview(preview)
        while not self._worker.outcomes.empty():
            loaded = self._worker.outcomes.get()
            if self.path is None or loaded.ticket != self._ticket:
                continue
            self.path = None
            yield loaded.value if isinstance(loaded, Done) else NotOpened(loaded.message)

    def stop(self, timeout: float) -> None:
        """End the thread."""
        self._worker.stop(timeout)

    def _load(self, path: Path, cancelled: Cancel) -> Opened:
        told_at = time.monotonic()

        def progress(share: float) -> None:
            nonlocal told_at
            if cancelled():
                return
            self.share = share
            if time.monotonic() - told_at > PROGRESS_SECONDS:  # each telling costs a frame
                told_at = time.monotonic()
                self._wake()

        preview = self._find_preview(path)
        if preview is not None and not cancelled():
            preview.content_key  # noqa: B018
            self._previews.put((path, preview))
            self._wake()
        opened = self._open(path, progress, cancelled)
        if isinstance(opened, LightField):
            opened.content_key  # noqa: B018  # computed here, where it holds up no frame
        if cancelled():
            raise Cancelled
        return opened
