"""The picture on screen against its partner: which synthesis by another model belongs to it, and how far the two are apart.

What is measured are the very arrays that are shown, once the picture is complete, in a thread of its own.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from app import scoring
from app.asking import SYNTHESIS_NICENESS, Task, Wish
from app.comparison import Comparison, Difference, Source
from app.engine import Answer, Engine
from app.geometry import Point
from app.readout import ScoreText
from app.worker import Done, LatestWorker
from lfcore.lightfield import FloatArray, LightField

STOP_SECONDS = 5.0


@dataclass(frozen=True)
class _Subject:
    """What a measurement is of; `difference` is the map that is wanted beside the score."""

    shown: FloatArray  # (H, W, 3)
    partner: FloatArray  # (H, W, 3)
    difference: Difference | None
    rule: str

    def same_score(self, other: _Subject | None) -> bool:
        """Whether the other is of the very same arrays, and by the same rule."""
        return other is not None and (self.shown is other.shown and self.partner is other.partner and self.rule == other.rule)


@dataclass(frozen=True)
class Measured:
    """How far the picture and its partner are apart; `values` is the map (H, W) that was wanted, nan where it has none."""

    score: ScoreText
    difference: Difference | None
    values: FloatArray | None


class Comparing:
    """The partner of the picture on screen. All methods belong to the main thread; `wake` is called from another."""

    def __init__(self, engine: Engine, wake: Callable[[], None]) -> None:
        self.answer: Answer | None = None  # the synthesis of the viewpoint by the partner, where that is a model
        self.measured: Measured | None = None
        self.instant_wanted = False  # the instant picture is to be read from the graphics, see `take_instant`
        self._engine = engine
        self._worker: LatestWorker[Measured] = LatestWorker("measuring", wake, SYNTHESIS_NICENESS)
        self._ticket = 0
        self._place: tuple[LightField, str | None, Point] | None = None  # what `answer` is for
        self._given_up: tuple[LightField, str | None, Point] | None = None  # the place where that failed
        self._subject: _Subject | None = None  # what `measured` is of, or will be
        self._captured: tuple[Point, FloatArray] | None = None  # the captured view there
        self._instant: tuple[Answer, FloatArray] | None = None  # the instant picture beside that one

    def forget(self) -> None:
        """Another light field, or none."""
        self.answer = self._place = self._given_up = self._captured = self._instant = None
        self.instant_wanted = False
        self._drop()

    def stop(self) -> None:
        """End the thread."""
        self._worker.stop(STOP_SECONDS)

    def follow(self, light_field: LightField, viewpoint: Point, comparison: Comparison) -> None:
        """The viewpoint, or the partner, may have changed: find the partner's synthesis, if it is in memory."""
        model = comparison.model
        place = (light_field, model, viewpoint)
        if self._place is None or self._place[0] is not light_field or place[1:] != self._place[1:]:
            self._place = place
            self.answer = self._engine.cached_by(model, light_field, *viewpoint) if model is not None else None

    def wish(self) -> Wish | None:
        """What the synthesis thread is to do for the partner."""
        if self._place is None or self.answer is not None:
            return None
        _, model, viewpoint = self._place
        if model is None or self._engine.failed_by(model) or self._place == self._given_up:
            return None
        return Wish(Task.COMPARE, viewpoint, model)

    def give_up(self) -> None:
        """The partner cannot be synthesized here; it is tried again at another viewpoint."""
        self._given_up = self._place

    def take(self, wish: Wish, answer: Answer) -> None:
        """A synthesis by another model has come."""
        if self._place is not None and (wish.model, wish.at) == self._place[1:]:
            self.answer = answer

    def measure(self, light_field: LightField, picture: Answer | None, comparison: Comparison, mapped: bool) -> None:
        """Begin to measure the picture, if it is complete, against its partner. mapped: a map of that is looked at."""
        difference = comparison.difference if mapped and comparison.difference.measured else None
        partner = self._partner_of(light_field, picture, comparison.source, difference is not None)
        if picture is None or partner is None:
            self._drop()
            return
        subject = _Subject(picture.synthesis.image, partner, difference, comparison.rule)
        same = subject.same_score(self._subject)
        if same and self._subject is not None and subject.difference is self._subject.difference:
            return
        score = self.measured.score if same and self.measured is not None else None
        self._drop()
        self._subject = subject
        if score is not None:
            self.measured = Measured(score, None, None)
            if difference is None:
                return
        self._ticket = self._worker.submit(lambda cancelled: _measured(subject, score))

    def news(self) -> list[str]:
        """Take what has been measured since the last call. Returns messages for the person at the screen."""
        messages = []
        while not self._worker.outcomes.empty():
            outcome = self._worker.outcomes.get()
            if not isinstance(outcome, Done):
                messages.append(outcome.message)
            elif outcome.ticket == self._ticket and self._subject is not None:
                self.measured = outcome.value
        return messages

    def take_instant(self, picture: Answer, image: FloatArray) -> None:
        """The instant picture (H, W, 3) of that picture's viewpoint, as the graphics have drawn it."""
        self._instant = (picture, image)
        self.instant_wanted = False

    def _partner_of(self, light_field: LightField, picture: Answer | None, source: Source, mapped: bool) -> FloatArray | None:
        """What the picture is to be measured against; None where there is nothing to be measured, or not yet."""
        self.instant_wanted = False
        if picture is None or not picture.final:
            return None
        if source is Source.MODEL:
            return self.answer.synthesis.image if self.answer is not None else None
        if source is Source.INSTANT:
            if self._instant is not None and self._instant[0] is picture:
                return self._instant[1]
            self.instant_wanted = picture.synthesis.disparity is not None
            return None
        return self._captured_at(light_field, (picture.synthesis.u, picture.synthesis.v)) if mapped else None  # scored already

    def _captured_at(self, light_field: LightField, at: Point) -> FloatArray | None:
        place = light_field.at(*at)
        if place is None:
            return None
        if self._captured is None or self._captured[0] != at:
            self._captured = (at, light_field.view(*place))
        return self._captured[1]

    def _drop(self) -> None:
        """What has been measured, or is being, no longer counts."""
        if self._subject is not None:
            self._worker.cancel_all()
        self.measured = self._subject = None


def _measured(subject: _Subject, score: ScoreText | None) -> Measured:
    """score: of the two, where it is known."""
    score = score or scoring.score(subject.rule, subject.shown, subject.partner)
    if subject.difference is None:
        return Measured(score, None, None)
    rule = scoring.rule_for(subject.rule, *subject.shown.shape[:2])
    compute = rule.similarity if subject.difference is Difference.SIMILARITY else rule.blocks
    return Measured(score, subject.difference, compute(subject.shown, subject.partner))
