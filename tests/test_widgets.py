"""The parts that panels are made of, and the panel's own room, by fed events and without any GL."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest
from test_panels import Screen

from app import statusbar, theme, widgets
from app.sidebar import look, viewpoint_pad
from app.state import Grid, Tab
from app.widgets import broken, counted
from lfcore.cache import rounded


@pytest.fixture
def screen(imgui_context: Any) -> Screen:
    return Screen(imgui_context)


def in_a_frame(screen: Screen, asked: Callable[[], Any]) -> Any:
    """What is found while a frame is drawn, when a font is at hand."""
    screen.imgui.new_frame()
    found = asked()
    screen.imgui.end_frame()
    return found


def test_one_is_not_called_as_several_are() -> None:
    assert (counted(1, "view"), counted(0, "view"), counted(2, "view")) == ("1 view", "0 views", "2 views")


def test_text_is_broken_at_spaces_only(screen: Screen) -> None:
    words = "an array of views (.mat, .h5) and IMG_0480.LFR"
    for width in range(40, 400, 7):
        lines = in_a_frame(screen, lambda width=width: broken(words, float(width))).split("\n")
        assert " ".join(lines) == words
    assert in_a_frame(screen, lambda: broken("one\ntwo three", 1e4)) == "one\ntwo three"
    assert in_a_frame(screen, lambda: broken("one\ntwo three", 30.0)) == "one\ntwo\nthree"


def test_a_slider_is_as_wide_whatever_its_value(screen: Screen, monkeypatch: pytest.MonkeyPatch) -> None:
    widths: list[float] = []
    monkeypatch.setattr(widgets.imgui, "set_next_item_width", widths.append)
    screen.state.tab = Tab.FOCUS
    frames = []
    for value in (0.0, -0.73, -12.34):
        screen.state.focusing = replace(screen.state.focusing, focus=value)
        widths.clear()
        screen.frame()
        frames.append(tuple(widths))
    assert len(frames[0]) >= 4
    assert len(set(frames)) == 1


Where = tuple[float, float, float]


def pads(screen: Screen, monkeypatch: pytest.MonkeyPatch) -> list[Where]:
    """Place and size of the pad in every frame that is drawn from now on."""
    seen: list[Where] = []
    original = viewpoint_pad.draw

    def draw(state: Any, readout: Any, size: float) -> None:
        corner = screen.imgui.get_cursor_screen_pos()
        seen.append((corner.x, corner.y, size))
        original(state, readout, size)

    monkeypatch.setattr(viewpoint_pad, "draw", draw)
    return seen


def scroll_to_the_end(screen: Screen) -> None:
    panel = screen.layout.panel
    assert panel is not None
    screen.move(panel.x + 40, panel.y + panel.height - 20)
    for _ in range(20):
        screen.io.add_mouse_wheel_event(0, -5)
        screen.frame()


@pytest.mark.parametrize("size", [(1280, 800), (640, 700), (1920, 1080)])
def test_no_tab_moves_what_stands_above_it(screen: Screen, monkeypatch: pytest.MonkeyPatch, size: tuple[int, int]) -> None:
    """Though some need a scrollbar, and are scrolled."""
    screen.size = size
    seen = pads(screen, monkeypatch)
    for tab in (*Tab, *Tab):
        screen.state.tab = tab
        screen.frame(3)
        scroll_to_the_end(screen)
    assert len(set(seen[1:])) == 1


def test_in_a_small_window_all_of_the_panel_scrolls_and_tabs_begin_at_their_top(
    screen: Screen, monkeypatch: pytest.MonkeyPatch
) -> None:
    screen.size = (640, 400)
    seen = pads(screen, monkeypatch)
    screen.state.tab = Tab.EXPORT
    screen.frame(3)
    top = seen[-1][1]
    scroll_to_the_end(screen)
    assert seen[-1][1] < top - 300
    panel, original = screen.layout.panel, look._looks
    assert panel is not None
    tab_at: list[float] = []

    def looks(context: Any) -> None:
        tab_at.append(screen.imgui.get_cursor_screen_pos().y)
        original(context)

    monkeypatch.setattr(look, "_looks", looks)
    screen.state.tab = Tab.LOOK
    screen.frame(3)
    assert panel.y < tab_at[-1] < panel.y + 0.25 * panel.height


def test_nothing_is_complained_of_when_the_program_ends_within_a_frame(
    screen: Screen, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """As by a signal, which comes anywhere: here between a style and its end."""

    def ends(*_: Any) -> None:
        raise SystemExit(143)

    monkeypatch.setattr(look, "tile", ends)
    with pytest.raises(SystemExit):
        screen.frame()
    assert capfd.readouterr() == ("", "")


def test_captured_views_in_memory_are_seen_in_the_pad() -> None:
    grid = Grid(3, 4, 100, 80, frozenset({(0, 1)}))
    kept = [rounded(*grid.position(index)) for index in (0, 1, 6)]
    colours = viewpoint_pad.dot_colours(grid, (*kept, (0.123, 0.4)), frozenset({(0, 0), (0, 3)}))
    assert [index for index, colour in enumerate(colours) if colour is theme.ACCENT] == [0, 6]
    assert colours[1] is theme.FIELD_ACTIVE  # dark, whatever else it is
    assert colours[3] is theme.TEXT


def said_below(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The parts of the status line that are drawn from now on."""
    shown: list[str] = []
    original = statusbar.text

    def text(words: str, *colour: Any) -> None:
        shown.append(words)
        original(words, *colour)

    monkeypatch.setattr(statusbar, "text", text)
    return shown


@pytest.mark.parametrize(("size", "said"), [((600, 500), True), ((1280, 800), False)])
def test_the_status_line_says_where_the_panel_has_no_room(
    screen: Screen, monkeypatch: pytest.MonkeyPatch, size: tuple[int, int], said: bool
) -> None:
    shown = said_below(monkeypatch)
    screen.size = size
    screen.frame()
    assert ("no room for the panel" in shown) is said
    screen.state.panel = False  # nobody wants it
    shown.clear()
    screen.frame()
    assert "no room for the panel" not in shown


def test_the_status_line_tells_one_from_several_and_whether_views_are_made_ahead(
    screen: Screen, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown = said_below(monkeypatch)
    screen.readout = replace(screen.readout, cached=((0.5, 0.5),), cache_hits=1)
    screen.frame()
    assert "memory 0 of 1 MiB: 1 view, 1 hit" in shown
    screen.press("A")
    assert "memory 0 of 1 MiB: 1 view, 1 hit, none ahead" in shown
