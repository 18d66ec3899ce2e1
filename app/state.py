"""What the window shows, as plain values: no GL ids, no tensors, no imgui. Panels change them, the canvas draws by them."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import Enum

from lfcore.lightfield import EXTRAPOLATION_LIMIT

Point = tuple[float, float]
Size = tuple[int, int]

GAIN_LIMITS = (1.0, 64.0)
TAIL_LIMITS = (0.0, 20.0)
ZOOM_LIMITS = (1 / 16, 64.0)


class Look(Enum):
    """A way of looking at the textures of one viewpoint; the value is the name on screen."""

    SYNTHESIS = "Synthesis"
    DISPARITY = "Disparity"
    WARPED_ALL = "Warped inputs, all four"
    WARPED_TOP_LEFT = "Warped input, top left"
    WARPED_BOTTOM_LEFT = "Warped input, bottom left"
    WARPED_TOP_RIGHT = "Warped input, top right"
    WARPED_BOTTOM_RIGHT = "Warped input, bottom right"
    ERROR = "Error against the captured view"

    @property
    def corner(self) -> int | None:
        """Index into lightfield.CORNERS of the one warped input that this look shows, or None."""
        return _SINGLE_CORNER.get(self)

    @property
    def needs_disparity(self) -> bool:
        """Whether there is nothing to see before a disparity map has been computed."""
        return self is Look.DISPARITY or self is Look.WARPED_ALL or self.corner is not None


_SINGLE_CORNER = {
    Look.WARPED_TOP_LEFT: 0,
    Look.WARPED_BOTTOM_LEFT: 1,
    Look.WARPED_TOP_RIGHT: 2,
    Look.WARPED_BOTTOM_RIGHT: 3,
}


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

# A synthesis is carried by its disparity to viewpoints this near (of the baseline) as it is, and up to the second distance
# ever more mixed with the warped corner views, which know what it has not seen.
CARRIED_NEAR, CARRIED_FAR = 0.1, 0.2


def carried_share(distance: float) -> float:
    """Share of a synthesis, carried over this distance, in the picture on screen; the rest is that of the corner views."""
    return min(max((CARRIED_FAR - distance) / (CARRIED_FAR - CARRIED_NEAR), 0.0), 1.0)


@dataclass(frozen=True)
class Rect:
    """A rectangle of the window in its pixels, y downwards."""

    x: float
    y: float
    width: float
    height: float

    def contains(self, point: Point) -> bool:
        """Whether the point lies inside."""
        return self.x <= point[0] < self.x + self.width and self.y <= point[1] < self.y + self.height


@dataclass(frozen=True)
class Placement:
    """Where a picture lies in the window: `scale` window pixels per picture pixel, `origin` the picture's top left corner."""

    scale: float
    origin: Point

    def to_picture(self, point: Point) -> Point:
        """Window point to picture point, in pixels, where pixel (column x, row y) covers [x, x + 1) x [y, y + 1)."""
        return (point[0] - self.origin[0]) / self.scale, (point[1] - self.origin[1]) / self.scale

    def to_window(self, point: Point) -> Point:
        """Picture point to window point: the inverse of `to_picture`."""
        return self.origin[0] + point[0] * self.scale, self.origin[1] + point[1] * self.scale


@dataclass(frozen=True)
class Zoom:
    """How the picture is magnified: `scale` window pixels per picture pixel (None: fit), `centre` the picture point, as a
    fraction of its size, in the middle of the area."""

    scale: float | None = None
    centre: Point = (0.5, 0.5)


def place(zoom: Zoom, picture: Size, area: Rect) -> Placement:
    """The placement of a picture of that size (width, height) in the area under the zoom."""
    scale = zoom.scale if zoom.scale is not None else fit_scale(picture, area)
    origin_x = area.x + area.width / 2 - zoom.centre[0] * picture[0] * scale
    origin_y = area.y + area.height / 2 - zoom.centre[1] * picture[1] * scale
    return Placement(scale, (round(origin_x), round(origin_y)))


def fit_scale(picture: Size, area: Rect) -> float:
    """The largest scale at which the whole picture lies inside the area."""
    return max(min(area.width / picture[0], area.height / picture[1]), 1e-3)


