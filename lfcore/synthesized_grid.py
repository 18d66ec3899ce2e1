"""Synthesized views in a grid, as a light field's files: a folder of views, an ESLF picture, a quilt for a Looking Glass."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import numpy.typing as npt

from lfcore.errors import Cancelled, InputError
from lfcore.export import check_folder_target, check_no_views, check_target, removed_on_failure, write_picture, write_rows
from lfcore.formats.eslf import LENSLET
from lfcore.formats.images import MAX_BYTES
from lfcore.lightfield import FloatArray, LightField
from lfcore.metrics import to_uint8
from lfcore.quilt import MAX_VIEWS, Quilt, quilt_path
from lfcore.refocus import shifted
from lfcore.synthesis import never

ByteArray = npt.NDArray[np.uint8]
View = Callable[[float, float], FloatArray]

MAX_QUILT_SIDE = 32_768  # px


def check_grid_target(path: str | os.PathLike[str], side: int, light_field: LightField) -> Path:
    """Make sure, before long work, that `side` x `side` views can be written there: a .png name means an ESLF, any other name a
    folder of views. Raises InputError or OutputError."""
    target = Path(path)
    if not 2 <= side <= MAX_VIEWS:
        raise InputError(f"{side} x {side} views were asked for; give 2 to {MAX_VIEWS} a side.")
    if target.suffix.lower() == ".png":
        if side > LENSLET:
            raise InputError(
                f"{side} x {side} views were asked for; an ESLF holds at most {LENSLET} x {LENSLET}: name a folder."
            )
        needed = _eslf_shape(light_field)[0] * _eslf_shape(light_field)[1] * 3
        if needed > MAX_BYTES:
            raise InputError(f"This ESLF would take {needed / 2**30:.1f} GiB of memory; name a folder instead.")
        return check_target(target, (".png",))
    folder = check_folder_target(target)
    check_no_views(folder)
    return folder


def write_views(
    folder: Path, side: int, view: View, done: Callable[[int], None], cancelled: Callable[[], bool] = never
) -> None:
    """Write `side` x `side` views as view_RR_CC.png (8 bits), one in memory at a time.

    `done` is told how many are written. An error or `cancelled` (which raises Cancelled) removes them again.
    """
    with removed_on_failure(folder) as written:
        for count, (row, column, u, v) in enumerate(_grid(side), 1):
            _check(cancelled)
            target = folder / f"view_{row:02}_{column:02}.png"
            written.append(target)
            write_picture(target, to_uint8(view(u, v)))
            done(count)


def write_eslf(
    path: Path,
    side: int,
    light_field: LightField,
    view: View,
    done: Callable[[int], None],
    cancelled: Callable[[], bool] = never,
) -> None:
    """Write `side` x `side` views as the middle ones of an ESLF: a PNG with a block of 14 x 14 px per pixel of a view.

    The views around them are black, as the outer views of a camera nearly are. Opened again with `views=side`, the same views
    come back. Every block has a pixel of every view, so the whole picture is in memory: 588 bytes per pixel of a view.
    """
    start = (LENSLET - side) // 2
    height, width = _eslf_shape(light_field)
    picture = np.zeros((height, width, 3), np.uint8)
    for count, (row, column, u, v) in enumerate(_grid(side), 1):
        _check(cancelled)
        picture[start + row :: LENSLET, start + column :: LENSLET] = to_uint8(view(u, v))
        done(count)
    # A row of microlenses at a time, so that writing can be broken off too.
    bands = (picture[top : top + LENSLET] for top in range(0, height, LENSLET))
    write_rows(path, (height, width), _until(bands, cancelled))


def check_quilt_target(path: str | os.PathLike[str], quilt: Quilt, light_field: LightField) -> Path:
    """Make sure, before long work, that the quilt can be written; returns its full name. Raises InputError, OutputError."""
    height, width = quilt.rows * light_field.height, quilt.columns * light_field.width
    if max(height, width) > MAX_QUILT_SIDE:
        raise InputError(f"The quilt would have {width} x {height} px; at most {MAX_QUILT_SIDE} a side: take fewer views.")
    return check_target(quilt_path(Path(path), quilt, (light_field.width, light_field.height)), (".png",))


def write_quilt(
    path: Path,
    quilt: Quilt,
    light_field: LightField,
    view: View,
    done: Callable[[int], None],
    cancelled: Callable[[], bool] = never,
) -> None:
    """Write a quilt as one PNG, the view farthest to the left at its bottom left, one row of views in memory at a time."""
    total = quilt.columns * quilt.rows
    places = {quilt.place(number): number / (total - 1) for number in range(total)}

    def bands() -> Iterator[ByteArray]:
        count = 0
        for row in range(quilt.rows):
            band = np.empty((light_field.height, quilt.columns * light_field.width, 3), np.uint8)
            for column in range(quilt.columns):
                _check(cancelled)
                u = places[row, column]
                picture = shifted(view(u, quilt.v), (u - 0.5) * quilt.focus, 0.0)
                band[:, column * light_field.width :][:, : light_field.width] = to_uint8(picture)
                count += 1
                done(count)
            yield band

    write_rows(path, (quilt.rows * light_field.height, quilt.columns * light_field.width), bands())


def _eslf_shape(light_field: LightField) -> tuple[int, int]:
    return LENSLET * light_field.height, LENSLET * light_field.width


def _grid(side: int) -> Iterator[tuple[int, int, float, float]]:
    """Row, column, u, v of each view, row by row."""
    for row in range(side):
        for column in range(side):
            yield row, column, column / (side - 1), row / (side - 1)


def _until(bands: Iterator[ByteArray], cancelled: Callable[[], bool]) -> Iterator[ByteArray]:
    for band in bands:
        _check(cancelled)
        yield band


def _check(cancelled: Callable[[], bool]) -> None:
    if cancelled():
        raise Cancelled
