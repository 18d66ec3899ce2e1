"""Where a sweep goes: the file or folder, and what it is written as."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from pathlib import Path

from lfcore.errors import InputError
from lfcore.sweep_plan import Layer, SweepPlan


class Kind(Enum):
    """What a sweep is written as."""

    VIDEO = "one file: .mp4 (H.264), .webm (VP9), .webp or .gif"
    PNG = "a folder of PNG pictures with 8 bits"
    EXR = "a folder of EXR files: the image as half floats, disparity and error as floats"


def check_fits(plan: SweepPlan, kind: Kind) -> None:
    """Raise InputError where a kind of file cannot hold what the plan shows."""
    if kind is not Kind.EXR:
        return
    if plan.layer not in (Layer.IMAGE, Layer.DISPARITY, Layer.ERROR):
        raise InputError(f"EXR frames hold the numbers of one layer, not {plan.layer.value}; choose PNG frames or a video.")
    if plan.labels or plan.scale != 1 or plan.brighten:
        raise InputError("EXR frames hold numbers in their own size; leave out labels, scale and brightening.")


@dataclass(frozen=True)
class Target:
    """A file for a video, else a folder."""

    path: Path
    kind: Kind
