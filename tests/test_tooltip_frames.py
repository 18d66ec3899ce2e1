"""Where a tooltip may appear, for which the window draws on while the mouse rests."""

from __future__ import annotations

from imgui_bundle import imgui

from app.offscreen import Offscreen


def test_over_the_picture_there_is_none_and_over_the_panel_there_may_be(viewer: Offscreen) -> None:
    for place, may in (((300.0, 300.0), False), ((900.0, 300.0), True), ((300.0, 690.0), True)):
        imgui.get_io().add_mouse_pos_event(*place)
        for _ in range(2):
            viewer.frame()
        assert viewer.interface.may_explain is may, place
