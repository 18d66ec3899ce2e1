"""The interface by fed mouse and key events, without any GL."""

from __future__ import annotations

import ctypes
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from app import panels, theme
from app.commands import COMMANDS, Action, Ask, OpenTyped, Request
from app.dialogs import Purpose
from app.geometry import place
from app.keyboard import _CHARACTERS, _KEYS
from app.layout import Layout, lay_out
from app.painting import CORNER_BYTES
from app.picture import DRAG_SPAN
from app.readout import Compared, Readout, ScoreText
from app.state import Grid, Look, Step, Tab, ViewState

GRID = Grid(rows=8, columns=8, width=541, height=376)
OPEN = Readout(model="full", grid=GRID, name="Meadow", kind="folder of views", source="/tmp/Meadow", cache_limit=2**20)
SIZE = (1280.0, 800.0)


class Screen:
    """Draws frames and feeds events, as the window's backend would."""

    def __init__(self, imgui: Any, scale: float = 1.0) -> None:
        self.imgui = imgui
        self.state = ViewState()
        self.readout = OPEN
        self.requests: list[Request] = []
        self.begun: list[
            tuple[Layout, float, float]
        ] = []  # in each frame: the layout and the viewpoint when the picture may begin
        self.size = SIZE
        self.scale = scale
        self.fonts = theme.apply(scale)
        self.layout: Layout = lay_out(*SIZE, scale, True)
        self.frame(3)

    @property
    def io(self) -> Any:
        return self.imgui.get_io()

    def frame(self, count: int = 1) -> None:
        for _ in range(count):
            self.io.display_size = self.imgui.ImVec2(*self.size)
            self.imgui.new_frame()
            self.layout, requests = panels.draw(self.state, self.readout, self.size, self.scale, self.fonts, self._begin)
            self.imgui.render()
            for texture in self.imgui.get_draw_data().textures:
                texture.set_status(self.imgui.ImTextureStatus.ok)
            self.requests += requests

    def drawn(self) -> bytes:
        """Place and colour of all corners of the last frame's triangles, by which frames can be told apart."""
        lists = [commands.vtx_buffer for commands in self.imgui.get_draw_data().cmd_lists]
        read = b"".join(ctypes.string_at(corners.data_address(), corners.size() * CORNER_BYTES) for corners in lists)
        return np.delete(np.frombuffer(read, np.uint8).reshape(-1, CORNER_BYTES), range(8, 16), 1).tobytes()

    def _begin(self, layout: Layout) -> None:
        self.begun.append((layout, self.state.u, self.state.v))

    def press(self, name: str) -> None:
        """Press and release a key, or a chord, by the name on its cap."""
        cap = name.rsplit("+", 1)[-1] or "+"
        if cap in _CHARACTERS:
            self.io.add_input_character(ord(cap))
            self.frame(2)
            return
        keys = self.imgui.Key
        chord = [keys.mod_ctrl, keys.left_ctrl] if "Ctrl+" in name else []
        chord += [keys.mod_shift, keys.left_shift] if "Shift+" in name else []
        for down in (True, False):
            for key in [*chord, _KEYS[cap][0]]:
                self.io.add_key_event(key, down)
            self.frame(2)

    def move(self, x: float, y: float) -> None:
        self.io.add_mouse_pos_event(x, y)
        self.frame()

    def click(self, x: float, y: float, button: int = 0) -> None:
        self.move(x, y)
        self.io.add_mouse_button_event(button, True)
        self.frame()
        self.io.add_mouse_button_event(button, False)
        self.frame(2)

    def drag(self, start: tuple[float, float], delta: tuple[float, float], button: int = 0) -> None:
        self.move(*start)
        self.io.add_mouse_button_event(button, True)
        self.frame()
        for part in (0.3, 0.7, 1.0):
            self.move(start[0] + part * delta[0], start[1] + part * delta[1])
        self.io.add_mouse_button_event(button, False)
        self.frame(2)

    def find_in_panel(self, changed: Any, clicks: str = "right") -> tuple[float, float]:
        """Click down the panel until `changed()` holds; where that was."""
        panel = self.layout.panel
        assert panel is not None
        y, tab = panel.y + 8, self.state.tab
        while y < panel.y + panel.height:
            x = panel.x + panel.width * (0.9 if clicks == "right" else 0.3)
            self.click(x, y)
            if changed():
                return x, y
            self.state.tab = tab  # the tabs lie on the way
            y += 6
        raise AssertionError("nothing in the panel does that")


@pytest.fixture
def screen(imgui_context: Any) -> Screen:
    return Screen(imgui_context)


