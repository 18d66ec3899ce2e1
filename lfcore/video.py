"""Frames to a video file: MP4 (H.264), WebM (VP9), animated WebP and GIF, by PyAV alone: no ffmpeg program is run."""

from __future__ import annotations

import contextlib
import errno
import os
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path

import av
import av.error
import av.filter
import av.video.reformatter
import numpy as np
import numpy.typing as npt
from av.filter.context import FilterContext

from lfcore.atomic import atomic_path
from lfcore.errors import InputError, OutputError
from lfcore.export import check_target
from lfcore.sweep_plan import MAX_FPS, MIN_FPS

ByteArray = npt.NDArray[np.uint8]

_GIF_MAX_FPS = 50.0  # a GIF counts in hundredths of a second, and browsers slow down frames shorter than two of them
_BT709 = 1  # the number of BT.709 in the tables of ISO/IEC 23091-2 for primaries, transfer and matrix alike


@dataclass(frozen=True)
class _Kind:
    """How one kind of file is made: container and codec by their names in libav, pixel format, options."""

    container: str
    codec: str
    pixels: str
    options: dict[str, str]
    container_options: dict[str, str] = field(default_factory=dict)
    counts_plays: bool = False  # the file says how often it is to be played


_KINDS = {
    # One thread: with more, the same frames do not always give the same file; it is quick beside the networks.
    ".mp4": _Kind("mp4", "libx264", "yuv420p", {"crf": "18", "preset": "medium", "threads": "1"}, {"movflags": "+faststart"}),
    ".webm": _Kind("webm", "libvpx-vp9", "yuv420p", {"crf": "24", "b": "0", "cpu-used": "4", "row-mt": "1"}),
    # WebP is given RGB, since its own conversion to YUV is the one that its readers undo.
    ".webp": _Kind("webp", "libwebp_anim", "bgra", {"quality": "85"}, counts_plays=True),
    ".gif": _Kind("gif", "gif", "pal8", {}, counts_plays=True),
}

_TICK = Fraction(1, 100)  # the clock of the palette filters; only the order of frames matters there

VIDEO_EXTENSIONS = tuple(_KINDS)
COUNTING_EXTENSIONS = tuple(extension for extension, kind in _KINDS.items() if kind.counts_plays)


def check_video_target(path: str | os.PathLike[str], fps: float) -> Path:
    """Make sure, before long work, that this file can be written at this rate. Raises OutputError or InputError."""
    target = check_target(path, VIDEO_EXTENSIONS)
    limit = _GIF_MAX_FPS if target.suffix.lower() == ".gif" else MAX_FPS
    if not MIN_FPS <= fps <= limit:  # as it stands, NaN is caught too
        raise InputError(f"The rate is {fps:g} frames per second; it must be from {MIN_FPS:g} to {limit:g} here.")
    return target


def write_video(path: str | os.PathLike[str], frames: Iterable[ByteArray], fps: float, plays: int = 0) -> None:
    """Encode the frames, uint8 (H, W, 3) RGB of one size, as they come; only one is held in memory at a time.

    The file appears when the last frame is in it; an error or Ctrl-C on the way leaves none. MP4 and WebM are
    converted to BT.709 with limited range and tagged so; there, odd sizes are padded by the last row or column. WebP and
    GIF are played `plays` times, 0: for ever; the others leave that to the player.

    Raises OutputError where the file cannot be written, InputError for a bad rate or no frames; what the iterable
    raises passes through.
    """
    target = check_video_target(path, fps)
    kind = _KINDS[target.suffix.lower()]
    iterator = iter(frames)
    first = next(iterator, None)
    if first is None:
        raise InputError(f"Cannot write {target}: there are no frames.")
    rate = Fraction(fps).limit_denominator(1001)
    with atomic_path(target) as temporary, _as_output_error(target):
        prepare = _converter(kind, first)
        with av.open(str(temporary), "w", format=kind.container, options=_container_options(kind, plays)) as container:
            stream = _add_stream(container, kind, prepare(first), rate)
            for number, frame in enumerate(_chain(first, iterator)):
                if frame.shape != first.shape or frame.dtype != np.uint8:
                    raise ValueError(f"frame {number} is {frame.shape} {frame.dtype}, the first is {first.shape} uint8")
                picture = prepare(frame)
                picture.pts, picture.time_base = number, 1 / rate
                container.mux(stream.encode(picture))
            container.mux(stream.encode(None))


def _container_options(kind: _Kind, plays: int) -> dict[str, str]:
    if not kind.counts_plays:
        return kind.container_options
    # A WebP counts how often it is played; a GIF how often it is repeated, and without a count (-1) it is played once.
    loop = plays if kind.container == "webp" or plays == 0 else plays - 1 or -1
    return {**kind.container_options, "loop": str(loop)}


