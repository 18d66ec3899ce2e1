"""A progress bar for terminals: how far, how fast, how long still. In a pipe or a file it writes nothing."""

from __future__ import annotations

import shutil
import sys
import time
from types import TracebackType
from typing import TextIO

from app.limits import within

_WIDTH = 24
_INTERVAL = 0.1  # seconds between two drawings
_ERASE = "\r\x1b[K"


class Progress:
    """Counts work in `unit`s up to `total`; used as a context, which wipes the bar at the end.

    Use `step` after each unit of work, or `reach` where the work is known as a share of 1.
    """

    def __init__(self, label: str, total: float, unit: str = "", stream: TextIO | None = None) -> None:
        self._label, self._total, self._unit = label, total, unit
        self._stream = stream or sys.stderr
        self._shown = self._stream.isatty()
        self._done = 0.0
        self._start = time.monotonic()
        self._drawn = -_INTERVAL

    def __enter__(self) -> Progress:
        self._draw()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None) -> None:
        if self._shown:
            self._stream.write(_ERASE)
            self._stream.flush()

    def step(self, amount: float = 1) -> None:
        """`amount` more units are done."""
        self._done += amount
        self._draw()

    def reach(self, share: float) -> None:
        """The given share of the work, 0 to 1, is done."""
        self._done = share * self._total
        self._draw()

    def _draw(self) -> None:
        now = time.monotonic()
        if not self._shown or now - self._drawn < _INTERVAL:
            return
        self._drawn = now
        line = bar(self._label, self._done, self._total, self._unit, now - self._start)
        # A line that wraps could not be erased.
        self._stream.write(_ERASE + line[: shutil.get_terminal_size().columns - 1])
        self._stream.flush()


def bar(label: str, done: float, total: float, unit: str, seconds: float) -> str:
    """One line: label, bar, count with its unit, rate and time left once they are known."""
    share = within(done / total, (0.0, 1.0)) if total > 0 else 0.0
    filled = round(share * _WIDTH)
    text = f"{label} [{'#' * filled}{'.' * (_WIDTH - filled)}] "
    text += f"{done:.0f}/{total:.0f} {unit}" if unit else f"{100 * share:.0f}%"
    if done > 0 and seconds > 0:
        rate = done / seconds
        if unit:
            text += f", {rate:.1f}/s" if rate >= 1 else f", {1 / rate:.1f} s each"
        text += f", {clock((total - done) / rate)} left"
    return text


def clock(seconds: float) -> str:
    """Seconds as 0:07, 12:30 or 1:02:05."""
    whole = max(round(seconds), 0)
    hours, minutes = divmod(whole // 60, 60)
    return f"{hours}:{minutes:02}:{whole % 60:02}" if hours else f"{minutes}:{whole % 60:02}"
