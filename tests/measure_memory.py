"""Memory of the whole interface over many drags: `python tests/measure_memory.py [DRAGS]` prints a line every tenth of them.

Everything but the networks runs as in the program, off screen, with a model that answers with a formula at once: the
controller, the threads, both caches, uploads, shaders, imgui. What grows here grows without bound in a long session.
"""

from __future__ import annotations

import math
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import moderngl
from moving_scene import TruthSynthesizer, light_field

from app.canvas import standalone_context
from app.controller import Controller
from app.engine import Engine
from app.offscreen import Offscreen
from lfcore.cache import held_bytes
from lfcore.store import ViewStore

PICTURE = (188, 270)  # (H, W)
WINDOW = (480, 320)
VIEWS_HELD = 20
FRAMES_PER_DRAG = 3


class _Quick(TruthSynthesizer):
    name = "realtime"


@contextmanager
def dragging(
    context: moderngl.Context, folder: Path, picture: tuple[int, int] = PICTURE, window: tuple[int, int] = WINDOW
) -> Iterator[Offscreen]:
    """The interface on a made-up light field, its caches small enough to be full soon."""
    room = VIEWS_HELD * held_bytes(*picture)
    engine = Engine(TruthSynthesizer, room, _Quick, ViewStore(folder, 2 * room))
    controller = Controller(engine, lambda *_: light_field(3, 3, picture), lambda: None, "truth")
    viewer = Offscreen(controller, context, window, 1.0)
    try:
        controller.open(Path("any"))
        while controller.picture is None or not controller.picture.final:
            viewer.draw()
        yield viewer
    finally:
        viewer.close()
        controller.stop()


def drag(viewer: Offscreen, number: int) -> None:
    """One drag from where the hand is; now and then it comes to rest."""
    controller = viewer.interface.controller
    state = controller.state
    for frame in range(FRAMES_PER_DRAG):
        angle = 0.7 * number + 0.1 * frame
        state.drag_to(0.5 + 0.5 * math.cos(angle), 0.5 + 0.5 * math.sin(1.3 * angle))
        viewer.draw()
    state.dragging = False
    if number % 10 == 0:
        time.sleep(0.12)
        viewer.draw()


def resident_mib() -> float:
    """Memory of this process that is in RAM, in MiB (Linux)."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * 4096 / 2**20


def main() -> None:
    drags = int(sys.argv[1]) if len(sys.argv) > 1 else 10_000
    with tempfile.TemporaryDirectory() as folder, dragging(standalone_context(), Path(folder)) as viewer:
        for number in range(1, drags + 1):
            drag(viewer, number)
            if number % max(drags // 10, 1) == 0:
                views = viewer.interface.controller.readout(None)
                print(f"{number} drags: {resident_mib():.1f} MiB, {len(views.cached)} views held", flush=True)


if __name__ == "__main__":
    main()
