"""The program behind the window: which light field is open, which synthesis is at hand, what the workers are to do.

No GL, no imgui, no glfw: the frame loop calls `tick` once a frame, hands the pictures it finds here to the canvas and the
readout to the panels.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from app.asking import FOR_NOW, GIVES_WAY, Asking, NotAnswered, Task, Wish
from app.comparing import Comparing
from app.comparison import CAPTURED_VIEW, Source
from app.desk import Card, Folder
from app.engine import Answer, Engine, ModelChoice, disparity_range
from app.exhibits import Exhibit, Exhibition
from app.exports import Exports, take_plan
from app.eyes import Eyes
from app.focusing import FocusFacts, among, captured_sliced, captured_summed, carried_disparity, focus_limits
from app.foresight import captured_viewpoints, heading, viewpoints_ahead
from app.geometry import Point
from app.loading import FindPreview, Loading, NotOpened, Open, Preview
from app.looking import LEVELS
from app.on_screen import OnScreen, viewpoint_of
from app.readable import readable
from app.readout import Compared, Readout
from app.samples import Samples
from app.sampling import Sampler
from app.scoreboard import Scoreboard
from app.scoring import DEFAULT_RULE, RULES
from app.state import Grid, Look, Step, Tab, ViewState, carried_share
from app.sway import Sway
from lfcore.cache import rounded
from lfcore.errors import LfviewError
from lfcore.lightfield import LightField
from lfcore.nearest_inputs import Cell, cell_around
from lfcore.sweep_plan import is_plan_file

REST_SECONDS = 0.08  # the hand counts as resting when the viewpoint has not moved for so long
QUIET_SECONDS = 0.6  # after the last thing that the person did, views are computed ahead
# A dragged viewpoint that comes to rest this near to a captured or a cached one goes there: no pixel of an ordinary light
# field moves visibly by it, and the camera's view or the finished picture is there at once.
MAGNET_RADIUS = 0.012
STOP_SECONDS = 10.0


class Controller:
    """Ties the view state to the loader and the synthesis thread. All methods belong to the main thread."""

    def __init__(
        self,
        engine: Engine,
        open_light_field: Open,
        wake: Callable[[], None],
        model: str,
        preview: FindPreview = lambda path: None,
        models: Mapping[str, ModelChoice] | None = None,
    ) -> None:
        self.state = ViewState()
        self.light_field: LightField | None = None
        self.exhibition: Exhibition | None = None  # what is open in place of a light field
        self.folder: Folder | None = None  # what there is to choose from in the browser
        self.messages: list[str] = []
        self._engine = engine
        self._loading = Loading(open_light_field, preview, wake)
        self._asking = Asking(engine, wake)
        self.previewing = False  # what is on screen stands in for the light field that is being opened
        self._model = model
        self._models = models or {}
        for name, choice in self._models.items():
            engine.know(name, choice)
        self._sampler = Sampler()
        self._sway = Sway()
        self.comparing = Comparing(engine, wake)
        self._scoreboard = Scoreboard(engine, self._models)
        self.exports = Exports(self._models, wake, self._hand_waits)
        self.eyes = Eyes(engine)
        self._grid: Grid | None = None
        self._screen = OnScreen()
        self._shown: Point | None = None  # viewpoint at the last tick
        self._aimed: LightField | None = None  # for which focus and level have been chosen
        self._heading: Point = (0.0, 0.0)
        self._moved_at = -math.inf
        self._acted_at = -math.inf
        self._acted = False
        self._now = 0.0
        self._cached: dict[Point, None] = {}  # viewpoints in memory, the one used longest ago first
        self._faulted = False  # the last query failed, and the viewpoint has not moved since
        self._hits = 0
        self._not_opened: str | None = None  # why the last path could not be opened

    # What the person asks for.

    def open(self, path: Path) -> None:
        """Begin to open a light field; one that is still being opened is given up, the one on screen stays until then.

        A saved sweep is taken into the tab Export.
        """
        if is_plan_file(path):
            self._take_sweep(path)
        else:
            self._loading.begin(path)

    def cancel_open(self) -> None:
        """Give up the light field that is being opened."""
        self._loading.cancel()
        if self.previewing:
            self._take(None)

    def close(self) -> None:
        """Put the light field away; the start picture appears."""
        self.cancel_open()
        self._take(None)

    def show_light_field(self, light_field: LightField) -> None:
        """Show a light field that is already in memory."""
        self._take(light_field)

    def say(self, message: str) -> None:
        """Show a message until it is dismissed, over all others; one that is already there is not said twice."""
        self.unsay(message)
        self.messages.append(message)

    def unsay(self, message: str | None) -> None:
        """Put a message away that has become untrue, where it is still shown."""
        if message in self.messages:
            self.messages.remove(message)

    def dismiss(self) -> None:
        """Put the newest message away, which is the one that is shown."""
        if self.messages:
            self.messages.pop()

    def touch(self) -> None:
        """The person does something: whatever is being computed ahead stops at once."""
        self._acted = True
        wish = self._asking.wish
        if wish is not None and wish.task in GIVES_WAY and wish != self.comparing.wish():
            self._asking.give_up()

    def stop(self) -> None:
        """End the threads, waiting a little for work that cannot be broken off at once."""
        self._loading.stop(STOP_SECONDS)
        self._asking.stop(STOP_SECONDS)
        self.exports.stop(STOP_SECONDS)
        self.comparing.stop()

    # Once a frame.

    def tick(self, now: float) -> None:
        """Take what the workers have finished, and ask them for what is wanted next. `now` in seconds."""
        self._take_over(now)
        self._collect()
        self.exports.follow_dialog(self.state.export)
        for fault in self.exports.faults():
            self.say(fault)
        self._go_on(now)

    def follow(self, now: float) -> None:
        """Follow what has been done to the state since this frame's tick, but take nothing from the workers: what comes
        during a frame would have its picture made twice."""
        self._take_over(now)
        self._go_on(now)

    def _take_over(self, now: float) -> None:
        """What the person has done, and chosen."""
        self._now = now
        self._screen.pass_time(now)
        if self._acted:
            self._acted, self._acted_at = False, now
        if self.state.model not in ("", self._model):
            self._change_model(self.state.model)

    def _go_on(self, now: float) -> None:
        if self.light_field is None:
            return
        self._play(now)
        self._sway.move(self.state, now)
        self._aim(self.light_field)
        self._pick()
        if self._shown != self.viewpoint:
            self._follow(self.light_field)
        if self._resting and self.state.hand is not None:
            self._magnet(self.light_field)
            if not self.state.dragging:
                self.state.hand = None
        self._shown = self.viewpoint
        self._screen.go_on(self.viewpoint)
        self._compare(self.light_field)
        self.eyes.look_up(self.light_field, self.state, self._cached)
        if not self.previewing:
            useless = self._resting and self.has_disparity  # what was asked for elsewhere, to be carried here
            self._asking.ask(self.light_field, self._wanted(self.light_field), useless)

    @property
    def viewpoint(self) -> Point:
        """(u, v) on screen."""
        return self.state.u, self.state.v

    @property
    def exhibit(self) -> Exhibit | None:
        """The picture or map on screen of a Lytro file without raw."""
        return self.exhibition.exhibits[self.state.exhibit] if self.exhibition is not None else None

    @property
    def name(self) -> str:
        """Of what is open; empty where nothing is."""
        opened = self.light_field or self.exhibition
        return readable(opened.name) if opened is not None else ""

    @property
    def share(self) -> float:
        """How far the newest synthesis has been faded in over what was on screen before it."""
        return self._screen.share

    @property
    def newest(self) -> Answer | None:
        """The synthesis on screen, carried by its disparity map to the viewpoint."""
        return self._screen.newest

    @property
    def picture(self) -> Answer | None:
        """The same, where it was made for exactly the viewpoint on screen."""
        return self._screen.picture

    @property
    def next_frame_in(self) -> float | None:
        """Seconds until something changes by itself (0: animating), or None where only an event or a worker changes it."""
        if self.newest is not None and self.share < 1.0:
            return 0.0
        if self.light_field is None:
            return None
        if self.state.swaying:
            return 0.0
        if self.state.export.playing:
            return self.state.export.next_stop_in(self._now) or 0.0
        if not self._resting:
            return max(self._moved_at + REST_SECONDS - self._now, 0.0) + 1e-3
        if not self._quiet and self._has_idle_work:
            return max(self._acted_at, self._moved_at) + QUIET_SECONDS - self._now + 1e-3
        return None

    @property
    def step(self) -> Step:
        """Which step of quality is on screen."""
        if self._shows_captured:
            return Step.CAPTURED
        if self.picture is not None:
            return self.picture.step
        if self.newest is None or not self.has_disparity:
            return Step.BLEND
        carried = carried_share(math.dist(viewpoint_of(self.newest), self.viewpoint))
        return Step.REALTIME if self.newest.step is Step.REALTIME and carried >= 0.5 else Step.INSTANT

    @property
    def synthesizing(self) -> bool:
        """Whether the networks work for the viewpoint on screen."""
        wish = self._asking.wish
        return wish is not None and wish.task in FOR_NOW and self._asking.busy

    @property
    def captured_here(self) -> int | None:
        """Number of the captured view at the viewpoint, or None."""
        return self._grid.at(*self.viewpoint) if self._grid is not None else None

    @property
    def disparity_range(self) -> tuple[float, float] | None:
        """The disparities at either end of the colour map, px over the baseline."""
        if self.state.looking.hand_range is not None:
            return self.state.looking.hand_range
        answer = self.picture or self.newest
        if answer is None or answer.percentiles is None:
            return None
        return disparity_range(answer.percentiles, self.state.tail)

    def readout(self, instant_ms: float | None) -> Readout:
        """What the panels print. `instant_ms`: how long the picture of the last frame took where it was made per frame."""
        light_field, exhibition = self.light_field, self.exhibition
        answer = self.picture
        newest = answer or self.newest
        return Readout(
            model=self._model,
            models=tuple(self._models),
            grid=self._grid,
            name=self.name,
            kind=light_field.kind if light_field else exhibition.sentence if exhibition else "",
            source=light_field.source if light_field else exhibition.source if exhibition else "",
            warnings=light_field.warnings if light_field else (),
            facts=tuple(light_field.facts.items()) if light_field else (),
            step=self.step,
            step_ms=self._step_ms(instant_ms),
            from_cache=answer is not None and answer.kept and self.step is answer.step,
            busy=self._busy(),
            loading=self._loading.share if self._loading.path is not None else None,
            loading_name=self._loading.path.name if self._loading.path is not None else "",
            messages=tuple(self.messages),
            timings=tuple(newest.synthesis.timings.items()) if newest else (),
            disparity_range=self.disparity_range,
            has_disparity=self.has_disparity,
            disparity_under_cursor=self._disparity_under_cursor(),
            captured_here=self.captured_here,
            inputs=self._inputs(),
            compared=self._compared(),
            focus=self._focus_facts(),
            weighed=newest is not None and newest.synthesis.weights is not None,
            samples=self._samples(),
            captions=tuple(each.caption for each in exhibition.exhibits) if exhibition else (),
            value_under_cursor=self._value_under_cursor(),
            exports=self.exports.statuses,
            exporting=self.exports.words(self._now),
            cached=tuple(self._cached),
            cache_bytes=self._engine.cache.bytes_used,
            cache_limit=self._engine.cache.limit_bytes,
            cache_hits=self._hits,
        )

    # Inside.

    def _take_sweep(self, path: Path) -> None:
        try:
            take_plan(path, self.state.export)
        except LfviewError as error:
            self.say(str(error))
            return
        self.state.tab = Tab.EXPORT
        self.state.panel = True

    def _play(self, now: float) -> None:
        """Move the viewpoint along the path that is played; anything else that moves it stops that."""
        choices = self.state.export
        if self.state.dragging or choices.placed not in (None, self.viewpoint):
            choices.playing = False
        stop = choices.stop_at(now)
        if stop is None:
            choices.placed = None
            return
        self.state.move_to(stop.u, stop.v)
        choices.placed = self.viewpoint
        if stop.focus is not None:
            self.state.focusing = replace(self.state.focusing, aperture=choices.aperture)
            self.state.refocus_at(stop.focus)

    def _aim(self, light_field: LightField) -> None:
        """Where all disparities of what is open lie far from 0, focus, convergence and level of the sweep begin among them."""
        if self._screen.span is None or self._aimed is light_field:
            return
        self._aimed = light_field
        limits = focus_limits(self._screen.span)
        if limits[0] > LEVELS[1] or limits[1] < LEVELS[0]:
            self.state.focusing = self.state.focusing.among(limits)
            self.state.looking = replace(self.state.looking, level=among(self.state.looking.level, limits))

    def _pick(self) -> None:
        """Focus on the point that was clicked, as soon as its disparity is known."""
        pick = self.state.pick
        disparity = None if pick is None else self._disparity_at(pick)
        if disparity is not None:
            self.state.pick = None
            self.state.refocus_at(disparity)

    def _disparity_at(self, point: Point) -> float | None:
        """The disparity at a picture point, carried to the viewpoint on screen; px over the baseline."""
        newest = self.newest
        if newest is None or newest.synthesis.disparity is None:
            return None
        return carried_disparity(newest.synthesis.disparity, viewpoint_of(newest), self.viewpoint, point)

    def _focus_facts(self) -> FocusFacts:
        state = self.state
        under = self._disparity_at(state.sliced) if state.focusing.slices and state.sliced is not None else None
        return FocusFacts(focus_limits(self._screen.span), under=under, exact_eyes=len(self.eyes.answers) == 2)

    def _hand_waits(self) -> bool:
        """Whether the person waits for a view, which comes before exports."""
        wish = self._asking.wish
        return wish is not None and wish.task in FOR_NOW and self._asking.busy

    def _change_model(self, name: str) -> None:
        """Another model for a hand at rest. What is on screen stays until its first picture is there."""
        choice = self._models[name]
        self._model = name
        self._engine.use(name, choice)
        self.eyes.forget()
        self._asking.forget()
        self._faulted = False
        self._screen.outdate()
        if self.light_field is not None:
            self._count(self.light_field)
            self._look_up(self.light_field)

    @property
    def captured_summed(self) -> bool:
        """Whether refocusing sums up captured views, not such as are drawn in between."""
        grid = self._grid
        return grid is None or captured_summed(self.state.focusing.views, grid.rows, grid.columns, self._screen.span)

    @property
    def captured_sliced(self) -> bool:
        """Whether slices are drawn from captured views, not from the newest synthesis."""
        grid = self._grid
        return grid is None or captured_sliced(self.state.focusing.views, grid.rows, grid.columns)

    @property
    def _resting(self) -> bool:
        return self._now - self._moved_at >= REST_SECONDS

    @property
    def _quiet(self) -> bool:
        return self._now - max(self._acted_at, self._moved_at) >= QUIET_SECONDS

    @property
    def _has_idle_work(self) -> bool:
        return self.state.foresight or self.state.score_all or self._wants_table

    @property
    def _wants_table(self) -> bool:
        """Whether the table of models is looked at, and there is a captured view to score them against."""
        return self.state.panel and self.state.tab is Tab.COMPARE and self.captured_here is not None

    @property
    def has_partner(self) -> bool:
        """Whether what the picture is compared with has a picture of this viewpoint."""
        source = self.state.comparison.source
        if source is Source.CAPTURED:
            return self.captured_here is not None
        return self.has_disparity if source is Source.INSTANT else self.comparing.answer is not None

    @property
    def _shows_captured(self) -> bool:
        return self.state.captured and self.state.look is Look.SYNTHESIS and self.captured_here is not None

    @property
    def has_disparity(self) -> bool:
        """Whether the synthesis on screen has a disparity map."""
        return self.newest is not None and self.newest.synthesis.disparity is not None

    def _take(self, opened: LightField | Exhibition | None) -> None:
        light_field = opened if isinstance(opened, LightField) else None
        self.light_field = light_field
        self.exhibition = opened if isinstance(opened, Exhibition) else None
        self.state.exhibit = self.exhibition.first if self.exhibition is not None else 0
        if opened is not None:
            self.state.export.suggest(opened.source, opened.name)
        self.previewing = False
        self._screen.clear()
        self._asking.forget()
        self.comparing.forget()
        self.eyes.forget()
        self.state.pick = self.state.sliced = None
        self.state.focusing = replace(self.state.focusing, pin=None)
        self._shown = None
        self._heading = (0.0, 0.0)
        self._grid = None
        self._cached = {}
        self._faulted = False
        self.state.hand = None
        self.state.zoom = ViewState().zoom
        self.state.cursor = None
        self.state.move_to(0.5, 0.5)
        if light_field is not None:
            size = (light_field.rows, light_field.columns, light_field.width, light_field.height)
            self._grid = Grid(*size, light_field.dark)
            self._count(light_field)
        else:
            self._scoreboard.refresh(None, None)

    def _count(self, light_field: LightField) -> None:
        """Which viewpoints are in memory, and which have scores."""
        self._cached = dict.fromkeys(self._engine.cached_positions(light_field))
        self._scoreboard.refresh(light_field, self._grid)

    def _collect(self) -> None:
        for loaded in self._loading.news():
            self.unsay(self._not_opened)  # something else has been tried since
            self._not_opened = None
            if isinstance(loaded, Preview):
                self._take(loaded.light_field)
                self.previewing = True
            elif isinstance(loaded, NotOpened):
                if self.previewing:
                    self._take(None)
                self._not_opened = loaded.message
                self.say(loaded.message)
            elif isinstance(loaded, Folder):
                if self.previewing:  # of what was given up for this
                    self._take(None)
                self.folder = loaded
                self.state.desk.show(Card.BROWSER)
            else:
                self._take(loaded)
        for answered in self._asking.news():
            if isinstance(answered, NotAnswered):
                self.say(answered.message)
                if answered.wish is not None and answered.wish == self.comparing.wish():
                    self.comparing.give_up()
                else:
                    self._faulted = True
            elif self.light_field is not None:
                self._count(self.light_field)
                if answered.answer is None:
                    continue
                if answered.wish.task is Task.COMPARE:
                    self.comparing.take(answered.wish, answered.answer)
                else:
                    self._screen.accept(answered.answer, self.viewpoint)
        for message in self.comparing.news():
            self.say(message)

    def _follow(self, light_field: LightField) -> None:
        """The viewpoint has moved."""
        self._moved_at = self._now
        self._faulted = False
        if self._shown is not None:
            here = self.viewpoint
            self._heading = heading(self._heading, (here[0] - self._shown[0], here[1] - self._shown[1]))
        self._look_up(light_field)

    def _look_up(self, light_field: LightField) -> None:
        """A viewpoint seen before is on screen at once, without a fade."""
        known = self._engine.cached(light_field, *self.viewpoint)
        self._screen.move(self.viewpoint, known)
        self._hits += known is not None

    def _wanted(self, light_field: LightField) -> Wish | None:
        here, picture = self.viewpoint, self.picture
        if self._engine.failed:
            return Wish(Task.QUICK, here) if self._engine.quick and picture is None else None
        weighed = self.state.look is Look.LEAN and self._engine.weighs
        unscored = self._engine.scored and picture is not None and picture.score is None and self.captured_here is not None
        unweighed = picture is not None and picture.synthesis.weights is None and weighed
        if picture is None or not picture.final or unscored or unweighed:
            moving = not self._resting or (self.newest is None and not self._faulted)
            if self._engine.quick and moving and picture is None:
                return Wish(Task.QUICK, here)
            # Also while the hand may be about to move on: if it does, this is broken off at once.
            return Wish(Task.FINAL, here, weighed=weighed)
        return self._wanted_later(light_field) if self._resting else None

    def _compare(self, light_field: LightField) -> None:
        """The picture on screen against its partner."""
        state = self.state
        if state.comparison.model is not None and state.comparison.model not in self._models:
            state.comparison = replace(state.comparison, partner=CAPTURED_VIEW)
        if state.comparison.rule not in RULES:
            state.comparison = replace(state.comparison, rule=DEFAULT_RULE)
        if state.comparison.rule != self._engine.rule:
            self._engine.rule = state.comparison.rule
            self._count(light_field)
            self._screen.score(self._engine.scores(light_field).get(rounded(*self.viewpoint)))
        self.comparing.follow(light_field, self.viewpoint, state.comparison)
        self.comparing.measure(light_field, self.picture, state.comparison, state.look is Look.ERROR)

    def _compared(self) -> Compared:
        light_field, measured = self.light_field, self.comparing.measured
        if light_field is None:
            return Compared()
        against_captured = self.state.comparison.source is Source.CAPTURED
        score = self.picture.score if against_captured and self.picture else measured.score if measured else None
        return Compared(
            self.has_partner,
            score,
            measured is not None and measured.difference is self.state.comparison.difference,
            self._scoreboard.table(light_field, self.viewpoint) if self._wants_table else (),
            self._scoreboard.views,
            self._scoreboard.never_scored,
        )

    def _samples(self) -> Samples | None:
        """The values behind the picture, where it has been made for exactly the viewpoint."""
        if self.light_field is None or self.picture is None or viewpoint_of(self.picture) != self.viewpoint:
            return None
        source = self.state.comparison.source
        partner = self.comparing.answer if source is Source.MODEL else None
        return self._sampler.take(self.light_field, self.picture, partner, source, self._shows_captured)

    def _wanted_later(self, light_field: LightField) -> Wish | None:
        """What there is to do while the hand rests on a finished picture."""
        engine = self._engine
        partner = self.comparing.wish()
        if partner is not None:
            return partner
        unsaved = engine.unsaved
        if unsaved is not None:
            return Wish(Task.SAVE, (unsaved.u, unsaved.v), unsaved.model)
        stored = engine.stored_position(light_field)
        if stored is not None:
            return Wish(Task.FETCH, stored)
        eye = self.eyes.missing(self.state, self._cached)
        if eye is not None and not self.exports.busy and engine.has_room(light_field):
            return Wish(Task.AHEAD, eye)
        if not self._quiet or self._grid is None or self.exports.busy:
            return None
        missing = self._scoreboard.missing_model(light_field, self.viewpoint) if self._wants_table else None
        if missing is not None:
            return Wish(Task.COMPARE, self.viewpoint, missing)
        unscored = self._scoreboard.missing_view(self.viewpoint)
        if self.state.score_all and unscored is not None:
            return Wish(Task.SCORE, unscored)
        if self.state.foresight and engine.has_room(light_field):
            for point in viewpoints_ahead(self.viewpoint, self._heading, self._grid):
                if rounded(*point) not in self._cached:
                    return Wish(Task.AHEAD, point)
        unscored = self._scoreboard.missing_view(self.viewpoint, self._cached)  # which costs little
        return Wish(Task.SCORE, unscored) if unscored is not None else None

    def _magnet(self, light_field: LightField) -> None:
        assert self._grid is not None
        here = self.viewpoint
        captured = self._grid.position(self._grid.nearest(*here))
        # Not to what has just been made for this very place: it would be on screen at once, in the middle of its fade.
        others = (point for point in self._cached if point != rounded(*here))
        cached = min(others, key=lambda point: math.dist(point, here), default=captured)
        for magnet in (captured, cached):
            if math.dist(magnet, here) <= MAGNET_RADIUS:
                if magnet != here:
                    self.state.u, self.state.v = magnet
                    self._look_up(light_field)
                return

    def _step_ms(self, instant_ms: float | None) -> float | None:
        """How long what is on screen took: the networks, where it is their step, else the drawing."""
        if self.step is Step.CAPTURED:
            return None
        synthesized = self.newest if self.step is Step.REALTIME else self.picture
        if synthesized is None:
            return instant_ms
        seconds = synthesized.synthesis.timings.get("total")
        return None if seconds is None else 1e3 * seconds

    def _inputs(self) -> frozenset[tuple[int, int]]:
        if self.light_field is None:
            return frozenset()
        from_corners = self._engine.scored
        cell = Cell.whole(self.light_field) if from_corners else cell_around(self.light_field, *self.viewpoint)
        return frozenset(cell.places)

    def _busy(self) -> str:
        wish = self._asking.wish
        if self._engine.failed or wish is None or not self._asking.busy:
            return ""
        if wish.task in FOR_NOW:
            return "synthesizing" if self.newest is not None or self._engine.ready else "loading the networks"
        if wish.task is Task.AHEAD and self._grid is not None:
            captured = captured_viewpoints(self._grid)
            done = sum(rounded(*point) in self._cached for point in captured)
            return f"computing ahead, {done} of {len(captured)}"
        if wish.task is Task.SCORE and self._grid is not None:
            done = sum(score is not None for score in self._scoreboard.views)
            return f"scoring captured views, {done} of {len(captured_viewpoints(self._grid))}"
        return f"synthesizing by {wish.model}" if wish.task is Task.COMPARE else ""

    def _disparity_under_cursor(self) -> float | None:
        return None if self.picture is None else _at_cursor(self.picture.synthesis.disparity, self.state.cursor)

    def _value_under_cursor(self) -> float | None:
        exhibit = self.exhibit
        return None if exhibit is None or exhibit.caption.span is None else _at_cursor(exhibit.pixels, self.state.cursor)


def _at_cursor(values: npt.NDArray[np.generic] | None, cursor: Point | None) -> float | None:
    """The value of a map (H, W) at the cursor, None outside."""
    if values is None or cursor is None:
        return None
    x, y = int(cursor[0]), int(cursor[1])
    if not (0 <= y < values.shape[0] and 0 <= x < values.shape[1]):
        return None
    return float(values[y, x])
