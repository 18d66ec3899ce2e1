"""Light fields stored as one array of numbers: files of MATLAB (.mat) and HDF5 (.h5).

What MATLAB's toolboxes for light fields write (a variable LF, views[v, u, y, x, c]), and the first HCI benchmark (a data set
LF).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lfcore.errors import InputError
from lfcore.formats.array_files import StoredArray, stored_arrays
from lfcore.formats.checks import put_in_order, without_non_finite
from lfcore.formats.dark import find_dark_views, has_dark_corner
from lfcore.formats.images import MAX_BYTES, Pixels
from lfcore.illum import aperture_of_views
from lfcore.lightfield import LightField

KIND = "array of views"

_NAME = "lf"
_LEAST_SIDE = 8  # px, of a view
_COLOURS = (3, 4, 1)  # channels, the likeliest first; of four the last is no colour
_MOST_WHOLE = 65535
_LISTED = 4  # arrays in an error


@dataclass(frozen=True)
class Layout:
    """Which axes of an array are what; `channels`: None where it is grey and has no such axis."""

    views: tuple[int, int]  # rows and columns of the grid
    pixels: tuple[int, int]  # y and x
    channels: int | None

    @property
    def axes(self) -> tuple[int, ...]:
        """In the order v, u, y, x, c."""
        return (*self.views, *self.pixels, *(() if self.channels is None else (self.channels,)))


def layout_of(shape: Sequence[int]) -> Layout | None:
    """How a grid of views lies in an array of these sizes; None where it cannot be one.

    The two largest axes are the pixels', of the others, where there are five, the last one of 3, else of 4, else of 1 is the
    channels', the rest are the grid's. y comes before x, and rows before columns.
    """
    if len(shape) not in (4, 5):
        return None
    by_size = sorted(range(len(shape)), key=lambda axis: (-shape[axis], axis))
    pixels, others = sorted(by_size[:2]), sorted(by_size[2:])
    channels = None
    if len(shape) == 5:
        coloured = [axis for count in _COLOURS for axis in reversed(others) if shape[axis] == count]
        if not coloured:
            return None
        channels = coloured[0]
        others.remove(channels)
    if min(shape[axis] for axis in pixels) < _LEAST_SIDE or min(shape[axis] for axis in others) < 2:
        return None
    return Layout((others[0], others[1]), (pixels[0], pixels[1]), channels)


def read(
    path: Path,
    views: int = 8,
    progress: Callable[[float], None] | None = None,
    cancelled: Callable[[], bool] = lambda: False,
) -> LightField:
    """Read the array named LF, or the only one that may be a grid of views. 8 and 16 bit stay as they are, other whole numbers
    become 8 or 16 bit, floats in which 1 is white float32.

    Where corner views are dark, as those of a Lytro are, the middle `views` x `views` are taken. Rows are reversed where the
    pictures run against them. Memory while it works: the array twice. Raises InputError for a damaged file, one without such
    an array and too large ones; Cancelled where `cancelled` says so.
    """
    array, layout = _chosen(path)
    _check_memory(path, array)
    stored = _of_views(path, array.read({}, progress, cancelled), layout)  # (V, U, H, W, C)
    facts = {"Variable": array.name, "Stored": f"{_sizes(array)}, {array.dtype}"}
    if stored.shape[-1] == 1:
        facts["Colour"] = "grey pictures, the one channel repeated"
    rows, columns = stored.shape[:2]
    dark = find_dark_views(stored)
    if views < min(rows, columns) and has_dark_corner(dark, rows, columns):
        top, left = (rows - views) // 2, (columns - views) // 2
        stored = stored[top : top + views, left : left + views]
        dark = find_dark_views(stored)
        facts["Views taken"] = f"the middle {views} x {views} of {rows} x {columns}, whose corners are dark"
    taken = np.array(np.broadcast_to(stored[..., :3], (*stored.shape[:4], 3)), order="C")
    bad = sum(without_non_finite(view) for row in taken for view in row)
    warnings = (f"{bad} values that are no finite numbers were set to 0.",) if bad else ()
    light_field = LightField(
        views=taken,
        name=path.stem,
        source=str(path),
        kind=KIND,
        facts=facts,
        warnings=warnings,
        dark=dark,
        aperture=aperture_of_views(taken),
    )
    return put_in_order(light_field)


def middle_view(path: Path) -> tuple[Pixels, str]:
    """The view in the middle, (H, W, 1 or 3), and what the file holds in a few words. Raises InputError."""
    array, layout = _chosen(path)
    _check_memory(path, array)
    rows, columns, height, width = (array.shape[axis] for axis in layout.axes[:4])
    stored = _of_views(path, array.read({layout.views[0]: rows // 2, layout.views[1]: columns // 2}), layout)
    return stored[0, 0, ..., :3], f"{columns} × {rows} views of {width} × {height} px"


def _chosen(path: Path) -> tuple[StoredArray, Layout]:
    """The array that is called LF, or the only one that may be a light field."""
    arrays = stored_arrays(path)
    possible = [(array, layout) for array in arrays if (layout := layout_of(array.shape)) is not None]
    named = [pair for pair in possible if pair[0].name.lower() == _NAME]
    if len(named or possible) == 1:
        return (named or possible)[0]
    if possible:
        names = ", ".join(array.name for array, _ in possible[:_LISTED])
        raise InputError(f"{path} holds {len(possible)} arrays that may be light fields ({names}); name one of them LF.")
    listed = ", ".join(f"{array.name} ({_sizes(array)})" for array in arrays[:_LISTED]) or "no array of numbers"
    raise InputError(
        f"{path} holds {listed}{', ..' if len(arrays) > _LISTED else ''}; expected an array of views, best named LF, of "
        "the sizes rows x columns x height x width x 3."
    )


def _sizes(array: StoredArray) -> str:
    return " x ".join(map(str, array.shape))


def _check_memory(path: Path, array: StoredArray) -> None:
    if array.nbytes > MAX_BYTES:
        raise InputError(
            f"{path} claims an array of {_sizes(array)}, which takes {array.nbytes / 2**30:.1f} GiB; at most "
            f"{MAX_BYTES / 2**30:.0f} GiB are opened: store fewer or smaller views."
        )


def _of_views(path: Path, values: Pixels, layout: Layout) -> Pixels:
    """(V, U, H, W, C) of uint8, uint16 or float32."""
    views = values.transpose(layout.axes)
    if layout.channels is None:
        views = views[..., np.newaxis]
    if views.dtype in (np.uint8, np.uint16):
        return views
    if views.dtype.kind == "f" and not _whole(views):
        return views.astype(np.float32, copy=False)
    low, high = float(views.min()), float(views.max())
    if low < 0 or high > _MOST_WHOLE:
        raise InputError(
            f"{path} stores whole numbers from {low:g} to {high:g}; expected 0 to 255, 0 to {_MOST_WHOLE}, or floats in "
            "which 1 is white."
        )
    return views.astype(np.uint8 if high <= 255 else np.uint16)


def _whole(values: Pixels) -> bool:
    """Whether floats are whole numbers, as where white is 255: MATLAB computes in doubles."""
    finite = bool(np.isfinite(values).all())
    return finite and float(values.max()) > 1 and bool(np.array_equal(values, np.rint(values)))