LOOK_KEYS = {
    "1": Look.SYNTHESIS,
    "2": Look.DISPARITY,
    "3": Look.ERROR,
    "4": Look.WARPED_ALL,
    "5": Look.WARPED_TOP_LEFT,
    "6": Look.WARPED_TOP_RIGHT,
    "7": Look.WARPED_BOTTOM_LEFT,
    "8": Look.WARPED_BOTTOM_RIGHT,
}


def test_number_keys_switch_the_look(screen: Screen) -> None:
    for key, look in reversed(LOOK_KEYS.items()):
        screen.press(key)
        assert screen.state.look is look


@pytest.mark.parametrize("frames", ["each", "press", "release", "all"])
def test_a_drag_is_the_same_however_its_events_fall_into_frames(screen: Screen, frames: str) -> None:
    """The mouse comes from elsewhere, presses, moves and lets go; some or all of that between two frames."""
    state, io = screen.state, screen.io
    screen.move(600, 500)
    start, delta = (400, 300), (54, -36)
    together = {"each": [], "press": [0, 1], "release": [2, 3], "all": [0, 1, 2, 3]}[frames]
    events = [
        lambda: io.add_mouse_pos_event(*start),
        lambda: io.add_mouse_button_event(0, True),
        lambda: io.add_mouse_pos_event(start[0] + delta[0], start[1] + delta[1]),
        lambda: io.add_mouse_button_event(0, False),
        lambda: io.add_mouse_pos_event(900, 200),
    ]
    for number, event in enumerate(events):
        event()
        if number not in together:
            screen.frame()
    screen.frame(6)
    expected = (0.5 - delta[0] / DRAG_SPAN, 0.5 - delta[1] / DRAG_SPAN)
    assert (state.u, state.v) == pytest.approx(expected)
    assert not state.dragging


@pytest.mark.parametrize("look", [Look.DISPARITY, Look.ERROR, Look.WARPED_ALL, Look.WARPED_TOP_RIGHT])
def test_clicks_in_the_panel_switch_the_look(screen: Screen, look: Look) -> None:
    screen.find_in_panel(lambda: screen.state.look is look, "left" if look is Look.ERROR else "right")


def test_ticking_the_boxes_changes_the_state(screen: Screen) -> None:
    x, y = screen.find_in_panel(lambda: screen.state.captured, "left")
    screen.click(x, y)
    assert not screen.state.captured
    screen.find_in_panel(lambda: screen.state.inspector)


def test_dragging_the_picture_turns_the_scene_by_hand(screen: Screen) -> None:
    screen.drag((400, 300), (90, -36))
    # To the right: the camera goes to the left. Up: the camera goes down.
    assert screen.state.u == pytest.approx(0.5 - 90 / DRAG_SPAN)
    assert screen.state.v == pytest.approx(0.5 + 36 / DRAG_SPAN)
    assert not screen.state.dragging


def test_the_picture_may_begin_once_keys_and_the_mouse_have_moved_the_viewpoint(screen: Screen) -> None:
    screen.move(400, 300)
    screen.io.add_mouse_button_event(0, True)
    screen.frame()
    before = len(screen.begun)
    for x in (410, 425):
        u = screen.state.u
        screen.move(x, 300)
        assert screen.begun[-1] == (screen.layout, screen.state.u, screen.state.v)
        assert screen.state.u < u
    screen.io.add_mouse_button_event(0, False)
    screen.frame(2)
    u = screen.state.u
    screen.io.add_key_event(screen.imgui.Key.right_arrow, True)
    screen.frame()
    assert screen.begun[-1] == (screen.layout, screen.state.u, screen.state.v)
    assert screen.state.u > u
    assert len(screen.begun) == before + 5  # once a frame
    screen.io.add_key_event(screen.imgui.Key.right_arrow, False)
    screen.frame(2)


def test_drag_length_follows_the_content_scale(imgui_context: Any) -> None:
    screen = Screen(imgui_context, scale=2.0)
    screen.drag((200, 300), (90, 0))
    assert screen.state.u == pytest.approx(0.5 - 45 / DRAG_SPAN)


@pytest.mark.parametrize("button", [1, 2])
def test_right_and_middle_drag_move_the_picture(screen: Screen, button: int) -> None:
    before = place(screen.state.zoom, (541, 376), screen.layout.picture).origin
    screen.drag((400, 300), (50, 20), button)
    after = place(screen.state.zoom, (541, 376), screen.layout.picture).origin
    assert (after[0] - before[0], after[1] - before[1]) == pytest.approx((50, 20), abs=1)
    assert (screen.state.u, screen.state.v) == (0.5, 0.5)


def test_space_drag_moves_the_picture(screen: Screen) -> None:
    screen.io.add_key_event(screen.imgui.Key.space, True)
    screen.frame()
    screen.drag((400, 300), (50, 20))
    assert screen.state.zoom.scale is not None
    assert (screen.state.u, screen.state.v) == (0.5, 0.5)


