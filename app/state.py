"""What the window shows, as plain values: no GL ids, no tensors, no imgui. Panels change them, the canvas draws by them."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import Enum

from app.comparison import Comparison
from app.desk import Desk
from app.export_choices import ExportChoices
from app.focusing import Focusing
from app.geometry import Point, Zoom
from app.limits import within
from app.looking import Looking
from lfcore.lightfield import EXTRAPOLATION_LIMIT

GAIN_LIMITS = (1.0, 64.0)
TAIL_LIMITS = (0.0, 20.0)


class Look(Enum):
    """A way of looking at the textures of one viewpoint; the value is the name on screen."""

    SYNTHESIS = "Synthesis"
    DISPARITY = "Disparity"
    WARPED_ALL = "Warped inputs, all four"
    WARPED_TOP_LEFT = "Warped input, top left"
    WARPED_BOTTOM_LEFT = "Warped input, bottom left"
    WARPED_TOP_RIGHT = "Warped input, top right"
    WARPED_BOTTOM_RIGHT = "Warped input, bottom right"
    ERROR = "Difference"
    LEAN = "Which input it leans on"
    DISAGREEMENT = "Where the warped inputs disagree"
    SWEEP_MEAN = "Plane sweep, mean"
    SWEEP_DEVIATION = "Plane sweep, deviation"
    REFOCUS = "Refocused"
    ANAGLYPH = "Stereo, red and cyan"
    STEREO_PARALLEL = "Stereo, side by side"
    STEREO_CROSSED = "Stereo, crossed eyes"

    @property
    def corner(self) -> int | None:
        """Index into lightfield.CORNERS of the one warped input that this look shows, or None."""
        return _SINGLE_CORNER.get(self)

    @property
    def needs_disparity(self) -> bool:
        """Whether there is nothing to see before a disparity map has been computed."""
        return self in _BY_DISPARITY or self.corner is not None

    @property
    def tiles(self) -> tuple[int, int]:
        """(columns, rows) of the pictures of one viewpoint that it lays side by side."""
        if self is Look.WARPED_ALL:
            return 2, 2
        return (2, 1) if self in (Look.STEREO_PARALLEL, Look.STEREO_CROSSED) else (1, 1)

    @property
    def is_stereo(self) -> bool:
        """Whether it shows what two eyes see."""
        return self in (Look.ANAGLYPH, Look.STEREO_PARALLEL, Look.STEREO_CROSSED)

    @property
    def is_sweep(self) -> bool:
        """Whether it is of the plane sweep at a level."""
        return self is Look.SWEEP_MEAN or self is Look.SWEEP_DEVIATION

    @property
    def is_toned(self) -> bool:
        """Whether it is of pictures, which are looked at in a tone."""
        return not self.is_deviation and self not in (Look.DISPARITY, Look.ERROR, Look.LEAN)

    @property
    def is_deviation(self) -> bool:
        """Whether it is a map of deviations from 0 up, in colours and with a gain."""
        return self is Look.DISAGREEMENT or self is Look.SWEEP_DEVIATION


_BY_DISPARITY = frozenset(
    (
        Look.DISPARITY,
        Look.WARPED_ALL,
        Look.LEAN,
        Look.DISAGREEMENT,
        Look.ANAGLYPH,
        Look.STEREO_PARALLEL,
        Look.STEREO_CROSSED,
    )
)
_SINGLE_CORNER = {
    Look.WARPED_TOP_LEFT: 0,
    Look.WARPED_BOTTOM_LEFT: 1,
    Look.WARPED_TOP_RIGHT: 2,
    Look.WARPED_BOTTOM_RIGHT: 3,
}


class Tab(Enum):
    """The tabs of the panel; the value is the name on screen."""

    LOOK = "Look"
    COMPARE = "Compare"
    FOCUS = "Focus"
    EXPORT = "Export"


class Step(Enum):
    """How good the picture on screen is; the value is its name on screen."""

    BLEND = "blend"
    INSTANT = "instant"
    REALTIME = "realtime"
    FULL = "full"
    CAPTURED = "captured"


STEP_MEANING = {
    Step.BLEND: "the four corner views averaged by nearness, until the first disparity map is there",
    Step.INSTANT: "the newest synthesis, or the four corner views, warped by the newest disparity map, on every frame",
    Step.REALTIME: "the newest synthesis by the small networks, carried the rest of the way to where the hand is by now",
    Step.FULL: "the synthesis by the networks for exactly this viewpoint",
    Step.CAPTURED: "the camera's own view",
}


@dataclass(frozen=True)
class Reach:
    """How far a synthesis is carried by its disparity, in units of the baseline: up to `near` as it is, and up to `far` ever
    more mixed with the warped corner views, which know what it has not seen."""

    near: float
    far: float


CARRIED = Reach(0.2, 0.3)  # between the two, both are equally near to what the networks would make there (docs/speed.md)
# The corner views cost a software rasteriser three times as much as a synthesis that is carried: time which the networks, on
# the same cores, need for the synthesis that would take its place.
CARRIED_IN_SOFTWARE = Reach(0.5, 0.7)
SEAMLESS = 0.1  # one quick synthesis takes the place of another so near without a fade: the change cannot be seen


def carried_share(distance: float, reach: Reach = CARRIED) -> float:
    """Share of a synthesis, carried over this distance, in the picture on screen; the rest is that of the corner views."""
    return within((reach.far - distance) / (reach.far - reach.near), (0.0, 1.0))


@dataclass(frozen=True)
class Grid:
    """The captured views of a light field: how many, where, and how large (pixels)."""

    rows: int
    columns: int
    width: int
    height: int
    dark: frozenset[tuple[int, int]] = frozenset()

    def position(self, index: int) -> Point:
        """(u, v) of the captured view with that number, counted row by row from 0."""
        row, column = divmod(index, self.columns)
        return column / (self.columns - 1), row / (self.rows - 1)

    def nearest(self, u: float, v: float) -> int:
        """Number of the captured view nearest to (u, v)."""
        row = within(round(v * (self.rows - 1)), (0, self.rows - 1))
        column = within(round(u * (self.columns - 1)), (0, self.columns - 1))
        return row * self.columns + column

    def stepped(self, u: float, v: float, step: int) -> int:
        """Number of the captured view `step` places after the one nearest to (u, v), going round at the ends."""
        return (self.nearest(u, v) + step) % (self.rows * self.columns)

    def at(self, u: float, v: float, tolerance: float = 1e-3) -> int | None:
        """Number of the captured view at (u, v), or None; as LightField.at."""
        index = self.nearest(u, v)
        captured_u, captured_v = self.position(index)
        return index if math.hypot(u - captured_u, v - captured_v) <= tolerance else None


def clamp_viewpoint(u: float, v: float) -> Point:
    """The nearest viewpoint at most EXTRAPOLATION_LIMIT beyond the corners."""
    limits = (-EXTRAPOLATION_LIMIT, 1 + EXTRAPOLATION_LIMIT)
    return within(u, limits), within(v, limits)


@dataclass
class ViewState:
    """Everything the person at the screen has chosen."""

    u: float = 0.5
    v: float = 0.5
    hand: Point | None = None  # where a drag has taken the viewpoint; (u, v) may rest on a magnet beside it
    dragging: bool = False
    look: Look = Look.SYNTHESIS
    captured: bool = False  # show the camera's own view where there is one
    looking: Looking = field(default_factory=Looking)
    zoom: Zoom = field(default_factory=Zoom)
    gain: float = 8.0  # of the error look
    comparison: Comparison = field(default_factory=Comparison)
    flipped: bool = False  # the partner is shown in place of the picture
    score_all: bool = False  # every captured view is to be scored, not only those that come to memory anyway
    focusing: Focusing = field(default_factory=Focusing)
    pick: Point | None = None  # a picture point on which the person wants to focus
    sliced: Point | None = None  # the picture point through which slices go
    tail: float = 1.0  # per cent of the disparity values left out at either end of the colour range
    model: str = ""  # for a hand at rest; empty: the one that the program was started with
    foresight: bool = True  # compute views that may be wanted next while nothing else is to be done
    panel: bool = True
    tab: Tab = Tab.LOOK
    help: bool = False
    path_field: bool = False
    path_text: str = ""
    cursor: Point | None = None  # in picture pixels, None outside
    tile: tuple[int, int] = (0, 0)  # column and row of the picture, of those that the look shows, with the cursor in it
    inspector: bool = False
    swaying: bool = False  # the viewpoint moves by itself on a small circle
    desk: Desk = field(default_factory=Desk)  # what lies around the picture
    exhibit: int = 0  # which picture or map of a Lytro file without raw is shown
    export: ExportChoices = field(default_factory=ExportChoices)

    def move_to(self, u: float, v: float) -> None:
        """Go to a viewpoint, clamped to the extrapolation limit."""
        self.hand = None
        self.u, self.v = clamp_viewpoint(u, v)

    def refocus_at(self, disparity: float) -> None:
        """Show the picture with this disparity (px over the baseline) in focus."""
        self.focusing = self.focusing.focused_at(disparity)
        self.look = Look.REFOCUS

    def drag_by(self, du: float, dv: float) -> None:
        """Move the hand, and with it the viewpoint."""
        start = self.hand if self.hand is not None else (self.u, self.v)
        self.dragging = True
        if self.hand is None or (du, dv) != (0.0, 0.0):
            self.drag_to(start[0] + du, start[1] + dv)

    def drag_to(self, u: float, v: float) -> None:
        """Put the hand, and with it the viewpoint, somewhere."""
        self.dragging = True
        hand = clamp_viewpoint(u, v)
        if hand != self.hand:
            self.hand = hand
            self.u, self.v = hand

    def change_contrast(self, factor: float) -> None:
        """More (factor > 1) or less contrast of what is looked at, where it has any."""
        if self.look in (Look.ERROR, Look.LEAN) or self.look.is_deviation:
            self.gain = within(self.gain * factor, GAIN_LIMITS)
        elif self.look is Look.DISPARITY and self.looking.hand_range is not None:
            self.looking = self.looking.with_range_scaled(1 / factor)
        elif self.look is Look.DISPARITY:
            self.tail = within(self.tail + (1.0 if factor > 1 else -1.0), TAIL_LIMITS)
