"""What a query yields and what a model is asked for; without torch, which programs that only ask need not load."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol, cast, runtime_checkable

import numpy as np
import numpy.typing as npt

from lfcore.lightfield import FloatArray, LightField

ByteArray = npt.NDArray[np.uint8]


@dataclass(frozen=True)
class Synthesis:
    """All that one query yields. Arrays are float32; disparity in px over the full corner-to-corner baseline."""

    u: float
    v: float
    model: str
    image: FloatArray  # (H, W, 3), 0 to 1
    disparity: FloatArray | None  # (H, W); None where the model has none
    warped: FloatArray | None  # (4, H, W, 3) in the order of CORNERS
    timings: Mapping[str, float]  # seconds by stage: features, disparity, warp, colour, total
    weights: ByteArray | None = None  # (4, H, W), the inputs' shares in the image, 255 = whole; only where asked for


class LateSynthesis(Synthesis):
    """A Synthesis whose warped inputs are computed when they are first asked for."""

    def with_warped(self, compute: Callable[[], FloatArray]) -> LateSynthesis:
        """Itself, with a way to the warped inputs in place of the field."""
        self.__dict__["_compute"] = compute
        del self.__dict__["warped"]  # so that the property below is asked, once
        return self

    @cached_property
    def warped(self) -> FloatArray:
        """(4, H, W, 3)."""
        return cast(FloatArray, self.__dict__["_compute"]())


def never() -> bool:
    """Is not cancelled."""
    return False


class Synthesizer(Protocol):
    """What the viewer, the command line and the evaluation ask of a model."""

    @property
    def name(self) -> str:
        """The model's name, for people."""

    @property
    def key(self) -> str:
        """Hex digest of model and weights, for caches."""

    def set_light_field(self, light_field: LightField) -> None:
        """Take over the corner views; what does not depend on (u, v) is computed here."""

    def synthesize(self, u: float, v: float, cancelled: Callable[[], bool] = never) -> Synthesis:
        """The view at (u, v). Raises InputError outside the allowed range, Cancelled once `cancelled()` holds."""


@runtime_checkable
class WeighingSynthesizer(Synthesizer, Protocol):
    """A model whose image may be a weighted sum of the warped inputs, and which can tell the weights."""

    @property
    def weighs(self) -> bool:
        """Whether it is such a sum."""

    def synthesize_weighed(self, u: float, v: float, cancelled: Callable[[], bool] = never) -> Synthesis:
        """As `synthesize`, with the weights."""


def weighs(synthesizer: Synthesizer) -> bool:
    """Whether the synthesizer can tell weights."""
    return isinstance(synthesizer, WeighingSynthesizer) and synthesizer.weighs