def test_wheel_zooms_about_the_cursor(screen: Screen) -> None:
    area = screen.layout.picture
    screen.move(300, 350)
    before = place(screen.state.zoom, (541, 376), area)
    screen.io.add_mouse_wheel_event(0, 2)
    screen.frame(3)
    after = place(screen.state.zoom, (541, 376), area)
    assert after.scale > 1.3 * before.scale
    assert after.to_picture((300, 350)) == pytest.approx(before.to_picture((300, 350)), abs=0.6)


def test_wheel_over_the_panel_leaves_the_picture_alone(screen: Screen) -> None:
    assert screen.layout.panel is not None
    screen.move(screen.layout.panel.x + 50, 500)
    screen.io.add_mouse_wheel_event(0, 2)
    screen.frame(2)
    assert screen.state.zoom.scale is None


def test_zoom_keys(screen: Screen) -> None:
    screen.press("Z")
    assert screen.state.zoom.scale == 1.0
    screen.press("+")
    assert screen.state.zoom.scale == pytest.approx(1.25)
    screen.press("-")
    assert screen.state.zoom.scale == pytest.approx(1.0)
    screen.press("F")
    assert screen.state.zoom.scale is None


def test_arrow_keys_move_the_viewpoint_where_they_point(screen: Screen) -> None:
    for key, axis, sign in (("Left", "u", -1), ("Right", "u", 1), ("Up", "v", -1), ("Down", "v", 1)):
        before = getattr(screen.state, axis)
        screen.press(key)
        assert (getattr(screen.state, axis) - before) * sign > 0.005
    screen.press("Right")
    screen.press("Home")
    assert (screen.state.u, screen.state.v) == (0.5, 0.5)


def test_captured_view_keys(screen: Screen) -> None:
    screen.press("S")
    here = GRID.at(screen.state.u, screen.state.v)
    assert here is not None
    screen.press("N")
    assert GRID.at(screen.state.u, screen.state.v) == here + 1
    screen.press("P")
    screen.press("P")
    assert GRID.at(screen.state.u, screen.state.v) == here - 1


def test_the_pad_goes_where_it_is_clicked(screen: Screen) -> None:
    """A dot of the pad is a captured view: a click on its middle column lands on it."""
    screen.readout = Readout(model="full", grid=Grid(3, 3, 541, 376), name="x")
    screen.find_in_panel(lambda: (screen.state.u, screen.state.v) != (0.5, 0.5), "left")
    assert -0.25 <= screen.state.u <= 1.25
    assert screen.state.v == pytest.approx(-0.25, abs=0.08)  # the first row met from above is the upper rim


def test_typing_a_path_opens_it(screen: Screen) -> None:
    screen.press("Ctrl+Shift+O")
    screen.frame(2)
    for character in "/tmp/füße & co":
        screen.io.add_input_character(ord(character))
        screen.frame()
    assert screen.state.look is Look.SYNTHESIS  # letters are text now, not commands
    screen.io.add_key_event(screen.imgui.Key.enter, True)
    screen.frame(2)
    assert screen.requests == [OpenTyped("/tmp/füße & co")]
    assert not screen.state.path_field


def test_undoing_what_is_typed_leaves_the_view_alone(screen: Screen) -> None:
    for name in ("Ctrl+Z", "Ctrl+Y"):
        screen.press("Ctrl+Shift+O")
        screen.frame(2)
        screen.press(name)
        assert screen.requests == []
        screen.press("Esc")
        screen.press("Esc")
        screen.press(name)
        assert len(screen.requests) == 1
        screen.requests.clear()


def test_escape_puts_the_top_thing_away(screen: Screen) -> None:
    screen.readout = Readout(model="full", grid=GRID, messages=("It went wrong.",), loading=0.5, loading_name="x")
    screen.state.path_field = screen.state.help = True
    screen.frame(2)
    screen.press("Esc")
    assert not screen.state.help
    screen.press("Esc")
    assert not screen.state.path_field
    screen.press("Esc")
    assert screen.requests == [Action.CANCEL_OPEN]
    screen.readout = Readout(model="full", grid=GRID, messages=("It went wrong.",))
    screen.press("Esc")
    assert screen.requests[-1] is Action.DISMISS


def test_a_message_can_be_dismissed_with_the_mouse(screen: Screen) -> None:
    screen.readout = Readout(model="full", grid=GRID, messages=("It went wrong.", "And again."))
    screen.frame(2)
    area = screen.layout.picture
    for y in range(20, 160, 4):
        for x in range(int(area.width / 2 - 290), int(area.width / 2 + 290), 24):
            screen.click(x, y)
            if Action.DISMISS in screen.requests:
                return
    raise AssertionError("found no button to dismiss the message")


