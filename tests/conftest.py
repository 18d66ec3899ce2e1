"""Fixtures that several test files share: one GL context per run, an imgui context without GL, a virtual screen."""

from __future__ import annotations

import atexit
import os
import re
import shutil
import signal
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import av  # noqa: F401  adds a logger; a thread of the program's would, at a moment when pytest walks through the loggers
import pytest
from virtual_screen import VirtualScreen, require_tools, virtual_screen

if TYPE_CHECKING:
    from app.offscreen import Offscreen

# What the program keeps for its user, it keeps here; programs that the tests start inherit this.
_KEPT = tempfile.mkdtemp(prefix="lfview-tests-")
atexit.register(shutil.rmtree, _KEPT, ignore_errors=True)
os.environ["LFVIEW_CACHE"] = str(Path(_KEPT) / "kept")
os.environ["XDG_CACHE_HOME"] = str(Path(_KEPT) / "cache")
os.environ["XDG_CONFIG_HOME"] = str(Path(_KEPT) / "config")

# Tests that run beside each other share out the cores; else torch's threads would wait for each other, for half of the time.
if "PYTEST_XDIST_WORKER" in os.environ:
    os.environ.setdefault("OMP_NUM_THREADS", str(max((os.cpu_count() or 1) // int(os.environ["PYTEST_XDIST_WORKER_COUNT"]), 1)))

# A software context, so that the tests see the same pictures on every machine.
os.environ.setdefault("LIBGL_ALWAYS_SOFTWARE", "1")

# Where the tests are a background job of a script, Ctrl-C is ignored, also by the programs that they start.
signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(autouse=True)
def sigterm() -> Iterator[None]:
    """What is done at SIGTERM stays as it was; main() changes it for good, since its process is the program's."""
    before = signal.getsignal(signal.SIGTERM)
    yield
    signal.signal(signal.SIGTERM, before)


_OF_THE_PROGRAM = re.compile(r"^(from|import) app\b(?!\.(cli|commands|__main__)\b)", re.MULTILINE)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Tests of the program itself are marked: see `alone` in pyproject.toml."""
    concerned = {path: _OF_THE_PROGRAM.search(path.read_text(encoding="utf-8")) for path in {item.path for item in items}}
    for item in items:
        if concerned[item.path] is not None:
            item.add_marker("alone")


@pytest.fixture(scope="session")
def gl() -> Any:
    """The standalone GL context of this run, through EGL; tests that need it are skipped where there is none."""
    from app.canvas import standalone_context
    from lfcore.errors import LfviewError

    try:
        return standalone_context()
    except LfviewError as error:
        if os.environ.get("CI"):
            raise  # there the set-up has installed Mesa, so a want of it is a fault
        pytest.skip(str(error))


@pytest.fixture(scope="module")
def screen(tmp_path_factory: pytest.TempPathFactory) -> Iterator[VirtualScreen]:
    """A virtual screen for whole-program tests, one for each file of tests; skipped where there are no tools for it."""
    require_tools()
    with virtual_screen(tmp_path_factory.mktemp("screen")) as made:
        yield made


@pytest.fixture
def viewer(gl: Any) -> Iterator[Offscreen]:
    """The program off screen, 1000 x 700, with the finished picture of a made-up light field, whole."""
    from moving_scene import TruthSynthesizer, light_field

    from app.controller import Controller
    from app.engine import Engine
    from app.offscreen import Offscreen
    from app.state import Step

    controller = Controller(Engine(lambda: TruthSynthesizer(), 2**24), lambda *_: light_field(2, 2), lambda: None, "truth")
    made = Offscreen(controller, gl, (1000, 700), 1.0)
    try:
        controller.show_light_field(light_field(2, 2))
        deadline = time.monotonic() + 60
        while controller.step is not Step.FULL:
            assert time.monotonic() < deadline
            made.frame()
        made.settled()
        yield made
    finally:  # else the next tests would find two of them
        made.close()
        controller.stop()
    assert gl.error == "GL_NO_ERROR"


@pytest.fixture
def imgui_context() -> Iterator[Any]:
    """A fresh imgui context that takes events but draws nothing."""
    from imgui_bundle import ImVec2, imgui

    context = imgui.create_context()
    io = imgui.get_io()
    io.set_ini_filename("")
    io.display_size = ImVec2(1280, 800)
    io.delta_time = 1 / 60
    io.backend_flags |= imgui.BackendFlags_.renderer_has_textures.value
    yield imgui
    imgui.destroy_context(context)


@pytest.fixture(params=["compiled", "torch"])
def either_route(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """What the compiled kernels compute is computed by torch where there are none; a test with this runs with both."""
    from lfcore import kernels

    if request.param == "torch":
        monkeypatch.setattr(kernels, "_KERNELS", None)
    else:
        request.getfixturevalue("compiled_kernels")


@pytest.fixture
def several_threads() -> Iterator[None]:
    """Work is shared out among threads, as it is where nothing runs beside it."""
    import torch

    before = torch.get_num_threads()
    torch.set_num_threads(max(os.cpu_count() or 1, 2))
    yield
    torch.set_num_threads(before)


@pytest.fixture
def compiled_kernels() -> None:
    """They are there; else the test is skipped, and fails in CI, where they should have been compiled."""
    from lfcore import kernels

    _want(kernels.compiled(), "kernels")


@pytest.fixture
def compiled_painting() -> None:
    """Likewise."""
    from app import painting

    _want(painting.compiled(), "painting")


def _want(there: bool, what: str) -> None:
    if not there and os.environ.get("CI"):
        pytest.fail(f"the compiled {what} is not there; the set-up should have a C compiler")
    if not there:
        pytest.skip(f"this installation has no compiled {what}")
