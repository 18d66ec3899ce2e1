"""What kind of Lytro file a container is, and what it holds beside the raw mosaic: pictures, maps, calibration files."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from itertools import islice
from pathlib import PurePosixPath
from typing import Any

from lfcore.errors import InputError
from lfcore.formats.lytro.container import Container, Section
from lfcore.formats.lytro.fields import Fields, printable
from lfcore.formats.lytro.metadata import Capture, read_capture

_MAX_PICTURE_SIDE = 65_535
_MAX_PICTURES = 400
_MAX_PLACE = 120  # characters
_MAX_FILE_NAME = 100

# How the acceleration structures of both generations are called in words.
_STRUCTURES = {
    "com.lytro.acceleration.refocusStack": "refocus stack",
    "com.lytro.acceleration.depthMap": "depth map",
    "com.lytro.acceleration.edofParallax": "perspective stack",
    "focusStack": "refocus stack",
    "edofPerspective": "perspective stack",
    "edofWarp": "warp stack",
    "edofWarpPreAdjust": "warp stack",
    "compressed": "compressed mosaic",
}
_STACK = "refocus stack"
_MAPS = {"depthMap": "depth map", "confidenceMap": "confidence", "depthLut": "depth table"}


class Kind(Enum):
    """What a container is, by what it holds."""

    CAPTURE = "raw capture"
    CALIBRATION = "calibration files of a first-generation camera"
    REFOCUS_STACK = "refocus stack, without the raw capture"
    DEPTH_MAP = "depth map, without the raw capture"
    PICTURES = "pictures, without the raw capture"
    METADATA = "metadata only, without the raw capture"
    UNKNOWN = "container without anything that is known"


@dataclass(frozen=True)
class StoredPicture:
    """A picture in a section, or one frame of the video in a section. Width and height as the metadata claims them."""

    label: str  # "refocus stack", "thumbnail", ...
    section: Section
    representation: str  # "jpeg", "png", "h264"
    width: int | None = None
    height: int | None = None
    focus: float | None = None  # lambda: 0 is the plane that the camera was focused on, negative nearer
    viewpoint: tuple[float, float] | None = None  # x, y as stored
    frame: int | None = None  # of a video, from 0


@dataclass(frozen=True)
class StoredMap:
    """A map of one value in a section: depth in lambda, or how far it can be trusted."""

    label: str  # "depth map", "confidence", "depth table"
    section: Section
    representation: str  # "raw" and "packedFloat" are little-endian float32
    width: int
    height: int
    low: float | None = None  # range of the values as the metadata claims it
    high: float | None = None


@dataclass(frozen=True)
class StoredFile:
    """A file in the backup of a first-generation camera, by its name without folders."""

    name: str
    section: Section


@dataclass(frozen=True)
class Contents:
    """All that a container holds as far as it is known; only what is in the file itself is listed."""

    kind: Kind
    capture: Capture | None
    pictures: tuple[StoredPicture, ...]
    maps: tuple[StoredMap, ...]
    files: tuple[StoredFile, ...]

    @cached_property
    def stack(self) -> tuple[StoredPicture, ...]:
        """The pictures of the refocus stack that have a focus value, from near to far."""
        return tuple(sorted(filter(_in_stack, self.pictures), key=lambda picture: picture.focus or 0.0))

    @cached_property
    def others(self) -> tuple[StoredPicture, ...]:
        """The pictures that are not of the refocus stack."""
        return tuple(picture for picture in self.pictures if not _in_stack(picture))


def read_contents(container: Container) -> Contents:
    """List what the container holds. Raises InputError for damaged metadata."""
    capture = read_capture(container)
    pictures = tuple(islice(_pictures(container), _MAX_PICTURES + 1))
    maps, files = tuple(_maps(container)), tuple(_files(container))
    if len(pictures) > _MAX_PICTURES:
        raise InputError(f"{container.path} claims more than {_MAX_PICTURES} pictures, which no camera writes; it is damaged.")
    stored = Contents(Kind.UNKNOWN, capture, pictures, maps, files)
    return Contents(_kind(stored), capture, pictures, maps, files)


def _in_stack(picture: StoredPicture) -> bool:
    return picture.label == _STACK and picture.focus is not None


def _kind(stored: Contents) -> Kind:
    if stored.capture is not None and stored.capture.image is not None:
        return Kind.CAPTURE
    if stored.files:
        return Kind.CALIBRATION
    if stored.stack:
        return Kind.REFOCUS_STACK
    if stored.pictures:
        return Kind.PICTURES
    if stored.maps:
        return Kind.DEPTH_MAP
    return Kind.METADATA if stored.capture is not None else Kind.UNKNOWN


def raw_file(container: Container, capture: Capture | None) -> str:
    """In words, which file would have the mosaic that belongs to a container without one."""
    stem = container.path.stem
    for suffix in ("-stk", "-dm"):
        if stem.lower().endswith(suffix):
            return f"{stem[: -len(suffix)]}.lfp"
    name = None if capture is None else capture.facts.file_name
    return f"{name[:40]}.LFR" if name else "a file of 16 MB (.lfp, first generation) or 55 MB (.LFR, Illum)"


def roles(container: Container) -> dict[str, str]:
    """For each section that the table of contents refers to, the first place where it does: "frames[0].frame.imageRef"."""
    found: dict[str, str] = {}
    waiting: deque[tuple[str, Any]] = deque([("", container.table.values)])
    while waiting:
        place, value = waiting.popleft()
        if isinstance(value, dict):
            waiting += [(_shortened(f"{place}.{key}" if place else key), child) for key, child in value.items()]
        elif isinstance(value, list):
            waiting += [(_shortened(f"{place}[{index}]"), child) for index, child in enumerate(value)]
        elif isinstance(value, str) and (section := container.find(value)) is not None:
            found.setdefault(section.name, printable(place))
    return found


def _shortened(place: str) -> str:
    # Keys may be long, and deep: each place would hold all those above it.
    return place if len(place) <= _MAX_PLACE else f"..{printable(place[-_MAX_PLACE:])}"


def _structures(container: Container) -> Iterator[tuple[str, Fields]]:
    """(name in words, object) of all acceleration structures, of both generations."""
    table = container.table
    for entry in table.child("picture").children("accelerationArray"):
        kind = entry.text("type") or ""
        yield _STRUCTURES.get(kind, kind[:40] or "unnamed structure"), entry.child("vendorContent")
    for holder in (*table.children("views"), *table.children("frames")):
        for entry in holder.children("accelerations"):
            kind = entry.text("kind") or ""
            yield _STRUCTURES.get(kind, kind[:40] or "unnamed structure"), entry


def _pictures(container: Container) -> Iterator[StoredPicture]:
    for label, structure in _structures(container):
        for entry in structure.children("imageArray"):
            yield from _picture(container, label, entry, structure)
        for holder in (structure, *structure.children("perFrame")):
            for entry in holder.children("perImage"):
                yield from _picture(container, label, entry, structure)
        yield from _video(container, label, structure.child("blockOfImages"))
    for entry in (*container.table.children("thumbnailArray"), *container.table.children("thumbnails")):
        yield from _picture(container, "thumbnail", entry, entry)


def _picture(container: Container, label: str, entry: Fields, parent: Fields) -> Iterator[StoredPicture]:
    section = container.find(entry.text("imageRef"))
    if section is not None:
        yield StoredPicture(
            label=label,
            section=section,
            representation=_representation(entry) or _representation(parent) or "jpeg",
            width=_side(entry, "width") or _side(parent, "width"),
            height=_side(entry, "height") or _side(parent, "height"),
            focus=_focus(entry),
            viewpoint=_viewpoint(entry),
        )


def _video(container: Container, label: str, block: Fields) -> Iterator[StoredPicture]:
    section = container.find(block.text("blockOfImagesRef"))
    if section is None:
        return
    representation = _representation(block) or "h264"
    for index, entry in enumerate(block.children("metadataArray")):
        yield StoredPicture(
            label=label,
            section=section,
            representation=representation,
            width=_side(entry, "width"),
            height=_side(entry, "height"),
            focus=_focus(entry),
            viewpoint=_viewpoint(entry),
            frame=index,
        )


def _maps(container: Container) -> Iterator[StoredMap]:
    for _, structure in _structures(container):
        for key, label in _MAPS.items():
            entry = structure.child(key)
            section = container.find(entry.text("imageRef"))
            # The first generation writes the size and the range beside the map, the Illum into it.
            width = _side(entry, "width") or _side(structure, "width")
            height = _side(entry, "height") or _side(structure, "height")
            span = (entry if "minLambda" in entry else structure) if label == "depth map" else Fields({}, "")
            if section is not None and width and height:
                yield StoredMap(
                    label=label,
                    section=section,
                    representation=_representation(entry) or "raw",
                    width=width,
                    height=height,
                    low=span.number("minLambda"),
                    high=span.number("maxLambda"),
                )


def _files(container: Container) -> Iterator[StoredFile]:
    for entry in container.table.children("files"):
        section = container.find(entry.text("dataRef"))
        # Names are paths on the camera, such as C:\T1CALIB\MOD_0000.RAW: only the last part is a name here.
        name = PurePosixPath((entry.text("name") or "").replace("\\", "/")).name
        if section is not None and name not in ("", ".", "..") and len(name) <= _MAX_FILE_NAME:
            yield StoredFile(name, section)


def _side(fields: Fields, key: str) -> int | None:
    return fields.whole(key, 1, _MAX_PICTURE_SIDE)


def _representation(fields: Fields) -> str | None:
    text = fields.text("representation")
    return None if text is None else text[:20]


def _focus(entry: Fields) -> float | None:
    return _first(entry.number("lambda"), entry.number("focus"))


def _viewpoint(entry: Fields) -> tuple[float, float] | None:
    x = _first(entry.child("coord").number("x"), entry.number("perspectiveU"))
    y = _first(entry.child("coord").number("y"), entry.number("perspectiveV"))
    return None if x is None or y is None else (x, y)


def _first(first: float | None, second: float | None) -> float | None:
    return second if first is None else first
