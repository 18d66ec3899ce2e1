"""Folders that hold several light fields, to choose from."""

from __future__ import annotations

import contextlib
import os
import re
from collections.abc import Callable, Iterator
from pathlib import Path

from lfcore.errors import InputError
from lfcore.formats import array_files, eslf
from lfcore.formats.images import EXTENSIONS, read_header
from lfcore.formats.names import belongs_to_grid, find_grid

MEMBERS_LIMIT = 5000
CONTAINERS = (".lfp", ".lfr", ".lfx", *array_files.EXTENSIONS)  # files of one light field each
_LEVELS = 3


def folder_around(path: Path) -> Path:
    """The nearest folder above this light field in which there are several to choose from.

    Raises InputError where there is none, or it cannot be read.
    """
    for folder in path.absolute().parents[:_LEVELS]:
        if members(folder):
            return folder
    raise InputError(f"There are no other light fields in the folders around {path}; open another folder.")


def members(folder: Path) -> tuple[Path, ...]:
    """What in this folder may be a light field, in the order of their names: sub-folders with pictures or light fields in
    them, files of Lytro cameras, MATLAB and HDF5, pictures. Empty where the folder is no folder, is a light field itself, or
    holds none.

    Contents are not looked at, so that a folder of thousands is listed at once. Raises InputError where it cannot be read.
    """
    if not folder.is_dir():
        return ()
    try:
        found = sorted((entry for entry in os.scandir(folder) if not entry.name.startswith(".")), key=_by_name)
    except OSError as error:
        raise InputError(f"{folder} cannot be read: {error.strerror}; check its permissions.") from error
    files = [Path(entry.path) for entry in found if _is(entry.is_file)]
    folders = [Path(entry.path) for entry in found if _is(entry.is_dir)]
    pictures = [file for file in files if file.suffix.lower() in EXTENSIONS]
    containers = [file for file in files if file.suffix.lower() in CONTAINERS]
    inner = [each for each in folders if holds_something(each)]
    if pictures and _is_light_field(folder, pictures, bool(containers), len(inner)):
        return ()
    if not containers and not pictures and len(inner) == 1 and _holds(inner[0], EXTENSIONS):
        return ()  # a light field whose views lie one folder deeper
    chosen = {*containers, *pictures, *inner}
    return tuple([Path(entry.path) for entry in found if Path(entry.path) in chosen][:MEMBERS_LIMIT])


def holds_something(folder: Path) -> bool:
    """Whether there are pictures or files of Lytro cameras, MATLAB or HDF5 in the folder or in one of those in it."""
    endings = (*EXTENSIONS, *CONTAINERS)
    return _holds(folder, endings) or any(_holds(inner, endings) for inner in _folders(folder))


def _is_light_field(folder: Path, pictures: list[Path], among_containers: bool, inner: int) -> bool:
    """Whether these pictures, beside so many folders with some, are the views of one light field, and not one each.

    Views may be missing where nothing else tells that the folder is something to choose from: opening it then says which.
    """
    if _is_eslf(pictures[0]):
        return False
    if inner > 1 or (len(pictures) == 1 and (among_containers or inner)):
        return _is_whole_grid(folder, pictures)
    return len(pictures) == 1 or any(belongs_to_grid(picture, pictures) for picture in _one_of_each(pictures))


def _is_whole_grid(folder: Path, pictures: list[Path]) -> bool:
    try:
        find_grid(folder, pictures)
    except InputError:
        return False
    return True


def _one_of_each(pictures: list[Path]) -> list[Path]:
    """One picture of each way of naming: those of a grid are alike but for their numbers."""
    return list({re.sub(r"\d+", "#", picture.name): picture for picture in pictures}.values())[:16]


def _is_eslf(picture: Path) -> bool:
    try:
        return eslf.has_camera_size(read_header(picture))
    except InputError:
        return False


def _is(kind: Callable[[], bool]) -> bool:
    """Whether an entry is of that kind; a link that leads to itself is of none."""
    try:
        return kind()
    except OSError:
        return False


def _holds(folder: Path, endings: tuple[str, ...]) -> bool:
    with contextlib.suppress(OSError), os.scandir(folder) as found:
        return any(entry.name.lower().endswith(endings) and not entry.name.startswith(".") for entry in found)
    return False


def _folders(folder: Path) -> Iterator[Path]:
    with contextlib.suppress(OSError), os.scandir(folder) as found:
        yield from (Path(entry.path) for entry in found if _is(entry.is_dir) and not entry.name.startswith("."))


def _by_name(entry: os.DirEntry[str]) -> tuple[list[tuple[int, str]], str]:
    """Numbers in names count as numbers: IMG_9 before IMG_10."""
    parts = re.split(r"(\d+)", entry.name.lower())
    return [(int(part), "") if part.isdecimal() else (-1, part) for part in parts], entry.name
