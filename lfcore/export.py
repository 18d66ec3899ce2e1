"""Pictures and disparity maps to files: PNG for looking at, TIFF and EXR for computing with. All writes are atomic."""

from __future__ import annotations

import contextlib
import os
import shutil
import stat
import struct
import tempfile
from collections.abc import Collection, Iterable, Iterator, Mapping
from pathlib import Path

import numpy as np
import numpy.typing as npt
import OpenImageIO as oiio

from lfcore.atomic import atomic_path
from lfcore.errors import OutputError
from lfcore.lightfield import CORNERS, FloatArray

IMAGE_EXTENSIONS = (".png", ".tif", ".tiff", ".exr")
DISPARITY_EXTENSIONS = (".tif", ".tiff", ".exr")

_PNG_SIGNATURE = 8  # bytes
_PNG_CHUNK = 12  # bytes of a chunk beside its data
_FULL_DISK = 2**20  # bytes; with less room than this a failure to write is one of room


def check_target(path: str | os.PathLike[str], extensions: Collection[str]) -> Path:
    """Make sure, before long work, that a file of one of these extensions (lower case, with dot) can be written here.

    Raises OutputError: unknown extension, missing or read-only folder, read-only file, a folder of that name.
    """
    target = Path(path)
    if target.suffix.lower() not in extensions:
        found = f"ends in {target.suffix}" if target.suffix else "has no extension"
        raise OutputError(f"Cannot write {target}: its name {found}; choose one of {', '.join(extensions)}.")
    if target.is_dir():
        raise OutputError(f"Cannot write {target}: it is a folder; give the name of a file.")
    if target.exists() and not target.stat().st_mode & stat.S_IWUSR:
        raise OutputError(f"Cannot write {target}: the file is read-only; choose another name.")
    check_folder(target.parent)
    return target


def check_apart(targets: Iterable[str | os.PathLike[str]], inputs: Iterable[str | os.PathLike[str]] = ()) -> None:
    """Make sure, before long work, that no target is something that is read, and that no two are one, whatever they are called.

    Raises OutputError.
    """
    read = {identity for path in inputs for identity in _identities(path)}
    written: set[object] = set()
    for target in targets:
        identities = _identities(target)
        if read & identities:
            raise OutputError(f"Cannot write {os.fspath(target)}: it is read for this, and would be lost; choose another name.")
        if written & identities:
            raise OutputError(
                f"Cannot write {os.fspath(target)}: something else is to be written there; give each its own name."
            )
        written |= identities


def _identities(path: str | os.PathLike[str]) -> set[object]:
    """By which a path is known to be the same as another: where it leads, and the file that is there."""
    identities: set[object] = {os.path.realpath(path)}
    with contextlib.suppress(OSError):
        facts = Path(path).stat()
        identities.add((facts.st_dev, facts.st_ino))
    return identities


def check_folder(folder: Path) -> None:
    """Make sure that files can be made in this existing folder, by making one. Raises OutputError."""
    if not folder.is_dir():
        found = "is not a folder" if folder.exists() else "does not exist"
        raise OutputError(f"Cannot write to {folder}: it {found}; make the folder first or choose another.")
    try:
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise OutputError(f"Cannot write to {folder}: {error.strerror}; choose another folder.") from error


def check_folder_target(folder: str | os.PathLike[str]) -> Path:
    """Make sure, before long work, that this folder is there and takes files, or that it can be made. Raises OutputError."""
    path = Path(folder)
    existing = path
    while not existing.exists() and existing != existing.parent:
        existing = existing.parent
    check_folder(existing)
    return path


def check_no_views(folder: Path) -> None:
    """Make sure that there are no views in the folder, which those to be written would be taken together with. Raises
    OutputError."""
    if any(folder.glob("view_*")):
        raise OutputError(f"Cannot write views to {folder}: it holds some already; choose another folder or empty this one.")


def make_folder(folder: str | os.PathLike[str]) -> Path:
    """The folder, made with its parents if it is missing, and checked to be writable. Raises OutputError."""
    path = Path(folder)
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"Cannot make the folder {path}: {error.strerror}; choose another place.") from error
    check_folder(path)
    return path


@contextlib.contextmanager
def removed_on_failure(folder: Path) -> Iterator[list[Path]]:
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


def write_image(path: str | os.PathLike[str], image: FloatArray) -> None:
    """Write a picture (H, W, 3), 1 = white: PNG with 8 bits, TIFF with 16 bits, EXR as half floats.

    The values are written as they are, in the tone of the light field; no transfer function is applied. OutputError
    where the target cannot be written.
    """
    target = check_target(path, IMAGE_EXTENSIONS)
    stored = {".png": "uint8", ".exr": "half"}.get(target.suffix.lower(), "uint16")
    _write(target, np.clip(image, 0, 1), stored, {})


