"""The window and the frame loop: the only place that knows glfw."""

from __future__ import annotations

import ctypes
import math
import threading
import time
from collections.abc import Iterator, Mapping, Sequence, Sized
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

# imgui-bundle brings its own glfw library and tells the glfw package to use that one: it must be imported first, or two
# copies of glfw would not know of each other's windows.
from imgui_bundle import ImVec2, imgui

import glfw  # isort: skip

from app import frametimes
from app.canvas import Target, draws_in_software, windowed_context
from app.controller import Controller
from app.display_loss import on_display_loss
from app.engine import Engine, ModelChoice
from app.frametimes import FrameTimes
from app.geometry import Rect
from app.interface import Interface
from app.opening import (
    DEFAULT_MODEL,
    make_engine,
    model_name,
    offered_models,
    open_by_content,
    preview,
    synthesis_process,
    thumbnail_store,
)
from app.pacing import Pace
from app.settings import SettingsFile, WindowPlace, default_path
from app.shared_window import SharedWindow
from app.surroundings import Keeping, Surroundings
from app.window_place import fitted
from assets import sample_path
from lfcore.errors import LfviewError
from lfcore.kept_files import default_root
from lfcore.machine import core_count
from lfcore.store import ViewStore

TITLE = "lfview"
WINDOW_SIZE = (1280, 800)
SMALLEST_SIZE = (200, 150)
MEBIBYTE = 2**20

_SETTLE_FRAMES = 3  # imgui shows the effect of an event up to two frames later
_WOKEN_FRAMES = 2
_HOVER_SECONDS = 0.8  # after the last movement of the mouse, a tooltip may still appear
_HOVER_INTERVAL = 0.1
_CARET_INTERVAL = 0.25  # of a blinking caret
_MODIFIERS = (glfw.KEY_LEFT_CONTROL, glfw.KEY_RIGHT_CONTROL, glfw.KEY_LEFT_SHIFT, glfw.KEY_RIGHT_SHIFT)
_NO_KEY = imgui.Key.f24  # no keyboard has it, and nothing is done by it
_LEAST_STEP = 1e-5  # seconds from one frame to the next, since imgui takes none of 0
_IDLE_INTERVAL = 0.5  # how long Ctrl-C may have to wait, since Python's signals wait for glfw to return


class NoDisplay(LfviewError):
    """There is no display, or none with OpenGL 3.3."""


def run_viewer(
    path: Path | None, model: str | None = None, cache_mib: int = 512, disk_mib: int = 1024, foresight: bool = True
) -> int:
    """Open the window on the light field at `path` and stay until it is closed. Returns the exit code 0.

    path: None shows the start picture with the files opened lately, the sample where there are none. model: None takes that
    of the last run. cache_mib, disk_mib: bounds of the memory and (0: none) the disk for past syntheses. foresight: compute
    views ahead. Faults of light fields and models are shown in the window. Raises NoDisplay where there is no display or no
    OpenGL 3.3.
    """
    file = SettingsFile(default_path())
    settings, fault = file.load()
    keeping = Keeping(settings, fault, file, thumbnail_store if disk_mib > 0 else None)
    chosen = model or settings.model or DEFAULT_MODEL
    store = ViewStore(default_root(), disk_mib * MEBIBYTE) if disk_mib > 0 else None
    if path is None and not settings.recent:
        path = sample_path()
    with synthesis_process() as process:
        process.start()  # it loads torch while the window and the light field are opened
        engine = make_engine(chosen, cache_mib * MEBIBYTE, process, store)
        show(path, engine, model_name(chosen), foresight, offered_models(chosen, process), keeping)
    return 0


def show(
    path: Path | None,
    engine: Engine,
    model: str,
    foresight: bool = True,
    models: Mapping[str, ModelChoice] | None = None,
    keeping: Keeping | None = None,
) -> None:
    """Open the window on the light field at `path` (None: on none) with this engine, and stay until it is closed.

    models: to choose from. keeping: what was kept from the last run, and where things are kept.
    """
    with _window(engine, model, models, keeping, foresight) as (window, controller):
        window.draw()  # the first frame, before anything slow is imported
        if path is not None:
            controller.open(path)
        window.warm_up()
        window.run()


def measure_frames(path: Path, seconds: float, model: str = "full") -> FrameTimes:
    """Frame times on the light field at `path` as `app.frametimes.measure` defines them: in a window, else off screen."""
    try:
        with (
            synthesis_process() as process,
            _window(make_engine(model, 512 * MEBIBYTE, process), model) as (window, controller),
        ):
            controller.open(path)
            return frametimes.measure(controller, window.poll_and_draw, lambda: window.interval, seconds, "window")
    except NoDisplay:
        from app.offscreen import measure_frames_offscreen

        return measure_frames_offscreen(path, seconds, model)


