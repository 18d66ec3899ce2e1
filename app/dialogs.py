"""The system's own dialogs to open and save files. They run beside the frame loop, which is woken when one has been answered.

On Linux the desktop's dialog programs are started from here: portable_file_dialogs, which serves Windows and macOS, would
hold up the frame loop for most of a second to find out which of them there are.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Any, Protocol

_POLL_SECONDS = 0.1
# A dialog program that ends so soon, without an answer, was not closed by a hand: it could not show itself.
_TOO_SOON_SECONDS = 0.3
_LIKE_ZENITY = ("zenity", "qarma", "matedialog")
_KDIALOG = "kdialog"


class Purpose(Enum):
    """What is asked for."""

    OPEN_FILE = "open a file"
    OPEN_FOLDER = "open a folder"
    SAVE_FILE = "save a file"


@dataclass(frozen=True)
class Question:
    """What a dialog asks: `start` is the folder or file that it begins with, `patterns` (such as "*.png") what it lists,
    under the name `kind`."""

    purpose: Purpose
    title: str
    start: Path
    kind: str = ""
    patterns: tuple[str, ...] = ()


@dataclass(frozen=True)
class Answered:
    """How it ended: with a path; with None where the person has given it up; `shown` False where it could not appear."""

    path: Path | None
    shown: bool = True


class Dialog(Protocol):
    """A dialog that is open, or has been answered."""

    def poll(self) -> Answered | None:
        """The answer, None as long as there is none."""

    def close(self) -> None:
        """Take it off the screen."""


def available() -> bool:
    """Whether this system has dialogs that can be asked for."""
    return sys.platform in ("win32", "darwin") or _program() is not None


def ask(question: Question, wake: Callable[[], None]) -> Dialog:
    """Show the dialog; `wake` is called, from another thread, when it has been answered.

    `available` must hold. Raises OSError where the dialog program cannot be started.
    """
    program = _program()
    dialog: Dialog = _Bundled(question) if program is None else _Started(command(program, question))

    def watch() -> None:
        while dialog.poll() is None:
            time.sleep(_POLL_SECONDS)
        wake()

    threading.Thread(target=watch, name="dialog", daemon=True).start()
    return dialog


def command(program: str, question: Question) -> list[str]:
    """The command that shows the question by a program such as zenity or kdialog."""
    start = os.fspath(question.start)
    if question.purpose is not Purpose.SAVE_FILE and question.start.is_dir():
        start = start.rstrip("/") + "/"  # else the folder above would be shown
    patterns = " ".join(question.patterns)
    if Path(program).name == _KDIALOG:
        verbs = {
            Purpose.OPEN_FILE: "--getopenfilename",
            Purpose.OPEN_FOLDER: "--getexistingdirectory",
            Purpose.SAVE_FILE: "--getsavefilename",
        }
        listed = [f"{patterns}|{question.kind}\n*|All files"] if patterns else []
        return [program, "--title", question.title, verbs[question.purpose], start, *listed]
    words = [program, "--file-selection", f"--title={question.title}", f"--filename={start}"]
    if question.purpose is Purpose.OPEN_FOLDER:
        return [*words, "--directory"]
    if question.purpose is Purpose.SAVE_FILE:
        words += ["--save", "--confirm-overwrite"]
    return [*words, f"--file-filter={question.kind}|{patterns}", "--file-filter=All files|*"] if patterns else words


def _program() -> str | None:
    """The dialog program of this desktop; None on systems that need none, or where there is none."""
    if sys.platform in ("win32", "darwin"):
        return None
    kde = "KDE" in os.environ.get("XDG_CURRENT_DESKTOP", "").upper()
    names = (_KDIALOG, *_LIKE_ZENITY) if kde else (*_LIKE_ZENITY, _KDIALOG)
    return next((found for found in map(shutil.which, names) if found is not None), None)


class _Started:
    """A dialog program that runs beside this one."""

    def __init__(self, words: Sequence[str]) -> None:
        self._started = time.monotonic()
        self._process = subprocess.Popen(
            list(words), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
        )
        self._answer: Answered | None = None
        self._asked = threading.Lock()

    def poll(self) -> Answered | None:
        with self._asked:
            if self._answer is None and self._process.poll() is not None:
                self._answer = self._read()
            return self._answer

    def _read(self) -> Answered:
        words = b"" if self._process.stdout is None else self._process.stdout.read()
        name = os.fsdecode(words.rstrip(b"\r\n"))
        if self._process.returncode == 0 and name:
            return Answered(Path(name))
        return Answered(None, shown=time.monotonic() - self._started > _TOO_SOON_SECONDS)

    def close(self) -> None:
        if self._process.poll() is None:
            self._process.terminate()


class _Bundled:
    """A dialog of Windows or macOS, by portable_file_dialogs."""

    def __init__(self, question: Question) -> None:
        from imgui_bundle import portable_file_dialogs as dialogs

        start = str(question.start)
        filters = [question.kind, " ".join(question.patterns), "All files", "*"] if question.patterns else None
        self._dialog: Any
        if question.purpose is Purpose.OPEN_FOLDER:
            self._dialog = dialogs.select_folder(question.title, start)
        elif question.purpose is Purpose.SAVE_FILE:
            self._dialog = dialogs.save_file(question.title, start, filters)
        else:
            self._dialog = dialogs.open_file(question.title, start, filters)

    def poll(self) -> Answered | None:
        if not self._dialog.ready(0):
            return None
        result = self._dialog.result()
        name = result if isinstance(result, str) else next(iter(result), "")
        return Answered(Path(name) if name else None)

    def close(self) -> None:
        self._dialog.kill()
