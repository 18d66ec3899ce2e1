"""The frames of a sweep as numbered files in a folder: PNG to look at, EXR to compute with."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from pathlib import Path

from lfcore.errors import OutputError
from lfcore.export import check_folder_target, removed_on_failure

_STEM = "frame_"


def check_frames_target(folder: str | os.PathLike[str]) -> Path:
    """Make sure, before long work, that numbered frames can be written into this folder, and that none are in it already."""
    path = check_folder_target(folder)
    if any(path.glob(f"{_STEM}*")):
        raise OutputError(f"Cannot write frames to {path}: it holds some already; choose another folder or empty this one.")
    return path


def write_numbered(
    folder: str | os.PathLike[str], extension: str, total: int, writers: Iterable[Callable[[Path], None]]
) -> None:
    """Write one file per writer, frame_0001 and so on with this extension, each atomically; the folder is made if missing.

    An error or Ctrl-C on the way removes every file that was written, and the folder if it was made here. What the iterable and
    the writers raise passes through.
    """
    path = check_frames_target(folder)
    digits = max(len(str(total)), 4)
    with removed_on_failure(path) as written:
        for number, write in enumerate(writers, 1):
            target = path / f"{_STEM}{number:0{digits}}{extension}"
            written.append(target)
            write(target)
