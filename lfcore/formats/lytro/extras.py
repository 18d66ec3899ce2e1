"""The pictures, the refocus stack and the depth map that a Lytro file holds beside the raw mosaic, as arrays."""

from __future__ import annotations

import io
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import av
import numpy as np
import numpy.typing as npt

from lfcore.errors import InputError
from lfcore.formats.images import open_picture
from lfcore.formats.lytro.container import Container, Section
from lfcore.formats.lytro.contents import Contents, Kind, StoredMap, StoredPicture, raw_file

Picture = npt.NDArray[np.uint8]
Map = npt.NDArray[np.float32]

_SUFFIXES = {b"\xff\xd8\xff": ".jpg", b"\x89PNG\r\n\x1a\n": ".png"}

# Decoded pictures may take this much and four times the file; the real stack of 1.4 MB takes 42 MB.
_ROOM = 46 * 2**20

# A progressive JPEG is worked through once for every scan, so that a small file could ask for hours.
_MAX_SCANS = 64

# Bytes per pixel while a picture is decoded: the picture, and the coefficients of a progressive JPEG.
_WORK = 9

# The same for a video: the decoder keeps up to 16 frames of 1.5 bytes a pixel, and the picture.
_VIDEO_WORK = 27


@dataclass(frozen=True)
class FocusStack:
    """Pictures (N, H, W, 3), uint8 sRGB, focused from near to far, and their focus (N,) in lambda, rising."""

    images: Picture
    focus: Map


@dataclass(frozen=True)
class DepthMap:
    """Depth (H, W) in lambda (negative is nearer than the plane of focus), confidence (H, W) if stored; float32."""

    depth: Map
    confidence: Map | None


@dataclass(frozen=True)
class Extras:
    """What a file shows without its raw mosaic: what it is, its pictures, refocus stack and depth map."""

    name: str
    sentence: str
    pictures: tuple[tuple[str, Picture], ...]  # label and (H, W, 3), those of the stack left out
    stack: FocusStack | None
    depth: DepthMap | None


def describe(container: Container, contents: Contents) -> str:
    """What the file is and, where the raw mosaic is not in it, where that would be: one sentence."""
    held = f"{container.path} is a Lytro file: {contents.kind.value}"
    if contents.kind is Kind.CAPTURE:
        return f"{held}."
    if contents.kind is Kind.CALIBRATION:
        return f"{held}; give it as calibration when a capture of that camera is decoded."
    return f"{held}; the raw capture would be {raw_file(container, contents.capture)}."


def read_extras(container: Container, contents: Contents) -> Extras:
    """Decode everything that can be looked at. Raises InputError for damaged pictures and for too large ones."""
    room = _Room(container)
    stack = _stack(container, contents, room)
    labels = (picture.label for picture in contents.others)
    pictures = tuple(zip(labels, _pictures(container, contents.others, room), strict=True))
    return Extras(container.path.stem, describe(container, contents), pictures, stack, _depth(container, contents))


def decode_pictures(container: Container, pictures: Sequence[StoredPicture]) -> list[Picture]:
    """The pictures, uint8 (H, W, 3), grey ones repeated. Raises InputError as `read_extras` does."""
    return _pictures(container, pictures, _Room(container))


def decode_map(container: Container, stored: StoredMap) -> Map:
    """A map (H, W), float32. Raises InputError where its data does not fit its size, or is stored in unknown ways."""
    source = container.describe(stored.section)
    if stored.representation not in ("raw", "packedFloat"):
        raise InputError(f"{source} stores a {stored.label} as {stored.representation!a}; expected raw or packedFloat.")
    expected = stored.width * stored.height * 4
    if stored.section.length != expected:
        raise InputError(
            f"{source} holds {stored.section.length:,} bytes, but a {stored.label} of {stored.width} x {stored.height} takes "
            f"{expected:,}; the file is damaged."
        )
    values = np.frombuffer(container.data(stored.section), "<f4").astype(np.float32)
    return values.reshape(stored.height, stored.width)


class _Room:
    """The memory that decoded pictures may still take."""

    def __init__(self, container: Container) -> None:
        self._path = container.path
        self._left = _ROOM + 4 * container.size

    def check(self, width: int, height: int, bytes_per_pixel: int) -> None:
        """Raise InputError where a picture would not fit while it is worked on."""
        if width * height * bytes_per_pixel > self._left:
            raise InputError(
                f"{self._path} claims pictures too large for its size, one of {width} x {height} px; it is damaged, or they "
                "are not meant for looking at."
            )

    def keep(self, width: int, height: int, count: int) -> None:
        """Count that many pictures that stay in memory; raise InputError where they do not fit."""
        self.check(width, height, 3 * count)
        self._left -= width * height * 3 * count


