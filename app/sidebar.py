"""The panel at the right: the light field, the viewpoint, the ways of looking, the numbers."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from app import theme, viewpoint_pad
from app.commands import Context
from app.geometry import Rect
from app.readout import Readout
from app.state import GAIN_LIMITS, TAIL_LIMITS, Look, Step
from app.widgets import (
    DASH,
    FIXED,
    button,
    choice,
    elided,
    em,
    font,
    heading,
    milliseconds,
    number,
    row,
    slider,
    switch,
    text,
    tile,
    tooltip,
    window,
    wrapped,
)

_TILES = (
    ("Top left", "top left", Look.WARPED_TOP_LEFT),
    ("Top right", "top right", Look.WARPED_TOP_RIGHT),
    ("Bottom left", "bottom left", Look.WARPED_BOTTOM_LEFT),
    ("Bottom right", "bottom right", Look.WARPED_BOTTOM_RIGHT),
)


def draw(rect: Rect, context: Context, readout: Readout, fonts: theme.Fonts) -> None:
    """The whole panel."""
    with window("panel", rect, FIXED & ~imgui.WindowFlags_.no_scrollbar.value):
        _light_field(context, readout, fonts)
        if readout.grid is None:
            return
        _viewpoint(context, readout, fonts)
        _looks(context, readout, fonts)
        _model(context, readout)
        _numbers(readout, fonts)


def _light_field(context: Context, readout: Readout, fonts: theme.Fonts) -> None:
    grid = readout.grid
    width = imgui.get_content_region_avail().x
    with font(fonts.bold, theme.LARGE):
        text(elided(readout.name if grid is not None else "lfview", width))
    tooltip(readout.source or "No light field is open")
    if grid is not None:
        text(f"{grid.columns} × {grid.rows} views of {grid.width} × {grid.height} px", theme.TEXT_SOFT)
        tooltip("\n".join([readout.kind, *(f"{name}: {value}" for name, value in readout.facts)]))
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


def _viewpoint(context: Context, readout: Readout, fonts: theme.Fonts) -> None:
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
    button("<", "previous", context, half)
    imgui.same_line(0, spacing.x / 2)
    button(">", "next", context, half)
    button("Centre", "centre", context, rest)
    imgui.end_group()


def _captured_name(readout: Readout) -> str:
    if readout.captured_here is None or readout.grid is None:
        return "in between"
    line, column = divmod(readout.captured_here, readout.grid.columns)
    return f"view {line + 1}, {column + 1}"


def _looks(context: Context, readout: Readout, fonts: theme.Fonts) -> None:
    heading("Look at", fonts)
    state = context.state
    spacing = imgui.get_style().item_spacing
    imgui.push_style_var(imgui.StyleVar_.item_spacing, ImVec2(spacing.x, em() * 0.12))
    row("Synthesis", "synthesis", state.look is Look.SYNTHESIS, context)
    row("Disparity", "disparity", state.look is Look.DISPARITY, context)
    row("Error", "error", state.look is Look.ERROR, context)
    row("Warped inputs", "warped", state.look is Look.WARPED_ALL, context)
    imgui.pop_style_var()
    imgui.push_style_var(imgui.StyleVar_.item_spacing, ImVec2(em() * 0.25, em() * 0.25))
    half = (imgui.get_content_region_avail().x - em() * 0.25) / 2
    for index, (label, command, look) in enumerate(_TILES):
        if index % 2:
            imgui.same_line()
        tile(label, command, state.look is look, context, half)
    imgui.pop_style_var()
    imgui.dummy(ImVec2(0, em() * 0.1))
    switch("Captured view", "captured", state.captured, context)
    switch("Brighten", "tone", state.display_tone, context)
    _contrast(context)


def _contrast(context: Context) -> None:
    """The slider that belongs to the look; its place stays empty where the look has none, so that nothing below jumps."""
    state = context.state
    if state.look is Look.ERROR:
        hint = "The error is shown this many times as bright.  (, and .)"
        logarithmic = imgui.SliderFlags_.logarithmic.value
        state.gain = slider("Gain", state.gain, GAIN_LIMITS, f"× {state.gain:.1f}", hint, logarithmic)
    elif state.look is Look.DISPARITY:
        hint = "So many per cent of the disparities at either end of the range share the last colour.  (, and .)"
        state.tail = slider("Cut off", state.tail, TAIL_LIMITS, f"{state.tail:.1f} %", hint)
    else:
        imgui.dummy(ImVec2(0, imgui.get_frame_height()))


def _model(context: Context, readout: Readout) -> None:
    """Which model makes the picture for a hand at rest."""
    if readout.models:
        hint = "The model that makes the picture when the hand rests.  (M: the next one)"
        chosen = choice("Model", readout.model, readout.models, hint)
        if chosen != readout.model:
            context.state.model = chosen


def _numbers(readout: Readout, fonts: theme.Fonts) -> None:
    heading("Against the captured view", fonts)
    score = readout.score
    _pairs(
        "score",
        [
            ("PSNR", f"{number(score.psnr, 2)} dB" if score else DASH),
            ("SSIM", number(score.ssim, 4) if score else DASH),
        ],
    )
    with font(fonts.regular, theme.SMALL):
        text(score.protocol if score else _why_no_score(readout), theme.TEXT_FAINT)
    heading("Time of the synthesis", fonts)
    stages = [(name, milliseconds(1e3 * seconds)) for name, seconds in readout.timings if name != "total"]
    _pairs("timings", stages or [(DASH, DASH)])


def _why_no_score(readout: Readout) -> str:
    if readout.captured_here is None:
        return "No captured view at this viewpoint"
    return "The camera's own view" if readout.step is Step.CAPTURED else "Scored when the synthesis is there"


def _pairs(name: str, rows: list[tuple[str, str]]) -> None:
    """Names, and beside them their values in a column."""
    imgui.push_style_var(imgui.StyleVar_.cell_padding, ImVec2(0, 1))
    if imgui.begin_table(name, 2):
        for label, value in rows:
            imgui.table_next_row()
            imgui.table_next_column()
            text(label, theme.TEXT_SOFT)
            imgui.table_next_column()
            text(value)
        imgui.end_table()
    imgui.pop_style_var()
