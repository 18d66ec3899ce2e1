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


class Idle:
    """A window that nobody touches, on a clock of its own, which goes on by its waits."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, waits: int) -> None:
        self.now = 0.0
        self.waits: list[float] = []
        self.drawn: list[tuple[int, float]] = []  # how many waits there had been, and when
        self.window: Any = object.__new__(_Window)
        monkeypatch.setattr(viewer, "time", SimpleNamespace(monotonic=lambda: self.now))
        context = SimpleNamespace(input_events_queue=[])
        imgui = SimpleNamespace(get_io=lambda: SimpleNamespace(want_text_input=False), get_current_context=lambda: context)
        monkeypatch.setattr(viewer, "imgui", imgui)
        graphics = SimpleNamespace(
            window_should_close=lambda _: len(self.waits) >= waits,
            wait_events_timeout=self.wait,
            poll_events=lambda: None,
            post_empty_event=lambda: None,
        )
        monkeypatch.setattr(viewer, "glfw", graphics)
        self.interface = SimpleNamespace(
            closing=False,
            next_frame_in=None,
            may_explain=False,
            surroundings=SimpleNamespace(next_frame_in=None),
            takes_from_networks=False,
        )
        self.window._interface = self.interface
        self.window._pace = SimpleNamespace(interval=lambda _: 0.01)
        self.window._window, self.window._woken = None, threading.Event()
        self.window._drawn_at = self.window._touched_at = -math.inf
        self.window.draw = lambda: self.drawn.append((len(self.waits), self.now))

    def wait(self, seconds: float) -> None:
        self.waits.append(seconds)
        self.now += seconds + 0.002  # as on a busy machine


@pytest.mark.parametrize("woken", [True, False])
def test_what_a_worker_has_done_is_drawn_even_where_it_comes_as_the_wait_ends(
    monkeypatch: pytest.MonkeyPatch, woken: bool
) -> None:
    """Where nothing else happens no other frame would show it."""
    idle = Idle(monkeypatch, 15)

    def wait(seconds: float) -> None:
        idle.wait(seconds)
        if len(idle.waits) == 8 and woken:
            idle.window.wake()

    monkeypatch.setattr(viewer.glfw, "wait_events_timeout", wait)
    idle.window.run()
    assert idle.waits[7] == idle.waits[-1] == viewer._IDLE_INTERVAL
    assert len([at for at, _ in idle.drawn if at < 8]) == viewer._SETTLE_FRAMES
    assert len([at for at, _ in idle.drawn if at >= 8]) == (viewer._WOKEN_FRAMES if woken else 0)


@pytest.mark.parametrize("due_in", [0.2, 0.6, 1.7])
def test_what_is_due_so_long_after_a_frame_has_another_frame_then(monkeypatch: pytest.MonkeyPatch, due_in: float) -> None:
    idle = Idle(monkeypatch, 15)
    idle.interface.next_frame_in = due_in  # as the last frame tells it, whenever it is asked for
    idle.window.run()
    times = [when for _, when in idle.drawn]
    first = times[viewer._SETTLE_FRAMES - 1]  # the last frame of those at the beginning
    assert due_in <= times[viewer._SETTLE_FRAMES] - first < due_in + 0.03
