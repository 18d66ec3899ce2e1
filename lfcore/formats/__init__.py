"""Files and folders that hold light fields. `open_light_field` decides by content which reader is asked."""

from __future__ import annotations

import os
import stat
from collections.abc import Callable
from pathlib import Path

import numpy as np

from lfcore.errors import InputError
from lfcore.formats import array_files, arrays, eslf, views_folder
from lfcore.formats.describe import describe
from lfcore.formats.images import EXTENSIONS, check_memory, read_header
from lfcore.formats.lytro.container import is_container, open_container
from lfcore.formats.lytro.contents import Kind, read_contents
from lfcore.formats.lytro.extras import describe as describe_container
from lfcore.lightfield import LightField

__all__ = ["coarse_light_field", "describe", "files_of", "open_light_field"]

_VIEWS = 8  # side of the middle square of views, as in the paper

_KINDS = (
    "a raw capture (.lfp, .LFR), an ESLF picture (14 x 14 px per microlens), a folder with one picture per view or an array of "
    "views (.mat, .h5)"
)


def open_light_field(
    path: str | os.PathLike[str],
    *,
    views: int = _VIEWS,
    progress: Callable[[float], None] | None = None,
    cancelled: Callable[[], bool] = lambda: False,
) -> LightField:
    """Open a light field of any kind that is understood: an ESLF picture, a folder of views, one view of a folder, an array
    of views in a file of MATLAB or HDF5, or a raw capture of a Lytro camera.

    `views` is the side of the middle square of views taken from an ESLF, a raw capture, or an array whose corner views are
    dark (2 to 14; 8 as in the paper, 14 for all). Raw captures are decoded with the calibration at hand and kept in this
    user's cache.
    `progress` is called in the calling thread with rising values up to 1; `cancelled` is asked often. Values keep their
    stored depth. Raises InputError (one sentence) for whatever cannot be opened, Cancelled where `cancelled` says so.
    """
    path = Path(path)
    _check_reachable(path)
    if path.is_dir():
        return views_folder.read(path, progress, cancelled)
    if is_container(path):
        return _open_lytro(path, views, progress, cancelled)
    if array_files.sniff(path):
        return arrays.read(path, views, progress, cancelled)
    header = read_header(path)
    check_memory(path, header)
    if eslf.has_camera_size(header):
        return eslf.read(path, views, progress, cancelled)
    if views_folder.sniff(path):
        return views_folder.read(path, progress, cancelled)
    if eslf.divides(header):
        return eslf.read(path, views, progress, cancelled)
    raise InputError(
        f"{path} is a picture of {header.size} px, which is neither whole 14 x 14 px microlenses nor one view among "
        f"others in its folder; expected {_KINDS}."
    )


def files_of(path: str | os.PathLike[str]) -> list[Path]:
    """The files that a light field is read from: the views of a folder, or of that around a view, else the file itself.

    Empty where nothing can be read, which opening it says in a sentence.
    """
    path = Path(path)
    if not path.exists():
        return []
    try:
        one_picture = path.suffix.lower() in EXTENSIONS and path.is_file() and eslf.has_camera_size(read_header(path))
        views = [] if one_picture or not views_folder.sniff(path) else list(views_folder.grid_of(path).files.values())
    except (InputError, OSError):
        views = []
    return views if path.is_dir() else [path, *views]


def coarse_light_field(path: str | os.PathLike[str]) -> LightField | None:
    """For a raw capture that has not been decoded before: its middle view, coarsely, in the place of 2 x 2 views. Else None.

    Takes about a second for a Lytro Illum. Raises InputError where the capture is damaged.
    """
    path = Path(path)
    if not path.is_file() or not is_container(path) or read_contents(open_container(path)).kind is not Kind.CAPTURE:
        return None
    from lfcore.decode.kept import default_store
    from lfcore.decode.pipeline import DecodeOptions, coarse_view, is_kept

    if is_kept(path, DecodeOptions(_VIEWS), default_store()):
        return None
    view = coarse_view(path)
    views = np.broadcast_to(view, (2, 2, *view.shape))
    return LightField(views=views, name=path.stem, source=str(path), kind="coarse picture")


def _check_reachable(path: Path) -> None:
    try:
        mode = path.stat().st_mode
    except FileNotFoundError as error:
        raise InputError(f"{path} does not exist; expected {_KINDS}.") from error
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(f"{path} cannot be opened: {reason}; check the path and its permissions.") from error
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        # A pipe would be waited for without end.
        raise InputError(f"{path} is neither a file nor a folder; expected {_KINDS}.")


def _open_lytro(path: Path, views: int, progress: Callable[[float], None] | None, cancelled: Callable[[], bool]) -> LightField:
    container = open_container(path)
    contents = read_contents(container)
    if contents.kind is not Kind.CAPTURE:
        what = describe_container(container, contents).rstrip(".")
        raise InputError(f"{what}; `lfview info --extract DIR` writes out what the file holds.")
    # The decoder loads torch, which takes a second that other kinds of files need not wait for.
    from lfcore.decode.kept import default_store
    from lfcore.decode.pipeline import DecodeOptions, open_capture

    return open_capture(path, DecodeOptions(views), default_store(), progress, cancelled)
