"""A glance at a light field: its middle view, small, and what it is in a few words, without reading all of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from lfcore.errors import InputError
from lfcore.formats import array_files, arrays, eslf, views_folder
from lfcore.formats.collection import members
from lfcore.formats.images import check_memory, open_picture, read_header
from lfcore.formats.lytro.container import is_container, open_container
from lfcore.formats.lytro.contents import Kind, read_contents
from lfcore.lightfield import as_float
from lfcore.metrics import to_uint8

LONGEST_SIDE = 192  # px

Picture = npt.NDArray[np.uint8]


@dataclass(frozen=True)
class Glance:
    """The middle view, uint8 (h, w, 3), at most LONGEST_SIDE a side, None for a folder of light fields; and what it is."""

    picture: Picture | None
    caption: str


def glance(path: Path, cancelled: Callable[[], bool] = lambda: False) -> Glance:
    """Look at what `lfcore.formats.open_light_field`, or the viewer, would open at this path.

    A folder of views takes a few milliseconds; an ESLF or a raw capture must be read whole, which takes about a second.
    Raises InputError where it cannot be opened, Cancelled where `cancelled` says so.
    """
    if path.is_dir():
        inside = members(path)
        if inside:
            return Glance(None, f"Folder, {len(inside)} inside")
        return _middle_of_grid(path)
    if is_container(path):
        return _of_container(path)
    if array_files.sniff(path):
        view, caption = arrays.middle_view(path)
        return Glance(shrunk(_in_colour(view)), caption)
    header = read_header(path)
    check_memory(path, header)
    if not eslf.has_camera_size(header) and views_folder.sniff(path):
        return _middle_of_grid(path)
    light_field = eslf.read(path, 2, cancelled=cancelled)
    caption = f"ESLF, 14 × 14 views of {light_field.width} × {light_field.height} px"
    return Glance(shrunk(light_field.views[1, 1]), caption)


def shrunk(picture: npt.NDArray[np.generic]) -> Picture:
    """A picture (H, W, 3), uint8, uint16 or float32, at most LONGEST_SIDE a side by means over square blocks: uint8."""
    height, width = picture.shape[:2]
    factor = max(-(-max(height, width) // LONGEST_SIDE), 1)
    rows, columns = max(height // factor, 1), max(width // factor, 1)
    down, across = min(factor, height), min(factor, width)
    total = np.zeros((rows, columns, 3), np.float32)
    for row in range(down):  # one sample of every block at a time, so that only small arrays are made
        for column in range(across):
            total += as_float(picture[row : row + rows * down : down, column : column + columns * across : across])
    return to_uint8(total / (down * across))


def _middle_of_grid(path: Path) -> Glance:
    grid = views_folder.grid_of(path)
    file = grid.files[grid.rows // 2, grid.columns // 2]
    with open_picture(file) as picture:
        header = picture.header
        check_memory(file, header, grid.rows * grid.columns)
        pixels = picture.read()  # (H, W, 1 or 3)
    caption = f"{grid.columns} × {grid.rows} views of {header.width} × {header.height} px"
    return Glance(shrunk(_in_colour(pixels)), caption)


def _in_colour(pixels: npt.NDArray[np.generic]) -> npt.NDArray[np.generic]:
    """(H, W, 1 or 3) -> (H, W, 3)."""
    return np.broadcast_to(pixels, (*pixels.shape[:2], 3))


def _of_container(path: Path) -> Glance:
    container = open_container(path)
    contents = read_contents(container)
    if contents.kind is Kind.CAPTURE:
        from lfcore.decode.pipeline import coarse_view  # loads torch, which other files need not wait for

        return Glance(shrunk(coarse_view(path)), "Raw capture")
    from lfcore.formats.lytro.extras import decode_map, decode_pictures, describe  # loads the decoder of videos

    caption = contents.kind.value.partition(",")[0].capitalize()
    pictures = sorted(contents.stack, key=lambda stored: abs(stored.focus or 0.0)) or contents.others
    if pictures:
        return Glance(shrunk(decode_pictures(container, pictures[:1])[0]), caption)
    if contents.maps:
        return Glance(shrunk(_grey(decode_map(container, contents.maps[0]))), caption)
    raise InputError(describe(container, contents))


def _grey(values: npt.NDArray[np.float32]) -> Picture:
    """A map (H, W) from black for its least finite value to white for the greatest."""
    finite = np.nan_to_num(values, nan=0.0, posinf=0.0, neginf=0.0)
    low, high = float(finite.min()), float(finite.max())
    grey = to_uint8((finite - low) / max(high - low, 1e-6))
    return np.repeat(grey[..., np.newaxis], 3, axis=2)
