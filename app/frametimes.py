"""How long the frame loop works per frame while the networks run without pause."""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass

from app.controller import Controller
from lfcore.errors import LfviewError

_PATIENCE_SECONDS = 120.0
FRAME_SECONDS = 1 / 60
_TURN_SECONDS = 4.0  # for once round the circle of viewpoints
_RADIUS = 0.35
_WARM_UP = (0.0, 0.05, 0.15, 0.3)  # distances from the centre, so that every shader has been compiled


@dataclass(frozen=True)
class FrameTimes:
    """Median and 95th percentile of the loop's work per frame, in milliseconds; over how many frames; how many syntheses came
    to the screen a second; where it was measured."""

    p50_ms: float
    p95_ms: float
    frames: int
    views_per_second: float
    where: str


def measure(
    controller: Controller, draw: Callable[[], None], interval: Callable[[], float], seconds: float, where: str
) -> FrameTimes:
    """Drag the viewpoint round a circle for `seconds` and time `draw`, which is called every `interval()` seconds.

    The networks are busy throughout, since every frame asks for another viewpoint. What counts is the loop's own
    work: events, panels, picture and swap, until the graphics are done; not the waiting for the next frame's time.
    Measuring begins when the first disparity map is at hand, so that the instant step is measured. Raises LfviewError
    where the light field or the model does not come.
    """
    _wait(controller, draw)
    for distance in _WARM_UP * 2:
        controller.state.move_to(0.5 + distance, 0.5)
        draw()
    times: list[float] = []
    views, newest = 0, controller.newest
    start = time.perf_counter()
    while (now := time.perf_counter()) - start < seconds:
        angle = 2 * math.pi * (now - start) / _TURN_SECONDS
        controller.state.move_to(0.5 + _RADIUS * math.cos(angle), 0.5 + _RADIUS * math.sin(angle))
        draw()
        spent = time.perf_counter() - now
        views += controller.newest is not newest
        newest = controller.newest
        times.append(1e3 * spent)
        time.sleep(max(interval() - spent, 0.0))
    ordered = sorted(times)
    p95 = ordered[int(0.95 * (len(ordered) - 1))]
    return FrameTimes(statistics.median(ordered), p95, len(ordered), views / seconds, where)


def _wait(controller: Controller, draw: Callable[[], None]) -> None:
    deadline = time.monotonic() + _PATIENCE_SECONDS
    while controller.newest is None:
        draw()
        if controller.messages:
            raise LfviewError(controller.messages[0])
        if time.monotonic() > deadline:
            raise LfviewError(f"The first synthesis took more than {_PATIENCE_SECONDS:.0f} s; try a smaller light field.")
        time.sleep(0.02)
