"""Comparing by mouse and keys on a virtual screen: a model that is too bright by a known amount against the captured views."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
from moving_scene import light_field, truth
from virtual_screen import SIZE, VirtualScreen, wait_until

from app.comparison import Arrangement, Comparison
from app.geometry import Rect, Zoom
from app.layout import lay_out
from app.panes import Pane, arrange, handle
from app.state import ViewState
from lfcore.lightfield import FloatArray
from tests.test_whole_program import BESIDE, EXACT, VIEW, save

EXCESS = 0.125
AREA = lay_out(*SIZE, 1.0, panel_wanted=True).picture
HERE = (2 / 3, 2 / 3)  # of the captured views, 4 x 4, the nearest to the centre: a half is rounded to even

PROGRAM = f"""
import sys
from dataclasses import replace
from pathlib import Path
from app.engine import Engine, ModelChoice
from app.viewer import show
from tests.moving_scene import TruthSynthesizer

class Bright(TruthSynthesizer):
    name = key = "bright"
    def synthesize(self, u, v, cancelled=lambda: False):
        made = super().synthesize(u, v, cancelled)
        return replace(made, model=self.name, image=made.image + {EXCESS})

models = {{"bright": ModelChoice(Bright, False), "truth": ModelChoice(TruthSynthesizer, False)}}
show(Path(sys.argv[1]), Engine(Bright, 2**26, name="bright"), "bright", models=models)
"""


def seen(screen: VirtualScreen, pane: Pane, part: Rect) -> tuple[FloatArray, FloatArray]:
    """Of the pixels of a pane at 1:1 that lie in `part` of the window: what is on the screen, and the truth there."""
    placement = pane.placement(Zoom(1.0), (VIEW[1], VIEW[0]))
    x0, y0 = (round(part.x), round(part.y))
    x1, y1 = (round(part.x + part.width), round(part.y + part.height))
    px, py = (round(x0 - placement.origin[0]), round(y0 - placement.origin[1]))
    on_screen = screen.pixels()[y0:y1, x0:x1].astype(np.float32) / 255
    return on_screen, truth(*HERE, VIEW)[py : py + y1 - y0, px : px + x1 - x0]


def excess(screen: VirtualScreen, pane: Pane, part: Rect) -> float | None:
    """How much brighter than the truth the part is, where it is that evenly; None where it is something else."""
    on_screen, expected = seen(screen, pane, part)
    difference = on_screen - expected
    return float(difference.mean()) if np.abs(difference - difference.mean()).max() <= 2 * EXACT else None


def near(found: float | None, expected: float) -> bool:
    return found is not None and abs(found - expected) <= EXACT


def panes(arrangement: Arrangement, wipe: float = 0.5) -> tuple[Pane, ...]:
    return arrange(ViewState(comparison=Comparison(arrangement=arrangement, wipe=wipe)), AREA)


def test_flip_wipe_side_by_side_and_difference(screen: VirtualScreen, tmp_path: Path) -> None:
    views = save(light_field(4, 4, VIEW), tmp_path)
    (alone,) = panes(Arrangement.ALONE)
    middle = AREA.x + AREA.width / 2, AREA.y + AREA.height / 2
    left = Rect(middle[0] - 100, middle[1] - 40, 60, 30)  # above the line at the middle, beside the handle
    right = Rect(middle[0] + 40, middle[1] - 40, 60, 30)
    with screen.program(PROGRAM, str(views)) as program:
        wait_until(lambda: screen.pixels().max() > 100, "the window")
        screen.xdotool("mousemove", *BESIDE)

        def at_a_captured_view() -> bool:
            screen.xdotool("key", "z")
            screen.xdotool("key", "s")
            return near(excess(screen, alone, left), EXCESS)

        wait_until(at_a_captured_view, "the synthesis of a captured viewpoint")

        screen.xdotool("keydown", "r")
        wait_until(lambda: near(excess(screen, alone, left), 0), "the captured view while the key is held")
        screen.xdotool("keyup", "r")
        wait_until(lambda: near(excess(screen, alone, left), EXCESS), "the synthesis again")

        screen.xdotool("key", "w")
        wait_until(lambda: near(excess(screen, alone, right), 0), "the captured view at the right of the handle")
        assert near(excess(screen, alone, left), EXCESS)
        x = round(handle(Comparison(), AREA))
        screen.drag((x, round(middle[1])), (130, 0))
        screen.xdotool("mouseup", 1)
        screen.xdotool("mousemove", *BESIDE)
        wait_until(lambda: near(excess(screen, alone, right), EXCESS), "the handle to pass")
        assert near(excess(screen, alone, left), EXCESS)  # and the viewpoint has stayed

        screen.xdotool("key", "d")
        one, other = panes(Arrangement.SIDE_BY_SIDE)
        parts = [Rect(pane.frame.x + pane.frame.width / 2 - 50, middle[1] - 40, 90, 30) for pane in (one, other)]
        wait_until(lambda: near(excess(screen, other, parts[1]), 0), "the captured view at the right side")
        assert near(excess(screen, one, parts[0]), EXCESS)
        screen.xdotool("key", "q")
        screen.xdotool("key", "q")  # captured view, instant, truth
        screen.xdotool("key", "d")
        screen.xdotool("key", "e")

        def difference() -> FloatArray:
            return seen(screen, alone, Rect(left.x, left.y, right.x - left.x, left.height))[0]

        grey = 255 * EXCESS * 4 / 255  # by a gain of 8, and then of half of that
        screen.xdotool("key", "comma")
        wait_until(lambda: float(np.abs(difference() - grey).max()) <= EXACT, "the difference from the other model")
        screen.xdotool("key", "e")
        wait_until(lambda: float(np.abs(difference() - (0.5 + grey / 2)).max()) <= EXACT, "the difference with its sign")

        screen.xdotool("key", "1")
        screen.xdotool("key", "h")
        time.sleep(0.1)
        screen.xdotool("key", "ctrl+q")
        assert program.wait(30) == 0
        assert program.stderr is not None
        assert program.stderr.read() == ""
