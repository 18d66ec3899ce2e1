"""What the person has chosen to export, as plain values, and the plan that comes of it."""

from __future__ import annotations

import os
from dataclasses import dataclass
from enum import Enum
from functools import lru_cache
from pathlib import Path
from typing import Any

from app.readable import readable
from app.typed_paths import expanded
from assets import sample_path
from lfcore.errors import InputError
from lfcore.key_frames import Stop
from lfcore.quilt import Quilt, quilt_path
from lfcore.sweep import PATHS
from lfcore.sweep_plan import KeyFramePath, Layer, ShapePath, SweepPlan, ViewPath
from lfcore.sweep_target import Kind, Target, check_fits

KEY_FRAMES = "key frames"
SHAPES = (*PATHS, KEY_FRAMES)
RADIUS_LIMITS = (0.05, 0.5)
SIZES = {"25 %": 0.25, "50 %": 0.5, "100 %": 1.0, "150 %": 1.5, "200 %": 2.0, "300 %": 3.0}
LAYERS = {
    "Image": Layer.IMAGE,
    "Disparity": Layer.DISPARITY,
    "Difference": Layer.ERROR,
    "Image | captured": Layer.BESIDE_CAPTURED,
    "Image | disparity": Layer.BESIDE_DISPARITY,
}
_DRAWN_STOPS = 160  # of the line on the pad
# A key frame is met by a click this near to it, in baselines.
_REACH = 0.06


class Product(Enum):
    """What is exported; the value is its name on screen."""

    SWEEP = "Sweep along a path"
    VIEWS = "Grid of views, a folder"
    ESLF = "Grid of views, ESLF"
    QUILT = "Quilt for a Looking Glass"


class Format(Enum):
    """What a sweep is written as; the value is its name on screen."""

    MP4 = "mp4 (H.264)"
    WEBM = "webm (VP9)"
    WEBP = "webp"
    GIF = "gif"
    PNG = "png frames"
    EXR = "exr frames"

    @property
    def extension(self) -> str:
        """Of the file, with its dot; empty for a folder of frames."""
        return "" if self.kind is not Kind.VIDEO else f".{self.name.lower()}"

    @property
    def kind(self) -> Kind:
        """As lfcore knows it."""
        return {Format.PNG: Kind.PNG, Format.EXR: Kind.EXR}.get(self, Kind.VIDEO)

    @property
    def counts_plays(self) -> bool:
        """Whether the file says how often it is played."""
        return self in (Format.WEBP, Format.GIF)


