"""Choosing another model while a light field is open."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

from moving_scene import TruthSynthesizer, light_field

from app.controller import Controller
from app.engine import Engine, ModelChoice
from app.opening import SHIPPED, is_slow, offered_models
from app.state import Step
from lfcore.errors import WeightsError
from lfcore.nearest_inputs import NEIGHBOURS
from lfcore.remote import SynthesisProcess
from lfcore.synthesis import Synthesis, Synthesizer
from lfcore.synthesizer import MODEL_NAMES


class Named(TruthSynthesizer):
    """The truth under another name."""

    def __init__(self, name: str) -> None:
        super().__init__()
        self.name = self.key = name

    def synthesize(self, u: float, v: float, cancelled: Callable[[], bool] = lambda: False) -> Synthesis:
        return super().synthesize(u, v, cancelled)


class Program:
    """A controller with three models, of which one cannot be loaded."""

    def __init__(self) -> None:
        self.made: dict[str, Named] = {}
        choices = {name: ModelChoice(self.factory(name), False) for name in ("first", "second", "broken")}
        engine = Engine(choices["first"].make, 64 * 2**20, name="first")
        self.controller = Controller(engine, lambda *_: light_field(), lambda: None, "first", models=choices)
        self.now = 100.0

    def factory(self, name: str) -> Callable[[], Synthesizer]:
        def make() -> Synthesizer:
            if name == "broken":
                raise WeightsError("broken has no weights.")
            assert name not in self.made  # each is loaded once
            self.made[name] = Named(name)
            return self.made[name]

        return make

    def until(self, condition: Callable[[], bool]) -> None:
        deadline = time.monotonic() + 60
        while not condition():
            assert time.monotonic() < deadline
            self.now += 0.05
            self.controller.tick(self.now)
            time.sleep(0.002)

    def on_screen(self) -> str:
        """The model of the finished picture of the viewpoint on screen."""
        picture = self.controller.picture
        if picture is None or not picture.final or (picture.synthesis.u, picture.synthesis.v) != self.controller.viewpoint:
            return ""
        return picture.synthesis.model


def test_another_model_answers_for_the_same_viewpoint_and_the_first_is_taken_up_again() -> None:
    program = Program()
    controller = program.controller
    controller.state.foresight = False
    controller.open(Path("any"))
    program.until(lambda: program.on_screen() == "first")
    controller.state.move_to(0.3, 0.6)
    program.until(lambda: program.on_screen() == "first")
    controller.state.model = "second"
    program.until(lambda: program.on_screen() == "second")
    assert controller.viewpoint == (0.3, 0.6) and program.made["second"].asked == [(0.3, 0.6)]
    assert controller.readout(None).model == "second" and controller.step is Step.FULL
    asked = len(program.made["first"].asked)
    controller.state.model = "first"
    program.until(lambda: program.on_screen() == "first")
    assert len(program.made["first"].asked) == asked  # it was still in the cache
    controller.stop()


def test_a_model_that_cannot_be_loaded_says_so_and_another_can_be_chosen() -> None:
    program = Program()
    controller = program.controller
    controller.state.foresight = False
    controller.open(Path("any"))
    program.until(lambda: program.on_screen() == "first")
    controller.state.model = "broken"
    program.until(lambda: bool(controller.messages))
    assert controller.messages == ["broken has no weights."]
    controller.state.model = "second"
    program.until(lambda: program.on_screen() == "second")
    controller.stop()


def test_the_shipped_models_are_offered_and_a_weight_file_besides() -> None:
    assert (*MODEL_NAMES, NEIGHBOURS) == SHIPPED
    process = SynthesisProcess()  # never started
    offered = offered_models("full", process)
    assert list(offered) == list(SHIPPED)
    assert [name for name, choice in offered.items() if not choice.scored] == [NEIGHBOURS]
    made = offered[NEIGHBOURS].make()
    assert made.name == NEIGHBOURS and process.pid is None  # its key is read from the file of the small networks
    assert list(offered_models("some/where/mine.safetensors", process)) == [*SHIPPED, "mine.safetensors"]
    assert is_slow("full") and is_slow("mine.safetensors") and not is_slow("mean")
