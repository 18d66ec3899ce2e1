"""Thumbnails on disk: what comes back, what is damaged, what makes room; and that a changed light field is looked at anew."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from test_formats import plain, random_views, save, save_views

from lfcore.errors import InputError, OutputError
from lfcore.formats.glance import Glance
from lfcore.thumbnails import ThumbnailStore, key_of


def seen(seed: int = 0, size: tuple[int, int] = (125, 180)) -> Glance:
    pixels = np.random.default_rng(seed).integers(0, 256, (*size, 3), dtype=np.uint8)
    return Glance(pixels, f"4 × 4 views, {seed}")


@pytest.fixture
def store(tmp_path: Path) -> ThumbnailStore:
    return ThumbnailStore(tmp_path / "für Tests" / "thumbnails")


def test_what_was_put_comes_back(store: ThumbnailStore) -> None:
    assert store.get("a") is None
    put = seen()
    store.put("a", put)
    store.put("b", Glance(None, "Folder, 5 inside"))
    got = ThumbnailStore(store.folder).get("a")
    assert got is not None
    assert got.picture is not None
    assert put.picture is not None
    assert (got.picture == put.picture).all()
    assert got.caption == put.caption
    assert store.get("b") == Glance(None, "Folder, 5 inside")
    assert store.usage()[0] == 2
    store.clear()
    assert store.usage() == (0, 0)


def test_any_damage_is_noticed_and_removed(store: ThumbnailStore) -> None:
    store.put("a", seen(size=(8, 8)))
    (path,) = store.folder.iterdir()
    good = path.read_bytes()
    for place in range(0, len(good), 7):
        bad = bytearray(good)
        bad[place] ^= 0x10
        path.write_bytes(bytes(bad))
        assert store.get("a") is None
        assert not path.exists()
    for size in (0, 3, 30, len(good) - 1):
        path.write_bytes(good[:size])
        assert store.get("a") is None


def test_those_used_longest_ago_make_room(store: ThumbnailStore) -> None:
    store.put("0", seen(0))
    one = store.usage()[1]
    small = ThumbnailStore(store.folder, int(3.5 * one))
    for number in (1, 2):
        small.put(str(number), seen(number))
    for age, number in ((300, 0), (200, 1), (100, 2)):
        path = store.folder / f"{number}.thumbnail"
        os.utime(path, (path.stat().st_atime - age, path.stat().st_mtime - age))
    assert small.get("0") is not None  # now used
    small.put("3", seen(3))
    assert small.get("1") is None
    assert all(small.get(name) is not None for name in "023")
    assert small.usage()[1] <= small.limit_bytes


def test_an_unwritable_place_is_a_sentence(tmp_path: Path) -> None:
    (tmp_path / "blocked").write_text("a file")
    with pytest.raises(OutputError, match="blocked"):
        ThumbnailStore(tmp_path / "blocked" / "thumbnails").put("a", seen())


def test_another_place_size_time_or_view_is_another_key(tmp_path: Path) -> None:
    folder = save_views(tmp_path / "a", random_views(2, 2), plain)
    other = save_views(tmp_path / "b", random_views(2, 2), plain)
    keys = [key_of(folder), key_of(other)]
    view = folder / plain(1, 1)
    save(view, random_views(1, 1, 8, 8)[0, 0])
    keys.append(key_of(folder))
    os.utime(view, (1, 1))
    keys.append(key_of(folder))
    view.rename(folder / "view.png")
    keys.append(key_of(folder))
    keys.append(key_of(folder / "view.png"))
    assert len(set(keys)) == len(keys)
    assert key_of(folder) == keys[-2]
    with pytest.raises(InputError, match="cannot be opened"):
        key_of(tmp_path / "gone")


def test_what_another_program_is_writing_is_left_alone_and_what_it_left_behind_is_not(tmp_path: Path) -> None:
    store = ThumbnailStore(tmp_path)
    store.put("a", Glance(None, "a"))
    young, old = tmp_path / ".b.1234.thumbnail", tmp_path / ".c.1234.thumbnail"
    for begun in (young, old):
        begun.write_bytes(b"half of")
    os.utime(old, (1, 1))
    store.put("d", Glance(None, "d"))
    assert sorted(tmp_path.iterdir()) == [young, store.path("a"), store.path("d")]
    store.clear()
    assert list(tmp_path.iterdir()) == [young]