@dataclass
class ExportChoices:
    """The tab Export. A key frame always has a focus, which counts where `refocus` is on."""

    product: Product = Product.SWEEP
    shape: str = "circle"
    radius: float = 0.3
    key_frames: tuple[Stop, ...] = ()
    closed: bool = True
    refocus: bool = False
    focus: tuple[float, float] = (0.0, 0.0)  # of shapes: from, to; of quilts the first is the screen's plane
    aperture: float = 1.0
    frames: int = 120
    fps: float = 30.0
    layer: Layer = Layer.IMAGE
    labels: bool = False
    scale: float = 1.0
    brighten: bool = False
    gain: float = 8.0
    format: Format = Format.MP4
    plays: int = 0
    side: int = 9
    columns: int = 8
    rows: int = 6
    model: str = ""  # empty: the one for a hand at rest
    folder: str = ""
    name: str = "sweep"
    playing: bool = False
    started: float | None = None  # when the preview began
    placed: tuple[float, float] | None = None  # where it has put the viewpoint
    typing: str = ""  # the field of the tab that takes the keyboard in the next frame
    seen_exports: int = 0  # number of the newest export that has been brought into sight

    def path(self) -> ViewPath:
        """The path."""
        if self.shape != KEY_FRAMES:
            return ShapePath(self.shape, self.radius, self.focus if self.refocus else None)
        kept = tuple(key if self.refocus else Stop(key.u, key.v) for key in self.key_frames)
        return KeyFramePath(kept, self.closed)

    def plan(self) -> SweepPlan:
        """The whole sweep. Raises InputError where it is impossible."""
        if self.shape == KEY_FRAMES and not self.key_frames:
            raise InputError("The path has no key frame yet: go to a viewpoint and press K.")
        planned = _planned(
            self.path(),
            self.frames,
            self.fps,
            self.layer,
            self.labels,
            self.scale,
            self.brighten,
            self.gain,
            self.aperture,
            self.plays,
        )
        if isinstance(planned, str):
            raise InputError(planned)
        return planned

    def take(self, plan: SweepPlan) -> None:
        """Choose what a plan says."""
        self.product = Product.SWEEP
        path = plan.path
        if isinstance(path, ShapePath):
            self.shape, self.radius, self.refocus = path.shape, path.radius, path.focus is not None
            self.focus = path.focus or self.focus
        else:
            self.shape, self.closed = KEY_FRAMES, path.closed
            self.refocus = path.key_frames[0].focus is not None
            self.key_frames = tuple(Stop(key.u, key.v, key.focus or 0.0) for key in path.key_frames)
        self.frames, self.fps, self.layer, self.labels = plan.frames, plan.fps, plan.layer, plan.labels
        self.scale, self.brighten, self.gain = plan.scale, plan.brighten, plan.gain
        self.aperture, self.plays = plan.aperture, plan.plays
        self.playing = False

    # Key frames.

    def add_key_frame(self, u: float, v: float, focus: float) -> None:
        """Put one more at the end of the path, which becomes one of key frames."""
        self.shape = KEY_FRAMES
        self.key_frames = (*self.key_frames, Stop(u, v, focus))

    def remove_last_key_frame(self) -> None:
        """Take the last one away again, if there is one."""
        self.key_frames = self.key_frames[:-1]

    def key_frame_at(self, u: float, v: float) -> int | None:
        """Number, from 0, of the key frame under this place of the pad."""
        for number, key in enumerate(self.key_frames):
            if (key.u - u) ** 2 + (key.v - v) ** 2 <= _REACH**2:
                return number
        return None

    def add_or_remove_key_frame(self, u: float, v: float, focus: float) -> None:
        """Take away the key frame under this place of the pad, or else put one there."""
        number = self.key_frame_at(u, v) if self.shape == KEY_FRAMES else None
        if number is None:
            self.add_key_frame(u, v, focus)
        else:
            self.key_frames = (*self.key_frames[:number], *self.key_frames[number + 1 :])

    # The preview on screen.

    def play(self) -> None:
        """Begin to move the viewpoint along the path, or stop."""
        self.playing, self.started, self.placed = not self.playing, None, None

    def stop_at(self, now: float) -> Stop | None:
        """Where the preview is, `now` in seconds; None while it is not played, or the path is impossible."""
        if not self.playing:
            return None
        stops = stops_of(self.path(), self.frames)
        if not stops:
            self.playing = False
            return None
        if self.started is None:
            self.started = now
        return stops[int((now - self.started) * self.fps) % len(stops)]

    def next_stop_in(self, now: float) -> float | None:
        """Seconds until the preview goes on, None while it is not played."""
        if not self.playing or self.started is None:
            return None
        passed = (now - self.started) * self.fps
        return (1 - passed % 1) / self.fps

    # Where it goes.

    def suggest(self, opened: str, name: str) -> None:
        """A place for exports of what was opened there: beside it, or at home where nothing should be written there."""
        source = Path(opened).absolute()
        effective = os.access in os.supports_effective_ids
        beside = os.access(source.parent, os.W_OK, effective_ids=effective) and source != sample_path()
        folder = str(source.parent if beside else Path.home())
        self.folder = folder if folder == readable(folder) else str(Path.home())  # a field holds texts only
        self.name = readable(f"{name} sweep")
        self.playing = False

    @property
    def target_path(self) -> Path:
        """The file or folder that is made, before a quilt's name gets its ending. Raises InputError as `expanded`."""
        folder = expanded(self.folder)
        if self.product is Product.SWEEP:
            return folder / f"{self.name}{self.format.extension}"
        return folder / (self.name if self.product is Product.VIEWS else f"{self.name}.png")

    @property
    def quilt(self) -> Quilt:
        """The quilt that is chosen."""
        return Quilt(self.columns, self.rows, focus=self.focus[0] if self.refocus else 0.0)

    @property
    def is_folder(self) -> bool:
        """Whether a folder is made, not a file."""
        if self.product is Product.SWEEP:
            return self.format.kind is not Kind.VIDEO
        return self.product is Product.VIEWS

    def made(self, view: tuple[int, int]) -> Path:
        """The file or folder that is made of views of that (width, height)."""
        path = self.target_path
        return quilt_path(path, self.quilt, view) if self.product is Product.QUILT else path

    def replaces(self, view: tuple[int, int]) -> bool:
        """Whether there is a file already where that is made; not, where that cannot be seen."""
        try:
            return self.made(view).is_file()
        except OSError:
            return False

    @property
    def target(self) -> Target:
        """Where a sweep goes."""
        return Target(self.target_path, self.format.kind)

    @property
    def fault(self) -> str:
        """Why it cannot be exported as chosen; empty where it can."""
        if not self.name.strip() or "/" in self.name or "\0" in self.name or self.name.strip() in (".", ".."):
            return "Give the export a name, not . or .., and without slashes."
        try:
            if self.product is Product.SWEEP:
                check_fits(self.plan(), self.format.kind)
            expanded(self.folder)
        except InputError as error:
            return str(error)
        return "" if self.folder.strip() and "\0" not in self.folder else "Give the folder in which the export is to lie."


@lru_cache(maxsize=16)
def _planned(path: ViewPath, *rest: Any) -> SweepPlan | str:
    """The plan, or why it is impossible; asked on every frame, and slow for long ones."""
    try:
        return SweepPlan(path, *rest)
    except InputError as error:
        return str(error)


@lru_cache(maxsize=64)
def stops_of(path: ViewPath, frames: int) -> tuple[Stop, ...]:
    """The stops of a path; none where it is impossible."""
    try:
        return tuple(path.stops(frames))
    except InputError:
        return ()


def drawn_path(choices: ExportChoices) -> tuple[Stop, ...]:
    """The path as a line on the pad; a closed one ends where it begins."""
    path = choices.path()
    stops = stops_of(path, _DRAWN_STOPS)
    return (*stops, stops[0]) if stops and path.closed else stops