def test_nothing_open_offers_the_sample_and_ignores_keys_of_the_picture(screen: Screen) -> None:
    screen.readout = Readout(model="full")
    screen.frame(3)
    assert screen.layout.panel is None
    screen.press("2")
    screen.press("N")
    assert screen.state.look is Look.SYNTHESIS
    screen.press("Ctrl+L")
    assert screen.requests == [Action.OPEN_SAMPLE]


def test_program_keys(screen: Screen) -> None:
    screen.press("Tab")
    assert screen.layout.panel is None
    screen.press("Tab")
    assert screen.layout.panel is not None
    screen.press("F1")
    assert screen.state.help
    screen.press("?")
    assert not screen.state.help
    screen.press("Ctrl+W")
    screen.press("Ctrl+Q")
    assert screen.requests == [Action.CLOSE, Action.QUIT]


def test_keys_of_the_tabs(screen: Screen) -> None:
    for digit, tab in zip("1234", Tab, strict=True):
        screen.press(f"Ctrl+{digit}")
        assert screen.state.tab is tab
        assert screen.state.look is Look.SYNTHESIS  # the digit alone means something else


def test_a_chord_whose_keys_come_up_within_one_slow_frame_still_counts(screen: Screen) -> None:
    imgui = screen.imgui
    screen.io.add_key_event(imgui.Key.mod_ctrl, True)
    screen.io.add_key_event(imgui.Key.left_ctrl, True)
    screen.frame()
    screen.io.add_key_event(imgui.Key.o, True)
    screen.io.add_key_event(imgui.Key.mod_ctrl, False)
    screen.io.add_key_event(imgui.Key.left_ctrl, False)
    screen.io.add_key_event(imgui.Key.o, False)
    screen.frame(3)
    assert screen.requests == [Ask(Purpose.OPEN_FILE)]


def test_every_key_is_known_and_none_means_two_things() -> None:
    caps = [cap for command in COMMANDS.values() for cap in command.keys]
    assert len(caps) == len(set(caps))
    for cap in caps:
        assert cap in _CHARACTERS or cap.rsplit("+", 1)[-1] in _KEYS


STATES = {
    "nothing": Readout(model="full"),
    "loading first": Readout(model="full", loading=0.3, loading_name="Meadow"),
    "open": OPEN,
    "two by two": Readout(model="full", grid=Grid(2, 2, 100, 80), name="tiny"),
    "everything": Readout(
        model="full",
        grid=Grid(17, 17, 1024, 1024, frozenset({(0, 0)})),
        name="a name so long that it has to be shortened to fit into the panel",
        warnings=("The rows are reversed.",),
        step=Step.FULL,
        step_ms=1234.5,
        busy="synthesizing",
        loading=0.7,
        loading_name="other",
        messages=("A long sentence that says what was found, what was expected and what to do about it." * 3,),
        compared=Compared(True, ScoreText(37.5, 0.97, "K16")),
        timings=(("features", 0.3), ("total", 1.2)),
        disparity_range=(-3.0, 4.0),
        has_disparity=True,
        disparity_under_cursor=1.5,
        captured_here=5,
        cached=((0.1, 0.2), (1.2, 1.2)),
        cache_limit=2**29,
    ),
}


@pytest.mark.parametrize("name", STATES)
@pytest.mark.parametrize(("size", "scale"), [((200, 150), 1.0), ((1280, 800), 1.0), ((2560, 1440), 2.0), ((5000, 3000), 3.0)])
def test_every_state_draws_in_every_size(imgui_context: Any, name: str, size: tuple[int, int], scale: float) -> None:
    screen = Screen(imgui_context, scale)
    screen.size, screen.readout = size, STATES[name]
    screen.frame(3)
    before = screen.drawn()
    for card in ("help", "path_field"):
        setattr(screen.state, card, True)
        screen.frame(3)
        assert screen.drawn() != before
        before = screen.drawn()
    screen.move(size[0] / 3, size[1] / 3)
    screen.frame(20)  # what comes a while after the mouse has
    looks = set()
    for look in Look:
        screen.state.look = look
        screen.frame(2)
        looks.add(screen.drawn())
    assert len(looks) == (1 if screen.readout.grid is None else len(Look))
    picture = screen.layout.picture
    assert picture.width > 0
    assert picture.height > 0


def test_m_goes_through_the_models(screen: Screen) -> None:
    screen.readout = replace(OPEN, models=("full", "realtime", "mean"))
    screen.press("M")
    assert screen.state.model == "realtime"
    screen.readout = replace(screen.readout, model="mean")
    screen.press("M")
    assert screen.state.model == "full"
