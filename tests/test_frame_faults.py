"""A frame that fails: it is said, the window lives on, and what goes on failing is closed."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import moderngl
import pytest
from moving_scene import light_field

from app import panels
from app.canvas import Canvas
from app.interface import FAULTS_TO_CLOSE, FAULTS_TO_END
from app.offscreen import Offscreen
from app.sidebar import viewpoint_pad


def failing(original: Callable[..., Any], times: int, error: Exception) -> Callable[..., Any]:
    """As the original, but the first calls fail."""
    left = [times]

    def call(*arguments: Any, **options: Any) -> Any:
        if left[0] > 0:
            left[0] -= 1
            raise error
        return original(*arguments, **options)

    return call


def at_rest(viewer: Offscreen) -> Any:
    """The frame when the workers have done all there is to do: the same five times, a while apart."""
    frames: list[Any] = []
    deadline = time.monotonic() + 60
    while len(frames) < 5 or any((frame != frames[0]).any() for frame in frames):
        assert time.monotonic() < deadline
        frames = [*frames[-4:], viewer.settled().copy()]
        time.sleep(0.2)
    return frames[0]


def test_a_fault_deep_in_the_panels_is_said_and_the_next_frame_is_whole(
    viewer: Offscreen, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = at_rest(viewer)
    monkeypatch.setattr(viewpoint_pad, "draw", failing(viewpoint_pad.draw, 2, RuntimeError("odd")))
    for _ in range(2):
        viewer.draw()
    controller = viewer.interface.controller
    assert controller.messages == ["Unexpected fault in the program: RuntimeError: odd"]
    assert controller.light_field is not None
    controller.dismiss()
    assert (at_rest(viewer) == before).all()


@pytest.mark.parametrize("error", [moderngl.Error("cannot create framebuffer"), MemoryError()])
def test_a_light_field_that_the_graphics_cannot_take_is_not_opened(
    viewer: Offscreen, monkeypatch: pytest.MonkeyPatch, error: Exception
) -> None:
    monkeypatch.setattr(Canvas, "set_light_field", failing(Canvas.set_light_field, 1000, error))
    controller = viewer.interface.controller
    controller.show_light_field(light_field(3, 3))
    for _ in range(FAULTS_TO_CLOSE + 2):
        viewer.frame()
    assert controller.light_field is None
    assert len(controller.messages) == 1
    assert "open a smaller light field" in controller.messages[0]
    monkeypatch.undo()
    controller.show_light_field(light_field(2, 2))
    viewer.frame()
    assert controller.light_field is not None


def test_what_fails_for_ever_ends_the_program(viewer: Offscreen, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise RuntimeError("for ever")

    monkeypatch.setattr(panels, "draw", fail)
    for _ in range(FAULTS_TO_END - 1):
        viewer.draw()
    with pytest.raises(RuntimeError, match="for ever"):
        viewer.draw()
    monkeypatch.undo()


def test_the_graphics_are_asked_for_room(viewer: Offscreen) -> None:
    class Full:
        error = "GL_OUT_OF_MEMORY"

    canvas = object.__new__(Canvas)
    canvas.context = Full()  # type: ignore[assignment]
    with pytest.raises(Exception, match="not enough memory"):
        canvas.check_memory()
