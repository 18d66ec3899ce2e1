"""Over the picture: the scale of its colours, with units."""

from __future__ import annotations

import functools
import itertools

from imgui_bundle import ImVec2, ImVec4, imgui

from app import theme
from app.geometry import Rect
from app.readout import Readout
from app.state import Look, ViewState
from app.widgets import PASSIVE, card, em, number, packed, text
from lfcore import colormaps

_LEGEND_STEPS = 48


def legend(area: Rect, state: ViewState, readout: Readout) -> None:
    """The colour scale of the disparity, the error or a file's map, with its units."""
    if area.width < 30 * em() or area.height < 20 * em():
        return
    if readout.captions:
        caption = readout.captions[state.exhibit]
        if caption.span is not None:
            _scale(area, _disparity_stops(), [(caption.unit, _ticks(*caption.span))])
        return
    if state.look is Look.DISPARITY and readout.disparity_range is not None and readout.grid is not None:
        low, high = readout.disparity_range
        views = readout.grid.columns - 1
        rows = [("px over the baseline", _ticks(low, high)), ("px per captured view", _ticks(low / views, high / views))]
        _scale(area, _disparity_stops(), rows)
    elif state.look is Look.ERROR and readout.captured_here is not None:
        top = 1 / state.gain
        rows = [("of white", _ticks(0, top, 3)), ("of 255", _ticks(0, 255 * top, 1))]
        _scale(area, (theme.colour(0x000000), theme.colour(0xFFFFFF)), rows)


def _ticks(low: float, high: float, decimals: int = 2) -> tuple[str, str, str]:
    return number(low, decimals), number((low + high) / 2, decimals), number(high, decimals)


def _scale(area: Rect, stops: tuple[ImVec4, ...], rows: list[tuple[str, tuple[str, str, str]]]) -> None:
    bar, gap = 13 * em(), em()
    units = max(imgui.calc_text_size(words).x for words, _ in rows)
    with card("legend", area, (0.0, 1.0), bar + gap + units + 2 * imgui.get_style().window_padding.x, PASSIVE):
        brush = imgui.get_window_draw_list()
        corner = imgui.get_cursor_screen_pos()
        step = bar / (len(stops) - 1)
        height = em() * 0.6
        for index, (low, high) in enumerate(itertools.pairwise(stops)):
            a, b = packed(low), packed(high)
            start = ImVec2(corner.x + index * step, corner.y)
            brush.add_rect_filled_multi_color(start, ImVec2(start.x + step, corner.y + height), a, b, b, a)
        imgui.dummy(ImVec2(bar, height))
        for words, ticks in rows:
            left = imgui.get_cursor_pos_x()
            for share, tick in zip((0.0, 0.5, 1.0), ticks, strict=True):
                imgui.set_cursor_pos_x(left + share * (bar - imgui.calc_text_size(tick).x))
                text(tick)
                imgui.same_line()
            imgui.set_cursor_pos_x(left + bar + gap)
            text(words, theme.TEXT_SOFT)


@functools.cache
def _disparity_stops() -> tuple[ImVec4, ...]:
    table = colormaps.disparity_colours()  # (256, 3)
    places = [round(i * 255 / _LEGEND_STEPS) for i in range(_LEGEND_STEPS + 1)]
    colours = [[float(value) / 255 for value in table[place]] for place in places]
    return tuple(ImVec4(red, green, blue, 1.0) for red, green, blue in colours)
