"""The program behind the window: opening, synthesizing, the cache, faults, the magnets."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import count, pairwise
from pathlib import Path

import numpy as np
import pytest
from moving_scene import DISPARITY, TruthSynthesizer, light_field, truth

from app.controller import MAGNET_RADIUS, REST_SECONDS, Controller
from app.engine import Engine, disparity_range
from app.on_screen import FADE_SECONDS
from app.state import Look, Step
from app.worker import Cancel
from lfcore.errors import InputError, WeightsError
from lfcore.lightfield import LightField
from lfcore.metrics import k16
from lfcore.store import ViewStore
from lfcore.synthesis import Synthesis, never

PATIENCE = 60.0
Progress = Callable[[float], None]


class Program:
    """A controller with its own clock, fed by made-up light fields: "3x3", "2x2", and so on; anything else fails to open."""

    def __init__(
        self, synthesizer: TruthSynthesizer, quick: TruthSynthesizer | None = None, store: ViewStore | None = None
    ) -> None:
        self.synthesizer = synthesizer
        self.engine = Engine(lambda: synthesizer, 64 * 2**20, None if quick is None else lambda: quick, store)
        self.controller = Controller(self.engine, self.opened, lambda: None, "truth")
        self.now = 100.0

    def opened(self, path: Path, progress: Progress, cancelled: Cancel) -> LightField:
        progress(0.5)
        if "x" not in path.name:
            raise InputError(f"{path.name} holds no views.")
        rows, columns = map(int, path.name.split("x"))
        return light_field(rows, columns)

    def tick(self, seconds: float = 0.01) -> None:
        self.now += seconds
        self.controller.tick(self.now)

    def until(self, condition: Callable[[], bool], seconds: float = 0.01) -> None:
        """Tick until it holds; each tick takes `seconds` of the controller's clock (0: the hand has not come to rest)."""
        deadline = time.monotonic() + PATIENCE
        self.tick(seconds)
        while not condition():
            assert time.monotonic() < deadline
            time.sleep(0.002)
            self.tick(seconds)

    def open(self, name: str) -> None:
        self.controller.open(Path(name))
        self.until(lambda: self.controller.readout(None).loading is None)

    def open_and_fade_in(self, name: str) -> None:
        """Open it and wait until its first finished picture is on screen, whole."""
        self.open(name)
        self.until_full()
        self.tick(2 * FADE_SECONDS)

    def until_full(self) -> None:
        self.until(lambda: self.controller.step is Step.FULL)


@pytest.fixture
def program() -> Iterator[Program]:
    made = Program(TruthSynthesizer())
    yield made
    made.controller.stop()


def test_steps_go_from_blend_to_full_and_instant_carries_the_drag(program: Program) -> None:
    program.synthesizer.seconds = 0.05
    program.open("3x3")
    controller = program.controller
    assert controller.step is Step.BLEND
    program.until_full()
    controller.state.move_to(0.3, 0.4)
    program.tick()
    assert controller.step is Step.INSTANT
    program.until_full()
    assert controller.picture is not None
    assert (controller.picture.synthesis.u, controller.picture.synthesis.v) == (0.3, 0.4)


def test_a_picture_that_comes_long_after_the_last_frame_fades_in_all_the_same(program: Program) -> None:
    """Where nothing moves, no frames are drawn while the networks work."""
    program.open_and_fade_in("3x3")
    controller = program.controller
    controller.state.move_to(0.3, 0.4)
    program.tick()
    assert controller.step is Step.INSTANT
    program.until(lambda: controller.step is Step.FULL, seconds=10 * FADE_SECONDS)
    assert controller.share == 0
    program.tick(FADE_SECONDS / 2)
    assert controller.share == pytest.approx(0.5)


