"""Files that change or vanish while they are shown."""

from __future__ import annotations

import os
import shutil
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from test_formats import plain, random_views, save_views

from app.watching import Change, Watching

PATIENCE = 30.0


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


def settle(watched: Watched, path: Path) -> None:
    """Follow, and give the thread time for its first look, which imports the readers of files."""
    watched.watching.follow(path)
    import lfcore.thumbnails  # noqa: F401

    time.sleep(0.5)
    assert watched.watching.news() is None


def test_a_view_that_changes_is_said_and_so_is_the_next_change(watched: Watched, folder: Path) -> None:
    settle(watched, folder)
    for stamp in (1000, 2000):
        os.utime(folder / plain(1, 1), (stamp, stamp))
        assert watched.news() == f"{folder} {Change.CHANGED.value}"
    assert watched.watching.news() is None


def test_what_vanishes_is_said_and_so_is_that_it_is_back(watched: Watched, folder: Path) -> None:
    settle(watched, folder)
    shutil.move(folder, folder.parent / "elsewhere")
    assert watched.news() == f"{folder} {Change.GONE.value}"
    shutil.move(folder.parent / "elsewhere", folder)
    assert watched.news() == f"{folder} {Change.CHANGED.value}"


def test_another_file_is_no_change(watched: Watched, folder: Path, tmp_path: Path) -> None:
    other = save_views(tmp_path / "other", random_views(2, 2), plain)
    settle(watched, folder)
    settle(watched, other)
    os.utime(folder / plain(0, 0), (5, 5))
    watched.watching.follow(None)
    os.utime(other / plain(0, 0), (5, 5))
    time.sleep(0.2)
    assert watched.watching.news() is None