def write_picture(path: str | os.PathLike[str], picture: npt.NDArray[np.uint8]) -> None:
    """Write a finished 8-bit picture (H, W, 3), such as a figure, as PNG."""
    _write(check_target(path, (".png",)), picture, "uint8", {})


def write_stored(path: str | os.PathLike[str], picture: npt.NDArray[np.generic]) -> None:
    """Write stored values (H, W, 3), uint8 or uint16, as they are: PNG, lightly compressed, for large pictures take long."""
    target = check_target(path, (".png",))
    _write(target, picture, "uint8" if picture.dtype == np.uint8 else "uint16", {"png:compressionLevel": 2})


def write_disparity(path: str | os.PathLike[str], disparity: FloatArray) -> None:
    """Write a disparity map (H, W), px over the full corner-to-corner baseline: TIFF or EXR, one channel, float32."""
    note = "disparity in pixels over the full corner-to-corner baseline; positive: content moves to larger x as u grows"
    write_map(path, disparity, note)


def write_map(path: str | os.PathLike[str], values: FloatArray, note: str) -> None:
    """Write a map of one value (H, W), with a note of what it is, unit and sign: TIFF or EXR, one channel, float32."""
    _write(check_target(path, DISPARITY_EXTENSIONS), values[..., None], "float", {"ImageDescription": note})


def write_warped(folder: str | os.PathLike[str], warped: FloatArray, extension: str) -> list[Path]:
    """Write the four warped inputs (4, H, W, 3) as warped_u0_v0, warped_u0_v1, ... in the folder; returns the paths."""
    paths = warped_paths(make_folder(folder), extension)
    for path, image in zip(paths, warped, strict=True):
        write_image(path, image)
    return paths


def warped_paths(folder: str | os.PathLike[str], extension: str) -> list[Path]:
    """Where `write_warped` writes the inputs, in the order of CORNERS."""
    return [Path(folder) / f"warped_u{u:.0f}_v{v:.0f}{extension}" for u, v in CORNERS]


def write_rows(path: str | os.PathLike[str], size: tuple[int, int], bands: Iterable[npt.NDArray[np.uint8]]) -> None:
    """Write an 8-bit picture of (height, width) as PNG, lightly compressed, from bands of rows (h, W, 3) as they come.

    Raises OutputError where the target cannot be written; what the iterable raises passes through and leaves no file.
    """
    target = check_target(path, (".png",))
    spec = oiio.ImageSpec(size[1], size[0], 3, "uint8")
    spec.attribute("png:compressionLevel", 2)
    with _opened(target, spec) as output:
        row = 0
        for band in bands:
            end = row + len(band)
            if not output.write_scanlines(row, end, 0, np.ascontiguousarray(band)):
                raise _cannot_write(target, output)
            row = end


def _write(target: Path, values: npt.NDArray[np.generic], stored: str, attributes: Mapping[str, str | int]) -> None:
    height, width, channels = values.shape
    spec = oiio.ImageSpec(width, height, channels, stored)
    for name, value in attributes.items():
        spec.attribute(name, value)
    if target.suffix.lower() in (".tif", ".tiff"):
        spec.attribute("compression", "zip")
    with _opened(target, spec) as output:
        if not output.write_image(np.ascontiguousarray(values)):
            raise _cannot_write(target, output)


@contextlib.contextmanager
def _opened(target: Path, spec: oiio.ImageSpec) -> Iterator[oiio.ImageOutput]:
    """A writer of the target, which appears when the block has succeeded. Raises OutputError."""
    with atomic_path(target) as temporary:
        output = oiio.ImageOutput.create(str(temporary))
        if output is None:
            raise OutputError(f"Cannot write {target}: {oiio.geterror()}; choose another kind of file.")
        try:
            if not output.open(str(temporary), spec):
                raise _cannot_write(target, output)
            yield output
        finally:
            closed = output.close()
        # OpenImageIO does not notice that a PNG has not found room.
        if not closed or (target.suffix.lower() == ".png" and not _is_whole_png(temporary)):
            raise _cannot_write(target, output)


def _is_whole_png(path: Path) -> bool:
    """Whether the chunks of a PNG follow one another up to the last one, which ends the file."""
    size = path.stat().st_size
    with path.open("rb") as file:
        end = len(file.read(_PNG_SIGNATURE))
        while end + _PNG_CHUNK <= size:
            file.seek(end)
            length, kind = struct.unpack(">I4s", file.read(8))
            end += _PNG_CHUNK + length
            if kind == b"IEND":
                return end == size
    return False


def _cannot_write(target: Path, output: oiio.ImageOutput) -> OutputError:
    reason = output.geterror()
    if not reason or shutil.disk_usage(target.parent).free < _FULL_DISK:
        reason = "the disk is full"
    return OutputError(f"Cannot write {target}: {reason}; choose another place or make room there.")