def test_full_fades_in_when_new_and_is_there_at_once_from_the_cache(program: Program) -> None:
    program.open("3x3")
    program.until_full()
    controller = program.controller
    assert 0 <= controller.share < 1
    assert controller.next_frame_in == 0.0
    program.tick(FADE_SECONDS + 1e-6)
    assert controller.share == 1
    controller.state.move_to(0.3, 0.4)
    program.until_full()
    controller.state.move_to(0.5, 0.5)
    program.tick()
    assert controller.step is Step.FULL
    assert controller.share == 1
    readout = controller.readout(None)
    assert readout.from_cache
    assert readout.cache_hits == 1
    assert set(readout.cached) == {(0.5, 0.5), (0.3, 0.4)}


def test_an_answer_for_a_viewpoint_that_was_left_is_not_shown_as_full(program: Program) -> None:
    program.open_and_fade_in("3x3")
    program.synthesizer.seconds = 0.2
    controller = program.controller
    controller.state.move_to(0.3, 0.3)
    program.until(lambda: (0.3, 0.3) in program.synthesizer.asked)
    controller.state.move_to(0.4, 0.3)
    program.tick()  # the hand is moving: the query for 0.3 goes on, and its disparity map is taken
    deadline = time.monotonic() + PATIENCE
    while controller.newest is None or controller.newest.synthesis.u == 0.5:
        assert time.monotonic() < deadline
        program.tick(0.0)
        time.sleep(0.002)
    assert controller.newest.synthesis.u == 0.3
    assert controller.step is Step.INSTANT


def test_a_query_for_another_viewpoint_is_given_up_when_the_hand_rests(program: Program) -> None:
    program.open("3x3")
    program.until_full()
    program.synthesizer.seconds = 60.0
    controller = program.controller
    controller.state.move_to(0.3, 0.3)
    program.until(lambda: (0.3, 0.3) in program.synthesizer.asked)
    program.synthesizer.seconds = 0.0
    controller.state.move_to(0.4, 0.3)
    program.until_full()  # long before the 60 s are over
    assert controller.picture is not None
    assert controller.picture.synthesis.u == 0.4


def test_score_is_that_of_the_picture_on_screen_against_the_captured_view(program: Program) -> None:
    program.open("3x3")
    program.until(lambda: program.controller.readout(None).compared.score is not None)  # the centre of 3 x 3 is a captured view
    score = program.controller.readout(None).compared.score
    assert score is not None
    expected = k16(truth(0.5, 0.5), light_field(3, 3).view(1, 1))
    assert (score.psnr, score.ssim) == pytest.approx((expected.psnr, expected.ssim))
    assert "K16" in score.protocol
    program.controller.state.move_to(0.3, 0.5)
    program.until_full()
    assert program.controller.readout(None).compared.score is None


def test_captured_step_only_where_there_is_a_captured_view(program: Program) -> None:
    program.open("3x3")
    controller = program.controller
    controller.state.captured = True
    program.tick()
    assert controller.step is Step.CAPTURED
    controller.state.look = Look.ERROR
    assert controller.step is not Step.CAPTURED
    controller.state.look = Look.SYNTHESIS
    controller.state.move_to(0.3, 0.3)
    program.tick()
    assert controller.step is not Step.CAPTURED


def test_a_light_field_that_does_not_open_leaves_the_old_one_and_says_why(program: Program) -> None:
    program.open("3x3")
    old = program.controller.light_field
    program.open("nothing")
    assert program.controller.light_field is old
    assert program.controller.messages == ["nothing holds no views."]
    program.open("nothing")
    assert len(program.controller.messages) == 1  # not said twice
    program.controller.dismiss()
    assert program.controller.messages == []
    program.until_full()  # and the viewer lives on


def test_opening_another_takes_the_place_of_one_being_opened(program: Program) -> None:
    seen: list[str] = []

    def slow(path: Path, progress: Progress, cancelled: Cancel) -> LightField:
        seen.append(path.name)
        deadline = time.monotonic() + PATIENCE
        while path.name == "slow" and not cancelled():
            assert time.monotonic() < deadline
            time.sleep(0.002)
        return light_field(2, 2)

    controller = Controller(program.engine, slow, lambda: None, "truth")
    program.controller, old = controller, program.controller
    old.stop()
    controller.open(Path("slow"))
    program.until(lambda: seen == ["slow"])
    program.open("other")
    assert controller.light_field is not None
    assert controller.light_field.rows == 2
    assert seen == ["slow", "other"]