def _converter(kind: _Kind, first: ByteArray) -> Callable[[ByteArray], av.VideoFrame]:
    """What turns an RGB frame into the pixels of this kind of file."""
    if kind.pixels == "pal8":
        return _PaletteMapper(first)
    return _to_bt709 if kind.pixels == "yuv420p" else _to_bgra


def _add_stream(container: av.container.OutputContainer, kind: _Kind, sample: av.VideoFrame, rate: Fraction) -> av.VideoStream:
    stream = container.add_stream(kind.codec, rate=rate, options=kind.options)
    assert isinstance(stream, av.VideoStream)
    context = stream.codec_context
    context.width, context.height, context.pix_fmt = sample.width, sample.height, kind.pixels
    context.time_base = 1 / rate
    if kind.pixels == "yuv420p":
        context.color_primaries = context.color_trc = context.colorspace = _BT709
        context.color_range = int(av.video.reformatter.ColorRange.MPEG)
    return stream


def _to_bt709(frame: ByteArray) -> av.VideoFrame:
    """RGB (H, W, 3) to yuv420p of BT.709 with limited range, padded to even sizes by the edge."""
    height, width = frame.shape[:2]
    even = np.pad(frame, ((0, height % 2), (0, width % 2), (0, 0)), mode="edge")
    return _rgb_frame(even).reformat(
        format="yuv420p",
        src_color_range=av.video.reformatter.ColorRange.JPEG,
        dst_colorspace=av.video.reformatter.Colorspace.ITU709,
        dst_color_range=av.video.reformatter.ColorRange.MPEG,
    )


def _to_bgra(frame: ByteArray) -> av.VideoFrame:
    return _rgb_frame(frame).reformat(format="bgra")


class _PaletteMapper:
    """Maps frames onto the 256 colours that suit the first one best.

    One palette serves all frames, since a sweep shows one scene, and the ordered dither stands still: nothing flickers.
    """

    def __init__(self, first: ByteArray) -> None:
        palette = _best_palette(first)
        # The graph is kept as well as its ends: PyAV's filters do not keep their graph alive, and crash without it.
        self._graph = av.filter.Graph()
        self._pictures = _add_source(self._graph, _rgb_frame(first), "pictures")
        colours = _add_source(self._graph, palette, "colours")
        dither = self._graph.add("paletteuse", "dither=bayer:bayer_scale=4")
        self._sink = self._graph.add("buffersink")
        self._pictures.link_to(dither, 0, 0)
        colours.link_to(dither, 0, 1)
        dither.link_to(self._sink)
        self._graph.configure()
        colours.push(palette)
        colours.push(None)
        self._count = 0

    def __call__(self, frame: ByteArray) -> av.VideoFrame:
        picture = _rgb_frame(frame)
        picture.pts, picture.time_base = self._count, _TICK
        self._count += 1
        self._pictures.push(picture)
        mapped = self._sink.pull()
        assert isinstance(mapped, av.VideoFrame)
        return mapped


def _best_palette(picture: ByteArray) -> av.VideoFrame:
    frame = _rgb_frame(picture)
    graph = av.filter.Graph()
    graph.link_nodes(
        _add_source(graph, frame, "picture"),
        graph.add("palettegen", "reserve_transparent=0"),
        graph.add("buffersink"),
    ).configure()
    graph.push(frame)
    graph.push(None)
    palette = graph.pull()
    assert isinstance(palette, av.VideoFrame)
    palette.pts, palette.time_base = 0, _TICK
    return palette


def _add_source(graph: av.filter.Graph, like: av.VideoFrame, name: str) -> FilterContext:
    return graph.add_buffer(width=like.width, height=like.height, format=like.format, time_base=_TICK, name=name)


def _rgb_frame(frame: ByteArray) -> av.VideoFrame:
    return av.VideoFrame.from_ndarray(np.ascontiguousarray(frame), format="rgb24")


def _chain(first: ByteArray, rest: Iterator[ByteArray]) -> Iterator[ByteArray]:
    yield first
    yield from rest


@contextlib.contextmanager
def _as_output_error(target: Path) -> Iterator[None]:
    """libav's errors as OutputError."""
    try:
        yield
    except av.error.FFmpegError as error:
        if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO):
            raise OutputError(f"Cannot write {target}: {error.strerror}; choose another place or make room there.") from error
        raise OutputError(f"Cannot write {target}: {error.strerror} (encoder); try another kind of file.") from error