@contextmanager
def _window(
    engine: Engine,
    model: str,
    models: Mapping[str, ModelChoice] | None = None,
    keeping: Keeping | None = None,
    foresight: bool = True,
) -> Iterator[tuple[_Window, Controller]]:
    """A window with a controller; at the end the window vanishes first, then the threads are waited for."""
    window = _Window(keeping.settings.window if keeping is not None else None)
    controller = Controller(engine, open_by_content, wake=window.wake, model=model, preview=preview, models=models)
    controller.state.foresight = foresight  # before what is kept: it is none of the person's choices
    surroundings = Surroundings(controller, window.wake, keeping)

    def stop() -> None:
        surroundings.stop()
        controller.stop()

    handler = on_display_loss(stop)
    try:
        window.attach(controller, surroundings)
        yield window, controller
    finally:
        surroundings.window = window.place()
        window.hide()
        stop()
        window.close()
        del handler


class _Loader:
    """Finds GL functions for moderngl through glfw, so that it works with whatever kind of context glfw has made."""

    def load_opengl_function(self, name: str) -> int:
        return ctypes.cast(glfw.get_proc_address(name), ctypes.c_void_p).value or 0


class _Window:
    """A glfw window with the interface in it; `place` is where it was the last time."""

    def __init__(self, place: WindowPlace | None = None) -> None:
        glfw.ERROR_REPORTING = "ignore"
        if not glfw.init():
            raise NoDisplay(
                f"Found no display to open a window on ({_glfw_fault()}); start it from a desktop session, or use "
                f"`lfview synth` and `lfview sweep`, which need none."
            )
        glfw.window_hint(glfw.CONTEXT_VERSION_MAJOR, 3)
        glfw.window_hint(glfw.CONTEXT_VERSION_MINOR, 3)
        glfw.window_hint(glfw.OPENGL_PROFILE, glfw.OPENGL_CORE_PROFILE)
        glfw.window_hint(glfw.OPENGL_FORWARD_COMPAT, True)
        glfw.window_hint(glfw.SCALE_TO_MONITOR, True)
        for unused in (glfw.ALPHA_BITS, glfw.DEPTH_BITS, glfw.STENCIL_BITS):  # whose clearing costs a software rasteriser time
            glfw.window_hint(unused, 0)
        glfw.window_hint(glfw.VISIBLE, place is None)  # a place is taken before the window is seen
        size = (place.width, place.height) if place is not None else WINDOW_SIZE
        self._window = glfw.create_window(*size, TITLE, None, None)
        if not self._window:
            fault = _glfw_fault()
            glfw.terminate()
            raise NoDisplay(
                f"Found no OpenGL 3.3 on this display ({fault}); update the graphics driver, or install Mesa's software "
                f"renderer (on Debian: libgl1-mesa-dri)."
            )
        glfw.set_window_size_limits(self._window, *SMALLEST_SIZE, glfw.DONT_CARE, glfw.DONT_CARE)
        if place is not None:
            self._go_to(place)
        glfw.make_context_current(self._window)
        glfw.swap_interval(1)
        loader = _Loader()
        self._load = loader.load_opengl_function
        self._context = windowed_context(loader)
        self._target = self._context.detect_framebuffer(0)
        self._pace = Pace(_frame_interval(), core_count())
        self._drawn_at = -math.inf  # when the last frame was begun
        self._frame_at = time.monotonic()  # by imgui's time
        self._cursor: int | None = None  # shape of the mouse that has been set
        self._interface: Interface | None = None
        self._shared: SharedWindow | None = None
        self._woken = threading.Event()  # by a worker, or by another size of the window, since the last look
        self._touched_at = 0.0  # last event of mouse or keyboard
        self._let_go = False  # whether a modifier has come up, and no key has gone down since
        self._title = TITLE
        self._unmaximised = place or WindowPlace(0, 0, *WINDOW_SIZE)
        imgui.create_context()
        imgui.get_io().set_ini_filename("")
        # Set before imgui sets its own callbacks, which call these.
        glfw.set_cursor_pos_callback(self._window, self._touched)
        glfw.set_mouse_button_callback(self._window, self._touched)
        glfw.set_scroll_callback(self._window, self._touched)
        glfw.set_key_callback(self._window, self._key)
        for follow in (
            glfw.set_framebuffer_size_callback,
            glfw.set_window_size_callback,
            glfw.set_window_content_scale_callback,
        ):
            follow(self._window, self._resized)
        self._resized()
        glfw.set_window_refresh_callback(self._window, self._uncovered)
        glfw.set_window_close_callback(self._window, self._asked_to_close)
        glfw.set_drop_callback(self._window, self._dropped)  # type: ignore[arg-type]  # its stub is wrong
        imgui.backends.glfw_init_for_opengl(ctypes.cast(self._window, ctypes.c_void_p).value or 0, True)

    def attach(self, controller: Controller, surroundings: Surroundings) -> None:
        """Show this controller's light field from now on."""
        self._shared = self._shared_window() if draws_in_software(self._context) else None
        self._interface = Interface(controller, self._context, self._scale, surroundings, self._load, self._shared)

    def _shared_window(self) -> SharedWindow | None:
        """What paints straight into the window; None where there is no such way."""
        if not hasattr(glfw, "get_x11_display"):
            return None
        display, number = glfw.get_x11_display(), glfw.get_x11_window(self._window)
        try:
            return SharedWindow(display, number) if display and number else None  # there are none on Wayland
        except OSError:
            return None

    def place(self) -> WindowPlace:
        """Where the window is; of a maximised one where it would go back to."""
        maximised = bool(glfw.get_window_attrib(self._window, glfw.MAXIMIZED))
        if not maximised:
            self._note_place()
        return replace(self._unmaximised, maximised=maximised)

    def _note_place(self) -> None:
        x, y = glfw.get_window_pos(self._window)
        self._unmaximised = WindowPlace(x, y, *glfw.get_window_size(self._window))

    def _go_to(self, place: WindowPlace) -> None:
        """Take the place of the last time, where some monitor still shows enough of it."""
        monitors = [Rect(*map(float, glfw.get_monitor_workarea(each))) for each in glfw.get_monitors()]
        x, y, width, height = fitted(place, monitors)
        glfw.set_window_size(self._window, width, height)
        glfw.set_window_pos(self._window, x, y)
        if place.maximised:
            glfw.maximize_window(self._window)
        glfw.show_window(self._window)

    def warm_up(self) -> None:
        """See Interface.warm_up."""
        self._at_hand.warm_up(Target(self._target, self._size))

    def run(self) -> None:
        """Draw frames as they are needed until the window is closed."""
        frames_due = _SETTLE_FRAMES
        while not glfw.window_should_close(self._window) and not self._at_hand.closing:
            if frames_due > 0 and time.monotonic() >= self._drawn_at + self.interval:
                frames_due -= 1
                self._drawn_at = time.monotonic()
                self.draw()
                if len(self._not_taken):
                    frames_due = _SETTLE_FRAMES
            wait = self._wait_seconds(frames_due > 0)
            before = time.monotonic()
            if wait > 0:
                glfw.wait_events_timeout(wait)
            else:
                glfw.poll_events()
            # Not told from the time alone: a worker may be done just as the wait ends.
            woken = self._woken.is_set() or time.monotonic() - before < wait
            if woken:  # not otherwise: what comes just now must be seen the next time
                self._woken.clear()
            if self._touched_at >= before:
                frames_due = max(frames_due, _SETTLE_FRAMES)
            elif woken:
                frames_due = max(frames_due, _WOKEN_FRAMES)
            elif wait < _IDLE_INTERVAL:
                frames_due = max(frames_due, 1)

    def wake(self) -> None:
        """Have frames drawn, since there is something new to show. May be called from any thread."""
        self._woken.set()
        glfw.post_empty_event()

    def poll_and_draw(self) -> None:
        """Take events and draw one frame, until the graphics are done with it."""
        glfw.poll_events()
        self.draw()
        self._context.finish()

    def draw(self) -> None:
        """Draw a frame and show it."""
        with self._pace.frame():
            self._draw()

    def _draw(self) -> None:
        size = self._size
        if min(size) == 0:
            return  # minimised
        interface = self._at_hand
        interface.set_scale(self._scale)
        self._new_frame()
        if interface.draw(Target(self._target, size), time.monotonic()):
            glfw.swap_buffers(self._window)
        self._name_window(interface.controller)

    def _new_frame(self) -> None:
        """Tell imgui size and time, as its backend for glfw does, but without asking the X server three times a frame. What the
        mouse does comes by callbacks; only another shape of it has to be set by the backend."""
        cursor, now = imgui.get_mouse_cursor(), time.monotonic()
        if cursor != self._cursor:
            imgui.backends.glfw_new_frame()
            self._cursor = cursor
        io = imgui.get_io()
        (width, height), (pixels_across, pixels_down) = self._units, self._size
        io.display_size = ImVec2(width, height)
        io.display_framebuffer_scale = ImVec2(pixels_across / max(width, 1), pixels_down / max(height, 1))
        io.delta_time = max(now - self._frame_at, _LEAST_STEP)
        self._frame_at = now

    @property
    def _not_taken(self) -> Sized:
        """Events that wait for another frame: imgui takes a press and what follows it in different ones."""
        queue: Sized = imgui.get_current_context().input_events_queue
        return queue

    def hide(self) -> None:
        """Take the window off the screen."""
        glfw.hide_window(self._window)

    def close(self) -> None:
        """Give the window and everything in it back."""
        if self._interface is not None:
            self._interface.shutdown()
        if self._shared is not None:
            self._shared.close()
        imgui.backends.glfw_shutdown()
        imgui.destroy_context()
        glfw.terminate()

    @property
    def _at_hand(self) -> Interface:
        if self._interface is None:
            raise RuntimeError("the window has no interface yet")
        return self._interface

    @property
    def interval(self) -> float:
        """The least time between the beginnings of two frames, in seconds."""
        return self._pace.interval(self._at_hand.takes_from_networks)

    def _wait_seconds(self, more_due: bool) -> float:
        """How long to wait for events before the next frame; _IDLE_INTERVAL or more: there is nothing to draw until then."""
        now = time.monotonic()
        to_next_frame = max(self._drawn_at + self.interval - now, 0.0)
        if more_due:
            return to_next_frame
        waits = [_IDLE_INTERVAL]
        for due_in in (self._at_hand.next_frame_in, self._at_hand.surroundings.next_frame_in):
            if due_in is not None:
                # That is so long after the frame by which it was told, however often has been waited since then.
                waits.append(max(self._drawn_at + due_in - now, to_next_frame))
        if now - self._touched_at < _HOVER_SECONDS and self._at_hand.may_explain:
            waits.append(_HOVER_INTERVAL)
        if imgui.get_io().want_text_input:
            waits.append(_CARET_INTERVAL)
        return min(waits)

    def _resized(self, *_: object) -> None:
        """Take note of size and scale, for which an X server is asked each time: a frame would wait for its answers."""
        self._woken.set()
        self._size = glfw.get_framebuffer_size(self._window)
        # Content scale in imgui's units, which on some systems are scaled already.
        content = max(glfw.get_window_content_scale(self._window))
        self._units = glfw.get_window_size(self._window)
        self._scale = content * max(self._units[0], 1) / max(self._size[0], 1) or 1.0

    def _asked_to_close(self, *_: object) -> None:
        """Its button was pressed: as the key that quits."""
        if self._interface is not None:
            glfw.set_window_should_close(self._window, False)
            self._interface.quit()
            self._touched()

    def _uncovered(self, *_: object) -> None:
        """A part of the window has come into sight."""
        self._woken.set()
        if self._interface is not None:
            self._interface.uncover()

    def _name_window(self, controller: Controller) -> None:
        title = f"{controller.name} \N{EN DASH} {TITLE}" if controller.name else TITLE
        if title != self._title:
            self._title = title
            glfw.set_window_title(self._window, title)

    def _touched(self, *_: object) -> None:
        self._touched_at = time.monotonic()
        if self._interface is not None:
            self._interface.controller.touch()

    def _key(self, _: object, key: int, __: int, action: int, ___: int) -> None:
        """imgui knows no order within a frame: a key that goes down after Ctrl has come up would count as pressed with it. So
        what follows is left to the next frame, as imgui does where one key goes down and up."""
        if key in _MODIFIERS:
            self._let_go = self._let_go or action == glfw.RELEASE
        elif action == glfw.PRESS and self._let_go:
            self._let_go = False
            for down in (True, False):
                imgui.get_io().add_key_event(_NO_KEY, down)
        self._touched()

    def _dropped(self, _: object, paths: Sequence[str]) -> None:
        """Open what was dropped on the window; where that are several, show them to choose from."""
        self._touched_at = time.monotonic()
        if len(paths) > 1:
            self._at_hand.surroundings.choose_among([Path(path) for path in paths])
        elif paths:
            self._at_hand.controller.open(Path(paths[0]))


def _glfw_fault() -> str:
    _, description = glfw.get_error()
    if isinstance(description, bytes):
        description = description.decode("utf-8", "replace")
    return description or "no reason given"


def _frame_interval() -> float:
    """The least time between two frames: a little less than the monitor's, so that waiting for the monitor sets the pace
    where it can be waited for."""
    monitor = glfw.get_primary_monitor()
    mode = glfw.get_video_mode(monitor) if monitor else None
    rate = mode.refresh_rate if mode is not None and mode.refresh_rate > 0 else 60
    return 0.85 / rate
