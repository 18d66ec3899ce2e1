"""The syntheses of what the two eyes of a stereo pair see, as far as they are in memory."""

from __future__ import annotations

from collections.abc import Container

from app.engine import Answer, Engine
from app.geometry import Point
from app.state import ViewState, clamp_viewpoint
from lfcore.cache import rounded
from lfcore.lightfield import LightField


class Eyes:
    """What is known of the eyes' viewpoints by the model for a hand at rest. Belongs to the main thread."""

    def __init__(self, engine: Engine) -> None:
        self.answers: dict[Point, Answer] = {}  # by viewpoint, of the pair that is looked at
        self._engine = engine

    def look_up(self, light_field: LightField, state: ViewState, cached: Container[Point]) -> None:
        """Take what is in memory; `cached`: the viewpoints that are."""
        found = {eye: self.answers.get(eye) for eye in _wanted(state) if rounded(*eye) in cached}
        answers = {eye: known or self._engine.cached(light_field, *eye) for eye, known in found.items()}
        self.answers = {eye: answer for eye, answer in answers.items() if answer is not None}

    def missing(self, state: ViewState, cached: Container[Point]) -> Point | None:
        """An eye's viewpoint that is not in memory, or None."""
        return next((eye for eye in _wanted(state) if rounded(*eye) not in cached), None)

    def forget(self) -> None:
        """Another light field or model has come."""
        self.answers = {}


def _wanted(state: ViewState) -> tuple[Point, ...]:
    """The eyes' viewpoints that can be synthesized, where a pair is looked at."""
    if not state.look.is_stereo:
        return ()
    return tuple(eye for eye in state.focusing.eyes((state.u, state.v)) if clamp_viewpoint(*eye) == eye)