def zoom_about(zoom: Zoom, factor: float, point: Point, picture: Size, area: Rect) -> Zoom:
    """Magnify by `factor` while the picture point under the window point `point` stays there."""
    before = place(zoom, picture, area)
    scale = min(max(before.scale * factor, ZOOM_LIMITS[0]), ZOOM_LIMITS[1])
    fixed = before.to_picture(point)
    centre_x = (fixed[0] + (area.x + area.width / 2 - point[0]) / scale) / picture[0]
    centre_y = (fixed[1] + (area.y + area.height / 2 - point[1]) / scale) / picture[1]
    return Zoom(scale, _inside_picture((centre_x, centre_y)))


def pan_by(zoom: Zoom, delta: Point, picture: Size, area: Rect) -> Zoom:
    """Move the picture by `delta` window pixels; its middle part stays in the area."""
    scale = place(zoom, picture, area).scale
    centre = (zoom.centre[0] - delta[0] / (scale * picture[0]), zoom.centre[1] - delta[1] / (scale * picture[1]))
    return Zoom(scale, _inside_picture(centre))


def _inside_picture(centre: Point) -> Point:
    return min(max(centre[0], 0.0), 1.0), min(max(centre[1], 0.0), 1.0)


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
        row = min(max(round(v * (self.rows - 1)), 0), self.rows - 1)
        column = min(max(round(u * (self.columns - 1)), 0), self.columns - 1)
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
    low, high = -EXTRAPOLATION_LIMIT, 1 + EXTRAPOLATION_LIMIT
    return min(max(u, low), high), min(max(v, low), high)


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


@dataclass
class ViewState:
    """Everything the person at the screen has chosen."""

    u: float = 0.5
    v: float = 0.5
    hand: Point | None = None  # where a drag has taken the viewpoint; (u, v) may rest on a magnet beside it
    dragging: bool = False
    look: Look = Look.SYNTHESIS
    captured: bool = False  # show the camera's own view where there is one
    display_tone: bool = False
    zoom: Zoom = field(default_factory=Zoom)
    gain: float = 8.0  # of the error look
    tail: float = 1.0  # per cent of the disparity values left out at either end of the colour range
    model: str = ""  # for a hand at rest; empty: the one that the program was started with
    foresight: bool = True  # compute views that may be wanted next while nothing else is to be done
    panel: bool = True
    help: bool = False
    path_field: bool = False
    path_text: str = ""
    cursor: Point | None = None  # in picture pixels, None outside
    exhibit: int = 0  # which picture or map of a Lytro file without raw is shown

    def move_to(self, u: float, v: float) -> None:
        """Go to a viewpoint, clamped to the extrapolation limit."""
        self.hand = None
        self.u, self.v = clamp_viewpoint(u, v)

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
        """More (factor > 1) or less contrast of the error or the disparity, whichever is looked at."""
        if self.look is Look.ERROR:
            self.gain = min(max(self.gain * factor, GAIN_LIMITS[0]), GAIN_LIMITS[1])
        elif self.look is Look.DISPARITY:
            self.tail = min(max(self.tail + (1.0 if factor > 1 else -1.0), TAIL_LIMITS[0]), TAIL_LIMITS[1])


@dataclass(frozen=True)
class ScoreText:
    """PSNR (dB) and SSIM of the synthesis on screen against the captured view, and the protocol they follow."""

    psnr: float
    ssim: float
    protocol: str


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
    score: ScoreText | None = None
    timings: tuple[tuple[str, float], ...] = ()  # seconds by stage of the newest synthesis
    disparity_range: tuple[float, float] | None = None  # px over the baseline, at the chosen percentiles
    has_disparity: bool = False
    disparity_under_cursor: float | None = None
    captured_here: int | None = None  # number of the captured view at (u, v)
    captions: tuple[Caption, ...] = ()  # of what a Lytro file without raw shows; `kind` then says what it is
    value_under_cursor: float | None = None  # in the unit of the caption
    cached: tuple[Point, ...] = ()  # viewpoints in the cache
    cache_bytes: int = 0
    cache_limit: int = 0
    cache_hits: int = 0