def _pictures(container: Container, stored: Sequence[StoredPicture], room: _Room) -> list[Picture]:
    found: dict[int, Picture] = {}
    for index, picture in _decode(container, stored, room):
        room.keep(picture.shape[1], picture.shape[0], 1)
        found[index] = picture
    return [found[index] for index in range(len(stored))]


def _stack(container: Container, contents: Contents, room: _Room) -> FocusStack | None:
    stored = contents.stack
    if not stored:
        return None
    images: Picture | None = None
    for index, picture in _decode(container, stored, room):
        if images is None:
            height, width = picture.shape[:2]
            room.keep(width, height, len(stored))
            images = np.empty((len(stored), height, width, 3), np.uint8)
        if picture.shape != images.shape[1:]:
            raise InputError(f"{container.path} has a refocus stack with pictures of different sizes; the file is damaged.")
        images[index] = picture
    assert images is not None
    return FocusStack(images, np.array([picture.focus for picture in stored], np.float32))


def _depth(container: Container, contents: Contents) -> DepthMap | None:
    by_label = {stored.label: stored for stored in contents.maps}
    if "depth map" not in by_label:
        return None
    confidence = by_label.get("confidence")
    return DepthMap(
        decode_map(container, by_label["depth map"]),
        None if confidence is None else decode_map(container, confidence),
    )


def _decode(container: Container, stored: Sequence[StoredPicture], room: _Room) -> Iterator[tuple[int, Picture]]:
    """(index in `stored`, picture), section by section: what several share is decoded once, videos frame by frame."""
    by_section: dict[Section, list[int]] = {}
    for index, picture in enumerate(stored):
        by_section.setdefault(picture.section, []).append(index)
    for section, indices in by_section.items():
        if all(stored[index].frame is None for index in indices):
            pixels = _decode_still(container, section, room)
            yield from ((index, pixels) for index in indices)
        else:
            by_frame: dict[int, list[int]] = {}
            for index in indices:
                by_frame.setdefault(stored[index].frame or 0, []).append(index)
            for frame, pixels in _decode_video(container, section, sorted(by_frame), room):
                yield from ((index, pixels) for index in by_frame[frame])


def _decode_still(container: Container, section: Section, room: _Room) -> Picture:
    data, source = container.data(section), container.describe(section)
    suffix = suffix_of(data)
    if suffix is None:
        raise InputError(f"{source} is neither JPEG nor PNG where a picture is expected; the file is damaged.")
    if suffix == ".jpg" and data.count(b"\xff\xda") > _MAX_SCANS:
        raise InputError(f"{source} is a JPEG of more than {_MAX_SCANS} scans, which no camera writes; the file is damaged.")
    # OpenImageIO reads files only.
    with tempfile.NamedTemporaryFile(suffix=suffix) as file:
        file.write(data)
        file.flush()
        try:
            with open_picture(Path(file.name)) as picture:
                room.check(picture.header.width, picture.header.height, _WORK)
                pixels = picture.read()
        except InputError as error:
            if file.name not in str(error):
                raise
            raise InputError(str(error).replace(file.name, source)) from error
    if pixels.dtype != np.uint8:
        raise InputError(f"{source} is a picture of {pixels.dtype}; expected 8 bit.")
    return np.ascontiguousarray(np.broadcast_to(pixels, (*pixels.shape[:2], 3)))


def suffix_of(data: bytes) -> str | None:
    """The suffix ".jpg" or ".png" for the beginning of such a picture, else None."""
    return next((suffix for magic, suffix in _SUFFIXES.items() if data.startswith(magic)), None)


def _decode_video(container: Container, section: Section, wanted: Sequence[int], room: _Room) -> Iterator[tuple[int, Picture]]:
    """(number, picture) of the wanted frames, in rising order, of an H.264 stream, bare or in MP4."""
    data, source = container.data(section), container.describe(section)
    left = set(wanted)
    try:
        with av.open(io.BytesIO(data), "r", format="mp4" if data[4:8] == b"ftyp" else "h264") as video:
            stream = video.streams.video[0]
            # Every thread would hold frames of its own.
            stream.codec_context.thread_count = 1
            room.check(stream.width, stream.height, _VIDEO_WORK)
            for number, frame in enumerate(islice(video.decode(stream), max(wanted) + 1)):
                if number in left:
                    room.check(frame.width, frame.height, _VIDEO_WORK)
                    left.remove(number)
                    yield number, np.ascontiguousarray(frame.to_ndarray(format="rgb24"))
    except (av.FFmpegError, IndexError, ValueError) as error:
        raise InputError(f"{source} is no readable H.264 video where pictures are expected; the file is damaged.") from error
    if left:
        raise InputError(
            f"{source} has {len(wanted) - len(left)} of {len(wanted)} pictures; it is cut off or damaged: copy the file again."
        )
