"""What a sweep is, as plain values: its path, its frames, what they show and how large. Kept as JSON, checked when read."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Any, TypeVar

from lfcore.atomic import atomic_path
from lfcore.errors import InputError
from lfcore.key_frames import Stop, check_stop, through
from lfcore.sweep import OPEN_PATHS, PATHS, check_frames

VERSION = 1
MAX_PLAN_BYTES = 2**20
MAX_KEY_FRAMES = 1000
SCALE_LIMITS = (0.05, 8.0)
GAIN_LIMITS = (1.0, 64.0)
MAX_PLAYS = 65_535  # what a GIF can count
MIN_FPS = 0.01
MAX_FPS = 240.0
_KEY = "lfview_sweep"
_LARGEST = 2**53  # whole number in a file; larger ones no float holds

_Choice = TypeVar("_Choice", bound=Enum)


class Layer(Enum):
    """What the frames show; the value is its name in files and on the command line."""

    IMAGE = "image"
    DISPARITY = "disparity"
    ERROR = "error"
    BESIDE_CAPTURED = "image+captured"
    BESIDE_DISPARITY = "image+disparity"


@dataclass(frozen=True)
class ShapePath:
    """One of the paths of lfcore.sweep around the middle. `focus`: from the first to the second disparity on the way, and on
    closed paths back again."""

    shape: str
    radius: float
    focus: tuple[float, float] | None = None

    @property
    def closed(self) -> bool:
        """Whether the last frame leads to the first."""
        return self.shape not in OPEN_PATHS

    def stops(self, frames: int) -> list[Stop]:
        """The path at even speed. Raises InputError for impossible values."""
        if self.shape not in PATHS:
            raise InputError(f"There is no path {self.shape!r}; choose one of {', '.join(PATHS)}.")
        viewpoints = PATHS[self.shape](frames, self.radius)
        if self.focus is None:
            return [Stop(u, v) for u, v in viewpoints]
        start, end = (Stop(0.5, 0.5, focus) for focus in self.focus)
        ends = [start, end, start] if self.closed else [start, end]
        for stop in ends:
            check_stop(stop)
        shares = [k / frames if self.closed else k / max(frames - 1, 1) for k in range(frames)]
        return [Stop(u, v, self._focus_at(share)) for (u, v), share in zip(viewpoints, shares, strict=True)]

    def _focus_at(self, share: float) -> float:
        assert self.focus is not None
        there = 1 - abs(2 * share - 1) if self.closed else share
        return self.focus[0] + there * (self.focus[1] - self.focus[0])


@dataclass(frozen=True)
class KeyFramePath:
    """A smooth path through key frames (lfcore.key_frames); two of them make a straight line."""

    key_frames: tuple[Stop, ...]
    closed: bool = False

    def stops(self, frames: int) -> list[Stop]:
        """The path at even speed. Raises InputError for impossible values."""
        if len(self.key_frames) > MAX_KEY_FRAMES:
            raise InputError(f"The path has {len(self.key_frames)} key frames; at most {MAX_KEY_FRAMES} are taken.")
        check_frames(frames)
        return through(self.key_frames, frames, self.closed)


ViewPath = ShapePath | KeyFramePath


@dataclass(frozen=True)
class SweepPlan:
    """A sweep: the same plan, light field and model give the same frames, in the window and on the command line.

    Raises InputError where it is made with impossible values.
    """

    path: ViewPath
    frames: int = 60
    fps: float = 30.0
    layer: Layer = Layer.IMAGE
    labels: bool = False
    scale: float = 1.0  # of a frame's pictures
    brighten: bool = False  # pictures in the display tone for dark captures
    gain: float = 8.0  # the error's colours end at 1 / gain of white
    aperture: float = 1.0  # diameter in baselines, where the path has a focus
    plays: int = 0  # of an animated .webp or .gif; 0: for ever

    def __post_init__(self) -> None:
        _check_range("rate in frames per second", self.fps, (MIN_FPS, MAX_FPS))
        _check_range("scale", self.scale, SCALE_LIMITS)
        _check_range("gain", self.gain, GAIN_LIMITS)
        _check_range("aperture", self.aperture, (0.0, 2.0))
        _check_range("number of times to play", self.plays, (0, MAX_PLAYS))
        self.stops()

    def stops(self) -> list[Stop]:
        """Where the frames are, in order."""
        return self.path.stops(self.frames)

    @property
    def seconds(self) -> float:
        """How long it plays once."""
        return self.frames / self.fps


def save_plan(path: str | os.PathLike[str], plan: SweepPlan) -> None:
    """Write the plan as JSON. Raises OutputError where the file cannot be written."""
    text = json.dumps(as_json(plan), indent=2, allow_nan=False) + "\n"
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def load_plan(path: str | os.PathLike[str]) -> SweepPlan:
    """Read a plan. Raises InputError, naming what is wrong, for anything but a plan of this version."""
    source = Path(path)
    try:
        size = source.stat().st_size
        if size > MAX_PLAN_BYTES:
            raise InputError(f"{source} has {size} bytes; a sweep has at most {MAX_PLAN_BYTES}.")
        text = source.read_text(encoding="utf-8")
    except OSError as error:
        raise InputError(f"{source} cannot be read: {error.strerror}; give a sweep saved as JSON.") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{source} is no text; give a sweep saved as JSON.") from error
    try:
        value = json.loads(text, parse_constant=_refuse_constant)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{source} is no JSON ({error}); give a sweep saved by lfview.") from error
    try:
        return from_json(value)
    except InputError as error:
        raise InputError(f"{source}: {error}") from error


def as_json(plan: SweepPlan) -> dict[str, Any]:
    """The plan as JSON holds it."""
    return {
        _KEY: VERSION,
        "path": _path_as_json(plan.path),
        "frames": plan.frames,
        "fps": plan.fps,
        "layer": plan.layer.value,
        "labels": plan.labels,
        "scale": plan.scale,
        "brighten": plan.brighten,
        "gain": plan.gain,
        "aperture": plan.aperture,
        "plays": plan.plays,
    }


def from_json(value: object) -> SweepPlan:
    """The plan that `as_json` gave; everything but the version and the path may be left out. Raises InputError."""
    if not isinstance(value, dict) or _KEY not in value:
        raise InputError(f'this is no sweep: expected an object with "{_KEY}"; save one in the window or by --save-path.')
    if value[_KEY] != VERSION:
        raise InputError(f"the sweep is of version {value[_KEY]!r}, this program knows {VERSION}; update it.")
    fields: Mapping[str, Callable[[str, object], Any]] = {
        "path": lambda name, path: _path_from_json(path),
        "frames": _whole,
        "fps": _number,
        "layer": _layer,
        "labels": _truth,
        "scale": _number,
        "brighten": _truth,
        "gain": _number,
        "aperture": _number,
        "plays": _whole,
    }
    _check_names(value, {_KEY, *fields}, "the sweep")
    if "path" not in value:
        raise InputError('the sweep has no "path".')
    return SweepPlan(**{name: read(name, value[name]) for name, read in fields.items() if name in value})


def is_plan_file(path: Path) -> bool:
    """Whether a file's name and beginning are those of a saved sweep."""
    try:
        if path.suffix.lower() != ".json" or not path.is_file():  # a pipe would be waited for
            return False
        with path.open("rb") as file:
            return f'"{_KEY}"'.encode() in file.read(4096)
    except OSError:
        return False


