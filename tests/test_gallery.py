"""Many light fields seen at a glance, in a thread."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest
from test_formats import plain, random_views, save_views

from app.gallery import HELD, Gallery
from lfcore.errors import Cancelled, InputError
from lfcore.formats.glance import Glance
from lfcore.thumbnails import ThumbnailStore

PATIENCE = 60.0
PICTURE = np.zeros((2, 3, 3), np.uint8)


def until(condition: Callable[[], bool], each_time: Callable[[], None]) -> None:
    deadline = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < deadline
        each_time()
        time.sleep(0.002)


def look_at(gallery: Gallery, paths: Sequence[Path]) -> None:
    until(lambda: all(gallery.seen(path) for path in paths), lambda: gallery.want(paths))


@pytest.fixture
def gallery() -> Iterator[Gallery]:
    made = Gallery(None, lambda: None)
    yield made
    made.stop(PATIENCE)


@pytest.fixture
def looked_at(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The names that `glance` was called for, in order; names with "bad" cannot be opened, with "odd" are a fault."""
    names: list[str] = []

    def fake(path: Path, cancelled: Callable[[], bool]) -> Glance:
        names.append(path.name)
        if "bad" in path.name:
            raise InputError(f"{path.name} is bad.")
        if "odd" in path.name:
            raise RuntimeError("odd")
        while "slow" in path.name:
            if cancelled():
                raise Cancelled
            time.sleep(0.002)
        return Glance(PICTURE, path.name)

    monkeypatch.setattr("lfcore.formats.glance.glance", fake)
    monkeypatch.setattr("lfcore.thumbnails.key_of", str)
    return names


def test_real_folders_are_seen_and_kept_on_disk(tmp_path: Path) -> None:
    views = random_views(2, 2)
    folder = save_views(tmp_path / "light field", views, plain)
    store = ThumbnailStore(tmp_path / "thumbnails")
    woken = threading.Event()
    for _ in range(2):  # the second time from the disk
        gallery = Gallery(lambda: store, woken.set)
        look_at(gallery, [folder, tmp_path / "absent"])
        seen, absent = gallery.seen(folder), gallery.seen(tmp_path / "absent")
        gallery.stop(PATIENCE)
        assert seen is not None
        assert seen.glance is not None
        assert seen.glance.picture is not None
        assert (seen.glance.picture == views[1, 1]).all()
        assert absent is not None
        assert "absent" in absent.reason
        assert store.usage()[0] == 1
    assert woken.is_set()


def test_the_first_are_looked_at_first_and_once(gallery: Gallery, looked_at: list[str]) -> None:
    paths = [Path(f"/{number}") for number in range(50)]
    look_at(gallery, paths)
    assert looked_at == [path.name for path in paths]
    gallery.want(paths)
    time.sleep(0.05)
    assert len(looked_at) == 50
    gallery.forget()
    assert gallery.seen(paths[0]) is None
    look_at(gallery, paths[:1])
    assert len(looked_at) == 51


def test_what_cannot_be_read_has_a_reason_and_the_others_are_seen(gallery: Gallery, looked_at: list[str]) -> None:
    paths = [Path("/bad"), Path("/odd"), Path("/good")]
    look_at(gallery, paths)
    reasons = [seen.reason for seen in map(gallery.seen, paths) if seen is not None]
    assert reasons == ["bad is bad.", "Unexpected fault in the program: RuntimeError: odd", ""]
    assert len(looked_at) == 3  # a failure is not tried for ever


def test_what_is_not_wanted_any_more_gives_way(gallery: Gallery, looked_at: list[str]) -> None:
    gallery.want([Path("/slow")])
    until(lambda: looked_at == ["slow"], lambda: None)
    look_at(gallery, [Path("/other")])
    assert gallery.seen(Path("/slow")) is None


def test_memory_holds_only_so_many_those_asked_for_last(gallery: Gallery, looked_at: list[str]) -> None:
    paths = [Path(f"/{number}") for number in range(HELD + 100)]
    look_at(gallery, paths[:HELD])
    assert gallery.seen(paths[0]) is not None
    look_at(gallery, paths[HELD:])
    assert gallery.seen(paths[0]) is not None  # asked for just now
    assert sum(gallery.seen(path) is not None for path in paths) <= HELD
