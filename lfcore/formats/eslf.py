"""ESLF: one picture with a block of 14 x 14 px per microlens of a Lytro Illum; view (r, c) is pixels [r::14, c::14]."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt

from lfcore.errors import Cancelled, InputError
from lfcore.formats.checks import warned_of_white
from lfcore.formats.dark import find_dark_views, has_dark_corner
from lfcore.formats.images import Header, Picture, Pixels, check_memory, open_picture, read_header
from lfcore.illum import CAMERA_SIZES, aperture_of_views
from lfcore.lightfield import LightField

LENSLET = 14

# The smallest view, in pixels a side, for which a picture divisible by 14 is taken for an ESLF.
_MIN_VIEW = 16

# Microlens rows read at a time: few enough for steady progress and the processor's cache, enough to cost nothing.
_BLOCK = 4

# In an ESLF the largest of the fourteen mean steps from pixel to pixel exceeds the smallest by more than this.
# (Measured: far above 2 in an ESLF, 1.1 to 1.6 in 22 ordinary pictures.)
_PATTERN_RATIO = 2.0


def divides(header: Header) -> bool:
    """Whether the picture is whole blocks of 14 x 14 px that give views of a usable size."""
    across, spare_x = divmod(header.width, LENSLET)
    down, spare_y = divmod(header.height, LENSLET)
    return spare_x == spare_y == 0 and min(across, down) >= _MIN_VIEW


def has_camera_size(header: Header) -> bool:
    """Whether the picture has exactly the size of a Lytro Illum's ESLF, such as 7574 x 5264."""
    return divides(header) and (header.width // LENSLET, header.height // LENSLET) in CAMERA_SIZES


def sniff(path: Path) -> bool:
    """Whether `path` is a picture of whole 14 x 14 px blocks."""
    if not path.is_file():
        return False
    try:
        return divides(read_header(path))
    except InputError:
        return False


def read(
    path: Path,
    views: int = 8,
    progress: Callable[[float], None] | None = None,
    cancelled: Callable[[], bool] = lambda: False,
) -> LightField:
    """Read the middle `views` x `views` of the 14 x 14 views in their stored depth: for 8, rows and columns 3..10.

    Rows and columns are counted from 0, as the paper's code takes 4..11 from 1. Alpha is dropped, grey repeated. The
    picture is read in blocks of rows, each sliced while it is in the cache. A file with 375 rows of microlenses gives
    views of 375 rows: the paper's code appends a black row, which its scores crop away. Raises InputError where the
    picture does not divide, is damaged or too large; Cancelled where `cancelled` says so.
    """
    if not 2 <= views <= LENSLET:
        raise InputError(f"{views} x {views} views were asked for; an ESLF holds 14 x 14, so ask for 2 to 14.")
    with open_picture(path) as picture:
        header = picture.header
        check_memory(path, header)
        if not divides(header):
            raise InputError(
                f"{path} is {header.size} px, which is not a whole number of {LENSLET} x {LENSLET} px microlenses; "
                "an ESLF of a Lytro Illum has 7574 x 5264, 7574 x 5250 or 7560 x 5250 px."
            )
        sliced, patterned = _slice(picture, views, progress, cancelled)  # (V, U, H, W, 3)
    start = (LENSLET - views) // 2
    numbers = f"rows and columns {start} to {start + views - 1}, counted from 0"
    taken = "all 14 x 14" if views == LENSLET else f"the middle {views} x {views} of 14 x 14 ({numbers})"
    facts = {"Views taken": taken}
    if header.channels == 1:
        facts["Colour"] = "a grey picture, its one channel repeated"
    dark = find_dark_views(sliced)
    warnings = []
    if not patterned:
        warnings.append(
            f"{path.name} shows no pattern of 14 x 14 px microlenses; it may be an ordinary photograph of a size that divides."
        )
    if has_dark_corner(dark, views, views):
        warnings.append("The corner views are dark, and so is what is synthesized from them: open the middle 8 x 8.")
    light_field = LightField(
        views=sliced,
        name=path.stem,
        source=str(path),
        kind="ESLF",
        facts=facts,
        warnings=tuple(warnings),
        dark=dark,
        aperture=aperture_of_views(sliced),
    )
    return warned_of_white(light_field)


def _slice(
    picture: Picture, count: int, progress: Callable[[float], None] | None, cancelled: Callable[[], bool]
) -> tuple[Pixels, bool]:
    """The middle views, and whether the picture shows the pattern of microlenses.

    In an ESLF the step from one pixel to the next depends on where in the microlens it is taken: from the last pixel of
    one to the first of the next it leaps from one end of the aperture to the other. In a photograph all are alike.
    """
    header = picture.header
    height, width = header.height // LENSLET, header.width // LENSLET
    start = (LENSLET - count) // 2
    views = np.empty((count, count, height, width, 3), header.dtype)  # (V, U, H, W, 3)
    # A tiled TIFF has no rows to read one after the other.
    whole = picture.read() if header.tiled else None
    steps = np.zeros(LENSLET)
    for begin in range(0, height, _BLOCK):
        if cancelled():
            raise Cancelled
        end = min(begin + _BLOCK, height)
        rows = slice(begin * LENSLET, end * LENSLET)
        block = whole[rows] if whole is not None else picture.read_rows(rows.start, rows.stop)
        lenses = block.reshape(end - begin, LENSLET, width, LENSLET, header.channels)
        for row in range(count):
            for column in range(count):
                views[row, column, begin:end] = lenses[:, start + row, :, start + column]
        steps += _steps(lenses[:, LENSLET // 2, :, :, header.channels // 2])
        if progress is not None:
            progress(end / height)
    return views, bool(steps.max() > _PATTERN_RATIO * steps.min())


def _steps(lenses: Pixels) -> npt.NDArray[np.float64]:
    """Sums of the steps from each of the 14 pixels across a microlens to the next: (rows, W, 14) -> (14,)."""
    line = lenses.reshape(len(lenses), -1).astype(np.float32)  # (rows, W * 14)
    steps = np.abs(np.diff(line, axis=1, append=line[:, -1:]))
    return steps.reshape(-1, LENSLET).sum(axis=0, dtype=np.float64)
