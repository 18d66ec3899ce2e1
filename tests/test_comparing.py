"""The picture against its partner, and scores of all captured views: what the program computes, when, and what comes out."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from moving_scene import SIZE, TruthSynthesizer, light_field, truth

from app.comparison import CAPTURED_VIEW, INSTANT, Difference
from app.controller import Controller
from app.engine import Engine, ModelChoice
from app.foresight import captured_viewpoints
from app.state import Look, Step, Tab
from lfcore.errors import LfviewError, WeightsError
from lfcore.lightfield import FloatArray
from lfcore.metrics import k16, luma_score, similarity_map, to_uint8
from lfcore.store import ViewStore
from lfcore.synthesizer import Synthesis

PATIENCE = 60.0


class Shifted(TruthSynthesizer):
    """The truth, a little too bright by an amount of its own: its score is known."""

    def __init__(self, name: str, excess: float) -> None:
        super().__init__()
        self.name = self.key = name
        self.excess = np.float32(excess)

    def synthesize(self, u: float, v: float, cancelled: Callable[[], bool] = lambda: False) -> Synthesis:
        made = super().synthesize(u, v, cancelled)
        return replace(made, image=made.image + self.excess)


class Program:
    """A controller with two models and one that cannot be loaded, and with a clock of its own."""

    def __init__(
        self, store: ViewStore | None = None, cache_bytes: int = 64 * 2**20, never_scored: frozenset[str] = frozenset()
    ) -> None:
        self.models = {"first": Shifted("first", 0.01), "second": Shifted("second", 0.03)}
        choices = {
            name: ModelChoice(lambda made=made: made, False, name not in never_scored) for name, made in self.models.items()
        }
        choices["broken"] = ModelChoice(broken, False)
        engine = Engine(choices["first"].make, cache_bytes, None, store, "first")
        self.controller = Controller(engine, lambda *_: light_field(), lambda: None, "first", models=choices)
        self.state = self.controller.state
        self.now = 100.0

    def tick(self, seconds: float = 0.01) -> None:
        self.now += seconds
        self.controller.tick(self.now)

    def until(self, condition: Callable[[], bool], seconds: float = 0.05) -> None:
        deadline = time.monotonic() + PATIENCE
        self.tick(seconds)
        while not condition():
            assert time.monotonic() < deadline
            time.sleep(0.002)
            self.tick(seconds)

    def idle(self, seconds: float = 3.0) -> None:
        """Let that much of its own time pass, in which workers may do what they want to do."""
        for _ in range(30):
            self.tick(seconds / 30)
            time.sleep(0.002)

    def open(self) -> None:
        self.controller.open(Path("any"))
        self.until(lambda: self.controller.step is Step.FULL)

    def compare(self, **changes: object) -> None:
        self.state.comparison = replace(self.state.comparison, **changes)  # type: ignore[arg-type]


def broken() -> TruthSynthesizer:
    raise WeightsError("broken has no weights.")


@pytest.fixture
def program() -> Iterator[Program]:
    made = Program()
    made.state.foresight = False
    made.open()
    yield made
    made.controller.stop()


def image_of(program: Program) -> FloatArray:
    assert program.controller.picture is not None
    return program.controller.picture.synthesis.image


def test_a_partner_is_synthesized_by_its_model_when_the_hand_rests_and_measured_from_what_is_shown(program: Program) -> None:
    controller, second = program.controller, program.models["second"]
    program.idle()
    assert second.asked == []  # nobody has asked for it
    program.compare(partner="second")
    program.until(lambda: controller.readout(None).compared.score is not None)
    assert second.asked == [(0.5, 0.5)]
    assert controller.comparing.answer is not None and controller.has_partner
    score = controller.readout(None).compared.score
    expected = k16(image_of(program), controller.comparing.answer.synthesis.image)
    assert score is not None
    assert (score.psnr, score.ssim) == pytest.approx((expected.psnr, expected.ssim), abs=1e-9)
    assert score.psnr == pytest.approx(-20 * np.log10(0.02), abs=0.3)  # 8 bits round
    assert controller.picture is not None
    assert controller.picture.synthesis.model == "first"  # what is on screen stays

    program.state.move_to(0.3, 0.4)  # no captured view; models can be compared anywhere
    program.tick()
    assert not controller.has_partner
    program.until(lambda: controller.readout(None).compared.score is not None)
    assert second.asked == [(0.5, 0.5), (0.3, 0.4)]
    program.state.move_to(0.5, 0.5)
    program.tick()
    assert controller.has_partner  # at once, from memory
    program.idle()
    assert len(second.asked) == 2


def test_a_partner_that_is_being_synthesized_gives_way_to_the_hand(program: Program) -> None:
    second = program.models["second"]
    second.seconds = 60.0
    program.compare(partner="second")
    program.until(lambda: len(second.asked) == 1)
    program.controller.touch()  # the mouse moves about: the partner goes on
    program.idle(0.3)
    assert len(second.asked) == 1
    program.state.move_to(0.3, 0.3)
    program.until(lambda: (0.3, 0.3) in program.models["first"].asked)  # long before the 60 s are over


def test_a_partner_whose_model_cannot_be_loaded_says_so_once_and_captured_views_still_serve(program: Program) -> None:
    program.compare(partner="broken")
    program.until(lambda: bool(program.controller.messages))
    program.controller.dismiss()
    program.idle()
    assert program.controller.messages == []
    assert not program.controller.has_partner
    program.compare(partner=CAPTURED_VIEW)
    program.tick()
    assert program.controller.has_partner


def test_a_partner_that_is_not_offered_is_replaced_by_the_captured_view(program: Program) -> None:
    program.compare(partner="a model of long ago")
    program.tick()
    assert program.state.comparison.partner == CAPTURED_VIEW


def test_against_the_captured_view_the_score_is_that_of_the_picture_and_its_map_agrees(program: Program) -> None:
    program.state.look = Look.ERROR
    program.compare(difference=Difference.SIMILARITY)
    program.until(lambda: program.controller.readout(None).compared.mapped)
    compared, measured = program.controller.readout(None).compared, program.controller.comparing.measured
    assert program.controller.picture is not None and measured is not None and measured.values is not None
    assert compared.score is program.controller.picture.score
    inside = (slice(22, -22), slice(22, -22))
    captured = light_field().view(1, 1)
    expected = similarity_map(to_uint8(image_of(program))[inside], to_uint8(captured)[inside])
    np.testing.assert_allclose(measured.values[inside], expected)
    assert float(expected.mean(dtype=np.float64)) == pytest.approx(measured.score.ssim, abs=1e-6)
    assert compared.score is not None
    assert compared.score.ssim == pytest.approx(measured.score.ssim, abs=2e-4)  # found before memory rounded the picture

    program.compare(difference=Difference.BLOCKS)
    program.tick()
    assert not program.controller.readout(None).compared.mapped  # not the map of another kind
    program.until(lambda: program.controller.readout(None).compared.mapped)
    program.state.move_to(0.3, 0.3)
    program.tick()
    assert not program.controller.readout(None).compared.mapped


def test_the_instant_picture_is_asked_of_the_graphics_once_and_measured(program: Program) -> None:
    controller = program.controller
    assert not controller.comparing.instant_wanted
    program.compare(partner=INSTANT)
    program.tick()
    assert controller.comparing.instant_wanted and controller.has_partner
    assert controller.picture is not None
    controller.comparing.take_instant(controller.picture, truth(0.5, 0.5))
    program.until(lambda: controller.readout(None).compared.score is not None)
    score = controller.readout(None).compared.score
    assert score is not None
    assert score.psnr == pytest.approx(k16(image_of(program), truth(0.5, 0.5)).psnr, abs=1e-9)
    program.idle(0.5)
    assert not controller.comparing.instant_wanted


def test_the_table_of_models_fills_while_it_is_looked_at_and_nothing_is_computed_twice(program: Program) -> None:
    controller = program.controller
    program.idle()
    assert controller.readout(None).compared.table == ()
    program.state.tab = Tab.COMPARE

    def table() -> dict[str, float | None]:
        return {name: None if score is None else score.psnr for name, score in controller.readout(None).compared.table}

    program.until(lambda: table().get("second") is not None)
    captured = light_field().view(1, 1)
    expected = {name: k16(truth(0.5, 0.5) + made.excess, captured).psnr for name, made in program.models.items()}
    program.until(lambda: bool(controller.messages))  # the third cannot be loaded
    assert table() == pytest.approx({**expected, "broken": None}, abs=1e-6)
    assert controller.picture is not None and controller.picture.synthesis.model == "first"
    asked = [len(made.asked) for made in program.models.values()]
    program.idle()
    assert [len(made.asked) for made in program.models.values()] == asked == [1, 1]
    program.state.move_to(0.3, 0.3)
    program.tick()
    assert controller.readout(None).compared.table == ()  # no captured view


def scores(program: Program) -> list[float | None]:
    return [None if score is None else score.psnr for score in program.controller.readout(None).compared.views]


def test_all_captured_views_are_scored_on_demand_without_driving_anything_out_of_memory() -> None:
    held = SIZE[0] * SIZE[1] * 8 + 1024
    program = Program(cache_bytes=int(3.5 * held))
    try:
        program.state.foresight = False
        program.open()
        program.idle()
        assert sum(score is not None for score in scores(program)) == 1
        program.state.score_all = True
        program.until(lambda: None not in scores(program))
        expected = [
            k16(truth(u, v) + program.models["first"].excess, light_field().view(*divmod(index, 3))).psnr
            for index, (u, v) in enumerate(captured_viewpoints(program.controller.readout(None).grid))  # type: ignore[arg-type]
        ]
        assert scores(program) == pytest.approx(expected, abs=0.02)  # some were scored from memory, as float16
        assert len(program.models["first"].asked) == 9  # each once
        assert (0.5, 0.5) in program.controller.readout(None).cached
        program.idle()
        assert len(program.models["first"].asked) == 9
        assert program.controller.next_frame_in is None
    finally:
        program.controller.stop()


def test_what_foresight_computes_is_scored_and_scores_belong_to_their_model(program: Program) -> None:
    program.state.foresight = True
    program.until(lambda: None not in scores(program))
    first = scores(program)
    program.state.model = "second"
    program.until(lambda: program.controller.readout(None).model == "second" and None not in scores(program))
    assert all(other < one for one, other in zip(first, scores(program), strict=True) if one and other)
    program.state.model = "first"
    program.tick()
    assert scores(program) == first  # kept


def test_views_from_disk_are_scored_without_being_synthesized_again(tmp_path: Path) -> None:
    first = Program(ViewStore(tmp_path))
    try:
        first.open()
        first.until(lambda: ViewStore(tmp_path).usage().views == 9)
    finally:
        first.controller.stop()
    second = Program(ViewStore(tmp_path))
    try:
        second.state.foresight = False
        second.open()
        second.until(lambda: None not in scores(second))
        assert second.models["first"].asked == []
    finally:
        second.controller.stop()


def test_scoring_stops_at_once_when_the_person_does_something(program: Program) -> None:
    first = program.models["first"]
    first.seconds = 60.0
    program.state.score_all = True
    program.until(lambda: len(first.asked) == 2)
    assert "scoring" in program.controller.readout(None).busy
    program.controller.touch()
    program.until(lambda: not program.controller._asking.busy, 0.01)  # long before the 60 s are over
    program.tick(1.0)
    program.until(lambda: len(first.asked) == 3)
    first.seconds = 0.0
    program.state.move_to(0.3, 0.3)
    program.until(lambda: program.controller.step is Step.FULL)


def test_another_protocol_scores_everything_anew_without_synthesizing_anything(program: Program) -> None:
    controller, state = program.controller, program.state
    state.foresight = True
    state.tab = Tab.COMPARE
    program.until(lambda: None not in scores(program))
    before, asked = scores(program), len(program.models["first"].asked)
    program.compare(rule="7x7-Y")
    program.tick()
    assert set(scores(program)) == {None}
    assert controller.readout(None).compared.score is None  # rather than that of another protocol
    program.until(lambda: None not in scores(program) and controller.readout(None).compared.score is not None)
    score = controller.readout(None).compared.score
    expected = luma_score(image_of(program), light_field().view(1, 1))
    assert score is not None and "7x7-Y" in score.protocol
    assert (score.psnr, score.ssim) == pytest.approx((expected.psnr, expected.ssim), abs=2e-3)  # of the picture in memory
    assert len(program.models["first"].asked) == asked
    program.compare(rule="a rule of long ago")
    program.tick()
    assert scores(program) == before  # K16 again, and kept


def test_a_partner_that_fails_is_not_asked_again_here_and_holds_nothing_else_up() -> None:
    class Failing(Shifted):
        def synthesize(self, u: float, v: float, cancelled: Callable[[], bool] = lambda: False) -> Synthesis:
            self.asked.append((u, v))
            raise LfviewError("Not this one.")

    program = Program()
    failing = program.models["second"] = Failing("second", 0.0)
    program.controller.stop()
    choices = {name: ModelChoice(lambda made=made: made, False) for name, made in program.models.items()}  # type: ignore[misc]
    engine = Engine(choices["first"].make, 64 * 2**20, None, None, "first")
    program.controller = Controller(engine, lambda *_: light_field(), lambda: None, "first", models=choices)
    program.state = program.controller.state
    try:
        program.open()
        program.compare(partner="second")
        program.until(lambda: bool(program.controller.messages))
        program.until(lambda: len(program.controller.readout(None).cached) > 1)  # views are computed ahead
        assert failing.asked == [(0.5, 0.5)]
        program.state.move_to(0.3, 0.3)
        program.until(lambda: len(failing.asked) == 2)
    finally:
        program.controller.stop()