def test_opening_can_be_cancelled(program: Program) -> None:
    program.controller.open(Path("3x3"))
    program.controller.cancel_open()
    for _ in range(50):
        program.tick()
        time.sleep(0.002)
    assert program.controller.light_field is None
    assert program.controller.readout(None).loading is None


def test_closing_shows_nothing_and_another_can_be_opened(program: Program) -> None:
    program.open("3x3")
    program.until_full()
    program.controller.state.move_to(0.1, 0.2)
    program.controller.close()
    program.tick()
    assert program.controller.readout(None).grid is None
    program.open("2x2")
    assert program.controller.viewpoint == (0.5, 0.5)
    program.until_full()


def test_a_model_that_cannot_be_loaded_is_said_once_and_blend_remains() -> None:
    def broken() -> TruthSynthesizer:
        raise WeightsError("The weight file is damaged; get it again.")

    program = Program(TruthSynthesizer())
    program.controller.stop()
    program.controller = Controller(Engine(broken, 2**20), program.opened, lambda: None, "full")
    try:
        program.open("3x3")
        program.until(lambda: bool(program.controller.messages))
        program.controller.state.move_to(0.3, 0.3)
        for _ in range(30):
            program.tick()
            time.sleep(0.002)
        assert program.controller.messages == ["The weight file is damaged; get it again."]
        assert program.controller.step is Step.BLEND
    finally:
        program.controller.stop()


def test_a_fault_in_a_synthesis_is_said_and_the_next_one_comes(program: Program) -> None:
    program.open("3x3")
    program.until_full()
    honest = program.synthesizer.synthesize

    def faulty(u: float, v: float, cancelled: Callable[[], bool]) -> None:
        raise RuntimeError("out of luck")

    program.synthesizer.synthesize = faulty  # type: ignore[method-assign, assignment]
    program.controller.state.move_to(0.3, 0.3)
    program.until(lambda: bool(program.controller.messages))
    assert "out of luck" in program.controller.messages[0]
    assert program.controller.step is Step.INSTANT
    program.synthesizer.synthesize = honest  # type: ignore[method-assign]
    program.controller.state.move_to(0.35, 0.3)
    program.until_full()


def test_a_dragged_viewpoint_rests_on_a_captured_or_cached_one_nearby(program: Program) -> None:
    program.open("3x3")
    program.until_full()
    controller, state = program.controller, program.controller.state
    state.move_to(0.3, 0.3)
    program.until_full()
    for magnet in ((0.3, 0.3), (0.0, 0.5)):  # cached, captured
        state.move_to(magnet[0] + 0.1, magnet[1])
        program.tick()
        state.drag_by(-0.1 + 0.6 * MAGNET_RADIUS, 0)
        state.dragging = False
        program.tick()
        assert controller.viewpoint != magnet  # not while it moves
        program.tick(REST_SECONDS + 0.01)
        assert controller.viewpoint == magnet
    state.move_to(0.7, 0.7)
    state.drag_by(0.01, 0)
    program.tick()
    program.tick(REST_SECONDS + 0.01)
    assert controller.viewpoint == (0.71, 0.7)


def test_a_finished_picture_fades_in_where_a_held_hand_rests(program: Program) -> None:
    """It lies in the cache at once, under its viewpoint to a few decimals, which is no place to be pulled to."""
    program.open_and_fade_in("3x3")
    controller, state = program.controller, program.controller.state
    here = (1 / 3, 0.41234567)
    state.move_to(*here)
    state.hand, state.dragging = here, True
    program.tick()
    program.until(lambda: controller.step is Step.FULL, seconds=10 * FADE_SECONDS)
    assert controller.viewpoint == here
    assert controller.share == 0
    program.tick(FADE_SECONDS / 2)
    assert controller.share == pytest.approx(0.5)


