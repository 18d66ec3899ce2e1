"""What the synthesis thread is asked for: one wish at a time, the latest one."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import Enum

from app.engine import Answer, Engine
from app.geometry import Point
from app.worker import Cancel, Done, Job, LatestWorker
from lfcore.lightfield import LightField

SYNTHESIS_NICENESS = 5  # of the thread that asks: scores and files may wait for the frame loop


class Task(Enum):
    """What the synthesis thread can be asked for."""

    QUICK = "the viewpoint, by the model for a hand that moves"
    FINAL = "the viewpoint, by the model for a hand at rest"
    SAVE = "writing a view to disk"
    FETCH = "bringing a view from disk"
    AHEAD = "a viewpoint that may be wanted next"
    COMPARE = "the viewpoint, by another model"
    SCORE = "the score of a captured view"


FOR_NOW = (Task.QUICK, Task.FINAL)
GIVES_WAY = (Task.AHEAD, Task.COMPARE, Task.SCORE)  # to anything else, at once


@dataclass(frozen=True)
class Wish:
    """One thing to be done, for one viewpoint; `model` tells apart what is done for it by several models."""

    task: Task
    at: Point
    model: str = ""
    weighed: bool = False  # with the weights of the inputs, where the model can tell them


@dataclass(frozen=True)
class NotAnswered:
    """Why a wish could not be fulfilled, for the person at the screen; the wish, where it is the latest one."""

    message: str
    wish: Wish | None


@dataclass(frozen=True)
class Answered:
    """A wish has been fulfilled; `answer` is what there is to show of it."""

    wish: Wish
    answer: Answer | None


class Asking:
    """The synthesis thread and its latest wish. All methods belong to the main thread; `wake` is called from the other."""

    def __init__(self, engine: Engine, wake: Callable[[], None]) -> None:
        self.wish: Wish | None = None
        self._engine = engine
        self._worker: LatestWorker[Answered] = LatestWorker("synthesis", wake, SYNTHESIS_NICENESS)
        self._ticket = 0  # of the latest wish
        self._first_ticket = 0  # of the first wish that still counts

    def ask(self, light_field: LightField, wish: Wish | None, useless: bool) -> None:
        """Give the thread what is wanted most, and break off what is not.

        Where there is a model for a hand that moves, anything else gives way to it at once. Where there is none, a query
        that runs for another viewpoint goes on while the hand moves, since it serves to be carried, unless it has become
        `useless`.
        """
        if wish != self.wish:
            before, self.wish = self.wish, wish
            if wish is None:
                self._worker.cancel_all()
                return
            self._ticket = self._worker.submit(self._job(light_field, wish))
            if before is not None and before.task is not Task.QUICK and (self._engine.quick or before.task in GIVES_WAY):
                self._worker.cancel_before(self._ticket)
        running = self._worker.running
        if useless and running is not None and running < self._ticket and not self._engine.quick:
            self._worker.cancel_before(self._ticket)

    def give_up(self) -> None:
        """Break off whatever is being done, and ask for nothing."""
        self._worker.cancel_all()
        self.wish = None

    def forget(self) -> None:
        """As `give_up`; and answers to what was asked so far no longer count."""
        self.give_up()
        self._first_ticket = self._ticket + 1

    def news(self) -> Iterator[Answered | NotAnswered]:
        """What has happened since the last call."""
        while not self._worker.outcomes.empty():
            outcome = self._worker.outcomes.get()
            if not isinstance(outcome, Done):
                yield NotAnswered(outcome.message, self.wish if outcome.ticket == self._ticket else None)
            elif outcome.ticket >= self._first_ticket:
                yield outcome.value

    @property
    def busy(self) -> bool:
        """Whether something is being done, or about to be."""
        return self._worker.busy

    def stop(self, timeout: float) -> None:
        """End the thread."""
        self._worker.stop(timeout)

    def _job(self, light_field: LightField, wish: Wish) -> Job[Answered]:
        engine, (u, v) = self._engine, wish.at

        def job(cancelled: Cancel) -> Answered:
            answer = None
            if wish.task is Task.QUICK:
                answer = engine.quick_answer(light_field, u, v, cancelled)
            elif wish.task is Task.FINAL:
                answer = engine.answer(light_field, u, v, cancelled, wish.weighed)
            elif wish.task is Task.COMPARE:
                answer = engine.answer_by(wish.model, light_field, u, v, cancelled)
            elif wish.task is Task.SCORE:
                engine.find_score(light_field, u, v, cancelled)
            elif wish.task is Task.SAVE:
                engine.save_one()
            elif wish.task is Task.FETCH:
                engine.fetch(light_field, u, v)
            else:
                engine.answer(light_field, u, v, cancelled)
            return Answered(wish, answer)

        return job
