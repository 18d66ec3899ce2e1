"""The states of the window of which pictures are stored: how to get there by keys, and what is seen.

`python -m tests.states` draws all of them anew into tests/pictures; look at each before it is committed.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from imgui_bundle import imgui

from app.controller import Controller
from app.engine import Engine
from app.geometry import Size
from app.keyboard import _KEYS
from app.offscreen import Offscreen, write_png
from lfcore.lightfield import LightField
from lfcore.synthesis import Synthesis
from tests.moving_scene import TruthSynthesizer, light_field, truth

Picture = npt.NDArray[np.uint8]

FOLDER = Path(__file__).parent / "pictures"
VIEW = (240, 320)  # (H, W)
NOISE = 0.05  # of the synthesis, so that there is an error to see
PATIENCE = 60.0


@dataclass(frozen=True)
class State:
    """One picture: the keys that lead to it, where a message is said, and the size of the window."""

    keys: tuple[str, ...] = ()
    is_open: bool = True
    message: str = ""
    size: Size = (1100, 760)
    scale: float = 1.0


STATES = {
    "start": State(is_open=False),
    "synthesis": State(),
    "disparity": State(("2",)),
    "warped": State(("4",)),
    "error": State(("S", "3")),
    "wipe": State(("S", "Ctrl+2", "W")),
    "side-by-side": State(("S", "D"), size=(900, 500)),
    "refocus-and-slices": State(("Ctrl+3", "O", "U")),
    "export": State(("Ctrl+4",)),
    "keys": State(("F1",)),
    "message": State(message="/scans/meadow.png is 300 x 200 px, which is not a multiple of 14 px; open an ESLF picture."),
    "tiny": State(size=(220, 160)),
    "large-type": State(("2",), size=(1500, 1100), scale=2.0),
}


class _Flawed(TruthSynthesizer):
    """The truth with a known fault: a brightness that grows over the picture."""

    def synthesize(self, u: float, v: float, cancelled: Any = lambda: False) -> Synthesis:
        ramp = np.linspace(-NOISE, NOISE, VIEW[1], dtype=np.float32)[None, :, None]
        disparity = (4 * np.linspace(-1, 1, VIEW[0], dtype=np.float32)[:, None] * np.ones(VIEW[1], np.float32)) - 6
        return Synthesis(u, v, self.name, truth(u, v, VIEW) + ramp, disparity, None, {"networks": 1.234, "total": 1.234})


def drawn(state: State, context: Any) -> Picture:
    """The window in that state, uint8 (H, W, 3)."""
    with _viewer(state, context) as viewer:
        controller = viewer.interface.controller
        viewer.frame()
        if state.is_open:
            _until(viewer, lambda: controller.picture is not None and controller.picture.final)
        for key in state.keys:
            _press(key)
            viewer.frame()
            viewer.frame()
            if state.is_open:
                _until(viewer, lambda: controller.picture is not None and controller.picture.final)
        if state.message:
            controller.say(state.message)
        picture = viewer.settled()
        for _ in range(40):  # what is refined over several frames comes to its end
            picture = viewer.frame()
        return picture


def reduced(picture: Picture) -> Picture:
    """Means of 4 x 4 pixels: what is stored and compared."""
    height, width = picture.shape[0] // 4 * 4, picture.shape[1] // 4 * 4
    blocks = picture[:height, :width].reshape(height // 4, 4, width // 4, 4, 3)
    means: Picture = np.round(blocks.mean((1, 3))).astype(np.uint8)
    return means


@contextmanager
def _viewer(state: State, context: Any) -> Iterator[Offscreen]:
    opened: list[LightField] = [light_field(5, 5, VIEW)] if state.is_open else []
    controller = Controller(Engine(_Flawed, 2**28, name="truth"), lambda *_: opened[0], lambda: None, "truth")
    controller.state.foresight = False  # what it does depends on time
    viewer = Offscreen(controller, context, state.size, state.scale)
    try:
        if opened:
            controller.show_light_field(opened[0])
            controller.state.export.folder = "/pictures"  # not that of the machine
        yield viewer
    finally:
        controller.stop()
        viewer.close()


def _press(chord: str) -> None:
    io = imgui.get_io()
    *held, cap = chord.split("+")
    modifiers = {"Ctrl": imgui.Key.mod_ctrl, "Shift": imgui.Key.mod_shift}
    for down in (True, False):
        for name in held:
            io.add_key_event(modifiers[name], down)
        io.add_key_event(_KEYS[cap][0], down)


def _until(viewer: Offscreen, condition: Any) -> None:
    deadline = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < deadline
        viewer.frame()
        time.sleep(0.005)


def main() -> None:
    """Draw all states anew."""
    from app.canvas import standalone_context

    context = standalone_context()
    FOLDER.mkdir(exist_ok=True)
    for name, state in STATES.items():
        write_png(FOLDER / f"{name}.png", reduced(drawn(state, context)))


if __name__ == "__main__":
    main()