def test_keys_may_go_where_a_magnet_would_pull(program: Program) -> None:
    program.open("3x3")
    program.controller.state.move_to(0.505, 0.5)
    program.tick()
    program.tick(REST_SECONDS + 0.01)
    assert program.controller.viewpoint == (0.505, 0.5)


def test_an_idle_program_asks_for_no_frames(program: Program) -> None:
    program.open("3x3")
    program.until_full()
    program.tick(1.0)
    assert program.controller.next_frame_in is None


def test_disparity_under_the_cursor(program: Program) -> None:
    program.open("3x3")
    program.until_full()
    program.controller.state.cursor = (10.5, 20.5)
    assert program.controller.readout(None).disparity_under_cursor == DISPARITY
    program.controller.state.cursor = (1e4, 0)
    assert program.controller.readout(None).disparity_under_cursor is None


def test_disparity_range_leaves_out_the_tails() -> None:
    percentiles = tuple(float(i) for i in range(101))
    assert disparity_range(percentiles, 0) == (0, 100)
    assert disparity_range(percentiles, 5) == (5, 95)
    low, high = disparity_range((2.0,) * 101, 0)
    assert high - low == pytest.approx(0.1)
    assert (low + high) / 2 == pytest.approx(2)


# Two models: a quick one while the hand moves, another when it rests.


@pytest.fixture
def pair() -> Iterator[tuple[Program, TruthSynthesizer]]:
    quick = TruthSynthesizer()
    quick.name = "realtime"
    made = Program(TruthSynthesizer(), quick)
    yield made, quick
    made.controller.stop()


def test_the_quick_model_serves_the_moving_hand_and_the_other_the_one_that_waits(
    pair: tuple[Program, TruthSynthesizer],
) -> None:
    program, quick = pair
    controller = program.controller
    program.open("3x3")
    program.until(lambda: controller.step is Step.REALTIME)  # the first picture, too, is the quick one's
    program.until_full()
    assert quick.asked == program.synthesizer.asked == [(0.5, 0.5)]
    program.tick(2 * FADE_SECONDS)
    parts = count(1)

    def moved_on() -> bool:
        controller.state.move_to(0.5 + 0.3 * math.sin(next(parts) / 100), 0.5)  # the hand is always ahead of it
        return len(quick.asked) > 5

    program.until(moved_on, 0.002)
    assert program.synthesizer.asked == [(0.5, 0.5)]
    program.until(lambda: quick.asked[-1] == controller.viewpoint, 0.0)  # no time passes: the hand does not count as resting
    program.until_full()
    assert quick.asked[-1] == program.synthesizer.asked[-1] == controller.viewpoint
    assert len(program.synthesizer.asked) == 2
    assert controller.picture is not None
    assert controller.picture.final


def test_the_picture_is_refined_as_soon_as_the_quick_one_is_there_though_the_hand_may_move_on(
    pair: tuple[Program, TruthSynthesizer],
) -> None:
    program, quick = pair
    controller = program.controller
    program.open_and_fade_in("3x3")
    controller.state.move_to(0.51, 0.5)
    program.until(lambda: len(program.synthesizer.asked) > 1, 0.0)  # no time passes: the hand does not count as resting
    assert quick.asked[-1] == program.synthesizer.asked[-1] == (0.51, 0.5)
    program.tick(0.5 * (FADE_SECONDS + REST_SECONDS))  # the quick one has been faded in
    program.until(lambda: controller.step is Step.FULL, 0.0)
    assert len(program.synthesizer.asked) == 2  # and nothing is computed ahead yet


def test_a_synthesis_for_the_resting_hand_is_broken_off_as_soon_as_the_hand_moves(
    pair: tuple[Program, TruthSynthesizer],
) -> None:
    program, quick = pair
    controller = program.controller
    program.open_and_fade_in("3x3")
    program.synthesizer.seconds = 60.0
    controller.state.move_to(0.3, 0.3)
    program.until(lambda: (0.3, 0.3) in program.synthesizer.asked)
    controller.state.move_to(0.31, 0.3)
    program.until(lambda: (0.31, 0.3) in quick.asked, 0.0)  # long before the 60 s are over


