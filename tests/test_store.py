"""Syntheses on disk: what comes back, what is damaged, what makes room, what several programs at once do to each other."""

from __future__ import annotations

import hashlib
import json
import os
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scenes import plane
from test_cache import key, synthesis

from lfcore import kept_files, thumbnails
from lfcore import store as module
from lfcore.cache import CacheKey
from lfcore.decode.kept import default_store, key_of
from lfcore.errors import OutputError
from lfcore.formats.glance import Glance
from lfcore.kept_files import default_root
from lfcore.store import UNUSED_DAYS, ViewStore
from lfcore.synthesizer import Synthesis

SIZE = (32, 32)


@pytest.fixture
def store(tmp_path: Path) -> ViewStore:
    return ViewStore(tmp_path / "in a folder" / "für Tests")


def only_file(store: ViewStore) -> Path:
    (path,) = store.root.rglob("*.view")
    return path


def test_what_was_put_comes_back_within_half_precision(store: ViewStore) -> None:
    put = replace(synthesis(u=0.123456, seed=1), timings={"disparity": 0.25, "total": 0.5})
    store.put(key(0.1235), put)
    for other in (store, ViewStore(store.root)):  # also to another program
        got = other.get(key(0.1235), SIZE)
        assert got is not None
        assert np.abs(got.image - put.image).max() < 0.13 / 255
        assert put.disparity is not None
        assert got.disparity is not None
        assert np.abs(got.disparity - put.disparity).max() <= 2**-7
        assert got.image.dtype == got.disparity.dtype == np.float32
        assert (got.u, got.v, got.model, got.timings, got.warped) == (put.u, put.v, put.model, put.timings, None)
        assert other.positions("lf", "m") == [(0.1235, 0.5)]


def test_without_disparity(store: ViewStore) -> None:
    store.put(key(), replace(synthesis(), disparity=None))
    got = store.get(key(), SIZE)
    assert got is not None
    assert got.disparity is None


def test_other_viewpoints_light_fields_models_and_code_find_nothing(store: ViewStore, monkeypatch: pytest.MonkeyPatch) -> None:
    store.put(key(-0.25, 0.75), synthesis())
    assert store.positions("lf", "m") == [(-0.25, 0.75)]
    for other in (key(0.25, 0.75), key(-0.25, 0.75, content="x"), key(-0.25, 0.75, model="x")):
        assert store.get(other, SIZE) is None
    assert store.positions("x", "m") == store.positions("lf", "x") == []
    monkeypatch.setattr(module, "code_digest", lambda *packages: "of other code")
    assert store.get(key(-0.25, 0.75), SIZE) is None


