"""Windows of X11 painted in shared memory: what is in the sheet is on the screen, and comes back when it was covered."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from moving_scene import light_field, truth
from test_whole_program import BESIDE, EXACT, PROGRAM, VIEW, save, shows
from virtual_screen import VirtualScreen, wait_until

# A bare window, and what is to be done with its sheet: a line of numbers for each step, as a file that says when.
BARE = """
import sys, time
from pathlib import Path
import numpy as np
from imgui_bundle import imgui
import glfw
from app.painting import Box
from app.shared_window import SharedWindow
folder = Path(sys.argv[1])
glfw.init()
glfw.window_hint(glfw.CLIENT_API, glfw.NO_API)
window = glfw.create_window(300, 200, "bare", None, None)
shared = SharedWindow(glfw.get_x11_display(), glfw.get_x11_window(window))
for step in range(4):
    while not (folder / f"go{step}").exists():
        glfw.poll_events()
        time.sleep(0.01)
    width, height, left, top, right, bottom = map(int, (folder / f"go{step}").read_text().split())
    glfw.set_window_size(window, width, height)
    for _ in range(20):
        glfw.poll_events()
        time.sleep(0.01)
    kept = shared.keeps((width, height))
    sheet = shared.sheet((width, height))
    if not kept:
        sheet[...] = 0
    sheet[...] += np.random.default_rng(step).integers(0, 99, sheet.shape, dtype=np.uint8)
    np.save(folder / f"sheet{step}.part.npy", sheet[..., 2::-1])
    shared.show(sheet, [Box(left, top, right, bottom)])
    (folder / f"sheet{step}.part.npy").rename(folder / f"sheet{step}.npy")
while not (folder / "end").exists():
    time.sleep(0.01)
shared.close()
glfw.terminate()
"""
# Covers a part of the screen for a moment.
COVER = """
import sys, time
from imgui_bundle import imgui
import glfw
glfw.init()
glfw.window_hint(glfw.CLIENT_API, glfw.NO_API)
window = glfw.create_window(400, 300, "cover", None, None)
glfw.set_window_pos(window, 300, 200)
while not glfw.window_should_close(window):
    glfw.wait_events_timeout(0.05)
"""
REFUSED = """
import sys
from imgui_bundle import imgui
import glfw
from app import shared_window
glfw.init()
glfw.window_hint(glfw.CLIENT_API, glfw.NO_API)
window = glfw.create_window(300, 200, "bare", None, None)
places = glfw.get_x11_display(), glfw.get_x11_window(window)
for name, stands_for in (("_attach", lambda self: False), ("_BLUE", 0xFF0000), ("_ALL_PLANES", 0)):
    holder = shared_window if name.isupper() else shared_window.SharedWindow
    before = getattr(holder, name)
    setattr(holder, name, stands_for)
    try:
        shared_window.SharedWindow(*places)
        sys.exit(f"{name} was not missed")
    except OSError as error:
        print(error)
    setattr(holder, name, before)
shared_window.SharedWindow(*places).close()
"""


@pytest.fixture(autouse=True)
def compiled(compiled_painting: None) -> None:
    """All of these need it."""


def test_boxes_of_a_sheet_come_to_the_screen_and_nothing_else(screen: VirtualScreen, tmp_path: Path) -> None:
    width, height = 300, 200
    steps = [(width, height, 0, 0, width, height), (width, height, 37, 21, 150, 122), (420, 350, 0, 0, 420, 350)]
    steps.append((200, 150, 0, 0, 200, 150))  # a smaller one in the same memory
    before = np.zeros((height, width, 3), np.uint8)
    with screen.program(BARE, str(tmp_path)) as program:
        for step, (width, height, left, top, right, bottom) in enumerate(steps):
            (tmp_path / "next").write_text(f"{width} {height} {left} {top} {right} {bottom}")
            (tmp_path / "next").rename(tmp_path / f"go{step}")
            wait_until((tmp_path / f"sheet{step}.npy").exists, "the sheet")
            sheet = np.load(tmp_path / f"sheet{step}.npy")
            expected = before.copy() if before.shape == sheet.shape else np.zeros_like(sheet)
            expected[top:bottom, left:right] = sheet[top:bottom, left:right]
            seen = screen.pixels()[:height, :width]
            np.testing.assert_array_equal(seen, expected)
            assert expected.std() > 20
            before = expected
        (tmp_path / "end").touch()
        assert program.wait(30) == 0
        assert program.stderr is not None and program.stderr.read() == ""


def test_what_was_covered_comes_back_though_nothing_else_has_changed(screen: VirtualScreen, tmp_path: Path) -> None:
    folder = save(light_field(4, 4, VIEW), tmp_path)
    with screen.program(PROGRAM, str(folder)) as program:
        wait_until(lambda: screen.pixels().max() > 100, "the window")
        screen.xdotool("mousemove", *BESIDE)
        wait_until(lambda: (screen.xdotool("key", "z"), shows(screen, truth(0.5, 0.5, VIEW), EXACT))[1], "the synthesis")
        covered = slice(200, 500), slice(300, 700)
        before = screen.pixels()[covered].copy()
        with screen.program(COVER):
            wait_until(lambda: not shows(screen, truth(0.5, 0.5, VIEW), 0.2), "what covers it")
        wait_until(lambda: bool((screen.pixels()[covered] == before).all()), "the window as it was")
        screen.xdotool("key", "ctrl+q")
        assert program.wait(30) == 0


def test_where_memory_cannot_be_shared_that_is_noticed(screen: VirtualScreen) -> None:
    with screen.program(REFUSED) as program:
        assert program.wait(30) == 0, program.stderr