def test_between_two_quick_syntheses_the_newest_one_is_carried(pair: tuple[Program, TruthSynthesizer]) -> None:
    program, quick = pair
    controller = program.controller
    program.open_and_fade_in("3x3")
    program.synthesizer.seconds = 60.0
    controller.state.move_to(0.52, 0.5)
    program.tick(0.0)
    assert controller.step is Step.INSTANT  # carried, but not made by the quick model
    program.until(lambda: controller.picture is not None, 0.0)
    program.tick(0.5 * (FADE_SECONDS + REST_SECONDS))
    quick.seconds = 60.0
    controller.state.move_to(0.54, 0.5)
    program.tick(0.0)
    assert controller.picture is None
    assert controller.step is Step.REALTIME
    assert controller.newest is not None
    of_networks = 1e3 * controller.newest.synthesis.timings["total"]
    assert controller.readout(3.5).step_ms == of_networks != 3.5  # not that of carrying, which is no step of theirs
    controller.state.move_to(0.9, 0.5)
    program.tick(0.0)
    assert controller.step is Step.INSTANT  # too far to be carried
    assert controller.readout(3.5).step_ms == 3.5


def moves_on(program: Program, changes: int) -> list[float]:
    """Move little by little until so many other syntheses have come to the screen; when they came."""
    controller = program.controller
    changed_at: list[float] = []
    newest = controller.newest
    deadline, steps = time.monotonic() + PATIENCE, count()
    while len(changed_at) < changes:
        assert time.monotonic() < deadline
        controller.state.move_to(0.5 + 0.4 * math.sin(next(steps) / 200), 0.5)
        for _ in range(5):
            time.sleep(0.001)
            program.tick(0.002)
            if controller.newest is not newest:
                newest = controller.newest
                changed_at.append(program.now)
    return changed_at


def test_a_synthesis_that_comes_during_a_fade_waits_for_its_end(program: Program) -> None:
    program.open_and_fade_in("3x3")
    changed_at = moves_on(program, 4)
    assert min(later - earlier for earlier, later in pairwise(changed_at)) >= FADE_SECONDS - 1e-6


def test_quick_syntheses_follow_each_other_without_a_fade(pair: tuple[Program, TruthSynthesizer]) -> None:
    program, _ = pair
    controller = program.controller
    program.open_and_fade_in("3x3")
    controller.state.move_to(0.49, 0.5)
    program.until(lambda: controller.newest is not None and controller.newest.step is Step.REALTIME, 0.0)
    assert controller.share < 1  # from the one to the other model there is one
    program.tick(0.5 * (FADE_SECONDS + REST_SECONDS))
    first = controller.newest
    controller.state.move_to(0.48, 0.5)
    program.until(lambda: controller.newest is not first, 0.0)
    assert controller.share == 1


def test_a_quick_model_that_cannot_be_loaded_is_said_and_the_other_serves_alone() -> None:
    def broken() -> TruthSynthesizer:
        raise WeightsError("The weights of realtime are damaged; get them again.")

    program = Program(TruthSynthesizer())
    program.controller.stop()
    engine = Engine(lambda: program.synthesizer, 2**26, broken)
    program.controller = Controller(engine, program.opened, lambda: None, "truth")
    try:
        program.open("3x3")
        program.until_full()
        assert program.controller.messages == ["The weights of realtime are damaged; get them again."]
        program.controller.state.move_to(0.3, 0.3)
        program.until_full()
    finally:
        program.controller.stop()


def test_the_networks_count_as_loading_until_one_has_answered() -> None:
    program = Program(TruthSynthesizer(seconds=0.1), TruthSynthesizer(seconds=0.1))
    try:
        program.open("3x3")
        program.until(lambda: program.controller.readout(None).busy == "loading the networks", 0)
        program.until(lambda: program.controller.readout(None).busy == "synthesizing")
        program.until_full()
    finally:
        program.controller.stop()


