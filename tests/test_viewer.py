"""What of the window can be tested without one: files dropped on it, and when frames are drawn."""

from __future__ import annotations

import math
import threading
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from app import viewer
from app.viewer import _Window


def test_one_thing_dropped_is_opened_and_several_are_shown_to_choose_from() -> None:
    opened: list[Path] = []
    shown: list[list[Path]] = []
    window: Any = object.__new__(_Window)  # no display is asked for
    controller, surroundings = SimpleNamespace(open=opened.append), SimpleNamespace(choose_among=shown.append)
    window._interface = SimpleNamespace(controller=controller, surroundings=surroundings)
    window._dropped(None, ["/tmp/a folder"])
    window._dropped(None, [])
    window._dropped(None, ["/tmp/a folder", "/tmp/b.png"])
    assert opened == [Path("/tmp/a folder")]
    assert shown == [[Path("/tmp/a folder"), Path("/tmp/b.png")]]


@pytest.mark.parametrize("woken", [True, False])
def test_what_a_worker_has_done_is_drawn_even_where_it_comes_as_the_wait_ends(
    monkeypatch: pytest.MonkeyPatch, woken: bool
) -> None:
    """Where nothing else happens no other frame would show it."""
    now = 0.0
    waits: list[float] = []
    drawn: list[int] = []  # how many waits there had been
    window: Any = object.__new__(_Window)

    def wait(seconds: float) -> None:
        nonlocal now
        waits.append(seconds)
        now += seconds + 0.002  # as on a busy machine
        if len(waits) == 8 and woken:
            window.wake()

    monkeypatch.setattr(viewer, "time", SimpleNamespace(monotonic=lambda: now))
    monkeypatch.setattr(viewer, "imgui", SimpleNamespace(get_io=lambda: SimpleNamespace(want_text_input=False)))
    graphics = SimpleNamespace(
        window_should_close=lambda _: len(waits) >= 15,
        wait_events_timeout=wait,
        poll_events=lambda: None,
        post_empty_event=lambda: None,
    )
    monkeypatch.setattr(viewer, "glfw", graphics)
    idle = SimpleNamespace(next_frame_in=None)
    window._interface = SimpleNamespace(
        closing=False, next_frame_in=None, may_explain=False, surroundings=idle, takes_from_networks=False
    )
    window._pace = SimpleNamespace(interval=lambda _: 0.01)
    window._window, window._presses, window._woken = None, 0, threading.Event()
    window._drawn_at = window._touched_at = -math.inf
    window.draw = lambda: drawn.append(len(waits))
    window.run()
    assert waits[7] == waits[-1] == viewer._IDLE_INTERVAL
    assert len([at for at in drawn if at < 8]) == viewer._SETTLE_FRAMES
    assert len([at for at in drawn if at >= 8]) == (viewer._WOKEN_FRAMES if woken else 0)
