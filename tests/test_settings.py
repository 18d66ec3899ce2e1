"""Settings: what comes back, what is bounded, and what happens with damaged and unwritable files."""

from __future__ import annotations

import json
import os
import random
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from app.settings import (
    FILES_LIMIT,
    RECENT_LIMIT,
    SIZE_LIMIT,
    VERSION,
    Settings,
    SettingsFile,
    Theme,
    WindowPlace,
    default_path,
)
from lfcore.errors import OutputError

FULL = Settings(
    window=WindowPlace(-20, 30, 900, 700, maximised=True),
    panel=False,
    theme=Theme.LIGHT,
    scale=1.5,
    model="planesweep",
    foresight=False,
    recent=("/a/é b", "/c"),
    files={"k1": {"u": 0.25, "look": "DISPARITY"}, "k2": {"zoom": {"scale": None, "centre": [0.5, 0.25]}}},
)


@pytest.fixture
def file(tmp_path: Path) -> SettingsFile:
    return SettingsFile(tmp_path / "none yet" / "settings.json")


def test_what_was_saved_comes_back(file: SettingsFile) -> None:
    assert file.load() == (Settings(), None)
    file.save(FULL)
    assert SettingsFile(file.path).load() == (FULL, None)
    assert [entry.name for entry in file.path.parent.iterdir()] == [file.path.name]


def test_the_newest_stay_and_the_oldest_go() -> None:
    settings = Settings()
    for number in range(RECENT_LIMIT + 5):
        settings = settings.with_recent(f"/{number}")
    settings = settings.with_recent("/10")
    assert len(settings.recent) == RECENT_LIMIT
    assert settings.recent[:2] == ("/10", f"/{RECENT_LIMIT + 4}")
    assert "/4" not in settings.recent
    for number in range(FILES_LIMIT + 5):
        settings = settings.with_file(f"k{number}", {"u": number})
    settings = settings.with_file("k50", {"u": -1})
    assert len(settings.files) == FILES_LIMIT
    assert "k4" not in settings.files
    assert list(settings.files)[-1] == "k50"
    assert settings.files["k50"] == {"u": -1}


def test_the_largest_settings_fit_into_what_is_read(file: SettingsFile) -> None:
    settings = Settings()
    for number in range(RECENT_LIMIT):
        settings = settings.with_recent(f"/{number}" + 4000 * "x")
    for number in range(FILES_LIMIT):
        settings = settings.with_file(f"{number:032}", {f"field {index}": 0.123456789012345 for index in range(60)})
    file.save(settings)
    assert file.path.stat().st_size < SIZE_LIMIT
    assert SettingsFile(file.path).load() == (settings, None)


@pytest.mark.parametrize(
    "text", ["", "{", "[]", "null", '{"theme": "DARK"}', '{"version": "1"}', "\0\1", "[" * 100_000, " " * (SIZE_LIMIT + 1)]
)
def test_a_damaged_file_is_said_once_and_replaced(file: SettingsFile, text: str) -> None:
    file.path.parent.mkdir()
    file.path.write_text(text)
    settings, message = file.load()
    assert settings == Settings()
    assert message is not None
    assert str(file.path) in message
    file.save(FULL)
    assert SettingsFile(file.path).load() == (FULL, None)


def test_fields_that_are_wrong_take_their_defaults_and_the_others_stay(file: SettingsFile) -> None:
    file.path.parent.mkdir()
    stored = {"version": VERSION, "panel": "no", "theme": "PINK", "scale": 99, "model": "mean", "window": {"x": 1}}
    stored.update(recent=["/a", 7], foresight=False, files={"k": [], "l": {}})
    file.path.write_text(json.dumps(stored))
    settings, message = file.load()
    assert message is None
    assert settings == Settings(model="mean", foresight=False, scale=3.0)
    file.path.write_text('{"version": 1, "scale": NaN, "window": {"x": 1, "y": 1, "width": 1e400, "height": 5}}')
    assert file.load() == (Settings(), None)


def test_any_bytes_are_survived(file: SettingsFile) -> None:
    file.save(FULL)
    good, dice = file.path.read_bytes(), random.Random(5)
    for _ in range(500):
        bad = bytearray(good)
        for _ in range(dice.randint(1, 5)):
            bad[dice.randrange(len(bad))] = dice.randrange(256)
        file.path.write_bytes(bytes(bad[: dice.randint(1, len(bad))] if dice.random() < 0.3 else bad))
        settings, _ = file.load()
        assert isinstance(settings, Settings)


def test_a_newer_versions_file_is_left_alone(file: SettingsFile) -> None:
    file.path.parent.mkdir()
    file.path.write_text(json.dumps({"version": VERSION + 1, "theme": "LIGHT"}))
    before = file.path.read_bytes()
    settings, message = file.load()
    assert settings == Settings()
    assert message is not None
    file.save(FULL)
    assert file.path.read_bytes() == before


def test_an_unwritable_place_is_said_once(tmp_path: Path) -> None:
    blocked = tmp_path / "a file"
    blocked.write_text("in the way of the folder")
    file = SettingsFile(blocked / "settings.json")
    file.load()
    with pytest.raises(OutputError, match="not kept"):
        file.save(FULL)
    file.save(replace(FULL, panel=True))
    assert blocked.read_text() == "in the way of the folder"


def test_what_has_not_changed_is_not_written_again(file: SettingsFile) -> None:
    file.save(FULL)
    file.path.unlink()
    file.save(FULL)
    assert not file.path.exists()


@pytest.mark.skipif(sys.platform in ("win32", "darwin"), reason="XDG")
def test_the_systems_place_is_used(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", os.fspath(Path("/somewhere")))
    assert default_path() == Path("/somewhere/lfview/settings.json")
    monkeypatch.setenv("XDG_CONFIG_HOME", "relative")
    assert default_path() == Path.home() / ".config/lfview/settings.json"


def test_what_is_nested_deeply_is_not_taken_over_and_harms_nothing(file: SettingsFile) -> None:
    file.path.parent.mkdir()
    looks = f'{{"deep": {"[" * 600}{"]" * 600}, "deeper": {{"a": {"[" * 900}{"]" * 900}}}, "usual": {{"u": 0.25}}}}'
    file.path.write_text(f'{{"version": {VERSION}, "files": {looks}}}')
    settings, message = file.load()
    assert message is None
    assert settings.files in ({}, {"usual": {"u": 0.25}})
    file.save(replace(settings, panel=False))
    assert not SettingsFile(file.path).load()[0].panel


def test_names_that_no_file_can_have_are_left_out(file: SettingsFile) -> None:
    file.path.parent.mkdir()
    stored = {"version": VERSION, "recent": ["/a", "/\ud800x", "/b\0c", "/caf\udce9"], "model": "\ud800"}
    file.path.write_text(json.dumps(stored))
    assert file.load() == (Settings(recent=("/a", "/caf\udce9")), None)
