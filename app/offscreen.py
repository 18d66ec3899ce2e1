"""The viewer without a window: the same frame, drawn into a picture file. `python -m app.offscreen PATH --out viewer.png`"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import moderngl
import numpy as np
import numpy.typing as npt
import OpenImageIO as oiio
from imgui_bundle import ImVec2, imgui

from app import frametimes
from app.canvas import Target, standalone_context, standalone_functions
from app.controller import Controller
from app.frametimes import FrameTimes
from app.geometry import Size
from app.interface import Interface
from app.opening import make_engine, open_by_content, synthesis_process
from app.pacing import Pace
from lfcore.atomic import atomic_path
from lfcore.errors import LfviewError, OutputError
from lfcore.machine import core_count

Picture = npt.NDArray[np.uint8]

PATIENCE_SECONDS = 300.0
_SETTLE_FRAMES = 3  # imgui knows the sizes of what it draws one frame later


class Offscreen:
    """The whole interface on a GL context without a window."""

    def __init__(self, controller: Controller, context: moderngl.Context, size: Size, scale: float) -> None:
        imgui.create_context()
        io = imgui.get_io()
        io.set_ini_filename("")
        io.display_size = ImVec2(*size)
        self._context = context
        self._texture = context.texture(size, 4)
        self._target = Target(context.framebuffer([self._texture]), size)
        self.interface = Interface(controller, context, scale, load=standalone_functions())
        self._pace = Pace(frametimes.FRAME_SECONDS, core_count())

    def frame(self) -> Picture:
        """Draw a frame and read it: uint8 (H, W, 3), first row first."""
        self.draw()
        width, height = self._target.size
        return np.frombuffer(self._target.framebuffer.read(components=3, alignment=1), np.uint8).reshape(height, width, 3)[::-1]

    def draw(self) -> None:
        """Draw a frame, until the graphics are done with it."""
        imgui.get_io().delta_time = frametimes.FRAME_SECONDS
        with self._pace.frame():
            self.interface.draw(self._target, time.monotonic())
            self._context.finish()

    @property
    def interval(self) -> float:
        """The least time between the beginnings of two frames in a row, in seconds: as in a window."""
        return self._pace.interval(self.interface.takes_from_networks)

    def settled(self) -> Picture:
        """The frame after imgui has found its sizes and every fade has ended."""
        for _ in range(_SETTLE_FRAMES):
            self.frame()
        while self.interface.next_frame_in == 0.0:
            self.frame()
        return self.frame()

    def close(self) -> None:
        """Give everything back."""
        self.interface.shutdown()
        imgui.destroy_context()
        self._target.framebuffer.release()
        self._texture.release()


def screenshot(path: Path, out: Path, model: str = "full", size: Size = (1280, 800), scale: float = 1.0) -> None:
    """Write the viewer as it looks when the light field at `path` is open and its centre view is synthesized, or all those in
    sight of a folder are seen, as PNG.

    Raises LfviewError where the light field cannot be opened, the model not loaded, or OpenGL is missing.
    """
    context = standalone_context()
    with _controller(model) as controller:
        viewer = Offscreen(controller, context, size, scale)
        try:
            controller.open(path)
            _wait_for_synthesis(viewer)
            picture = viewer.settled()
        finally:
            viewer.close()
    write_png(out, picture)


def measure_frames_offscreen(path: Path, seconds: float, model: str = "full") -> FrameTimes:
    """Frame times on the light field at `path` as `app.frametimes.measure` defines them, without a window."""
    context = standalone_context()
    with _controller(model) as controller:
        viewer = Offscreen(controller, context, (1280, 800), 1.0)
        try:
            controller.open(path)
            return frametimes.measure(controller, viewer.draw, lambda: viewer.interval, seconds, "off screen")
        finally:
            viewer.close()


def write_png(path: Path, picture: Picture) -> None:
    """Write uint8 (H, W, 3) as PNG, whole or not at all."""
    height, width, channels = picture.shape
    with atomic_path(path) as temporary:
        buffer = oiio.ImageBuf(oiio.ImageSpec(width, height, channels, oiio.UINT8))
        buffer.set_pixels(oiio.ROI(), np.ascontiguousarray(picture))
        if not buffer.write(str(temporary), "uint8", "png"):
            raise OutputError(f"Cannot write {path}: {buffer.geterror()}")


@contextmanager
def _controller(model: str) -> Iterator[Controller]:
    with synthesis_process() as process:
        engine = make_engine(model, 64 * 2**20, process)
        controller = Controller(engine, open_by_content, wake=lambda: None, model=model)
        try:
            yield controller
        finally:
            controller.stop()


def _wait_for_synthesis(viewer: Offscreen) -> None:
    controller = viewer.interface.controller
    deadline = time.monotonic() + PATIENCE_SECONDS
    while True:
        viewer.frame()
        if controller.messages:
            raise LfviewError(controller.messages[0])
        if controller.exhibition is not None or (controller.picture is not None and controller.picture.final):
            return
        if viewer.interface.surroundings.all_seen:
            return
        if time.monotonic() > deadline:
            raise LfviewError(f"The synthesis took more than {PATIENCE_SECONDS:.0f} s; try a smaller light field.")
        time.sleep(0.02)


def main(arguments: list[str] | None = None) -> int:
    """The command: exit code 0, or 2 with one sentence on stderr."""
    parser = argparse.ArgumentParser(prog="python -m app.offscreen", description=__doc__)
    parser.add_argument("path", type=Path, help="the light field")
    parser.add_argument("--out", type=Path, required=True, help="the PNG to write")
    parser.add_argument("--model", default="full", help="name of a model, or a .safetensors file")
    parser.add_argument("--size", type=int, nargs=2, default=(1280, 800), metavar=("WIDTH", "HEIGHT"))
    parser.add_argument("--scale", type=float, default=1.0, help="content scale of text, 2 for high-DPI")
    options = parser.parse_args(arguments)
    try:
        screenshot(options.path, options.out, options.model, tuple(options.size), options.scale)
    except LfviewError as error:
        print(f"lfview: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
