"""What lies over the picture: notices, legends, messages, loading, the path field, the start picture, the page of keys."""

from __future__ import annotations

import functools
import itertools

from imgui_bundle import ImVec2, ImVec4, imgui

from app import theme
from app.commands import COMMANDS, GESTURES, LOOKING, MOVING, PROGRAM, ZOOMING, Action, Context, OpenPath
from app.geometry import Rect
from app.readout import Readout
from app.state import Look, Step, ViewState
from app.widgets import CARD, button, card, em, font, number, packed, text, tooltip, wrapped
from lfcore import colormaps
from lfcore.lightfield import is_extrapolated

_PASSIVE = CARD | imgui.WindowFlags_.no_inputs.value
_LEGEND_STEPS = 48


# Over the picture.


def notices(area: Rect, state: ViewState, readout: Readout) -> None:
    """Short labels at the top of the picture: what is looked at, and whether it is extrapolated."""
    labels: list[tuple[str, ImVec4]] = []
    if readout.step is Step.CAPTURED:
        labels.append(("Captured view", theme.GOOD))
    elif state.look is not Look.SYNTHESIS:
        labels.append((state.look.value, theme.TEXT))
    if is_extrapolated(state.u, state.v):
        labels.append(("Extrapolated", theme.WARNING))
    if state.captured and state.look is Look.SYNTHESIS and readout.captured_here is None:
        labels.append(("No captured view here", theme.TEXT_SOFT))
    if not labels or area.height < 6 * em():
        return
    brush = imgui.get_background_draw_list()
    pad_x, pad_y = em() * 0.65, em() * 0.32
    x = area.x + em()
    for words, colour in labels:
        size = imgui.calc_text_size(words)
        if x + size.x + 2 * pad_x > area.x + area.width:
            break
        top = area.y + em()
        brush.add_rect_filled(
            ImVec2(x, top), ImVec2(x + size.x + 2 * pad_x, top + size.y + 2 * pad_y), packed(theme.LABEL), em() * 0.35
        )
        brush.add_text(ImVec2(x + pad_x, top + pad_y), packed(colour), words)
        x += size.x + 2 * pad_x + em() * 0.5


def missing(area: Rect, context: Context, readout: Readout) -> None:
    """Why the chosen look has nothing to show, and what to do."""
    look = context.state.look
    if look is Look.ERROR and readout.captured_here is None:
        with card("missing", area, (0.5, 0.5), 24 * em()):
            wrapped("No captured view at this viewpoint")
            wrapped("The error is measured against the camera's own views, which are the dots of the pad.", theme.TEXT_SOFT)
            button("Go to the nearest", "nearest", context)
    elif look.needs_disparity and not readout.has_disparity:
        with card("missing", area, (0.5, 0.5), 24 * em(), _PASSIVE):
            wrapped("No disparity yet")
            why = "It comes with the first synthesis." if readout.busy else f"The model {readout.model} has given none."
            wrapped(why, theme.TEXT_SOFT)


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
    with card("legend", area, (0.0, 1.0), bar + gap + units + 2 * imgui.get_style().window_padding.x, _PASSIVE):
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


# On top of everything.


def messages(area: Rect, context: Context, readout: Readout) -> None:
    """What went wrong, until it is put away."""
    if not readout.messages:
        return
    more = len(readout.messages) - 1
    with card("message", area, (0.5, 0.0), 38 * em()):
        corner, size = imgui.get_window_pos(), imgui.get_window_size()
        edge = ImVec2(corner.x + em() * 0.25, corner.y + size.y)
        imgui.get_window_draw_list().add_rect_filled(corner, edge, packed(theme.ERROR), em() * 0.12)
        wrapped(readout.messages[0])
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
            context.requests.append(OpenPath(state.path_text))
            state.path_field = False


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


def key_page(area: Rect, context: Context, fonts: theme.Fonts) -> None:
    """All keys, in groups."""
    if not context.state.help:
        return
    wide = area.width > 58 * em()
    width = min((56 if wide else 28) * em(), area.width - 2 * em())
    with card("keys", area, (0.5, 0.5), width, CARD & ~imgui.WindowFlags_.no_scrollbar.value):
        with font(fonts.bold, theme.LARGE):
            text("Keys")
        columns = ((LOOKING, ZOOMING), (MOVING, PROGRAM)) if wide else ((LOOKING, MOVING, ZOOMING, PROGRAM),)
        inner = width - 2 * imgui.get_style().window_padding.x - imgui.get_style().scrollbar_size
        flags = imgui.TableFlags_.sizing_stretch_same.value
        if imgui.begin_table("groups", len(columns), flags, ImVec2(inner, 0)):
            imgui.table_next_row()
            for groups in columns:
                imgui.table_next_column()
                for name in groups:
                    _group(name, fonts, inner / len(columns) - imgui.get_style().cell_padding.x * 2)
            imgui.end_table()
        if imgui.button("Done"):
            context.state.help = False
        tooltip("Put this page away  (Esc or F1)")


def _group(name: str, fonts: theme.Fonts, width: float) -> None:
    imgui.dummy(ImVec2(0, em() * 0.3))
    with font(fonts.bold, theme.SMALL):
        text(name, theme.TEXT_SOFT)
    gestures = [(keys, words) for group, keys, words in GESTURES if group == name]
    keyed = [(" ".join(c.keys), c.text) for c in COMMANDS.values() if c.group == name]
    if imgui.begin_table(name, 2, 0, ImVec2(width, 0)):
        keys_width = min(6.2 * em(), width / 3)
        imgui.table_setup_column("keys", imgui.TableColumnFlags_.width_fixed.value, keys_width)
        imgui.table_setup_column("words", imgui.TableColumnFlags_.width_fixed.value, width - keys_width - em())
        for keys, words in [*gestures, *keyed]:
            imgui.table_next_row()
            imgui.table_next_column()
            wrapped(keys, theme.ACCENT)
            imgui.table_next_column()
            wrapped(words)
        imgui.end_table()
