"""The frames of a sweep as numbered files in a folder: PNG to look at, EXR to compute with."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

from lfcore.errors import OutputError
from lfcore.export import check_folder_target, make_folder

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
    with _removed_on_failure(path) as written:
        for number, write in enumerate(writers, 1):
            target = path / f"{_STEM}{number:0{digits}}{extension}"
            written.append(target)
            write(target)


@contextlib.contextmanager
def _removed_on_failure(folder: Path) -> Iterator[list[Path]]:
    """Make the folder; where the block fails, remove the files of the yielded list, and the folders that were made."""
    missing = [parent for parent in (folder, *folder.parents) if not parent.exists()]
    make_folder(folder)
    written: list[Path] = []
    try:
        yield written
    except BaseException:
        for file in written:
            file.unlink(missing_ok=True)
        for made in missing:
            with contextlib.suppress(OSError):  # somebody else has put something there meanwhile
                made.rmdir()
        raise
