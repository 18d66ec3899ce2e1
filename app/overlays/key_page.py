"""The page of all keys."""

from __future__ import annotations

import functools
import itertools
import math

from imgui_bundle import ImVec2, imgui

from app import theme
from app.commands import (
    COMMANDS,
    COMPARING,
    EXPORTING,
    FOCUSING,
    GESTURES,
    INSIDE,
    LOOKING,
    MOVING,
    PROGRAM,
    TONES,
    ZOOMING,
    Context,
)
from app.geometry import Rect
from app.limits import within
from app.widgets import CARD, broken, card, em, font, text, tooltip, wrapped

# In an order in which two, three or four columns of them are about equally long.
_GROUPS = (LOOKING, INSIDE, TONES, ZOOMING, FOCUSING, COMPARING, EXPORTING, MOVING, PROGRAM)
_COLUMN = 28.0  # em, the width of a column of groups
_MOST_COLUMNS = 4
_AROUND_GROUP = 2.2  # lines that a group's name and the room about it take
_LINE = 1.4  # em, from row to row

Row = tuple[str, str]  # the keys, and what they do


def key_page(area: Rect, context: Context, fonts: theme.Fonts) -> None:
    """All keys, in groups."""
    if not context.state.help:
        return
    count = within(int((area.width / em() - 2) // _COLUMN), (1, _MOST_COLUMNS))
    width = min(count * _COLUMN * em(), area.width - 2 * em())
    with card("keys", area, (0.5, 0.5), width, CARD & ~imgui.WindowFlags_.no_scrollbar.value):
        inner = width - 2 * imgui.get_style().window_padding.x - imgui.get_style().scrollbar_size
        with font(fonts.bold, theme.LARGE):
            text("Keys")
        imgui.same_line(inner - 2 * em())
        _done(context, "top")
        flags = imgui.TableFlags_.sizing_stretch_same.value
        if imgui.begin_table("groups", count, flags, ImVec2(inner, 0)):
            imgui.table_next_row()
            room = inner / count - imgui.get_style().cell_padding.x * 2
            for names in _columns(count, room, em()):
                imgui.table_next_column()
                for name in names:
                    _group(name, fonts, room)
            imgui.end_table()
        _done(context, "bottom")
        _scroll()


def _done(context: Context, place: str) -> None:
    if imgui.button(f"Done##{place}"):
        context.state.help = False
    tooltip("Put this page away  (Esc or F1)")


@functools.lru_cache(maxsize=4)
def _columns(count: int, width: float, unit: float) -> tuple[tuple[str, ...], ...]:
    """The groups in their order in so many columns of that width, the longest of which is as short as can be. unit: the height
    of the text."""
    heights = [_AROUND_GROUP + sum(_lines(row, width) for row in rows_of(name)) for name in _GROUPS]
    best: tuple[float, tuple[tuple[str, ...], ...]] = (math.inf, ())
    for cuts in itertools.combinations(range(1, len(_GROUPS)), count - 1):
        spans = list(itertools.pairwise((0, *cuts, len(_GROUPS))))
        longest = max(sum(heights[first:last]) for first, last in spans)
        if longest < best[0]:
            best = longest, tuple(_GROUPS[first:last] for first, last in spans)
    return best[1]


def _lines(row: Row, width: float) -> float:
    """How high a row is, in rows of one line."""
    keys, words = _widths(width)
    most = max(broken(row[0], keys).count("\n"), broken(row[1], words).count("\n"))
    return 1 + most / _LINE


def _widths(width: float) -> tuple[float, float]:
    """Of the keys, and of the words beside them."""
    keys = min(6.2 * em(), width / 3)
    return keys, width - keys - em()


def _scroll() -> None:
    """By the arrow keys, and by pages."""
    pressed = imgui.is_key_pressed
    lines = int(pressed(imgui.Key.down_arrow)) - int(pressed(imgui.Key.up_arrow))
    pages = int(pressed(imgui.Key.page_down)) - int(pressed(imgui.Key.page_up))
    if lines or pages:
        room = imgui.get_window_height() - 2 * em()
        imgui.set_scroll_y(imgui.get_scroll_y() + 2 * lines * em() + pages * room)


def rows_of(group: str) -> list[Row]:
    """What the mouse and the keys do, of this group."""
    gestures = [(keys, words) for name, keys, words in GESTURES if name == group]
    return gestures + [(" or ".join(c.keys), c.text) for c in COMMANDS.values() if c.group == group and c.keys]


def _group(name: str, fonts: theme.Fonts, width: float) -> None:
    imgui.dummy(ImVec2(0, em() * 0.3))
    with font(fonts.bold, theme.SMALL):
        text(name, theme.TEXT_SOFT)
    if imgui.begin_table(name, 2, 0, ImVec2(width, 0)):
        keys_width, words_width = _widths(width)
        imgui.table_setup_column("keys", imgui.TableColumnFlags_.width_fixed.value, keys_width)
        imgui.table_setup_column("words", imgui.TableColumnFlags_.width_fixed.value, words_width)
        for keys, words in rows_of(name):
            imgui.table_next_row()
            imgui.table_next_column()
            wrapped(keys, theme.ACCENT)
            imgui.table_next_column()
            wrapped(words)
        imgui.end_table()
