"""A folder with one picture per view: view_RR_CC, lf_R_C, HCI input_CamNNN, Stanford out_RR_CC_Y_X, corners only."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from pathlib import Path

import numpy as np

from lfcore.errors import Cancelled, InputError
from lfcore.formats.checks import put_in_order, with_warnings, without_non_finite
from lfcore.formats.dark import find_dark_views
from lfcore.formats.images import EXTENSIONS, Header, Pixels, check_memory, open_picture, read_header
from lfcore.formats.names import GANTRY, RULES, Grid, belongs_to_grid, find_grid
from lfcore.illum import aperture_of_views
from lfcore.lightfield import LightField

# More threads than this gain nothing: the decoders wait for memory by then.
_MAX_THREADS = 8


def sniff(path: Path) -> bool:
    """Whether `path` is a folder, or a picture that its neighbours' names make one view of a grid."""
    if path.is_dir():
        return True
    try:
        return path.suffix.lower() in EXTENSIONS and belongs_to_grid(path, pictures_in(path.parent))
    except InputError:
        return False


def read(
    path: Path,
    progress: Callable[[float], None] | None = None,
    cancelled: Callable[[], bool] = lambda: False,
) -> LightField:
    """Read a folder of views (or the folder around the given view) in its stored depth.

    Raises InputError for missing views, views of another size or depth, damaged files and too large ones; Cancelled
    where `cancelled` says so.
    """
    given = path if path.is_dir() else path.parent
    grid = grid_of(path)
    first = grid.files[0, 0]
    header = read_header(first)
    check_memory(first, header, grid.rows * grid.columns)
    views = np.empty((grid.rows, grid.columns, header.height, header.width, 3), header.dtype)  # (V, U, H, W, 3)
    bad_values = _read_all(grid, header, views, progress, cancelled)
    warnings = list(grid.warnings)
    if bad_values:
        name, total = next(iter(sorted(bad_values.items()))), sum(bad_values.values())
        warnings.append(f"{total} values that are no finite numbers were set to 0 (first in {name[0]}).")
    facts = dict(grid.facts)
    if header.channels == 1:
        facts["Colour"] = "grey pictures, the one channel repeated"
    if first.parent != given:
        facts["Folder"] = str(first.parent)
    light_field = LightField(
        views=views,
        name=given.resolve().name,
        source=str(path),
        kind=grid.kind,
        facts=facts,
        warnings=tuple(warnings),
        dark=find_dark_views(views),
        aperture=aperture_of_views(views, grid.steps),
    )
    # A gantry's columns are in the order of the camera's x, so where one axis is reversed it must be the rows.
    return put_in_order(light_field) if grid.kind == GANTRY else with_warnings(light_field)


def grid_of(path: Path) -> Grid:
    """Which files are the views of this folder, or of the folder around the given view. Raises InputError."""
    folder = _folder_of_views(path if path.is_dir() else path.parent)
    return find_grid(folder, pictures_in(folder))


def pictures_in(folder: Path) -> list[Path]:
    """The files of a folder that have a picture's extension; hidden ones are left out (macOS leaves ._name files)."""
    try:
        return [
            entry
            for entry in folder.iterdir()
            if entry.suffix.lower() in EXTENSIONS and not entry.name.startswith(".") and entry.is_file()
        ]
    except OSError as error:
        raise InputError(f"{folder} cannot be read: {error.strerror}; check its permissions.") from error


def _folder_of_views(folder: Path) -> Path:
    """`folder` itself if it holds pictures, else its only sub-folder that does."""
    if pictures_in(folder):
        return folder
    inner = [entry for entry in sorted(folder.iterdir()) if entry.is_dir() and pictures_in(entry)]
    if len(inner) == 1:
        return inner[0]
    if inner:
        raise InputError(
            f"{folder} holds {len(inner)} folders of pictures ({inner[0].name}, {inner[1].name}, ..); open one of them."
        )
    if any(folder.iterdir()):
        raise InputError(f"{folder} holds no pictures ({', '.join(EXTENSIONS)}); expected one file per view, named {RULES}.")
    raise InputError(f"{folder} is an empty folder; expected one picture per view, named {RULES}.")


def _read_all(
    grid: Grid,
    header: Header,
    views: Pixels,
    progress: Callable[[float], None] | None,
    cancelled: Callable[[], bool],
) -> dict[str, int]:
    """Fill `views` from the files, several at a time; count the values per file that were not finite."""
    stop = threading.Event()
    first = grid.files[0, 0]
    bad_values: dict[str, int] = {}

    def read_one(index: tuple[int, int]) -> None:
        if stop.is_set():
            return
        file = grid.files[index]
        with open_picture(file) as picture:
            _check_alike(file, picture.header, first, header)
            target = views[index]  # (H, W, 3)
            target[...] = picture.read()  # grey is repeated
        count = without_non_finite(target)
        if count:
            bad_values[file.name] = count

    # OpenImageIO decodes without holding the interpreter's lock, so threads read as many views at once as cores allow.
    with ThreadPoolExecutor(min(_MAX_THREADS, os.cpu_count() or 1)) as pool:
        waiting = {pool.submit(read_one, index) for index in grid.files}
        total = len(waiting)
        try:
            while waiting:
                if cancelled():
                    raise Cancelled
                done, waiting = wait(waiting, timeout=0.2, return_when=FIRST_COMPLETED)
                for future in done:
                    future.result()
                if progress is not None and done:
                    progress((total - len(waiting)) / total)
        except BaseException:
            stop.set()
            pool.shutdown(cancel_futures=True)
            raise
    return bad_values


def _check_alike(file: Path, header: Header, first: Path, expected: Header) -> None:
    if (header.width, header.height) != (expected.width, expected.height):
        raise InputError(f"{file} is {header.size} px, but {first.name} is {expected.size} px; all views must have one size.")
    if header.dtype != expected.dtype:
        raise InputError(
            f"{file} stores {header.depth}, but {first.name} stores {expected.depth}; all views must have one depth."
        )
