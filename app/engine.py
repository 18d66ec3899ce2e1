"""What the synthesis thread does with one query: the models, the caches in memory and on disk, the score."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from app.geometry import Point
from app.painting import in_bytes
from app.readout import ScoreText
from app.scoring import DEFAULT_RULE
from app.scoring import score as scored
from app.state import Step
from app.worker import Cancel
from lfcore.cache import CacheKey, SynthesisCache, cache_key, held_bytes
from lfcore.errors import InputError, LfviewError, OutputError, WeightsError
from lfcore.lightfield import FloatArray, LightField
from lfcore.store import ViewStore
from lfcore.synthesis import Synthesis, Synthesizer, WeighingSynthesizer, weighs

MakeSynthesizer = Callable[[], Synthesizer]

PERCENTILES = tuple(range(101))
_PERCENTILE_STRIDE = 3  # every third row and column tell a range well enough, in a tenth of the time
SCORES_KEPT = 4096
_NAME_OF_SMALL_NETWORKS = "realtime"
_ROOM_LEFT = 0.1  # of the memory cache, for what the hand itself asks for


@dataclass(frozen=True)
class ModelChoice:
    """A model that the person may choose. stands_in: whether the quick model serves in its place while the hand moves. scored:
    whether its pictures are scored against captured views; not where those around the viewpoint are its inputs."""

    make: MakeSynthesizer
    stands_in: bool
    scored: bool = True


@dataclass(frozen=True)
class Answer:
    """The synthesis of one viewpoint and what the canvas and the panels want to know about it."""

    synthesis: Synthesis
    pixels: npt.NDArray[np.uint8]  # (H, W, 4), the synthesized image in 8 bits
    step: Step
    final: bool  # made by the model for a hand at rest
    kept: bool  # was in memory or on disk already
    score: ScoreText | None  # None where (u, v) is on no captured view, or not final
    percentiles: tuple[float, ...] | None  # of the disparity in px over the baseline, 0 to 100


class _Model:
    """A synthesizer that is made when first needed, and takes over a light field when it is another than the last."""

    def __init__(self, make: MakeSynthesizer, scored: bool = True) -> None:
        self._make = make
        self.scored = scored
        self._light_field: LightField | None = None
        self.synthesizer: Synthesizer | None = None
        self.failure: LfviewError | None = None
        self.has_answered = False

    def prepare(self) -> Synthesizer:
        """Load the model, where that has not been done; raises the same error each time where there is no such model."""
        if self.failure is not None:
            raise self.failure
        if self.synthesizer is None:
            try:
                self.synthesizer = self._make()
            except (InputError, WeightsError) as error:
                self.failure = error
                raise
        return self.synthesizer

    def synthesize(self, light_field: LightField, u: float, v: float, cancelled: Cancel, weighed: bool = False) -> Synthesis:
        synthesizer = self.prepare()
        if self._light_field is not light_field:
            synthesizer.set_light_field(light_field)
            self._light_field = light_field
        ask = synthesizer.synthesize
        if weighed and isinstance(synthesizer, WeighingSynthesizer):
            ask = synthesizer.synthesize_weighed
        try:
            synthesis = ask(u, v, cancelled)
        except WeightsError as error:  # of a model that is loaded with its first query
            self.failure = error
            raise
        self.has_answered = True
        return synthesis


class Engine:
    """Answers queries. What computes or reads belongs to one worker thread; the properties, `cached`, `cached_positions` and
    `stored_position` may be used from any.

    `make_synthesizer`: the model for a hand at rest, which `use` finds again by `name`, and in whose place it puts others;
    `scored`: see ModelChoice.
    `make_quick`: a faster one for a hand that moves; without it the first serves both. `store`: where views of the first are
    kept on disk.
    """

    def __init__(
        self,
        make_synthesizer: MakeSynthesizer,
        cache_bytes: int,
        make_quick: MakeSynthesizer | None = None,
        store: ViewStore | None = None,
        name: str = "",
        scored: bool = True,
    ) -> None:
        self.cache = SynthesisCache(cache_bytes)
        self._final = _Model(make_synthesizer, scored)
        self._models = {name: self._final}  # by name; those that have been used
        self._stands_in = True  # whether the quick model may serve in place of the other
        self._quick = _Model(make_quick) if make_quick is not None else None
        self._store = store
        self._tidied = False
        self._stored_of: tuple[str, str] | None = None  # content of a light field, key of the model for a hand at rest
        self._stored: frozenset[Point] = frozenset()  # viewpoints of these on disk
        self._unsaved: dict[CacheKey, None] = {}  # in the order in which they came
        self.rule = DEFAULT_RULE  # by which views are scored; the main thread may change it
        self._scores: dict[tuple[CacheKey, str], ScoreText] = {}  # by view and rule

    def use(self, name: str, choice: ModelChoice) -> None:
        """Take another model for a hand at rest; one that was used under this name before is taken up again.

        Belongs to the main thread; a query that runs is answered by the model it began with.
        """
        self.know(name, choice)
        self._stands_in = choice.stands_in
        self._final = self._models[name]
        self._stored_of, self._stored = None, frozenset()

    def know(self, name: str, choice: ModelChoice) -> None:
        """Make a model known by its name, if it is not yet; it is loaded when it is first asked for something."""
        self._models.setdefault(name, _Model(choice.make, choice.scored))

    @property
    def ready(self) -> bool:
        """Whether a model is known to have been loaded, since it has answered."""
        return any(model is not None and model.has_answered for model in (self._final, self._quick))

    @property
    def failed(self) -> bool:
        """Whether that model could not be loaded; it is not tried again."""
        return self._final.failure is not None

    @property
    def quick(self) -> bool:
        """Whether there is a model for a hand that moves."""
        return self._stands_in and self._quick is not None and self._quick.failure is None

    @property
    def scored(self) -> bool:
        """Whether pictures of the model for a hand at rest are scored against captured views."""
        return self._final.scored

    @property
    def weighs(self) -> bool:
        """Whether the model for a hand at rest can tell how much of each input is in its picture."""
        return self._final.synthesizer is not None and weighs(self._final.synthesizer)

    def quick_answer(self, light_field: LightField, u: float, v: float, cancelled: Cancel) -> Answer:
        """The synthesis of (u, v) by the model for a hand that moves; or that of the other where it lies on disk, which is
        quicker still, and may be so before any model has been loaded. It is not kept: making it again is quick."""
        assert self._quick is not None
        if self._lies_on_disk(light_field, u, v):
            return self.answer(light_field, u, v, cancelled)
        return _answer(self._quick.synthesize(light_field, u, v, cancelled), final=False, kept=False, score=None)

    def answer(self, light_field: LightField, u: float, v: float, cancelled: Cancel, weighed: bool = False) -> Answer:
        """The synthesis of (u, v), from memory, from disk or by the model, with its score. weighed: with the weights of the
        inputs too, where the model can tell them; then it may have to be made again."""
        return self._answered(self._final, light_field, u, v, cancelled, weighed and self.weighs)

    def answer_by(self, name: str, light_field: LightField, u: float, v: float, cancelled: Cancel) -> Answer:
        """The same by a known model, whichever serves the hand."""
        return self._answered(self._models[name], light_field, u, v, cancelled)

    def cached(self, light_field: LightField, u: float, v: float) -> Answer | None:
        """The answer for (u, v) if its synthesis is in memory; quick enough for the frame loop."""
        return self._cached(self._final, light_field, u, v)

    def cached_by(self, name: str, light_field: LightField, u: float, v: float) -> Answer | None:
        """The same by a known model."""
        return self._cached(self._models[name], light_field, u, v)

    def scored_by(self, name: str) -> bool:
        """Whether pictures of a known model are scored against captured views."""
        return self._models[name].scored

    def failed_by(self, name: str) -> bool:
        """Whether a known model could not be loaded."""
        return self._models[name].failure is not None

    def score_by(self, name: str, light_field: LightField, u: float, v: float) -> ScoreText | None:
        """The score of a known model at (u, v), if it has been found."""
        synthesizer = self._models[name].synthesizer
        return None if synthesizer is None else self._scores.get((cache_key(light_field, synthesizer, u, v), self.rule))

    def scores(self, light_field: LightField) -> dict[Point, ScoreText]:
        """The scores found by the present rule for the model for a hand at rest, by viewpoint as caches know it."""
        synthesizer = self._final.synthesizer
        if synthesizer is None:
            return {}
        of = (light_field.content_key, synthesizer.key, self.rule)
        known = self._scores.copy().items()
        return {(key.u, key.v): found for (key, rule), found in known if (key.content, key.model, rule) == of}

    def _answered(
        self, model: _Model, light_field: LightField, u: float, v: float, cancelled: Cancel, weighed: bool = False
    ) -> Answer:
        known = self._cached(model, light_field, u, v)
        if weighed and (known is None or known.synthesis.weights is None):
            return self._weighed(model, light_field, u, v, cancelled)
        if known is not None and (known.score is not None or not model.scored or light_field.at(u, v) is None):
            return known
        key = cache_key(light_field, model.prepare(), u, v)
        synthesis = known.synthesis if known is not None else self._from_disk(model, light_field, key, u, v)
        kept = synthesis is not None
        if synthesis is None:
            synthesis = model.synthesize(light_field, u, v, cancelled)
            if self._store is not None:
                self._unsaved[key] = None
        self.cache.put(key, synthesis)
        return _answer(synthesis, final=True, kept=kept, score=self._keep_score(model, light_field, key, synthesis))

    def _weighed(self, model: _Model, light_field: LightField, u: float, v: float, cancelled: Cancel) -> Answer:
        """Made by the model in any case, since weights are not kept on disk."""
        key = cache_key(light_field, model.prepare(), u, v)
        synthesis = model.synthesize(light_field, u, v, cancelled, weighed=True)
        self.cache.put(key, synthesis)
        if self._store is not None and (key.u, key.v) not in self._stored:
            self._unsaved[key] = None
        return _answer(synthesis, final=True, kept=False, score=self._keep_score(model, light_field, key, synthesis))

    def _keep_score(self, model: _Model, light_field: LightField, key: CacheKey, synthesis: Synthesis) -> ScoreText | None:
        if not model.scored:
            return None
        rule = self.rule
        found = _score(light_field, synthesis, rule)
        if found is not None:
            if len(self._scores) >= SCORES_KEPT:
                self._scores.pop(next(iter(self._scores)))
            self._scores[(key, rule)] = found
        return found

    def _cached(self, model: _Model, light_field: LightField, u: float, v: float) -> Answer | None:
        if model.synthesizer is None:
            return None
        key = cache_key(light_field, model.synthesizer, u, v)
        synthesis = self.cache.get(key)
        if synthesis is None:
            return None
        score = self._scores.get((key, self.rule))
        return _answer(dataclasses.replace(synthesis, u=u, v=v), final=True, kept=True, score=score)

    def cached_positions(self, light_field: LightField) -> tuple[Point, ...]:
        """The viewpoints of this light field that are in memory."""
        synthesizer = self._final.synthesizer
        if synthesizer is None:
            return ()
        return tuple(self.cache.positions(light_field.content_key, synthesizer.key))

    # What is done while nothing is asked.

    @property
    def unsaved(self) -> CacheKey | None:
        """A view that is to be written to disk, or None."""
        return next(iter(tuple(self._unsaved)), None)

    def save_one(self) -> None:
        """Write a view to disk. Raises OutputError once, and then goes on without the disk."""
        if self._store is None or not self._unsaved:
            return
        key = next(iter(self._unsaved))
        del self._unsaved[key]
        synthesis = self.cache.get(key)
        if synthesis is not None:
            self._keep_on_disk(key, synthesis)

    def _keep_on_disk(self, key: CacheKey, synthesis: Synthesis) -> None:
        if self._store is None:
            return
        try:
            self._store.put(key, synthesis)
            if self._stored_of == (key.content, key.model):
                self._stored |= {(key.u, key.v)}
        except OutputError as error:
            self._store = None
            self._stored = frozenset()
            self._unsaved.clear()
            raise OutputError(f"Synthesized views are not kept on disk from now on: {error}") from error

    def stored_position(self, light_field: LightField) -> Point | None:
        """A viewpoint of this light field that is on disk, not in memory, and for which there is room there, or None."""
        synthesizer = self._final.synthesizer
        if synthesizer is None or self._stored_of != (light_field.content_key, synthesizer.key):
            return None
        if not self.has_room(light_field):
            return None
        return next(iter(self._stored.difference(self.cached_positions(light_field))), None)

    def fetch(self, light_field: LightField, u: float, v: float) -> None:
        """Bring a view from disk into memory."""
        model = self._final
        key = cache_key(light_field, model.prepare(), u, v)
        synthesis = self._from_disk(model, light_field, key, u, v)
        if synthesis is not None:
            self.cache.put(key, synthesis)

    def find_score(self, light_field: LightField, u: float, v: float, cancelled: Cancel) -> None:
        """Score the view at (u, v), a captured one. Its synthesis is kept in memory only where there is room."""
        model = self._final
        key = cache_key(light_field, model.prepare(), u, v)
        synthesis = self.cache.get(key) or self._from_disk(model, light_field, key, u, v)
        if synthesis is None and self.has_room(light_field):
            self._answered(model, light_field, u, v, cancelled)
            return
        if synthesis is None:
            synthesis = model.synthesize(light_field, u, v, cancelled)
            self._keep_on_disk(key, synthesis)
        self._keep_score(model, light_field, key, dataclasses.replace(synthesis, u=u, v=v))

    def has_room(self, light_field: LightField) -> bool:
        """Whether memory holds another view of this light field without driving one out."""
        wanted = held_bytes(light_field.height, light_field.width)
        return self.cache.bytes_used + wanted <= (1 - _ROOM_LEFT) * self.cache.limit_bytes

    def _from_disk(self, model: _Model, light_field: LightField, key: CacheKey, u: float, v: float) -> Synthesis | None:
        if self._store is None:
            return None
        if model is self._final and self._stored_of != (key.content, key.model):
            self._list_stored(key)
        synthesis = self._store.get(key, (light_field.height, light_field.width))
        if synthesis is None:
            if self._stored_of == (key.content, key.model):
                self._stored -= {(key.u, key.v)}  # damaged, or removed by another program
            return None
        return dataclasses.replace(synthesis, u=u, v=v)

    def _lies_on_disk(self, light_field: LightField, u: float, v: float) -> bool:
        """Whether a view by the model for a hand at rest does."""
        if self._store is None or self._final.failure is not None:
            return False
        try:
            synthesizer = self._final.prepare()
        except LfviewError:
            self._final.failure = None  # it is tried again, and what is wrong said, when a view by it is asked for
            return False
        key = cache_key(light_field, synthesizer, u, v)
        if self._stored_of != (key.content, key.model):
            self._list_stored(key)
        return (key.u, key.v) in self._stored

    def _list_stored(self, key: CacheKey) -> None:
        assert self._store is not None
        if not self._tidied:
            self._tidied = True
            self._store.tidy()
        self._stored = frozenset(self._store.positions(key.content, key.model))
        self._stored_of = (key.content, key.model)


def _answer(synthesis: Synthesis, *, final: bool, kept: bool, score: ScoreText | None) -> Answer:
    step = Step.REALTIME if synthesis.model == _NAME_OF_SMALL_NETWORKS else Step.FULL
    return Answer(synthesis, in_bytes(synthesis.image), step, final, kept, score, _percentiles(synthesis.disparity))


def _score(light_field: LightField, synthesis: Synthesis, rule: str) -> ScoreText | None:
    """The score against the captured view at the synthesis's viewpoint, None where there is none."""
    place = light_field.at(synthesis.u, synthesis.v)
    return None if place is None else scored(rule, synthesis.image, light_field.view(*place))


def _percentiles(disparity: FloatArray | None) -> tuple[float, ...] | None:
    if disparity is None:
        return None
    # Sorted once, which is several times as fast as np.percentile, and holds the others' interpreter lock for less.
    values = np.sort(disparity[::_PERCENTILE_STRIDE, ::_PERCENTILE_STRIDE], axis=None)
    places = np.multiply(PERCENTILES, (len(values) - 1) / 100)
    return tuple(np.interp(places, np.arange(len(values)), values).tolist())


@lru_cache(maxsize=8)  # it is asked for several times in each frame
def disparity_range(percentiles: tuple[float, ...], tail: float) -> tuple[float, float]:
    """The disparities below and above which `tail` per cent of the values lie, at least 0.1 px apart."""
    low = float(np.interp(tail, PERCENTILES, percentiles))
    high = float(np.interp(100 - tail, PERCENTILES, percentiles))
    margin = max(0.1 - (high - low), 0.0) / 2
    return low - margin, high + margin
