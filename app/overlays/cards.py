"""On top of everything: messages, loading, the field for a path."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from app import theme
from app.commands import Action, Context, OpenTyped
from app.geometry import Rect
from app.readout import Readout
from app.widgets import card, em, packed, text, tooltip, wrapped


def messages(area: Rect, context: Context, readout: Readout) -> None:
    """What went wrong, the newest first, until it is put away."""
    if not readout.messages:
        return
    more = len(readout.messages) - 1
    with card("message", area, (0.5, 0.0), 38 * em()):
        corner, size = imgui.get_window_pos(), imgui.get_window_size()
        edge = ImVec2(corner.x + em() * 0.25, corner.y + size.y)
        imgui.get_window_draw_list().add_rect_filled(corner, edge, packed(theme.ERROR), em() * 0.12)
        wrapped(readout.messages[-1])
        if imgui.button("Dismiss"):
            context.requests.append(Action.DISMISS)
        tooltip("Put the message away  (Esc)")
        if more:
            imgui.same_line()
            imgui.align_text_to_frame_padding()
            text(f"{more} more", theme.TEXT_SOFT)


def loading(area: Rect, context: Context, readout: Readout) -> None:
    """How far the light field being opened has been read."""
    if readout.loading is None:
        return
    with card("loading", area, (0.5, 1.0) if readout.grid or readout.captions else (0.5, 0.5), 26 * em()):
        wrapped(f"Opening {readout.loading_name}")
        imgui.push_style_var(imgui.StyleVar_.frame_rounding, em() * 0.2)
        imgui.progress_bar(readout.loading, ImVec2(-1, em() * 0.4), "")
        imgui.pop_style_var()
        if imgui.button("Cancel"):
            context.requests.append(Action.CANCEL_OPEN)
        tooltip("Give it up  (Esc)")


def path_field(area: Rect, context: Context) -> None:
    """The field for a path: Enter opens it."""
    state = context.state
    if not state.path_field:
        return
    with card("open", area, (0.5, 0.12), 40 * em()):
        text("Open a light field")
        if imgui.is_window_appearing():
            imgui.set_keyboard_focus_here()
        imgui.set_next_item_width(imgui.get_content_region_avail().x)
        entered, state.path_text = imgui.input_text_with_hint(
            "##path",
            "Path of a file or folder",
            state.path_text,
            imgui.InputTextFlags_.enter_returns_true.value | imgui.InputTextFlags_.auto_select_all.value,
        )
        tooltip("An ESLF picture, or a folder of views  (Enter opens)")
        wrapped("Enter opens it, Esc puts the field away. Or drop a file or folder on the window.", theme.TEXT_SOFT)
        if entered and state.path_text.strip():
            context.requests.append(OpenTyped(state.path_text))
            state.path_field = False
