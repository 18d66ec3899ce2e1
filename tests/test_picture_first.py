"""The picture is begun before the panels are drawn, and is made anew where they change what it shows."""

from __future__ import annotations

from typing import Any

import pytest
from moving_scene import TruthSynthesizer, light_field
from virtual_screen import wait_until

from app.canvas import Canvas, Frame
from app.geometry import Point
from app.offscreen import Offscreen
from app.sidebar import viewpoint_pad
from app.state import ViewState
from lfcore.errors import Cancelled

FIRST, MOVED = (0.5, 0.5), (0.3, 0.4)


class Recorder:
    """In which order pictures were made, panels drawn and pictures shown, and for which viewpoint."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, moved: Point | None) -> None:
        self.order: list[tuple[str, Point]] = []
        prepare, draw, beneath, pad = Canvas.prepare, Canvas.draw, Canvas.beneath, viewpoint_pad.draw

        def recorded_prepare(canvas: Canvas, frame: Frame) -> bool:
            self.order.append(("made", frame.viewpoint))
            return prepare(canvas, frame)

        def recorded_draw(canvas: Canvas, frame: Frame, *where: Any) -> None:
            self.order.append(("shown", frame.viewpoint))
            draw(canvas, frame, *where)

        def recorded_beneath(canvas: Canvas, frame: Frame, *where: Any) -> Any:  # of a window that is painted
            self.order.append(("shown", frame.viewpoint))
            return beneath(canvas, frame, *where)

        def moving_pad(state: ViewState, *others: Any) -> Any:
            self.order.append(("panels", (state.u, state.v)))
            result = pad(state, *others)
            if moved is not None:
                state.move_to(*moved)
            return result

        monkeypatch.setattr(Canvas, "prepare", recorded_prepare)
        monkeypatch.setattr(Canvas, "draw", recorded_draw)
        monkeypatch.setattr(Canvas, "beneath", recorded_beneath)
        monkeypatch.setattr(viewpoint_pad, "draw", moving_pad)


def test_the_picture_is_made_once_and_before_the_panels(viewer: Offscreen, monkeypatch: pytest.MonkeyPatch) -> None:
    recorder = Recorder(monkeypatch, None)
    viewer.draw()
    assert recorder.order == [("made", FIRST), ("panels", FIRST), ("shown", FIRST)]


def test_a_light_field_that_comes_during_the_frame_is_made_ready_too(
    viewer: Offscreen, monkeypatch: pytest.MonkeyPatch
) -> None:
    def never(*_: object) -> None:
        raise Cancelled

    monkeypatch.setattr(TruthSynthesizer, "synthesize", never)
    controller = viewer.interface.controller
    controller.show_light_field(light_field(3, 3))
    viewer.draw()  # without a synthesis nothing tells the frames of two light fields apart
    recorder = Recorder(monkeypatch, None)
    pad = viewpoint_pad.draw

    def opening_pad(*arguments: Any) -> None:
        pad(*arguments)
        controller.show_light_field(light_field(3, 3))

    monkeypatch.setattr(viewpoint_pad, "draw", opening_pad)
    viewer.draw()
    assert recorder.order == [("made", FIRST), ("panels", FIRST), ("made", FIRST), ("shown", FIRST)]


def test_what_the_panels_change_is_shown_in_the_same_frame(viewer: Offscreen, monkeypatch: pytest.MonkeyPatch) -> None:
    recorder = Recorder(monkeypatch, MOVED)
    viewer.draw()
    assert recorder.order == [("made", FIRST), ("panels", FIRST), ("made", MOVED), ("shown", MOVED)]


def test_a_synthesis_that_comes_during_the_frame_is_for_the_next_one(
    viewer: Offscreen, monkeypatch: pytest.MonkeyPatch
) -> None:
    controller = viewer.interface.controller
    before = controller.newest
    recorder = Recorder(monkeypatch, None)
    pad = viewpoint_pad.draw

    def waiting_pad(*arguments: Any) -> None:
        pad(*arguments)
        wait_until(lambda: not controller._asking._worker.outcomes.empty(), "the synthesis")

    controller.state.move_to(*MOVED)
    with monkeypatch.context() as patched:
        patched.setattr(viewpoint_pad, "draw", waiting_pad)
        viewer.draw()
    assert recorder.order == [("made", MOVED), ("panels", MOVED), ("shown", MOVED)]
    assert controller.newest is before
    viewer.draw()
    assert controller.newest is not before and not controller.messages
