"""A virtual screen for whole-program tests: its own Xvfb on a free display, events by xdotool, pixels from its memory."""

from __future__ import annotations

import os
import shutil
import struct
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

SIZE = (1280, 800)
PATIENCE = 60.0
_HEADER_WORDS = 25  # of an XWD file, big-endian


def missing_tools() -> list[str]:
    """The programs that these tests need and that are not installed."""
    return [name for name in ("Xvfb", "xdotool") if shutil.which(name) is None]


def require_tools() -> None:
    """Skip the test where these programs are missing; in CI, whose set-up installs them, fail."""
    if missing_tools():
        if os.environ.get("CI"):
            pytest.fail(f"the set-up should have installed {', '.join(missing_tools())}")
        pytest.skip(f"not installed: {', '.join(missing_tools())} (on Debian: xvfb, xdotool)")


def comes(condition: Callable[[], bool], patience: float) -> bool:
    """Whether the condition holds within so many seconds."""
    deadline = time.monotonic() + patience
    while not condition():
        if time.monotonic() >= deadline:
            return False
        time.sleep(0.03)
    return True


def wait_until(condition: Callable[[], bool], what: str, patience: float = PATIENCE) -> None:
    """Wait for the condition, at most so many seconds."""
    assert comes(condition, patience), f"waited {patience:.0f} s for {what}"


# Between reaching a place, pressing there and moving on: no hand does all three between two frames.
_HAND_SECONDS = 0.15


@dataclass(frozen=True)
class VirtualScreen:
    """A running Xvfb."""

    display: str
    memory: Path

    def environment(self) -> dict[str, str]:
        """What programs on this screen need to find it, and no other."""
        kept = {name: value for name, value in os.environ.items() if name != "WAYLAND_DISPLAY"}
        return {**kept, "DISPLAY": self.display, "LIBGL_ALWAYS_SOFTWARE": "1"}

    def pixels(self) -> npt.NDArray[np.uint8]:
        """What is on the screen now: (H, W, 3)."""
        data = self.memory.read_bytes()
        header = struct.unpack(f">{_HEADER_WORDS}I", data[: 4 * _HEADER_WORDS])
        size, width, height, bytes_per_line, colours = header[0], header[4], header[5], header[12], header[19]
        start = size + 12 * colours
        rows = np.frombuffer(data, np.uint8, height * bytes_per_line, start).reshape(height, bytes_per_line // 4, 4)
        return rows[:, :width, 2::-1]  # stored as blue, green, red, nothing

    def xdotool(self, *words: str | int) -> None:
        """Mouse and keys."""
        subprocess.run(["xdotool", *map(str, words)], env=self.environment(), check=True, timeout=PATIENCE)

    def click(self, x: int, y: int) -> None:
        """Move the mouse there, press and release the left button, and stay for a moment."""
        for words in (("mousemove", x, y), ("mousedown", 1), ("mouseup", 1)):
            self.xdotool(*words)
            time.sleep(_HAND_SECONDS)

    def drag(self, start: tuple[int, int], delta: tuple[int, int]) -> None:
        """Move the mouse to `start`, press the left button and move by `delta`; the button stays down."""
        self.xdotool("mousemove", *start)
        time.sleep(_HAND_SECONDS)
        self.xdotool("mousedown", 1)
        time.sleep(_HAND_SECONDS)
        for part in (1, 2, 3):
            self.xdotool("mousemove", start[0] + delta[0] * part // 3, start[1] + delta[1] * part // 3)

    def press_and_see(self, keys: str, what: str) -> None:
        """Press keys that change what is on the screen, and wait until it has changed."""
        before = self.pixels().copy()
        self.xdotool("key", keys)
        wait_until(lambda: bool((self.pixels() != before).any()), what)

    def still(self, but_for_a_caret: bool = False) -> bool:
        """Whether nothing changes on the screen for half a second, which is not so while the program starts."""
        before = self.pixels().astype(int)
        time.sleep(0.5)
        changed = int((np.abs(self.pixels() - before).max(2) > 8).sum())
        return changed <= (100 if but_for_a_caret else 0)

    @contextmanager
    def program(self, code: str, *arguments: str) -> Iterator[subprocess.Popen[str]]:
        """Run Python code on this screen; it is ended with the block if it has not ended by itself."""
        command = [sys.executable, "-c", code, *arguments]
        root = Path(__file__).parents[1]
        running = subprocess.Popen(command, env=self.environment(), cwd=root, text=True, stderr=subprocess.PIPE)
        try:
            yield running
        except BaseException:
            state = "was still running" if running.poll() is None else f"had ended with {running.returncode}"
            _end(running)
            said = running.stderr.read() if running.stderr is not None and not running.stderr.closed else ""
            print(f"the program on the virtual screen {state} and said: {said}", file=sys.stderr)
            raise
        finally:
            _end(running)
            if running.stderr is not None:
                running.stderr.close()


def _end(running: subprocess.Popen[str]) -> None:
    if running.poll() is None:
        running.terminate()
        try:
            running.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            running.kill()


@contextmanager
def virtual_screen(folder: Path) -> Iterator[VirtualScreen]:
    """Start an Xvfb that keeps its picture in `folder`; end it with the block."""
    read, write = os.pipe()
    command = ["Xvfb", "-displayfd", str(write), "-screen", "0", f"{SIZE[0]}x{SIZE[1]}x24", "-dpi", "96"]
    server = subprocess.Popen(
        [*command, "-nolisten", "tcp", "-fbdir", str(folder)], pass_fds=[write], stderr=subprocess.DEVNULL
    )
    os.close(write)
    try:
        with os.fdopen(read) as answer:
            number = answer.readline().strip()
        assert number, "Xvfb did not start"
        yield VirtualScreen(f":{number}", folder / "Xvfb_screen0")
    finally:
        server.terminate()
        server.wait(PATIENCE)
