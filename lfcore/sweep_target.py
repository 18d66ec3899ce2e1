"""Where a sweep goes: the file or folder, and what it is written as."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from pathlib import Path


class Kind(Enum):
    """What a sweep is written as."""

    VIDEO = "one file: .mp4 (H.264), .webm (VP9), .webp or .gif"
    PNG = "a folder of PNG pictures with 8 bits"
    EXR = "a folder of EXR files: the image as half floats, disparity and error as floats"


@dataclass(frozen=True)
class Target:
    """A file for a video, else a folder."""

    path: Path
    kind: Kind