def _path_as_json(path: ViewPath) -> dict[str, Any]:
    if isinstance(path, ShapePath):
        focus = {} if path.focus is None else {"focus": list(path.focus)}
        return {"shape": path.shape, "radius": path.radius, **focus}
    keys = [{"u": key.u, "v": key.v} | ({} if key.focus is None else {"focus": key.focus}) for key in path.key_frames]
    return {"closed": path.closed, "key_frames": keys}


def _path_from_json(value: object) -> ViewPath:
    if not isinstance(value, dict) or ("shape" in value) == ("key_frames" in value):
        raise InputError('the "path" must be an object with either "shape" or "key_frames".')
    if "shape" in value:
        _check_names(value, {"shape", "radius", "focus"}, 'the "path"')
        if not isinstance(value["shape"], str):
            raise InputError(f"the path's shape must be one of {', '.join(PATHS)}.")
        focus = value.get("focus")
        if focus is not None and not (isinstance(focus, list) and len(focus) == 2):
            raise InputError('the path\'s "focus" must be two numbers: where it begins and where it ends.')
        ends = None if focus is None else (_number("focus", focus[0]), _number("focus", focus[1]))
        return ShapePath(value["shape"], _number("radius", value.get("radius", 0.3)), ends)
    _check_names(value, {"key_frames", "closed"}, 'the "path"')
    keys = value["key_frames"]
    if not isinstance(keys, list) or not 1 <= len(keys) <= MAX_KEY_FRAMES:
        raise InputError(f'"key_frames" must be a list of 1 to {MAX_KEY_FRAMES} key frames.')
    return KeyFramePath(
        tuple(_stop(number, key) for number, key in enumerate(keys, 1)), _truth("closed", value.get("closed", False))
    )


def _stop(number: int, value: object) -> Stop:
    if not isinstance(value, dict) or not {"u", "v"} <= set(value):
        raise InputError(f'key frame {number} must be an object with "u" and "v".')
    _check_names(value, {"u", "v", "focus"}, f"key frame {number}")
    focus = value.get("focus")
    return Stop(_number("u", value["u"]), _number("v", value["v"]), None if focus is None else _number("focus", focus))


def _check_names(value: Mapping[str, object], known: set[str], what: str) -> None:
    unknown = sorted(set(value) - known)
    if unknown:
        raise InputError(f'{what} has an unknown "{unknown[0]}"; known are {", ".join(sorted(known))}.')


def _number(name: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise InputError(f'"{name}" must be a number.')
    try:
        return float(value)
    except OverflowError as error:
        raise InputError(f'"{name}" is too large a number.') from error


def _whole(name: str, value: object) -> int:
    if isinstance(value, bool) or not isinstance(value, int):
        raise InputError(f'"{name}" must be a whole number.')
    if abs(value) > _LARGEST:
        raise InputError(f'"{name}" is too large a number.')
    return value


def _truth(name: str, value: object) -> bool:
    if not isinstance(value, bool):
        raise InputError(f'"{name}" must be true or false.')
    return value


def _layer(name: str, value: object) -> Layer:
    for layer in Layer:
        if layer.value == value:
            return layer
    raise InputError(f'"{name}" must be one of {", ".join(layer.value for layer in Layer)}.')


def _check_range(name: str, value: float, limits: tuple[float, float]) -> None:
    low, high = limits
    if not low <= value <= high:  # as it stands, NaN is caught too
        raise InputError(f"The {name} is {value:g}; it must be at least {low:g} and at most {high:g}.")


def _refuse_constant(word: str) -> float:
    raise ValueError(f"{word} is no number that JSON knows")
