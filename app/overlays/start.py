"""The start picture: what to do when nothing is open."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from app import theme
from app.commands import Context
from app.geometry import Rect
from app.widgets import button, card, em, font, packed, text, wrapped


def start(area: Rect, context: Context, fonts: theme.Fonts) -> None:
    """What to do when nothing is open."""
    with card("start", area, (0.5, 0.45), 25 * em()):
        with font(fonts.bold, theme.LARGE):
            text("Open a light field")
        wrapped("Drag in it, and see any view in between the captured ones.", theme.TEXT_SOFT)
        imgui.dummy(ImVec2(0, em() * 0.3))
        width = 8.5 * em()
        for label, command, words in (
            ("Drop", None, "a file or folder on this window"),
            ("Type its path", "open", "Ctrl+O"),
            ("See the sample", "sample", "Ctrl+L"),
        ):
            if command is None:
                _outlined(label, width)
            else:
                button(label, command, context, width)
            imgui.same_line(0, em())
            imgui.align_text_to_frame_padding()
            text(words, theme.TEXT_SOFT)
        imgui.dummy(ImVec2(0, em() * 0.3))
        wrapped("F1 shows all keys.", theme.TEXT_FAINT)


def _outlined(label: str, width: float) -> None:
    """Looks like a button's outline: something to do with the mouse that is not a click."""
    corner = imgui.get_cursor_screen_pos()
    height = imgui.get_frame_height()
    brush = imgui.get_window_draw_list()
    end = ImVec2(corner.x + width, corner.y + height)
    brush.add_rect(corner, end, packed(theme.FIELD_ACTIVE), imgui.get_style().frame_rounding)
    size = imgui.calc_text_size(label)
    brush.add_text(ImVec2(corner.x + (width - size.x) / 2, corner.y + (height - size.y) / 2), packed(theme.TEXT), label)
    imgui.dummy(ImVec2(width, height))
