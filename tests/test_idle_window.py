"""What the real window does while nobody does anything, and when keys come faster than frames."""

from __future__ import annotations

import time
from pathlib import Path

from moving_scene import light_field
from test_whole_program import BESIDE, VIEW, save
from virtual_screen import VirtualScreen, wait_until

# On a model that knows the truth, and notes in a file what it is asked for.
PROGRAM = """
import sys
from pathlib import Path
from app.engine import Engine
from app.viewer import show
from tests.moving_scene import TruthSynthesizer

class Noting(TruthSynthesizer):
    def synthesize(self, u, v, *others):
        with Path(sys.argv[2]).open("a") as notes:
            print(u, v, file=notes)
        return super().synthesize(u, v, *others)

show(Path(sys.argv[1]), Engine(lambda: Noting(0.02), 2**26), "truth")
"""


def test_views_are_computed_ahead_after_a_single_movement_of_the_mouse(screen: VirtualScreen, tmp_path: Path) -> None:
    notes = tmp_path / "notes"

    def noted() -> int:
        return len(notes.read_text().splitlines()) if notes.exists() else 0

    with screen.program(PROGRAM, str(save(light_field(4, 4, VIEW), tmp_path)), str(notes)):
        wait_until(lambda: noted() > 0, "the first synthesis")
        for place in range(4):  # each puts off what is computed ahead, and begins the wait for it anew
            screen.xdotool("mousemove", BESIDE[0] + place, BESIDE[1])
            before = noted()
            wait_until(lambda before=before: noted() > before, "views computed ahead")  # type: ignore[misc]
            if noted() >= 4 * 4:
                break


def test_a_key_right_after_a_chord_is_not_taken_for_another_chord(screen: VirtualScreen, tmp_path: Path) -> None:
    with screen.program(PROGRAM, str(save(light_field(4, 4, VIEW), tmp_path)), str(tmp_path / "notes")) as program:
        wait_until(lambda: (tmp_path / "notes").exists(), "the first synthesis")
        for _ in range(12):  # Ctrl+Q would end the program, Q alone goes to a captured view
            screen.xdotool("key", "--delay", 1, "ctrl+z", "q", "ctrl+z", "q", "ctrl+z", "q")
        time.sleep(1)
        assert program.poll() is None


def test_a_burst_of_keys_is_taken_to_its_end(screen: VirtualScreen, tmp_path: Path) -> None:
    with screen.program(PROGRAM, str(save(light_field(4, 4, VIEW), tmp_path)), str(tmp_path / "notes")) as program:
        wait_until(lambda: (tmp_path / "notes").exists(), "the first synthesis")
        screen.xdotool("key", "--delay", 1, *("1", "2", "4", "5") * 40, "ctrl+q")
        wait_until(lambda: program.poll() is not None, "the last of the keys")
        assert program.returncode == 0
