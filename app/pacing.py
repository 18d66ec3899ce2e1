"""How often frames are drawn where the graphics draw on the processor, which then the networks need too."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

# Of all cores, while something is being synthesized. A view that comes sooner is worth more than a frame of the same view,
# carried a little farther.
DRAWING_SHARE = 0.3
LONGEST_INTERVAL = 1 / 20  # drawing is never made slower than this
_WEIGHT = 0.2  # of the newest frame in the mean cost


class Pace:
    """The least time between two frames. shortest: that of the monitor, in seconds; cores: on which frames are drawn too."""

    def __init__(self, shortest: float, cores: int) -> None:
        self.shortest = shortest
        self._cores = cores
        self._cost = 0.0  # seconds of processor time a frame, over all threads

    @contextmanager
    def frame(self) -> Iterator[None]:
        """Around the drawing of a frame, until it is on the screen."""
        before = time.process_time()
        yield
        self._cost += _WEIGHT * (time.process_time() - before - self._cost)

    def interval(self, takes_from_networks: bool) -> float:
        """The least time between the beginnings of two frames, in seconds."""
        return self.sharing if takes_from_networks else self.shortest

    @property
    def sharing(self) -> float:
        """The least time between two frames, in seconds, that leaves the networks their share of the cores."""
        affordable = self._cost / (DRAWING_SHARE * self._cores)
        return max(min(affordable, LONGEST_INTERVAL), self.shortest)
