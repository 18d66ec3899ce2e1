"""What the stores on disk share: where they lie, which files there are, when they were used, by which code they were made."""

from __future__ import annotations

import contextlib
import hashlib
import os
import sys
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from importlib import resources
from pathlib import Path
from typing import ClassVar

from lfcore.errors import OutputError

LEFTOVER_SECONDS = 3600.0  # temporary files this old were left by a program that was killed
_CODE = (".py", ".c", ".h", ".so", ".pyd")  # what was compiled stands for C where that is not installed


@dataclass(frozen=True)
class KeptFile:
    """A file of a store."""

    path: Path
    size: int
    used_at: float  # seconds since 1970


def default_root() -> Path:
    """Where views are kept: $LFVIEW_CACHE, or `lfview` in the folder that the system means for caches."""
    chosen = os.environ.get("LFVIEW_CACHE")
    if chosen:
        return Path(chosen).expanduser()
    if sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    elif sys.platform == "darwin":
        base = Path.home() / "Library" / "Caches"
    else:
        given = os.environ.get("XDG_CACHE_HOME", "")
        base = Path(given) if given.startswith("/") else Path.home() / ".cache"  # relative ones are to be ignored
    return base / "lfview"


def entries(folder: Path) -> Iterator[KeptFile]:
    """The files of a folder; what vanishes meanwhile is passed over, and so is a folder that is not there."""
    with contextlib.suppress(OSError), os.scandir(folder) as found:
        for entry in found:
            with contextlib.suppress(OSError):
                facts = entry.stat(follow_symlinks=False)
                yield KeptFile(Path(entry.path), facts.st_size, facts.st_mtime)


def make_private(folder: Path) -> None:
    """Make the folder of a store, for its owner alone: pictures are nobody else's business. Raises OutputError."""
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"Cannot make the folder {folder}: {error.strerror or error}.") from error


def make_room(files: Iterable[KeptFile], wanted: int, limit: int) -> None:
    """Remove those used longest ago, until `wanted` more bytes stay within the limit."""
    oldest_first = sorted(files, key=lambda file: file.used_at)
    excess = sum(file.size for file in oldest_first) + wanted - limit
    for file in oldest_first:
        if excess <= 0:
            return
        remove(file.path)
        excess -= file.size


@dataclass(frozen=True)
class FileStore:
    """Files of one kind in a folder that is made when first written to, at most `limit_bytes` of them, found by a key."""

    folder: Path
    limit_bytes: int
    suffix: ClassVar[str]

    def usage(self) -> tuple[int, int]:
        """(files, bytes) that are kept."""
        files = self._files()
        return len(files), sum(file.size for file in files)

    def clear(self) -> None:
        """Remove all of them, but not what another program is just writing. Raises OutputError where some cannot be removed."""
        stuck = sum(not remove(file.path) for file in self._files() if not _is_being_written(file))
        check_all_removed(stuck, self.folder)

    def room_for(self, key: str, size: int) -> Path:
        """Where to write the file under this key, once those used longest ago have made room for it. Raises OutputError."""
        for file in self._files():
            if file.path.name.startswith(".") and not _is_being_written(file):
                remove(file.path)  # begun by a program that did not end it
        make_room(self._files(), size, self.limit_bytes)
        make_private(self.folder)
        return self.path(key)

    def path(self, key: str) -> Path:
        """The file under this key, be it there or not."""
        return self.folder / f"{key}{self.suffix}"

    def _files(self) -> list[KeptFile]:
        return [file for file in entries(self.folder) if file.path.name.endswith(self.suffix)]


def _is_being_written(file: KeptFile) -> bool:
    return file.path.name.startswith(".") and time.time() - file.used_at < LEFTOVER_SECONDS


def mark_used(path: Path) -> None:
    """Note that a file is used now."""
    with contextlib.suppress(OSError):
        os.utime(path)


def remove(path: Path) -> bool:
    """Whether the file is gone, by this or by another program's doing."""
    try:
        path.unlink(missing_ok=True)
    except OSError:
        return False
    return True


def check_all_removed(stuck: int, folder: Path) -> None:
    """Raise OutputError where so many files of a store could not be removed."""
    if stuck:
        raise OutputError(f"Cannot remove {stuck} files below {folder}; look whether they are yours to remove.")


@cache
def code_digest(*packages: str) -> str:
    """Digest of the sources of packages, without those below them: what other code has made is not shown as this program's."""
    digest = hashlib.blake2b(digest_size=16)
    for package in packages:
        for module in sorted(resources.files(package).iterdir(), key=lambda item: item.name):
            if module.name.endswith(_CODE):
                digest.update(module.name.encode() + module.read_bytes())
    return digest.hexdigest()
