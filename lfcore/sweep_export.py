"""A sweep into files: one video, or a folder of numbered frames. The window and the command line both export by this."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import TypeVar

from lfcore.errors import Cancelled, OutputError
from lfcore.export import write_disparity, write_image, write_map, write_picture
from lfcore.frame_files import check_frames_target, write_numbered
from lfcore.lightfield import FloatArray
from lfcore.sweep_frames import SweepFrames
from lfcore.sweep_plan import Layer, SweepPlan
from lfcore.sweep_target import Kind, Target, check_fits
from lfcore.synthesis import never
from lfcore.video import VIDEO_EXTENSIONS, check_video_target, write_video

_T = TypeVar("_T")


def check_target(plan: SweepPlan, target: Target) -> None:
    """Make sure, before long work, that the sweep can be written there so. Raises OutputError or InputError."""
    check_fits(plan, target.kind)
    if target.kind is Kind.VIDEO:
        if target.path.suffix.lower() not in VIDEO_EXTENSIONS:
            raise OutputError(
                f"Cannot write {target.path}: a video's name ends in {', '.join(VIDEO_EXTENSIONS)}; choose one of them, or "
                "frames in a folder."
            )
        check_video_target(target.path, plan.fps)
        return
    check_frames_target(target.path)


def export_sweep(
    frames: SweepFrames,
    target: Target,
    done: Callable[[int], None] = lambda count: None,
    cancelled: Callable[[], bool] = never,
) -> None:
    """Write all frames; `done` is told how many are made, after each.

    Files appear whole or not at all: an error, Ctrl-C or `cancelled` (which raises Cancelled) leaves nothing. Raises
    OutputError where the target cannot be written, InputError where light field or model cannot give what the plan shows.
    """
    plan = frames.plan
    check_target(plan, target)
    if target.kind is Kind.VIDEO:
        pictures = _counted((frames.picture(index) for index in range(len(frames))), done, cancelled)
        write_video(target.path, pictures, plan.fps, plan.plays)
        return
    extension = ".png" if target.kind is Kind.PNG else ".exr"
    makers = (_file_maker(frames, index, target.kind) for index in range(len(frames)))
    write_numbered(target.path, extension, len(frames), _counted(makers, done, cancelled))


def _file_maker(frames: SweepFrames, index: int, kind: Kind) -> Callable[[Path], None]:
    """What writes one frame, made already, to a file."""
    if kind is Kind.PNG:
        return partial(write_picture, picture=frames.picture(index))
    return partial(_write_numbers, numbers=frames.numbers(index), layer=frames.plan.layer)


def _write_numbers(path: Path, numbers: FloatArray, layer: Layer) -> None:
    if layer is Layer.DISPARITY:
        write_disparity(path, numbers[..., 0])
    elif layer is Layer.ERROR:
        write_map(path, numbers[..., 0], "mean over the channels of the absolute error against the captured view, 1 = white")
    else:
        write_image(path, numbers)


def _counted(items: Iterator[_T], done: Callable[[int], None], cancelled: Callable[[], bool]) -> Iterator[_T]:
    """The items, each counted once it has been used."""
    count = 0
    while True:
        if cancelled():
            raise Cancelled
        try:
            item = next(items)
        except StopIteration:
            return
        yield item
        count += 1
        done(count)
