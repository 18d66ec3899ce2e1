"""The top of the panel: which light field is open, and the buttons for files."""

from __future__ import annotations

from imgui_bundle import imgui

from app import theme
from app.commands import Context
from app.readout import Readout
from app.widgets import button, counted, elided, font, text, tooltip, wrapped


def draw(context: Context, readout: Readout, fonts: theme.Fonts) -> None:
    """Name, grid and warnings of the light field, and the buttons."""
    grid = readout.grid
    width = imgui.get_content_region_avail().x
    with font(fonts.bold, theme.LARGE):
        text(elided(readout.name if grid is not None else "lfview", width))
    tooltip(readout.source or "No light field is open")
    if grid is not None:
        text(f"{grid.columns} × {grid.rows} views of {grid.width} × {grid.height} px", theme.TEXT_SOFT)
        order = f"{counted(grid.columns, 'column')}, {counted(grid.rows, 'row')}"
        tooltip("\n".join([readout.kind, order, *(f"{name}: {value}" for name, value in readout.facts)]))
        for warning in readout.warnings:
            wrapped(warning, theme.WARNING)
    else:
        text("No light field is open", theme.TEXT_SOFT)
    open_and_close(context, grid is not None)


def open_and_close(context: Context, is_open: bool) -> None:
    """The two buttons for files."""
    half = (imgui.get_content_region_avail().x - imgui.get_style().item_spacing.x) / 2
    button("Open", "open", context, half)
    imgui.same_line()
    imgui.begin_disabled(not is_open)
    button("Close", "close", context, half)
    imgui.end_disabled()
