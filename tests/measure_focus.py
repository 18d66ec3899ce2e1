"""What refocusing, stereo and slices cost the software rasteriser in a frame (run by hand, not by pytest).

    LIBGL_ALWAYS_SOFTWARE=1 python -m tests.measure_focus [WIDTH HEIGHT VIEWS]

Frames of a window of 1280 x 800 are drawn off screen, of VIEWS x VIEWS views of noise, 8 x 8 of 541 x 376 px by default. What
is printed is the processor time of all threads together, which other programs hardly change, without that of the panels. The
frame in which something is drawn for the first time compiles its shaders, and is left out.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable

import numpy as np

from app.canvas import Canvas, Frame, Target, standalone_context
from app.canvas.slices import Slicing
from app.focusing import Focusing
from app.geometry import Zoom, place
from app.layout import lay_out, with_strips
from app.state import Look
from app.tone import Tone
from lfcore.lightfield import CORNERS

_WINDOW = (1280, 800)
_FRAMES = 20


class Bench:
    """A canvas with a light field of noise and a synthesis of its middle."""

    def __init__(self, width: int, height: int, count: int) -> None:
        chance = np.random.default_rng(0)
        views = chance.integers(0, 256, (1, 1, height, width, 3), dtype=np.uint8)
        views = np.broadcast_to(views, (count, count, height, width, 3))
        self.context = standalone_context()
        self.canvas = Canvas(self.context)
        self.canvas.set_light_field(np.stack([views[-int(v), -int(u)] for u, v in CORNERS]))
        self.canvas.set_views(views, frozenset())
        image = chance.random((height, width, 3), dtype=np.float32)
        disparity = chance.uniform(-3, 3, (height, width)).astype(np.float32)
        self.canvas.set_synthesis(image, np.full((height, width, 4), 200, np.uint8), disparity, (0.5, 0.5))
        self.target = Target(self.context.framebuffer([self.context.texture(_WINDOW, 4)]), _WINDOW)
        self.layout = with_strips(lay_out(*_WINDOW, 1.0, True), 1.0)

    def frame(self, frame: Frame, slices: bool) -> float:
        """Draw it; milliseconds of processor time."""
        start = time.process_time()
        area, strips = self.layout.picture, self.layout.strips
        assert strips is not None
        self.canvas.begin(self.target)
        self.canvas.prepare(frame)
        placement = place(Zoom(), self.canvas.picture_size(frame.look), area)
        self.canvas.draw(frame, self.target, area, placement)
        if slices:
            slicing = Slicing((100.0, 100.0), frame.viewpoint, frame.captured_summed)
            self.canvas.draw_slices(slicing, Tone(), self.target, strips, area, placement)
        self.context.finish()
        return 1e3 * (time.process_time() - start)

    def report(self, name: str, frames: Iterable[Frame], slices: bool = False) -> None:
        """Print the median and the largest of all but the first."""
        times = [self.frame(frame, slices) for frame in frames][1:]
        print(f"{name:48} {np.median(times):6.1f} {max(times):6.1f}  {len(times):4}")

    def finished(self, frame: Frame) -> Iterable[Frame]:
        """The same frame until it no longer becomes better."""
        yield frame
        while self.canvas.unfinished:
            yield frame


def main() -> None:
    """Print one line per kind of frame."""
    bench = Bench(*(map(int, sys.argv[1:4]) if len(sys.argv) > 3 else (541, 376, 8)))
    print(f"{'ms of processor time':48} median   most  frames")
    places = [(0.4 + 0.005 * k, 0.5) for k in range(_FRAMES)]
    still = (0.5, 0.5)
    bench.report("the synthesis, the viewpoint moves", (Frame(Look.SYNTHESIS, at) for at in places))
    bench.report("views handed over and summed up", bench.finished(Frame(Look.REFOCUS, still)))
    other = Frame(Look.REFOCUS, still, focusing=Focusing(1.3))
    bench.report("another focus, until it is finished", bench.finished(other))
    bench.report("refocused and finished", [other] * _FRAMES)
    moving = [Frame(Look.REFOCUS, still, focusing=Focusing(0.1 * k)) for k in range(_FRAMES)]
    bench.report("the focus moves", moving)
    bench.report("refocused, the viewpoint moves", (Frame(Look.REFOCUS, at) for at in places))
    bench.report("views in between drawn and summed up", bench.finished(Frame(Look.REFOCUS, still, captured_summed=False)))
    bench.report("red and cyan, the viewpoint moves", (Frame(Look.ANAGLYPH, at) for at in places))
    bench.report("side by side, the viewpoint moves", (Frame(Look.STEREO_PARALLEL, at) for at in places))
    sliced = [Frame(Look.SYNTHESIS, at) for at in places]
    bench.report("the synthesis with captured slices, it moves", sliced, True)
    carried = [Frame(Look.SYNTHESIS, at, captured_summed=False) for at in places]
    bench.report("the synthesis with carried slices, it moves", carried, True)


if __name__ == "__main__":
    main()
