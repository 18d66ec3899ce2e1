"""The card of settings."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from app import theme
from app.commands import Context
from app.desk import Card
from app.geometry import Rect
from app.readout import Readout
from app.settings import SCALE_LIMITS, Theme
from app.widgets import CARD, button, card, choice, em, font, heading, labelled, switch, text, tooltip, wrapped


def settings(area: Rect, context: Context, readout: Readout, fonts: theme.Fonts) -> None:
    """Theme, scale, model, foresight, what is remembered; Esc puts the card away."""
    desk = context.state.desk
    if desk.card is not Card.SETTINGS:
        return
    with card("settings", area, (0.5, 0.35), 26 * em(), CARD & ~imgui.WindowFlags_.no_scrollbar.value):
        with font(fonts.bold, theme.LARGE):
            text("Settings")
        heading("Interface", fonts)
        names = [each.value for each in Theme]
        desk.theme = Theme(choice("Theme", desk.theme.value, names, "Light or dark  (Ctrl+Shift+L)"))
        _scale(context)
        heading("Synthesis", fonts)
        if readout.models:
            hint = "The model that makes the picture when the hand rests.  (M: the next one)"
            chosen = choice("Model", readout.model, readout.models, hint)
            if chosen != readout.model:
                context.state.model = chosen
        switch("Compute views ahead", "foresight", context.state.foresight, context)
        heading("Remembered", fonts)
        wrapped("Window, panel, these settings, recent files, and how each file was looked at.", theme.TEXT_SOFT)
        imgui.begin_disabled(not readout.shelf.recent)
        button("Forget files and how they were looked at", "forget", context)
        imgui.end_disabled()
        imgui.same_line()
        if imgui.button("Done"):
            desk.card = None
        tooltip("Put this card away  (Esc)")


def _scale(context: Context) -> None:
    """The scale in steps, or that of the monitor."""
    desk = context.state.desk
    labelled("Scale")
    square = imgui.get_frame_height()
    imgui.begin_disabled(context.scale <= SCALE_LIMITS[0])
    button("-", "smaller", context, square)
    imgui.end_disabled()
    imgui.same_line(0, em() * 0.25)
    shown = f"{100 * context.scale:.0f} %"
    room = imgui.calc_text_size("300 %").x + em()
    corner = imgui.get_cursor_pos_x()
    imgui.set_cursor_pos_x(corner + (room - imgui.calc_text_size(shown).x) / 2)
    imgui.align_text_to_frame_padding()
    text(shown)
    imgui.same_line(corner + room)
    imgui.begin_disabled(context.scale >= SCALE_LIMITS[1])
    button("+", "larger", context, square)
    imgui.end_disabled()
    imgui.same_line(0, em())
    imgui.begin_disabled(desk.scale is None)
    button("As the monitor", "own scale", context)
    imgui.end_disabled()
    imgui.dummy(ImVec2(0, 0))
