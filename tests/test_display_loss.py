"""The X server ends while the viewer is open: settings are kept, one sentence is said, and nothing hangs."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path

from virtual_screen import require_tools, virtual_screen, wait_until

from app.display_loss import EXIT_CODE
from app.settings import SettingsFile

PROGRAM = """
import sys
from pathlib import Path
from app.engine import Engine
from app.settings import SettingsFile
from app.surroundings import Keeping
from app.viewer import show
from tests.moving_scene import TruthSynthesizer
file = SettingsFile(Path(sys.argv[1]))
show(Path(sys.argv[2]), Engine(lambda: TruthSynthesizer(0.1), 2**26), "truth", keeping=Keeping(file.load()[0], None, file))
"""


def test_the_program_says_so_and_ends_with_its_settings_kept(tmp_path: Path) -> None:
    require_tools()
    kept = tmp_path / "settings.json"
    with ExitStack() as display:
        screen = display.enter_context(virtual_screen(tmp_path))
        with screen.program(PROGRAM, str(kept), str(tmp_path)) as program:
            wait_until(lambda: screen.pixels().max() > 100, "the window")
            screen.xdotool("key", "ctrl+shift+l")  # the light theme
            wait_until(lambda: screen.pixels().mean() > 150, "the light theme")
            display.close()
            assert program.wait(60) == EXIT_CODE
            assert program.stderr is not None
            said = program.stderr.read()
    assert said == "lfview: The display was lost; settings are kept, and the program ends.\n"
    assert SettingsFile(kept).load()[0].theme.value == "Light"
