"""Where a tooltip may appear, for which the window draws on while the mouse rests."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from imgui_bundle import imgui
from moving_scene import TruthSynthesizer, light_field

from app.controller import Controller
from app.engine import Engine
from app.offscreen import Offscreen

WINDOW = (1000, 700)


@pytest.fixture
def viewer(gl: Any) -> Iterator[Offscreen]:
    controller = Controller(Engine(lambda: TruthSynthesizer(), 2**24), lambda *_: light_field(2, 2), lambda: None, "truth")
    made = Offscreen(controller, gl, WINDOW, 1.0)
    controller.show_light_field(light_field(2, 2))
    made.settled()
    yield made
    made.close()
    controller.stop()


def test_over_the_picture_there_is_none_and_over_the_panel_there_may_be(viewer: Offscreen) -> None:
    for place, may in (((300.0, 300.0), False), ((WINDOW[0] - 100.0, 300.0), True), ((300.0, WINDOW[1] - 10.0), True)):
        imgui.get_io().add_mouse_pos_event(*place)
        for _ in range(2):
            viewer.frame()
        assert viewer.interface.may_explain is may, place
