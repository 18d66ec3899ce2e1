"""Native dialogs, by dialog programs made up for the test that answer as zenity and kdialog do."""

from __future__ import annotations

import os
import sys
import threading
from pathlib import Path

import pytest

from app import dialogs
from app.dialogs import Answered, Purpose, Question

pytestmark = pytest.mark.skipif(
    sys.platform in ("win32", "darwin"), reason="these systems' dialogs cannot be answered by a test"
)
PATIENCE = 60.0


@pytest.fixture
def programs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The only folder in which programs are looked for, besides those of the shell."""
    folder = tmp_path / "programs"
    folder.mkdir()
    monkeypatch.setattr("shutil.which", lambda name: str(folder / name) if (folder / name).exists() else None)
    monkeypatch.delenv("XDG_CURRENT_DESKTOP", raising=False)
    return folder


def install(folder: Path, name: str, script: str) -> None:
    path = folder / name
    path.write_text(f'#!/bin/sh\nprintf "%s\\n" "$@" > "{folder}/words"\n{script}\n')
    path.chmod(0o755)


def answer_of(question: Question) -> Answered:
    woken = threading.Event()
    dialog = dialogs.ask(question, woken.set)
    assert woken.wait(PATIENCE)
    answer = dialog.poll()
    assert answer is not None
    return answer


def test_without_a_program_there_are_no_dialogs(programs: Path) -> None:
    assert not dialogs.available()
    install(programs, "kdialog", "")
    assert dialogs.available()


def test_the_path_that_was_chosen_comes_back_and_the_loop_is_woken(programs: Path, tmp_path: Path) -> None:
    install(programs, "zenity", 'sleep 0.2\nprintf "/some where/ü.png\\n"')
    question = Question(Purpose.OPEN_FILE, "Open a light field", tmp_path, "Light fields", ("*.png", "*.lfp"))
    assert answer_of(question) == Answered(Path("/some where/ü.png"))
    words = (programs / "words").read_text().splitlines()
    assert f"--filename={tmp_path}/" in words
    assert "--file-filter=Light fields|*.png *.lfp" in words


def test_asking_does_not_wait(programs: Path, tmp_path: Path) -> None:
    install(programs, "zenity", f'while [ ! -e "{tmp_path}/go" ]; do sleep 0.05; done\necho /a')
    woken = threading.Event()
    dialog = dialogs.ask(Question(Purpose.OPEN_FOLDER, "Open", tmp_path), woken.set)
    assert dialog.poll() is None
    (tmp_path / "go").touch()
    assert woken.wait(PATIENCE)
    assert dialog.poll() == Answered(Path("/a"))


def test_giving_up_and_failing_to_appear_are_told_apart(
    programs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    question = Question(Purpose.SAVE_FILE, "Save", tmp_path / "new.png")
    monkeypatch.setattr(dialogs, "_TOO_SOON_SECONDS", 0.05)
    install(programs, "zenity", "sleep 0.1\nexit 1")
    assert answer_of(question) == Answered(None, shown=True)
    monkeypatch.setattr(dialogs, "_TOO_SOON_SECONDS", 30.0)
    install(programs, "zenity", "echo no display >&2\nexit 1")
    assert answer_of(question) == Answered(None, shown=False)


def test_a_dialog_can_be_closed(programs: Path, tmp_path: Path) -> None:
    install(programs, "zenity", "exec sleep 60")
    woken = threading.Event()
    dialog = dialogs.ask(Question(Purpose.OPEN_FILE, "Open", tmp_path), woken.set)
    dialog.close()
    assert woken.wait(PATIENCE)
    answer = dialog.poll()
    assert answer is not None
    assert answer.path is None


def test_the_desktops_own_program_is_preferred(programs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install(programs, "zenity", "echo /by/zenity")
    install(programs, "kdialog", "echo /by/kdialog")
    question = Question(Purpose.SAVE_FILE, "Save the picture", tmp_path / "a b.png", "Pictures", ("*.png",))
    assert answer_of(question).path == Path("/by/zenity")
    monkeypatch.setenv("XDG_CURRENT_DESKTOP", "KDE")
    assert answer_of(question).path == Path("/by/kdialog")
    words = (programs / "words").read_text().splitlines()
    assert words == [
        "--title",
        "Save the picture",
        "--getsavefilename",
        os.fspath(tmp_path / "a b.png"),
        "*.png|Pictures",
        "*|All files",
    ]