def test_a_model_that_turns_out_damaged_with_its_first_query_is_said_once_and_the_quick_one_serves_alone() -> None:
    class Damaged(TruthSynthesizer):
        def synthesize(self, u: float, v: float, cancelled: Cancel = lambda: False) -> Synthesis:
            super().synthesize(u, v, cancelled)
            raise WeightsError("The weights of full are damaged; get them again.")

    damaged, quick = Damaged(), TruthSynthesizer()
    program = Program(damaged, quick)
    try:
        program.open("3x3")
        program.until(lambda: bool(program.controller.messages))
        assert program.controller.messages == ["The weights of full are damaged; get them again."]
        program.controller.dismiss()
        for u in (0.3, 0.4):
            program.controller.state.move_to(u, 0.3)
            program.until(lambda: program.controller.picture is not None)
            program.tick(1.0)
        assert program.controller.messages == []
        assert len(damaged.asked) == 1
    finally:
        program.controller.stop()


# Foresight and the disk.


def test_idle_time_is_used_for_what_may_be_wanted_next_and_none_of_it_twice(program: Program) -> None:
    program.open("3x3")
    program.until_full()
    program.tick(1.0)
    captured = {(u / 2, v / 2) for u in range(3) for v in range(3)}
    program.until(lambda: captured <= set(program.controller.readout(None).cached))
    program.tick(1.0)
    for _ in range(10):
        time.sleep(0.002)
        program.tick(0.1)
    assert sorted(program.synthesizer.asked) == sorted(captured)
    assert program.controller.next_frame_in is None  # and then it is quiet
    before = len(program.synthesizer.asked)
    program.controller.state.move_to(1.0, 0.5)
    program.tick()
    assert program.controller.step is Step.FULL  # on the next frame
    assert len(program.synthesizer.asked) == before


@pytest.mark.parametrize(("disparity", "begins"), [(-6.0, 0.0), (57.0, 57.0)])
def test_focus_and_levels_begin_where_a_scene_is_that_lies_far_from_0(disparity: float, begins: float) -> None:
    class Far(TruthSynthesizer):
        def synthesize(self, u: float, v: float, cancelled: Callable[[], bool] = never) -> Synthesis:
            found = super().synthesize(u, v, cancelled)
            return replace(found, disparity=np.full(found.image.shape[:2], disparity, np.float32))

    program = Program(Far())
    try:
        program.open("3x3")
        program.until_full()
        state = program.controller.state
        assert state.focusing.focus == state.focusing.convergence == state.looking.level == begins
        state.refocus_at(-3.0)  # and whatever is then chosen stays
        program.tick()
        assert state.focusing.focus == -3.0
    finally:
        program.controller.stop()


def test_foresight_goes_along_the_direction_of_travel_first(program: Program) -> None:
    program.open("3x3")
    program.until_full()
    program.controller.state.move_to(0.48, 0.5)  # an arrow key
    program.until_full()
    program.tick(1.0)
    program.until(lambda: len(program.synthesizer.asked) >= 4)
    assert program.synthesizer.asked[2:4] == [pytest.approx((0.46, 0.5)), pytest.approx((0.44, 0.5))]


def test_foresight_stops_at_once_when_the_person_does_something_and_may_be_switched_off(program: Program) -> None:
    controller = program.controller
    program.open("3x3")
    program.until_full()
    program.synthesizer.seconds = 60.0
    program.tick(1.0)
    program.until(lambda: len(program.synthesizer.asked) == 2)
    assert "ahead" in controller.readout(None).busy
    controller.touch()
    program.until(lambda: not controller._asking.busy)  # long before the 60 s are over
    program.tick(0.1)
    assert len(program.synthesizer.asked) == 2
    program.tick(1.0)
    program.until(lambda: len(program.synthesizer.asked) == 3)  # and goes on after a while
    program.synthesizer.seconds = 0.0
    controller.state.move_to(0.3, 0.3)  # an actual query does not wait for it
    program.until_full()
    controller.state.foresight = False
    asked = len(program.synthesizer.asked)
    program.tick(1.0)
    for _ in range(20):
        time.sleep(0.002)
        program.tick(0.1)
    assert len(program.synthesizer.asked) == asked


