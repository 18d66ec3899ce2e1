"""Undo and redo of what is looked at, and how. A drag is one change, and so is a run of presses of one key."""

from __future__ import annotations

import math
from collections import deque

from app.snapshot import Snapshot

LIMIT = 200
RUN_SECONDS = 0.5  # changes of the same fields that follow each other so soon are one


class History:
    """Snapshots of the past and, after an undo, of the future."""

    def __init__(self) -> None:
        self._past: deque[Snapshot] = deque(maxlen=LIMIT)
        self._future: list[Snapshot] = []
        self._settled: Snapshot | None = None  # as of the last change that was over
        self._fields: frozenset[str] = frozenset()  # that the last change was of
        self._changed_at = -math.inf
        self._held = False  # a hand has held something since then

    def start(self, snapshot: Snapshot) -> None:
        """Begin anew, with another light field."""
        self._past.clear()
        self._future.clear()
        self._settle(snapshot)

    def observe(self, snapshot: Snapshot, now: float, holding: bool) -> None:
        """Once a frame: how things are now (seconds), and whether a hand still holds something, or they move by themselves."""
        if holding:
            self._held = True
            return
        if self._settled is None:
            self._settle(snapshot)
        if self._settled is None or snapshot == self._settled:
            return
        before = self._settled
        fields = frozenset(name for name in snapshot if snapshot[name] != before.get(name))
        if self._held or now - self._changed_at > RUN_SECONDS or not fields <= self._fields:
            self._past.append(before)
            self._fields = fields
        elif self._past and self._past[-1] == snapshot:
            self._past.pop()  # there and back again
        self._future.clear()
        self._settled, self._changed_at, self._held = snapshot, now, False

    def undo(self) -> Snapshot | None:
        """How things were before the last change; None where there is none."""
        if not self._past or self._settled is None:
            return None
        self._future.append(self._settled)
        return self._settle(self._past.pop())

    def redo(self) -> Snapshot | None:
        """How things were before the last undo; None where none was, or something has changed since."""
        if not self._future or self._settled is None:
            return None
        self._past.append(self._settled)
        return self._settle(self._future.pop())

    def _settle(self, snapshot: Snapshot) -> Snapshot:
        self._settled, self._fields, self._changed_at, self._held = snapshot, frozenset(), -math.inf, False
        return snapshot
