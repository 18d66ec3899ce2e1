"""Where the viewpoint is, and the ways to another."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from app import theme
from app.commands import Context
from app.readout import Readout
from app.sidebar import viewpoint_pad
from app.widgets import button, heading, number, text, tile


def draw(context: Context, readout: Readout, fonts: theme.Fonts) -> None:
    """The pad, and beside it the numbers and buttons."""
    heading("Viewpoint", fonts)
    spacing = imgui.get_style().item_spacing
    width = imgui.get_content_region_avail().x
    pad = round(width * 0.54)
    viewpoint_pad.draw(context.state, readout, pad)
    imgui.same_line()
    imgui.begin_group()
    rest = width - pad - spacing.x
    text(f"u  {number(context.state.u, 3)}")
    text(f"v  {number(context.state.v, 3)}")
    text(_captured_name(readout), theme.GOOD if readout.captured_here is not None else theme.TEXT_FAINT)
    buttons = 3 * imgui.get_frame_height() + 2 * spacing.y
    used = 3 * imgui.get_text_line_height_with_spacing()
    imgui.dummy(ImVec2(0, max(pad - used - buttons - spacing.y, 0)))
    half = (rest - spacing.x / 2) / 2
    button("Nearest", "nearest", context, rest)
    quarter = (rest - 3 * spacing.x / 2) / 4
    for index, (label, command) in enumerate((("|<", "first"), ("<", "previous"), (">", "next"), (">|", "last"))):
        if index:
            imgui.same_line(0, spacing.x / 2)
        button(label, command, context, quarter)
    button("Centre", "centre", context, half)
    imgui.same_line(0, spacing.x / 2)
    tile("Sway", "sway", context.state.swaying, context, half)
    imgui.end_group()


def _captured_name(readout: Readout) -> str:
    if readout.captured_here is None or readout.grid is None:
        return "in between"
    line, column = divmod(readout.captured_here, readout.grid.columns)
    return f"row {line + 1}, column {column + 1}"
