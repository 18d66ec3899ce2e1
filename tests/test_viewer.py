"""What of the window can be tested without one: files dropped on it."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

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
