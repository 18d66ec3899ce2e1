"""Scores of synthesized views against the captured ones: all that have been found, and what is still to be found."""

from __future__ import annotations

import math
from collections.abc import Container, Iterable

from app.engine import Engine
from app.foresight import captured_viewpoints
from app.geometry import Point
from app.readout import ScoreText
from app.state import Grid
from lfcore.cache import rounded
from lfcore.lightfield import LightField


class Scoreboard:
    """What is known of the light field that is open. All methods belong to the main thread."""

    def __init__(self, engine: Engine, models: Iterable[str]) -> None:
        self.views: tuple[ScoreText | None, ...] = ()  # of the model for a hand at rest, by number of the captured view
        self._engine = engine
        self._models = tuple(models)
        self._unscored: tuple[Point, ...] = ()  # captured viewpoints

    def refresh(self, light_field: LightField | None, grid: Grid | None) -> None:
        """Take over what the engine has found."""
        if light_field is None or grid is None:
            self.views, self._unscored = (), ()
            return
        found = self._engine.scores(light_field)
        missing = captured_viewpoints(grid) if self._engine.scored else []
        self._unscored = tuple(point for point in missing if rounded(*point) not in found)
        self.views = tuple(found.get(rounded(*grid.position(index))) for index in range(grid.rows * grid.columns))

    def table(self, light_field: LightField, here: Point) -> tuple[tuple[str, ScoreText | None], ...]:
        """The models and their scores at a viewpoint."""
        return tuple((model, self._engine.score_by(model, light_field, *here)) for model in self._models)

    def missing_model(self, light_field: LightField, here: Point) -> str | None:
        """A model whose score at a captured viewpoint is still to be found."""
        for model, score in self.table(light_field, here):
            if score is None and self._engine.scored_by(model) and not self._engine.failed_by(model):
                return model
        return None

    @property
    def never_scored(self) -> frozenset[str]:
        """The models whose pictures are not scored against captured views."""
        return frozenset(model for model in self._models if not self._engine.scored_by(model))

    def missing_view(self, here: Point, among: Container[Point] | None = None) -> Point | None:
        """The nearest captured viewpoint that has no score yet; `among`: only these, as caches know them."""
        points = self._unscored
        if among is not None:
            points = tuple(point for point in points if rounded(*point) in among)
        return min(points, key=lambda point: math.dist(point, here), default=None)