def test_foresight_does_not_drive_out_what_is_in_memory() -> None:
    program = Program(TruthSynthesizer())
    program.controller.stop()
    held = 96 * 128 * 8 + 1024
    engine = Engine(lambda: program.synthesizer, int(5.7 * held))
    program.controller = Controller(engine, program.opened, lambda: None, "truth")
    try:
        program.open("3x3")
        program.until_full()
        program.until(lambda: len(program.controller.readout(None).cached) == 5, 0.5)  # of nine
        for _ in range(50):  # and there it stays
            time.sleep(0.002)
            program.tick(0.5)
        assert len(program.controller.readout(None).cached) == 5
        assert (0.5, 0.5) in program.controller.readout(None).cached
    finally:
        program.controller.stop()


def test_what_one_run_has_synthesized_the_next_one_has_at_once(tmp_path: Path) -> None:
    first = Program(TruthSynthesizer(), store=ViewStore(tmp_path))
    try:
        first.open("3x3")
        first.until_full()
        first.controller.state.foresight = False
        first.controller.state.move_to(0.3, 0.4)
        first.until_full()
        first.until(lambda: ViewStore(tmp_path).usage().views == 2)
    finally:
        first.controller.stop()
    quick = TruthSynthesizer()
    second = Program(TruthSynthesizer(), quick, ViewStore(tmp_path))
    try:
        second.controller.state.foresight = False
        second.open("3x3")
        second.until_full()
        assert second.controller.readout(None).from_cache
        assert second.controller.readout(None).compared.score is not None
        second.until(lambda: len(second.controller.readout(None).cached) == 2)
        second.controller.state.move_to(0.3, 0.4)
        second.tick()
        assert second.controller.step is Step.FULL
        assert second.synthesizer.asked == []
        assert quick.asked == []  # what lies on disk is sooner there
    finally:
        second.controller.stop()


def test_a_disk_that_cannot_be_written_is_said_once_and_the_viewer_goes_on(tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("a file where the folder should be")
    program = Program(TruthSynthesizer(), store=ViewStore(tmp_path / "taken"))
    try:
        program.open("3x3")
        program.until(lambda: bool(program.controller.messages))
        assert "not kept on disk" in program.controller.messages[0]
        program.controller.dismiss()
        for u in (0.3, 0.4):
            program.controller.state.move_to(u, 0.3)
            program.until_full()
            program.tick(1.0)
        assert program.controller.messages == []
    finally:
        program.controller.stop()


def test_the_newest_message_is_on_top_and_goes_when_its_cause_is_gone(program: Program) -> None:
    controller = program.controller
    controller.say("first")
    controller.say("second")
    controller.say("first")
    assert controller.messages == ["second", "first"]  # the last one is shown
    controller.dismiss()
    assert controller.messages == ["second"]
    program.open("nothing")
    program.open("nothing else")
    assert controller.messages == ["second", "nothing else holds no views."]
    program.open("3x3")
    assert controller.messages == ["second"]


def test_a_model_that_cannot_be_loaded_leaves_the_quick_one_to_serve_also_with_a_disk(tmp_path: Path) -> None:
    def broken() -> TruthSynthesizer:
        raise WeightsError("The weights of full are damaged; get them again.")

    program = Program(TruthSynthesizer())
    program.controller.stop()
    engine = Engine(broken, 2**26, lambda: program.synthesizer, ViewStore(tmp_path, 2**26))
    program.controller = Controller(engine, program.opened, lambda: None, "truth")
    try:
        program.open("3x3")
        program.until(lambda: program.controller.picture is not None)
        program.until(lambda: bool(program.controller.messages), 0.1)
        assert program.controller.messages == ["The weights of full are damaged; get them again."]
    finally:
        program.controller.stop()
