"""The page of all keys."""

from __future__ import annotations

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
from app.widgets import CARD, card, em, font, text, tooltip, wrapped

_GROUPS = (LOOKING, INSIDE, TONES, FOCUSING, COMPARING, MOVING, ZOOMING, EXPORTING, PROGRAM)


def key_page(area: Rect, context: Context, fonts: theme.Fonts) -> None:
    """All keys, in groups."""
    if not context.state.help:
        return
    wide = area.width > 58 * em()
    width = min((56 if wide else 28) * em(), area.width - 2 * em())
    with card("keys", area, (0.5, 0.5), width, CARD & ~imgui.WindowFlags_.no_scrollbar.value):
        with font(fonts.bold, theme.LARGE):
            text("Keys")
        columns = ((LOOKING, INSIDE, TONES, FOCUSING), (COMPARING, MOVING, ZOOMING, EXPORTING, PROGRAM)) if wide else (_GROUPS,)
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
        _scroll()


def _scroll() -> None:
    """By the arrow keys, and by pages."""
    pressed = imgui.is_key_pressed
    lines = int(pressed(imgui.Key.down_arrow)) - int(pressed(imgui.Key.up_arrow))
    pages = int(pressed(imgui.Key.page_down)) - int(pressed(imgui.Key.page_up))
    if lines or pages:
        room = imgui.get_window_height() - 2 * em()
        imgui.set_scroll_y(imgui.get_scroll_y() + 2 * lines * em() + pages * room)


def _group(name: str, fonts: theme.Fonts, width: float) -> None:
    imgui.dummy(ImVec2(0, em() * 0.3))
    with font(fonts.bold, theme.SMALL):
        text(name, theme.TEXT_SOFT)
    gestures = [(keys, words) for group, keys, words in GESTURES if group == name]
    keyed = [(" ".join(c.keys), c.text) for c in COMMANDS.values() if c.group == name and c.keys]
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