def test_keys_change_with_the_sources_of_all_code_that_decides_what_comes_out(
    store: ViewStore, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(kept_files.resources, "files", lambda package: tmp_path / package)
    sources = "lfcore/synthesizer.py", "lfcore.kernels/warp.c", "lfcore.decode/colour.py", "lfcore.formats/dark.py"
    for name in (*sources, "lfcore.formats.lytro/metadata.py", "lfcore/notes.txt"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("1")

    def keys() -> tuple[Path, str]:
        kept_files.code_digest.cache_clear()
        return store._path(key(0.5, 0.5)), key_of("a capture")

    try:
        seen = [keys()]
        for name in (*sources, "lfcore.formats.lytro/metadata.py"):
            (tmp_path / name).write_text("2")
            seen.append(keys())
            view, decoded = (int(now != before) for now, before in zip(seen[-1], seen[-2], strict=True))
            assert (view, decoded) == ((1, 0) if name in sources[:2] else (0, 1)), name
        (tmp_path / "lfcore" / "notes.txt").write_text("2")
        assert keys() == seen[-1]
    finally:
        kept_files.code_digest.cache_clear()


def test_nothing_is_there_before_the_first_put(store: ViewStore) -> None:
    assert store.get(key(), SIZE) is None
    assert store.positions("lf", "m") == []
    assert store.usage() == module.Usage(0, 0, 0)
    store.tidy()
    store.clear()
    assert not store.root.exists()


@pytest.mark.parametrize("at", [0, 16, 40, 1000, -1])
def test_a_flipped_bit_anywhere_is_found_and_the_file_removed(store: ViewStore, at: int) -> None:
    store.put(key(), synthesis())
    path = only_file(store)
    data = bytearray(path.read_bytes())
    data[at] ^= 4
    path.write_bytes(data)
    assert store.get(key(), SIZE) is None
    assert not path.exists()


@pytest.mark.parametrize("length", [0, 5, 100, 3000])
def test_a_truncated_file_is_removed(store: ViewStore, length: int) -> None:
    store.put(key(), synthesis())
    path = only_file(store)
    path.write_bytes(path.read_bytes()[:length])
    assert store.get(key(), SIZE) is None
    assert not path.exists()


def test_a_picture_of_another_size_and_a_file_too_large_are_removed(store: ViewStore, monkeypatch: pytest.MonkeyPatch) -> None:
    store.put(key(), synthesis(side=16))
    assert store.get(key(), SIZE) is None
    store.put(key(), synthesis())
    path = only_file(store)
    with path.open("ab") as file:
        file.truncate(2**30)  # sparse

    def read(path: Path) -> bytes:
        raise AssertionError(f"{path} was read into memory")

    monkeypatch.setattr(Path, "read_bytes", read)
    assert store.get(key(), SIZE) is None
    assert not path.exists()


def test_the_longest_unused_make_room_and_the_limit_holds(tmp_path: Path) -> None:
    store = ViewStore(tmp_path)
    store.put(key(0.0), synthesis())
    one = store.usage().bytes
    store = ViewStore(tmp_path, 3 * one + one // 2)
    for number, u in enumerate((0.1, 0.2)):
        store.put(key(u, content=f"light field {number}"), synthesis(u))
    files = sorted(store.root.rglob("*.view"), key=lambda path: path.name)
    for age, path in zip((300, 200, 100), files, strict=True):
        os.utime(path, (time.time() - age,) * 2)
    assert store.get(key(0.0), SIZE) is not None  # used just now
    store.put(key(0.3), synthesis(0.3))
    assert store.usage().bytes <= store.limit_bytes
    assert store.get(key(0.1, content="light field 0"), SIZE) is None
    for kept in (key(0.0), key(0.2, content="light field 1"), key(0.3)):
        assert store.get(kept, SIZE) is not None


def test_what_exceeds_the_limit_is_not_kept_and_drives_nothing_out(tmp_path: Path) -> None:
    store = ViewStore(tmp_path, 20_000)
    store.put(key(0.1), synthesis())
    store.put(key(0.2), synthesis(side=64))
    assert store.positions("lf", "m") == [(0.1, 0.5)]


def test_tidying_removes_what_is_old_and_what_was_left_behind(store: ViewStore) -> None:
    for u in (0.1, 0.2):
        store.put(key(u), synthesis(u))
    folder = only_file_folder(store)
    left, fresh = folder / ".+0.1.x.view", folder / ".+0.2.y.view"
    for path in (left, fresh):
        path.write_bytes(b"half")
    os.utime(left, (time.time() - 2 * 3600,) * 2)
    old = next(path for path in folder.iterdir() if path.name.startswith("+0.1000"))
    os.utime(old, (time.time() - (UNUSED_DAYS + 1) * 86400,) * 2)
    assert len(store.positions("lf", "m")) == 2  # files being written are no views
    store.tidy()
    assert {path.name[:7] for path in folder.iterdir()} == {"+0.2000", ".+0.2.y"}


def only_file_folder(store: ViewStore) -> Path:
    (folder,) = {path.parent for path in store.root.rglob("*.view")}
    return folder


def test_clearing_leaves_what_is_not_a_view(store: ViewStore) -> None:
    store.put(key(), synthesis())
    (store.root / "notes").mkdir()
    (store.root / "notes" / "mine.txt").write_text("mine")
    assert store.usage().views == 1
    store.clear()
    assert store.usage().views == 0
    assert [path.name for path in store.root.rglob("*.txt")] == ["mine.txt"]


def test_no_permission_and_no_room_are_said(store: ViewStore, monkeypatch: pytest.MonkeyPatch) -> None:
    store.root.parent.mkdir()
    store.root.write_text("a file where the folder should be")
    with pytest.raises(OutputError, match="Cannot make the folder"):
        store.put(key(), synthesis())
    store.root.unlink()

    def full(path: Path, data: bytes) -> int:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(OutputError, match="No space left"):
        store.put(key(), synthesis())
    assert [path for path in store.root.rglob("*") if path.is_file()] == []


def test_programs_that_write_read_and_clear_at_once_see_whole_views_or_none(tmp_path: Path) -> None:
    """Several stores on one folder stand for several programs; each sees only the file system."""
    views: dict[CacheKey, Synthesis] = {key(n / 8): synthesis(n / 8, seed=n) for n in range(8)}
    limit = 5 * 8 * 32 * 32 + 5 * 500
    failures: list[str] = []

    def use(seed: int) -> None:
        random = np.random.default_rng(seed)
        store = ViewStore(tmp_path, limit)
        try:
            for n in random.integers(0, 8, 40):
                wanted = key(float(n) / 8)
                if n % 2:
                    store.put(wanted, views[wanted])
                got = store.get(wanted, SIZE)
                if got is not None and not np.allclose(got.image, views[wanted].image, atol=1e-3):
                    failures.append(f"{wanted} is another view")
                if seed == 0 and n == 0:
                    store.clear()
        except Exception as error:
            failures.append(repr(error))

    threads = [threading.Thread(target=use, args=(seed,)) for seed in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert failures == []
    ViewStore(tmp_path, limit).put(key(0.0), views[key(0.0)])
    assert ViewStore(tmp_path).usage().bytes <= limit


def test_the_folder_is_the_one_that_the_environment_names(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.delenv("LFVIEW_CACHE", raising=False)
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    assert default_root() == tmp_path / ".cache" / "lfview"
    monkeypatch.setenv("XDG_CACHE_HOME", "relative, so ignored")
    assert default_root() == tmp_path / ".cache" / "lfview"
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "caches"))
    assert default_root() == tmp_path / "caches" / "lfview"
    monkeypatch.setenv("LFVIEW_CACHE", "~/mine")
    assert default_root() == tmp_path / "mine"


def test_the_verb_says_how_much_there_is_and_removes_it(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    import json

    from app.__main__ import main

    monkeypatch.setenv("LFVIEW_CACHE", str(tmp_path))
    store = ViewStore(tmp_path)
    store.put(key(0.1), synthesis())
    store.put(key(0.1, content="another"), synthesis())
    default_store().put(key_of("a capture"), plane(1.0, (2, 2), (40, 50)))
    thumbnails.default_store().put("a", Glance(None, "Folder, 2 inside"))
    assert main(["cache", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    decoded_bytes = default_store().usage()[1]
    assert decoded_bytes > 1000
    assert told == {
        "folder": str(tmp_path),
        "views": 2,
        "light_fields": 2,
        "bytes": store.usage().bytes,
        "removed": 0,
        "decoded_captures": 1,
        "decoded_bytes": decoded_bytes,
        "thumbnails": 1,
        "thumbnail_bytes": thumbnails.default_store().usage()[1],
    }
    assert main(["cache", "--clear"]) == 0
    told_in_words = capsys.readouterr().out
    assert "2 views removed" in told_in_words and "decoded captures: 1 removed" in told_in_words
    assert "thumbnails: 1 removed" in told_in_words
    assert main(["cache"]) == 0
    told_in_words = capsys.readouterr().out
    assert "0 views of 0 light fields" in told_in_words and "decoded captures: 0" in told_in_words
    assert "thumbnails: 0" in told_in_words


@pytest.mark.parametrize("field", [{"timings": []}, {"u": 10**400}, {"nested": "[" * 1500 + "]" * 1500}])
def test_a_whole_file_that_says_something_else_is_removed(store: ViewStore, field: dict[str, object]) -> None:
    store.put(key(), synthesis())
    path = next(store.root.rglob("*.view"))
    begin = len(b"lfview view 1\n") + 4
    data = path.read_bytes()[:-16]
    length = int.from_bytes(data[begin - 4 : begin], "little")
    header = json.dumps({**json.loads(data[begin : begin + length]), **field}).encode()
    if "nested" in field:
        header = header.replace(b'"[', b"[").replace(b']"', b"]")
    changed = data[: begin - 4] + len(header).to_bytes(4, "little") + header + data[begin + length :]
    path.write_bytes(changed + hashlib.blake2b(changed, digest_size=16).digest())
    assert store.get(key(), SIZE) is None
    assert not path.exists()


def test_what_cannot_be_removed_is_said_and_not_counted(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from app.__main__ import main

    monkeypatch.setenv("LFVIEW_CACHE", str(tmp_path))
    store = ViewStore(tmp_path)
    store.put(key(0.1), synthesis())
    thumbnails.default_store().put("a", Glance(None, "Folder, 2 inside"))
    monkeypatch.setattr("lfcore.kept_files.remove", lambda path: False)
    assert main(["cache", "--clear"]) == 2
    output = capsys.readouterr()
    assert "1 view removed" in output.out and "thumbnails: 0 removed, 0.0 MiB" in output.out
    assert output.err.startswith("lfview: Cannot remove 1 files below") and output.err.count("\n") == 1
