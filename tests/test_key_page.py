"""The page of all keys, by fed events and without any GL."""

from __future__ import annotations

import sys
from typing import Any

import pytest
from test_panels import Screen

from app.commands import COMMANDS, GESTURES
from app.overlays.key_page import _GROUPS, _columns, _done, rows_of
from app.widgets import em


@pytest.fixture
def screen(imgui_context: Any) -> Screen:
    return Screen(imgui_context)


def test_every_key_and_gesture_is_on_the_page_and_several_keys_are_told_apart() -> None:
    rows = [row for group in _GROUPS for row in rows_of(group)]
    assert {words for _, words in rows} == {c.text for c in COMMANDS.values() if c.keys} | {g[2] for g in GESTURES}
    assert len(rows) == sum(bool(c.keys) for c in COMMANDS.values()) + len(GESTURES)
    assert ("Ctrl+4 or Ctrl+E", COMMANDS["export tab"].text) in rows


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_columns_hold_every_group_once_and_are_about_equally_long(screen: Screen, count: int) -> None:
    screen.imgui.new_frame()
    columns = _columns(count, 26 * em(), em())
    screen.imgui.end_frame()
    assert tuple(name for column in columns for name in column) == _GROUPS
    lengths = [sum(len(rows_of(name)) + 2 for name in column) for column in columns]
    assert max(lengths) < 1.25 * sum(lengths) / count


@pytest.mark.parametrize("size", [(640, 400), (1280, 800), (1920, 1080), (3840, 2160)])
def test_the_page_can_be_put_away_at_its_top(screen: Screen, monkeypatch: pytest.MonkeyPatch, size: tuple[int, int]) -> None:
    buttons: list[tuple[float, float]] = []
    key_page = sys.modules["app.overlays.key_page"]  # a function of the package has the same name
    original = _done

    def done(context: Any, place: str) -> None:
        corner = screen.imgui.get_cursor_screen_pos()
        buttons.append((corner.x + 8, corner.y + 8))
        original(context, place)

    monkeypatch.setattr(key_page, "_done", done)
    screen.size = size
    screen.press("F1")
    screen.frame(3)
    screen.click(*buttons[-2])
    assert not screen.state.help
