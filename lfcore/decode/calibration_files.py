"""The files of a camera's calibration, wherever they are: a folder of MOD_*, caldata-*.tar, data.C.0 to data.C.3."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from itertools import islice
from pathlib import Path

from lfcore.errors import InputError
from lfcore.formats import tar
from lfcore.formats.lytro.container import Container, is_container, open_container, reference_to
from lfcore.formats.lytro.contents import read_contents

_WANTED = re.compile(r"MOD_\d+\.(RAW|TXT|GCT)|CAL_FILE_MANIFEST\.JSON")
_BACKUP = re.compile(r"data\.C\.\d+", re.IGNORECASE)

# How deep folders are searched, and how many entries of them are looked at.
_MAX_DEPTH = 3
_MAX_ENTRIES = 20_000


@dataclass(frozen=True)
class StoredBytes:
    """The bytes of a file on disk, in an archive or in a container; `label` names it in messages."""

    label: str
    path: Path
    offset: int
    size: int
    checksum: str | None = None
    changed: int = 0  # when the file on disk was, in nanoseconds: without a checksum it tells whether these are the same bytes

    def read(self) -> bytes:
        """All bytes, checked where a checksum is known. Raises InputError where they are missing or differ."""
        data = self.part(0, self.size)
        if self.checksum is not None and reference_to(data) != self.checksum:
            raise InputError(f"{self.label} does not match its checksum; the file is damaged: copy it again.")
        return data

    def part(self, begin: int, count: int) -> bytes:
        """`count` bytes from `begin`, unchecked. Raises InputError where they cannot be read."""
        try:
            with self.path.open("rb") as file:
                file.seek(self.offset + begin)
                data = file.read(count)
        except OSError as error:
            raise InputError(f"{self.label} cannot be read: {error.strerror}; check its permissions.") from error
        if len(data) < count:
            raise InputError(f"{self.label} is cut off; copy it again.")
        return data


@dataclass(frozen=True)
class CalibrationSet:
    """Files that belong together, by their names in capitals: one folder, one archive, or one backup of several parts."""

    source: Path
    files: Mapping[str, StoredBytes]


@dataclass(frozen=True)
class Found:
    """Sets of calibration files, and what was found damaged on the way, a sentence each."""

    sets: tuple[CalibrationSet, ...]
    problems: tuple[str, ...] = ()


def find_sets(path: Path) -> Found:
    """All sets of calibration files at `path`, which may be a folder (searched three levels deep) or one of the files.

    A file MOD_0012.RAW or .TXT stands for itself alone. Raises InputError where there is nothing that can be used.
    """
    search = _Search()
    if path.is_dir():
        search.folder(path, _MAX_DEPTH)
    else:
        search.add(lambda: _single(path))
    if search.sets:
        return search.found
    if search.problems:
        raise InputError(search.problems[0])
    raise InputError(
        f"{path} holds no calibration of a Lytro camera; expected a caldata-*.tar (Illum), data.C.0 to data.C.3 (first "
        "generation), or a folder with these or with MOD_*.RAW and MOD_*.TXT."
    )


def sets_beside(path: Path) -> Found:
    """Sets in the folder of that file, not in folders below."""
    search = _Search()
    search.folder(path.parent, 0)
    return search.found


def holds_calibration(path: Path) -> bool:
    """Whether a file, or a folder or one of its folders, is calibration and no light field."""
    search = _Search()
    if path.is_dir():
        search.folder(path, 1)
    elif path.is_file() and not _WANTED.fullmatch(path.name.upper()):
        search.add(lambda: _single(path))
    else:
        return path.is_file()
    return bool(search.sets)


class _Search:
    """Gathers sets; what is damaged is noted, not raised, so that it does not hide the rest."""

    def __init__(self) -> None:
        self.sets: list[CalibrationSet] = []
        self.problems: list[str] = []
        self._left = _MAX_ENTRIES

    @property
    def found(self) -> Found:
        return Found(tuple(self.sets), tuple(self.problems))

    def add(self, read: Callable[[], CalibrationSet]) -> None:
        """Add a set unless it is empty or damaged."""
        try:
            found = read()
        except InputError as error:
            self.problems.append(str(error))
        else:
            self.sets += [found] if found.files else []

    def folder(self, folder: Path, depth: int) -> None:
        """The plain files of a folder, its backup, its archives; then those of its folders, down to `depth`."""
        files, folders = self._entries(folder)
        self.add(lambda: CalibrationSet(folder, _plain_files(file for file in files if _WANTED.fullmatch(file.name.upper()))))
        self.add(lambda: _backup(folder, [file for file in files if _BACKUP.fullmatch(file.name) and is_container(file)]))
        for file in files:
            if file.suffix.lower() == ".tar":
                self.add(partial(_archive, file))
        if depth:
            for entry in folders:
                self.folder(entry, depth - 1)

    def _entries(self, folder: Path) -> tuple[list[Path], list[Path]]:
        try:
            entries = sorted(islice(folder.iterdir(), self._left))
            self._left -= len(entries)
            # Links to folders may lead round in circles.
            return [e for e in entries if e.is_file()], [e for e in entries if e.is_dir() and not e.is_symlink()]
        except OSError as error:
            self.problems.append(f"{folder} cannot be read: {error.strerror}; check its permissions.")
            return [], []


def _single(path: Path) -> CalibrationSet:
    if not path.exists():
        raise InputError(f"{path} does not exist; expected the calibration of a Lytro camera.")
    if _WANTED.fullmatch(path.name.upper()):
        return CalibrationSet(path, _plain_files(entry for entry in path.parent.iterdir() if entry.stem == path.stem))
    if is_container(path):
        if not _BACKUP.fullmatch(path.name):
            return _backup(path, [path])
        return _backup(path.parent, [entry for entry in path.parent.iterdir() if _BACKUP.fullmatch(entry.name)])
    return _archive(path)


def _plain_files(paths: Iterator[Path]) -> dict[str, StoredBytes]:
    found = ((path, path.stat()) for path in paths if path.is_file())
    return {
        path.name.upper(): StoredBytes(str(path), path, 0, facts.st_size, changed=facts.st_mtime_ns) for path, facts in found
    }


def _archive(path: Path) -> CalibrationSet:
    if not tar.is_tar(path):
        raise InputError(f"{path} is no calibration of a Lytro camera; expected a caldata-*.tar, a data.C.0 or a MOD_*.RAW.")
    changed = path.stat().st_mtime_ns
    files = {
        member.name.upper(): StoredBytes(f"{path}: {member.name}", path, member.offset, member.size, changed=changed)
        for member in tar.members(path)
        if _WANTED.fullmatch(member.name.upper())
    }
    return CalibrationSet(path, files)


def _backup(source: Path, paths: list[Path]) -> CalibrationSet:
    files: dict[str, StoredBytes] = {}
    for path in paths:
        files.update(_container_files(open_container(path)))
    return CalibrationSet(source, files)


def _container_files(container: Container) -> dict[str, StoredBytes]:
    return {
        file.name.upper(): StoredBytes(
            f"{container.path}: {file.name}", container.path, file.section.offset, file.section.length, file.section.name
        )
        for file in read_contents(container).files
        if _WANTED.fullmatch(file.name.upper())
    }
