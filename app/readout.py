"""What the panels print, as plain values: gathered by the controller once a frame."""

from __future__ import annotations

from dataclasses import dataclass, field

from app.desk import Shelf
from app.exporting import Status
from app.focusing import FocusFacts
from app.geometry import Point
from app.samples import Samples
from app.state import Grid, Step


@dataclass(frozen=True)
class Caption:
    """What is said about a picture or a map of a Lytro file without raw: its name and size (pixels); for a picture of the
    refocus stack its focus in lambda; for a map the least and the greatest value, and their unit."""

    label: str
    width: int
    height: int
    focus: float | None = None
    span: tuple[float, float] | None = None
    unit: str = ""


@dataclass(frozen=True)
class ScoreText:
    """PSNR (dB) and SSIM of the synthesis on screen against the captured view, and the protocol they follow."""

    psnr: float
    ssim: float
    protocol: str


@dataclass(frozen=True)
class Compared:
    """The picture on screen against its partner, and what is known of scores."""

    there: bool = False  # whether the partner has a picture of this viewpoint
    score: ScoreText | None = None  # of the picture on screen against its partner
    mapped: bool = False  # the map of their difference that is looked at has been computed
    table: tuple[tuple[str, ScoreText | None], ...] = ()  # models and their scores against the captured view
    views: tuple[ScoreText | None, ...] = ()  # of this model, by number of the captured view
    never_scored: frozenset[str] = frozenset()  # models whose inputs are captured views


@dataclass(frozen=True)
class Readout:
    """What the panels print: facts of the frame on screen, gathered by the controller."""

    model: str = ""
    models: tuple[str, ...] = ()  # to choose from
    grid: Grid | None = None
    name: str = ""
    kind: str = ""
    source: str = ""
    warnings: tuple[str, ...] = ()
    facts: tuple[tuple[str, str], ...] = ()
    step: Step = Step.BLEND
    step_ms: float | None = None
    from_cache: bool = False  # the synthesis on screen was there already
    busy: str = ""  # what the workers are doing, in words; empty when idle
    loading: float | None = None  # fraction read of the light field being opened, None when none is
    loading_name: str = ""
    messages: tuple[str, ...] = ()
    timings: tuple[tuple[str, float], ...] = ()  # seconds by stage of the newest synthesis
    disparity_range: tuple[float, float] | None = None  # px over the baseline, at the chosen percentiles
    has_disparity: bool = False
    disparity_under_cursor: float | None = None
    captured_here: int | None = None  # number of the captured view at (u, v)
    inputs: frozenset[tuple[int, int]] = frozenset()  # (row, column) of the captured views that the model is given there
    compared: Compared = field(default_factory=Compared)
    focus: FocusFacts = field(default_factory=FocusFacts)
    weighed: bool = False  # the weights of the inputs in the newest synthesis are known
    samples: Samples | None = None  # the values behind the picture, where they are known
    captions: tuple[Caption, ...] = ()  # of what a Lytro file without raw shows; `kind` then says what it is
    value_under_cursor: float | None = None  # in the unit of the caption
    cached: tuple[Point, ...] = ()  # viewpoints in the cache
    cache_bytes: int = 0
    cache_limit: int = 0
    cache_hits: int = 0
    shelf: Shelf = field(default_factory=Shelf)  # files to choose from
    exports: tuple[Status, ...] = ()  # in the order in which they came
    exporting: str = ""  # how far exports are, or what has just been written, in words; empty when there is nothing to say
