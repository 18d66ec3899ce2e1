"""Over the picture: the scale of its colours, with units."""

from __future__ import annotations

import functools
import itertools

from imgui_bundle import ImVec2, ImVec4, imgui

from app import theme
from app.geometry import Rect
from app.looking import CORNER_COLOURS
from app.overlays.comparison import difference_scale
from app.readout import Readout
from app.state import Look, ViewState
from app.widgets import PASSIVE, card, em, number, packed, text, ticks, wrapped
from lfcore import colormaps
from lfcore.colormaps import ColourMap
from lfcore.lightfield import CORNERS

_LEGEND_STEPS = 48

Stops = tuple[ImVec4, ...]
Row = tuple[str, tuple[str, str, str]]  # the unit, and the values at both ends and in the middle


def legend(area: Rect, state: ViewState, readout: Readout) -> None:
    """What the colours mean of the disparity, the error, a deviation or a file's map, with units."""
    if area.width < 30 * em() or area.height < 20 * em():
        return
    colours = _stops(state.looking.colour_map)
    if readout.captions:
        caption = readout.captions[state.exhibit]
        if caption.span is not None:
            _scale(area, colours, [(caption.unit, ticks(*caption.span))])
    elif state.look is Look.DISPARITY and readout.disparity_range is not None and readout.grid is not None:
        low, high = readout.disparity_range
        views = readout.grid.columns - 1
        rows = [("px over the baseline", ticks(low, high)), ("px per captured view", ticks(low / views, high / views))]
        _scale(area, colours, rows)
    elif state.look is Look.ERROR and readout.compared.there:
        _scale(area, *difference_scale(state))
    elif state.look is Look.DISAGREEMENT and readout.has_disparity:
        _scale(area, colours, _of_white(state.gain), "Deviation of the four warped inputs")
    elif state.look is Look.SWEEP_DEVIATION:
        _scale(area, colours, _of_white(state.gain), f"Deviation of the inputs {_at_level(state)}")
    elif state.look is Look.SWEEP_MEAN:
        _note(area, f"Mean of the inputs {_at_level(state)}")
    elif state.look is Look.LEAN and readout.has_disparity:
        _lean(area, state.gain if readout.weighed else None)


def _at_level(state: ViewState) -> str:
    return f"at {number(state.looking.level, 2)} px over the baseline: luminance in the root tone, as the network sees it"


def _of_white(gain: float) -> list[Row]:
    top = 1 / gain
    return [("of white", ticks(0, top, 3)), ("of 255", ticks(0, 255 * top, 1))]


def _note(area: Rect, words: str) -> None:
    with card("legend", area, (0.0, 1.0), 22 * em(), PASSIVE):
        wrapped(words, theme.TEXT_SOFT)


def _scale(area: Rect, stops: Stops, rows: list[Row], title: str = "") -> None:
    bar, gap = 13 * em(), em()
    units = max(imgui.calc_text_size(words).x for words, _ in rows)
    with card("legend", area, (0.0, 1.0), bar + gap + units + 2 * imgui.get_style().window_padding.x, PASSIVE):
        if title:
            wrapped(title, theme.TEXT_SOFT)
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


_BY_WEIGHTS = "Colour: how much of each warped input is in the picture, by the weights of the colour network, to the power of"
_BY_LIKENESS = "Colour: the warped input that the picture is most like here. By likeness: this model tells no weights."


def _lean(area: Rect, contrast: float | None) -> None:
    """The inputs' colours, each in its corner, and what decides: weights to the power of the contrast, or likeness."""
    side = 1.4 * em()
    with card("legend", area, (0.0, 1.0), 22 * em(), PASSIVE):
        brush = imgui.get_window_draw_list()
        corner = imgui.get_cursor_screen_pos()
        for (u, v), colour in zip(CORNERS, CORNER_COLOURS, strict=True):
            start = ImVec2(corner.x + u * side, corner.y + v * side)
            brush.add_rect_filled(start, ImVec2(start.x + side, start.y + side), packed(ImVec4(*colour, 1.0)))
        imgui.dummy(ImVec2(2 * side, 2 * side))
        imgui.same_line(0, em())
        imgui.begin_group()
        wrapped(_BY_LIKENESS if contrast is None else f"{_BY_WEIGHTS} {contrast:.1f}.", theme.TEXT_SOFT)
        imgui.end_group()


@functools.cache
def _stops(chosen: ColourMap) -> Stops:
    table = colormaps.colours(chosen)  # (256, 3)
    places = [round(i * 255 / _LEGEND_STEPS) for i in range(_LEGEND_STEPS + 1)]
    colours = [[float(value) / 255 for value in table[place]] for place in places]
    return tuple(ImVec4(red, green, blue, 1.0) for red, green, blue in colours)
