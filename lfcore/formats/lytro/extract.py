"""What a Lytro file holds, written out: pictures as they are stored, maps as TIFF, metadata as JSON, calibration files."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

from lfcore.atomic import atomic_path
from lfcore.errors import InputError
from lfcore.export import make_folder, write_map, write_picture
from lfcore.formats.lytro.container import TABLE, Container, Section
from lfcore.formats.lytro.contents import Contents, StoredMap, StoredPicture
from lfcore.formats.lytro.extras import decode_map, decode_pictures, suffix_of
from lfcore.formats.lytro.metadata import frames

_NOTE = "depth in lambda, the cameras' own measure: 0 is the plane of focus, negative is nearer"
_MAP_NOTES = {"depth map": _NOTE, "depth table": _NOTE, "confidence": "how far the depth map can be trusted"}


def extract(container: Container, contents: Contents, folder: Path, progress: Callable[[float], None]) -> list[Path]:
    """Write everything but the mosaic into the folder, which is made if it is missing; returns the paths.

    JPEG and PNG pictures are written byte for byte, frames of videos as PNG, maps as float32 TIFF. Raises InputError for
    what is damaged, after writing what is not; OutputError where the folder cannot be written.
    """
    make_folder(folder)
    damaged: list[str] = []
    paths: list[Path] = []
    jobs = list(_jobs(container, contents, folder))
    for index, job in enumerate(jobs):
        try:
            paths += job()
        except InputError as error:
            damaged.append(str(error))
        progress((index + 1) / len(jobs))
    if damaged:
        more = f" (and {len(damaged) - 1} more)" if len(damaged) > 1 else ""
        raise InputError(f"{damaged[0].rstrip('.')}{more}; what is whole was written to {folder}.")
    return paths


_Job = Callable[[], list[Path]]


def _jobs(container: Container, contents: Contents, folder: Path) -> Iterator[_Job]:
    for name, section in _documents(container):
        yield partial(_write_section, container, section, folder / name)
    numbered = {picture: number for number, picture in enumerate(contents.pictures)}
    for picture, number in numbered.items():
        if picture.frame is None:
            yield partial(_write_still, container, picture, folder / _picture_name(picture, number))
    for section in {picture.section for picture in numbered if picture.frame is not None}:
        frames = {
            folder / _picture_name(picture, number): picture
            for picture, number in numbered.items()
            if picture.section == section and picture.frame is not None
        }
        yield partial(_write_frames, container, frames)
    for number, stored in enumerate(contents.maps):
        yield partial(_write_map, container, stored, folder / f"{_slug(stored.label)}_{number:02}.tif")
    for file in contents.files:
        yield partial(_write_section, container, file.section, folder / file.name)


def _documents(container: Container) -> Iterator[tuple[str, Section]]:
    """The table of contents and the metadata of the frames, by the names of their files."""
    for section in container.sections:
        if section.kind == TABLE:
            yield "table.json", section
    for number, frame in enumerate(frames(container)):
        for key, name in (("metadataRef", "metadata"), ("privateMetadataRef", "private_metadata")):
            found = container.find(frame.text(key))
            if found is not None:
                yield f"{name}_{number:02}.json", found


def _write_section(container: Container, section: Section, path: Path) -> list[Path]:
    with atomic_path(path) as temporary:
        temporary.write_bytes(container.data(section))
    return [path]


def _write_still(container: Container, picture: StoredPicture, stem: Path) -> list[Path]:
    data = container.data(picture.section)
    path = stem.with_name(stem.name + (suffix_of(data) or ".bin"))
    with atomic_path(path) as temporary:
        temporary.write_bytes(data)
    return [path]


def _write_frames(container: Container, stored: dict[Path, StoredPicture]) -> list[Path]:
    paths = [stem.with_name(f"{stem.name}.png") for stem in stored]
    for path, pixels in zip(paths, decode_pictures(container, list(stored.values())), strict=True):
        write_picture(path, pixels)
    return paths


def _write_map(container: Container, stored: StoredMap, path: Path) -> list[Path]:
    write_map(path, decode_map(container, stored), _MAP_NOTES[stored.label])
    return [path]


def _picture_name(picture: StoredPicture, number: int) -> str:
    focus = "" if picture.focus is None else f"_lambda{picture.focus:+.2f}"
    return f"{_slug(picture.label)}_{number:02}{focus}"


def _slug(label: str) -> str:
    return "".join(letter if letter.isalnum() else "_" for letter in label.lower())
