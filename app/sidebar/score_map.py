"""The captured views as a grid of cells, coloured by how well they are synthesized; a click goes there."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

from imgui_bundle import ImVec2, ImVec4, imgui

from app import theme
from app.commands import Context
from app.limits import within
from app.readout import Readout, ScoreText
from app.state import Grid
from app.widgets import DASH, decibels, em, number, packed, pairs, tile, tooltip
from lfcore import colormaps
from lfcore.colormaps import ColourMap
from lfcore.lightfield import CORNERS


@dataclass(frozen=True)
class Summary:
    """PSNR in dB of the views that are synthesized from others: how many there are, and of those with a score the mean, the
    least and the greatest (None where there is no score)."""

    views: int
    scored: int
    mean: float | None = None
    least: float | None = None
    greatest: float | None = None


def summary(grid: Grid, scores: tuple[ScoreText | None, ...]) -> Summary:
    """Of all captured views but the dark ones and the four inputs."""
    novel = [index for index in range(grid.rows * grid.columns) if is_novel(grid, index)]
    found = [score.psnr for index in novel if index < len(scores) and (score := scores[index]) is not None]
    if not found:
        return Summary(len(novel), 0)
    return Summary(len(novel), len(found), sum(found) / len(found), min(found), max(found))


def is_novel(grid: Grid, index: int) -> bool:
    """Whether the captured view with that number is neither dark nor one of the four inputs."""
    return divmod(index, grid.columns) not in grid.dark and grid.position(index) not in CORNERS


def scored_words(readout: Readout, grid: Grid) -> str:
    """How many of all captured views but the dark ones have a score, which is what the status line counts too."""
    if readout.model in readout.compared.never_scored:
        return "none"
    scored = sum(score is not None for score in readout.compared.views)
    return f"{scored} of {grid.rows * grid.columns - len(grid.dark)}"


def draw(context: Context, readout: Readout, grid: Grid, total: Summary) -> None:
    """The grid, and beside it what it comes to."""
    _cells(context, readout, grid, total, round(0.38 * imgui.get_content_region_avail().x))
    imgui.same_line()
    imgui.begin_group()
    rows = [("mean PSNR", total.mean), ("least", total.least), ("greatest", total.greatest)]
    pairs("views", [(name, DASH if value is None else decibels(value)) for name, value in rows])
    _bar()
    why_not = "" if total.views else "All captured views are inputs, or dark: there is none that is synthesized from others."
    on = context.state.score_all and not why_not
    tile("Score all", "score all", on, context, imgui.get_content_region_avail().x, why_not)
    imgui.end_group()


def _cells(context: Context, readout: Readout, grid: Grid, total: Summary, size: float) -> None:
    corner = imgui.get_cursor_screen_pos()
    cell = size / max(grid.columns, grid.rows)
    width, height = cell * grid.columns, cell * grid.rows
    clicked = imgui.invisible_button("score map", ImVec2(width, height))
    mouse = imgui.get_mouse_pos()
    column, row = int((mouse.x - corner.x) / cell), int((mouse.y - corner.y) / cell)
    inside = 0 <= column < grid.columns and 0 <= row < grid.rows
    if inside:
        index = row * grid.columns + column
        tooltip(_words(readout, grid, index))
        if clicked:
            context.state.move_to(*grid.position(index))
    brush = imgui.get_window_draw_list()
    gap = 1.0 if cell >= 6 else 0.0
    for index in range(grid.rows * grid.columns):
        line, place = divmod(index, grid.columns)
        start = ImVec2(corner.x + place * cell, corner.y + line * cell)
        end = ImVec2(start.x + cell - gap, start.y + cell - gap)
        brush.add_rect_filled(start, end, packed(_colour(readout, grid, index, total)))
        if index == readout.captured_here:
            brush.add_rect(start, end, packed(theme.TEXT), 0, max(em() * 0.12, 1.0))


def _colour(readout: Readout, grid: Grid, index: int, total: Summary) -> ImVec4:
    scores = readout.compared.views
    score = scores[index] if index < len(scores) else None
    if divmod(index, grid.columns) in grid.dark:
        return theme.BACKGROUND
    if score is None or total.least is None or total.greatest is None:
        return theme.FIELD
    span = total.greatest - total.least
    share = (score.psnr - total.least) / span if math.isfinite(span) and span > 0 else 1.0
    return _stops()[round(within(share, (0.0, 1.0)) * 255)]


def _words(readout: Readout, grid: Grid, index: int) -> str:
    row, column = divmod(index, grid.columns)
    name = f"Row {row + 1}, column {column + 1}"
    if (row, column) in grid.dark:
        return f"{name}: too dark to be used"
    if grid.position(index) in CORNERS:
        name += ", an input"
    scores = readout.compared.views
    score = scores[index] if index < len(scores) else None
    if score is None:
        why = "not scored yet" if readout.model not in readout.compared.never_scored else "an input, not scored"
        return f"{name}: {why}. A click goes there."
    return f"{name}: PSNR {decibels(score.psnr)}, SSIM {number(score.ssim, 4)} ({score.protocol}). A click goes there."


def _bar() -> None:
    """The colours from the least to the greatest."""
    corner = imgui.get_cursor_screen_pos()
    width, height = imgui.get_content_region_avail().x, em() * 0.5
    brush = imgui.get_window_draw_list()
    stops = _stops()[::17]
    step = width / (len(stops) - 1)
    for index in range(len(stops) - 1):
        a, b = packed(stops[index]), packed(stops[index + 1])
        start = ImVec2(corner.x + index * step, corner.y + em() * 0.2)
        brush.add_rect_filled_multi_color(start, ImVec2(start.x + step, start.y + height), a, b, b, a)
    imgui.dummy(ImVec2(width, height))
    tooltip("Colours from the least PSNR to the greatest; inputs, which are all but given, may lie above")


@functools.cache
def _stops() -> tuple[ImVec4, ...]:
    table = colormaps.colours(ColourMap.VIRIDIS)  # (256, 3)
    return tuple(ImVec4(float(red) / 255, float(green) / 255, float(blue) / 255, 1.0) for red, green, blue in table)
