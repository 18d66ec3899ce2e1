"""Files that change or vanish while they are shown."""

from __future__ import annotations

import os
import shutil
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from test_formats import plain, random_views, save_views

from app import watching
from app.watching import Change, Watching

PATIENCE = 60.0


class Watched:
    def __init__(self) -> None:
        self.woken = threading.Event()
        self.watching = Watching(self.woken.set, interval=0.02)

    def news(self) -> str | None:
        assert self.woken.wait(PATIENCE)
        self.woken.clear()
        return self.watching.news()


@pytest.fixture
def watched() -> Iterator[Watched]:
    made = Watched()
    yield made
    made.watching.stop(PATIENCE)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return save_views(tmp_path / "light field", random_views(2, 2), plain)


def first_look(monkeypatch: pytest.MonkeyPatch, path: Path) -> threading.Event:
    """Set once the thread has seen how this path is; whatever changes from then on is news."""
    seen = threading.Event()
    look = watching._state

    def noted(at: Path) -> str | None:
        state = look(at)
        if at == path:
            seen.set()
        return state

    monkeypatch.setattr(watching, "_state", noted)
    return seen


@pytest.fixture
def settle(watched: Watched, monkeypatch: pytest.MonkeyPatch) -> Callable[[Path], None]:
    """Follow a path, and wait for the first look at it."""

    def follow(path: Path) -> None:
        seen = first_look(monkeypatch, path)
        watched.watching.follow(path)
        assert seen.wait(PATIENCE)
        assert watched.watching.news() is None

    return follow


def test_a_view_that_changes_is_said_and_so_is_the_next_change(
    watched: Watched, settle: Callable[[Path], None], folder: Path
) -> None:
    settle(folder)
    for stamp in (1000, 2000):
        os.utime(folder / plain(1, 1), (stamp, stamp))
        assert watched.news() == f"{folder} {Change.CHANGED.value}"
    assert watched.watching.news() is None


def test_what_vanishes_is_said_and_so_is_that_it_is_back(
    watched: Watched, settle: Callable[[Path], None], folder: Path
) -> None:
    settle(folder)
    shutil.move(folder, folder.parent / "elsewhere")
    assert watched.news() == f"{folder} {Change.GONE.value}"
    shutil.move(folder.parent / "elsewhere", folder)
    assert watched.news() == f"{folder} {Change.CHANGED.value}"


def test_another_file_is_no_change(watched: Watched, settle: Callable[[Path], None], folder: Path, tmp_path: Path) -> None:
    other = save_views(tmp_path / "other", random_views(2, 2), plain)
    settle(folder)
    settle(other)
    os.utime(folder / plain(0, 0), (5, 5))
    watched.watching.follow(None)
    os.utime(other / plain(0, 0), (5, 5))
    time.sleep(0.2)
    assert watched.watching.news() is None
