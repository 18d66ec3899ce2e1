"""The program behind the window: which light field is open, which synthesis is at hand, what the workers are to do.

No GL, no imgui, no glfw: the frame loop calls `tick` once a frame, hands the pictures it finds here to the canvas and the
readout to the panels.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from pathlib import Path

from app.engine import Answer, Engine, disparity_range
from app.state import Grid, Look, Point, Readout, Step, ViewState
from app.worker import Cancel, Done, LatestWorker
from lfcore.errors import Cancelled
from lfcore.lightfield import LightField

Progress = Callable[[float], None]
OpenLightField = Callable[[Path, Progress, Cancel], LightField]

REST_SECONDS = 0.12  # the hand counts as resting when the viewpoint has not moved for so long
FADE_SECONDS = 0.12
# A dragged viewpoint that comes to rest this near to a captured or a cached one goes there: no pixel of an ordinary light
# field moves visibly by it, and the camera's view or the finished picture is there at once.
MAGNET_RADIUS = 0.012
PROGRESS_SECONDS = 0.15
STOP_SECONDS = 10.0
# The networks take every core they find; the frame loop, which draws on the same cores where there is no GPU, comes first.
SYNTHESIS_NICENESS = 2


class Controller:
    """Ties the view state to the loader and the synthesis thread. All methods belong to the main thread."""

    def __init__(self, engine: Engine, open_light_field: OpenLightField, wake: Callable[[], None], model: str) -> None:
        self.state = ViewState()
        self.light_field: LightField | None = None
        self.newest: Answer | None = None  # whose disparity map carries the instant step
        self.picture: Answer | None = None  # the synthesis for exactly the viewpoint on screen
        self.messages: list[str] = []
        self._engine = engine
        self._open_light_field = open_light_field
        self._model = model
        self._wake = wake
        self._loader: LatestWorker[LightField] = LatestWorker("loader", wake)
        self._synthesis: LatestWorker[Answer] = LatestWorker("synthesis", wake, SYNTHESIS_NICENESS)
        self._loading: Path | None = None
        self._load_ticket = 0
        self._loaded_share = 0.0
        self._grid: Grid | None = None
        self._asked: Point | None = None  # viewpoint of the latest query
        self._ticket = 0  # of the latest query
        self._first_ticket = 0  # of the first query about this light field
        self._shown: Point | None = None  # viewpoint at the last tick
        self._moved_at = -math.inf
        self._faded_in_at = -math.inf
        self._now = 0.0
        self._cached: tuple[Point, ...] = ()
        self._hits = 0
        self._from_cache = False

    # What the person asks for.

    def open(self, path: Path) -> None:
        """Begin to open a light field; one that is still being opened is given up, the one on screen stays until then."""

        def load(cancelled: Cancel) -> LightField:
            told_at = time.monotonic()

            def progress(share: float) -> None:
                nonlocal told_at
                if cancelled():
                    return
                self._loaded_share = share
                if time.monotonic() - told_at > PROGRESS_SECONDS:  # each telling costs a frame
                    told_at = time.monotonic()
                    self._wake()

            light_field = self._open_light_field(path, progress, cancelled)
            light_field.content_key  # noqa: B018  # computed here, where it holds up no frame
            if cancelled():
                raise Cancelled
            return light_field

        self._loader.cancel_all()
        self._loading, self._loaded_share = path, 0.0
        self._load_ticket = self._loader.submit(load)

    def cancel_open(self) -> None:
        """Give up the light field that is being opened."""
        self._loader.cancel_all()
        self._loading = None

    def close(self) -> None:
        """Put the light field away; the start picture appears."""
        self.cancel_open()
        self._synthesis.cancel_all()
        self._take(None)

    def show_light_field(self, light_field: LightField) -> None:
        """Show a light field that is already in memory."""
        self._take(light_field)

    def say(self, message: str) -> None:
        """Show a message until it is dismissed; one that is already there is not said twice."""
        if message not in self.messages:
            self.messages.append(message)

    def dismiss(self) -> None:
        """Put the oldest message away."""
        if self.messages:
            self.messages.pop(0)

    def stop(self) -> None:
        """End the threads, waiting a little for work that cannot be broken off at once."""
        self._loader.stop(STOP_SECONDS)
        self._synthesis.stop(STOP_SECONDS)

    # Once a frame.

    def tick(self, now: float) -> None:
        """Take what the workers have finished, and ask them for what is wanted next. `now` in seconds."""
        self._now = now
        self._collect()
        if self.light_field is None:
            return
        if self._shown != self.viewpoint:
            self._moved_at = now
            self._look_up(self.light_field)
        if self._resting and self.state.hand is not None:
            self._magnet(self.light_field)
            if not self.state.dragging:
                self.state.hand = None
        self._shown = self.viewpoint
        self._ask(self.light_field)

    @property
    def viewpoint(self) -> Point:
        """(u, v) on screen."""
        return self.state.u, self.state.v

    @property
    def full_share(self) -> float:
        """How far the synthesis of this viewpoint has been faded in: 0 where there is none."""
        if self.picture is None:
            return 0.0
        return min(max((self._now - self._faded_in_at) / FADE_SECONDS, 0.0), 1.0)

    @property
    def next_frame_in(self) -> float | None:
        """Seconds until something changes by itself (0: animating), or None where only an event or a worker changes it."""
        if self.picture is not None and self.full_share < 1.0:
            return 0.0
        if self.light_field is not None and not self._resting:
            return max(self._moved_at + REST_SECONDS - self._now, 0.0) + 1e-3
        return None

    @property
    def step(self) -> Step:
        """Which step of quality is on screen."""
        if self._shows_captured:
            return Step.CAPTURED
        if self.picture is not None:
            return Step.FULL
        return Step.INSTANT if self._newest_disparity else Step.BLEND

    @property
    def captured_here(self) -> int | None:
        """Number of the captured view at the viewpoint, or None."""
        return self._grid.at(*self.viewpoint) if self._grid is not None else None

    @property
    def disparity_range(self) -> tuple[float, float] | None:
        """The disparities at either end of the colour map, px over the baseline."""
        answer = self.picture or self.newest
        if answer is None or answer.percentiles is None:
            return None
        return disparity_range(answer.percentiles, self.state.tail)

    def readout(self, instant_ms: float | None) -> Readout:
        """What the panels print. `instant_ms`: how long the picture of the last frame took where it was made per frame."""
        light_field = self.light_field
        answer = self.picture
        newest = answer or self.newest
        return Readout(
            model=self._model,
            grid=self._grid,
            name=light_field.name if light_field else "",
            kind=light_field.kind if light_field else "",
            source=light_field.source if light_field else "",
            warnings=light_field.warnings if light_field else (),
            facts=tuple(light_field.facts.items()) if light_field else (),
            step=self.step,
            step_ms=self._step_ms(instant_ms),
            from_cache=self._from_cache and self.step is Step.FULL,
            busy=self._busy(),
            loading=self._loaded_share if self._loading is not None else None,
            loading_name=self._loading.name if self._loading is not None else "",
            messages=tuple(self.messages),
            score=answer.score if answer else None,
            timings=tuple(newest.synthesis.timings.items()) if newest else (),
            disparity_range=self.disparity_range,
            has_disparity=self._newest_disparity,
            disparity_under_cursor=self._disparity_under_cursor(),
            captured_here=self.captured_here,
            cached=self._cached,
            cache_bytes=self._engine.cache.bytes_used,
            cache_limit=self._engine.cache.limit_bytes,
            cache_hits=self._hits,
        )

    # Inside.

    @property
    def _resting(self) -> bool:
        return self._now - self._moved_at >= REST_SECONDS

    @property
    def _shows_captured(self) -> bool:
        return self.state.captured and self.state.look is Look.SYNTHESIS and self.captured_here is not None

    @property
    def _newest_disparity(self) -> bool:
        return self.newest is not None and self.newest.synthesis.disparity is not None

    def _take(self, light_field: LightField | None) -> None:
        self.light_field = light_field
        self.newest = self.picture = None
        self._asked = self._shown = None
        self._first_ticket = self._ticket + 1
        self._grid = None
        self._cached = ()
        self.state.hand = None
        self.state.zoom = ViewState().zoom
        self.state.cursor = None
        self.state.move_to(0.5, 0.5)
        if light_field is not None:
            size = (light_field.rows, light_field.columns, light_field.width, light_field.height)
            self._grid = Grid(*size, light_field.dark)
            self._cached = self._engine.cached_positions(light_field)

    def _collect(self) -> None:
        while not self._loader.outcomes.empty():
            loaded = self._loader.outcomes.get()
            if self._loading is None or loaded.ticket != self._load_ticket:
                continue  # given up in the meantime
            self._loading = None
            if isinstance(loaded, Done):
                self._synthesis.cancel_all()
                self._take(loaded.value)
            else:
                self.say(loaded.message)
        while not self._synthesis.outcomes.empty():
            answered = self._synthesis.outcomes.get()
            if not isinstance(answered, Done):
                self.say(answered.message)
            elif answered.ticket >= self._first_ticket:
                self._accept(answered.value)

    def _accept(self, answer: Answer) -> None:
        self.newest = answer
        if (answer.synthesis.u, answer.synthesis.v) == self.viewpoint:
            if self.picture is None:
                self._faded_in_at = self._now
            self.picture = answer
        if self.light_field is not None:
            self._cached = self._engine.cached_positions(self.light_field)

    def _look_up(self, light_field: LightField) -> None:
        """A viewpoint seen before is on screen at once, without a fade."""
        self.picture = self._engine.cached(light_field, *self.viewpoint)
        self._from_cache = self.picture is not None
        if self.picture is not None:
            self.newest = self.picture
            self._faded_in_at = -math.inf
            self._hits += 1

    def _ask(self, light_field: LightField) -> None:
        """Query the viewpoint on screen. A query that runs for another goes on while the hand moves, since its disparity
        map serves the instant step, and is given up when the hand rests."""
        wanted = self.viewpoint
        have_all = self.picture is not None and (self.picture.score is not None or self.captured_here is None)
        if self._asked != wanted and not self._engine.failed:
            self._asked = wanted
            if have_all:
                return
            self._ticket = self._synthesis.submit(lambda cancelled: self._engine.answer(light_field, *wanted, cancelled))
        running = self._synthesis.running
        if self._resting and running is not None and running < self._ticket and self._newest_disparity:
            self._synthesis.cancel_before(self._ticket)

    def _magnet(self, light_field: LightField) -> None:
        assert self._grid is not None
        here = self.viewpoint
        captured = self._grid.position(self._grid.nearest(*here))
        cached = min(self._cached, key=lambda point: math.dist(point, here), default=captured)
        for magnet in (captured, cached):
            if math.dist(magnet, here) <= MAGNET_RADIUS:
                if magnet != here:
                    self.state.u, self.state.v = magnet
                    self._look_up(light_field)
                return

    def _step_ms(self, instant_ms: float | None) -> float | None:
        if self.step is Step.CAPTURED:
            return None
        if self.picture is not None:
            seconds = self.picture.synthesis.timings.get("total")
            return None if seconds is None else 1e3 * seconds
        return instant_ms

    def _busy(self) -> str:
        if self._engine.failed or not self._synthesis.busy:
            return ""
        return "synthesizing" if self._engine.ready else "loading the networks"

    def _disparity_under_cursor(self) -> float | None:
        if self.picture is None or self.picture.synthesis.disparity is None or self.state.cursor is None:
            return None
        disparity = self.picture.synthesis.disparity
        x, y = int(self.state.cursor[0]), int(self.state.cursor[1])
        if not (0 <= y < disparity.shape[0] and 0 <= x < disparity.shape[1]):
            return None
        return float(disparity[y, x])
