"""What the window costs while a person uses it, on a virtual screen with Mesa's software renderer.

`python -m tests.measure_window LIGHT_FIELD ANOTHER` (folders of views): seconds from start to the first picture and to the
finished one that lies on disk, and from the end of a drag to the finished picture, by the program's own frames, since
looking at the screen takes a part of what the networks need; then the times of frames while another light field is opened, the
cache fills, and a sweep is exported.
"""

from __future__ import annotations

import itertools
import os
import shutil
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from app.opening import SHIPPED
from app.state import Step
from tests.virtual_screen import VirtualScreen, virtual_screen, wait_until

STARTS = 4
RESTS = 12
UNTIL_NEXT = 2.0  # s from one drag to the next
TOO_LONG = 0.05  # s, of a frame
PICTURE = (slice(100, 600), slice(100, 800))  # rows and columns of the screen that lie on the picture
DOT = (784, slice(12, 22))  # of the step in the status line
COLOUR_OF_FULL = (108, 182, 232)

# The program, which writes when each frame ended, how long it took, which step was on screen and how far it had been faded in.
PROGRAM = """
import sys, time
from pathlib import Path
import app.viewer
draw = app.viewer._Window.draw
frames = open(sys.argv[2], "w", buffering=1)
def timed(window):
    start = time.monotonic()
    draw(window)
    end, controller = time.monotonic(), window._at_hand.controller
    print(end, end - start, controller.step.value, controller.share, file=frames)
app.viewer._Window.draw = timed
if __name__ == "__main__":
    app.viewer.run_viewer(Path(sys.argv[1]))
"""


def _has_picture(screen: VirtualScreen) -> bool:
    return bool(screen.pixels()[PICTURE].std() > 20)


def _is_full(screen: VirtualScreen) -> bool:
    return bool((np.abs(screen.pixels()[DOT].astype(int) - COLOUR_OF_FULL).sum(-1) < 10).any())


def _seconds_until(condition: Callable[[], bool], start: float) -> float:
    wait_until(condition, "the picture")
    return time.monotonic() - start


def measure_start(screen: VirtualScreen, path: Path, frames: Path) -> None:
    """The first start fills the cache on disk, the others find it there."""
    for number in range(STARTS):
        start = time.monotonic()
        with screen.program(PROGRAM, str(path), str(frames)):
            first = _seconds_until(lambda: _has_picture(screen), start)
            finished = _seconds_until(lambda: _is_full(screen), start)
            print(f"start {number + 1}: first picture after {first:.2f} s, that of full after {finished:.2f} s")
            time.sleep(3)


def measure_rest(screen: VirtualScreen, path: Path, frames: Path) -> None:
    """How long a hand that comes to rest at a viewpoint nobody has seen waits for the first frame with the picture of `full`,
    and for the one in which it has been faded in."""
    moved = []
    with screen.program(PROGRAM, str(path), str(frames)):
        wait_until(lambda: _is_full(screen), "the picture of full")
        time.sleep(5)  # the networks may still be on their way
        screen.xdotool("mousemove", 400, 300, "mousedown", 1)
        for drag in range(1, RESTS + 1):
            moved.append(time.monotonic())
            # By uneven steps: the next of even ones has been computed ahead.
            screen.xdotool("mousemove", 400 + 23 * drag + 5 * (drag**2 % 7), 300 + 17 * (drag % 5))
            time.sleep(UNTIL_NEXT)
        screen.xdotool("mouseup", 1)
    drawn = [_Frame.of(line) for line in frames.read_text().splitlines()]
    for name, least in (("on screen", 0.0), ("faded in", 1.0)):
        seconds = [_full_again(drawn, start, least) - start for start in moved]
        print(f"full {name} after the hand came to rest: {min(seconds):.2f} to {max(seconds):.2f} s", end=", ")
        print(f"median {np.median(seconds):.2f}")


@dataclass(frozen=True)
class _Frame:
    """A line of what the program writes."""

    end: float
    seconds: float
    full: bool
    share: float

    @classmethod
    def of(cls, line: str) -> _Frame:
        end, seconds, step, share = line.split()
        return cls(float(end), float(seconds), step == Step.FULL.value, float(share))


def _full_again(frames: list[_Frame], start: float, share: float) -> float:
    """When the first frame after `start` ended that has the picture of `full`, so far faded in, after one that has not."""
    later = itertools.dropwhile(lambda frame: frame.end < start or frame.full, frames)
    return next(frame.end for frame in later if frame.full and frame.share >= share)


def measure_frames(screen: VirtualScreen, path: Path, another: Path, frames: Path, folder: Path) -> None:
    """Times of frames in each part of a use. The export goes beside the second light field, so that is copied first."""
    copy = folder / "another"
    shutil.copytree(another, copy)
    marks: list[tuple[str, float]] = []

    def mark(name: str, seconds: float) -> None:
        marks.append((name, time.monotonic()))
        time.sleep(seconds)

    with screen.program(PROGRAM, str(path), str(frames)) as program:
        mark("start", 8)
        mark("filling the cache", 12)
        marks.append(("opening", time.monotonic()))
        screen.xdotool("mousemove", 400, 300, "key", "ctrl+shift+o")
        time.sleep(1)
        screen.xdotool("type", "--delay", 20, str(copy))
        screen.xdotool("key", "Return")
        time.sleep(8)
        for _ in range(SHIPPED.index("realtime")):  # from full on, which is the first
            screen.xdotool("key", "m")
            time.sleep(2)
        screen.xdotool("key", "ctrl+shift+e")
        marks.append(("exporting", time.monotonic()))
        start = time.monotonic()
        wait_until((folder / f"{copy.name} sweep.mp4").is_file, "the export")
        print(f"export of 120 views by realtime: {time.monotonic() - start:.1f} s")
        mark("end", 0)
        screen.xdotool("key", "ctrl+q")
        program.wait(30)
    drawn = [_Frame.of(line) for line in frames.read_text().splitlines()]
    for (name, begin), (_, end) in itertools.pairwise(marks):
        of_part = 1e3 * np.array([frame.seconds for frame in drawn if begin <= frame.end < end])
        if not of_part.size:
            print(f"{name}: nothing was drawn")
            continue
        middle, most, longest = np.percentile(of_part, (50, 95, 100))
        over = int((of_part > 1e3 * TOO_LONG).sum())
        print(f"{name}: {len(of_part)} frames, p50 {middle:.1f}, p95 {most:.1f}, longest {longest:.1f} ms, {over} over 50 ms")


def main() -> None:
    """See the module."""
    path, another = (Path(each).resolve() for each in sys.argv[1:3])
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        for name in ("XDG_CACHE_HOME", "XDG_CONFIG_HOME"):
            os.environ[name] = str(folder / name)
        (folder / "screen").mkdir()
        with virtual_screen(folder / "screen") as screen:
            measure_start(screen, path, folder / "frames")
            measure_rest(screen, path, folder / "frames")
            measure_frames(screen, path, another, folder / "frames", folder)


if __name__ == "__main__":
    main()
