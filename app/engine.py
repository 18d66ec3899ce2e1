"""What the synthesis thread does with one query: the synthesizer, its cache and the score against the captured view.

torch is imported here when the first query runs, in that thread, so that the window is up before.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from app.state import ScoreText
from app.worker import Cancel
from lfcore.cache import CacheKey, SynthesisCache, cache_key
from lfcore.errors import LfviewError
from lfcore.lightfield import FloatArray, LightField
from lfcore.metrics import K16_CROP, k16, psnr, ssim, to_uint8

if TYPE_CHECKING:
    from lfcore.synthesizer import Synthesis, Synthesizer

PERCENTILES = tuple(range(101))
_PERCENTILE_STRIDE = 3  # every third row and column tell a range well enough, in a tenth of the time
SCORES_KEPT = 4096


@dataclass(frozen=True)
class Answer:
    """The synthesis of one viewpoint and what the panels print about it."""

    synthesis: Synthesis
    score: ScoreText | None  # None where (u, v) is on no captured view
    percentiles: tuple[float, ...] | None  # of the disparity in px over the baseline, 0 to 100


class Engine:
    """Answers queries. `answer` belongs to one worker thread; `cached` may be called from any."""

    def __init__(self, make_synthesizer: Callable[[], Synthesizer], cache_bytes: int) -> None:
        self._make_synthesizer = make_synthesizer
        self._synthesizer: Synthesizer | None = None
        self._failure: LfviewError | None = None
        self._light_field: LightField | None = None
        self._scores: dict[CacheKey, ScoreText] = {}
        self.cache = SynthesisCache(cache_bytes)

    @property
    def ready(self) -> bool:
        """Whether the model has been loaded."""
        return self._synthesizer is not None

    @property
    def failed(self) -> bool:
        """Whether the model could not be loaded; it is not tried again."""
        return self._failure is not None

    def prepare(self) -> None:
        """Load the model, where that has not been done; raises the same error each time where it cannot be done."""
        if self._failure is not None:
            raise self._failure
        if self._synthesizer is None:
            try:
                self._synthesizer = self._make_synthesizer()
            except LfviewError as error:
                self._failure = error
                raise

    def answer(self, light_field: LightField, u: float, v: float, cancelled: Cancel) -> Answer:
        """The synthesis of (u, v), from the cache or by the networks, with its score. Runs in the worker thread."""
        known = self.cached(light_field, u, v)
        if known is not None and (known.score is not None or light_field.at(u, v) is None):
            return known
        self.prepare()
        assert self._synthesizer is not None
        key = cache_key(light_field, self._synthesizer, u, v)
        synthesis = known.synthesis if known is not None else self._synthesize(light_field, u, v, cancelled)
        self.cache.put(key, synthesis)
        score = _score(light_field, synthesis)
        if score is not None:
            if len(self._scores) >= SCORES_KEPT:
                self._scores.pop(next(iter(self._scores)))
            self._scores[key] = score
        return Answer(synthesis, score, _percentiles(synthesis.disparity))

    def cached(self, light_field: LightField, u: float, v: float) -> Answer | None:
        """The answer for (u, v) if its synthesis is in the cache; quick enough for the frame loop."""
        if self._synthesizer is None:
            return None
        key = cache_key(light_field, self._synthesizer, u, v)
        synthesis = self.cache.get(key)
        if synthesis is None:
            return None
        return Answer(synthesis, self._scores.get(key), _percentiles(synthesis.disparity))

    def cached_positions(self, light_field: LightField) -> tuple[tuple[float, float], ...]:
        """The viewpoints of this light field that are in the cache."""
        if self._synthesizer is None:
            return ()
        return tuple(self.cache.positions(light_field.content_key, self._synthesizer.key))

    def _synthesize(self, light_field: LightField, u: float, v: float, cancelled: Cancel) -> Synthesis:
        assert self._synthesizer is not None
        if self._light_field is not light_field:
            self._synthesizer.set_light_field(light_field)
            self._light_field = light_field
        return self._synthesizer.synthesize(u, v, cancelled)


def _score(light_field: LightField, synthesis: Synthesis) -> ScoreText | None:
    """The score against the captured view at the synthesis's viewpoint: by K16, or of the whole picture if it is small."""
    place = light_field.at(synthesis.u, synthesis.v)
    if place is None:
        return None
    truth = light_field.view(*place)
    if min(truth.shape[:2]) > 2 * K16_CROP + 11:
        score = k16(synthesis.image, truth)
        return ScoreText(score.psnr, score.ssim, "K16: 8 bits, 22 px cropped")
    a, b = to_uint8(synthesis.image), to_uint8(truth)
    return ScoreText(psnr(a, b), ssim(a, b), "8 bits, whole picture")


def _percentiles(disparity: FloatArray | None) -> tuple[float, ...] | None:
    if disparity is None:
        return None
    values = np.percentile(disparity[::_PERCENTILE_STRIDE, ::_PERCENTILE_STRIDE], PERCENTILES)
    return tuple(float(value) for value in values)


def disparity_range(percentiles: tuple[float, ...], tail: float) -> tuple[float, float]:
    """The disparities below and above which `tail` per cent of the values lie, at least 0.1 px apart."""
    low = float(np.interp(tail, PERCENTILES, percentiles))
    high = float(np.interp(100 - tail, PERCENTILES, percentiles))
    margin = max(0.1 - (high - low), 0.0) / 2
    return low - margin, high + margin
