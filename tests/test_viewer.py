"""What of the window can be tested without one: files dropped on it."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

from app.viewer import _Window


def test_of_several_things_dropped_the_first_is_opened() -> None:
    opened: list[Path] = []
    window: Any = object.__new__(_Window)  # no display is asked for
    window._interface = SimpleNamespace(controller=SimpleNamespace(open=opened.append))
    window._dropped(None, ["/tmp/a folder", "/tmp/b.png"])
    window._dropped(None, [])
    assert opened == [Path("/tmp/a folder")]
