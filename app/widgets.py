"""Small parts that the panels are made of: text in a size, rows with a key beside them, buttons that run a command."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

from imgui_bundle import ImVec2, ImVec4, imgui

from app import commands, theme
from app.geometry import Rect
from app.limits import within
from app.readable import readable

# Nothing but its contents.
BARE = (
    imgui.WindowFlags_.no_decoration.value
    | imgui.WindowFlags_.no_move.value
    | imgui.WindowFlags_.no_saved_settings.value
    | imgui.WindowFlags_.no_nav.value
)
# Parts of the window that do not move; app.interface fills their ground, since clearing costs less than drawing.
FIXED = BARE | imgui.WindowFlags_.no_bring_to_front_on_focus.value | imgui.WindowFlags_.no_background.value
CARD = BARE | imgui.WindowFlags_.always_auto_resize.value
PASSIVE = CARD | imgui.WindowFlags_.no_inputs.value  # a card that is only looked at
LABELS = 4.6  # em, the column in which the labels of controls stand
_VALUES = 4.1  # em, beside sliders: "-99.99 px" and a gap
DASH = "\N{EN DASH}"
MINUS = "\N{MINUS SIGN}"


def number(value: float, decimals: int) -> str:
    """A number with a true minus sign, so that columns of them line up."""
    return f"{value:.{decimals}f}".replace("-", MINUS)


def capital(words: str) -> str:
    """The words as they begin a sentence, or an entry of a list."""
    return words[:1].upper() + words[1:]


def disparity_words(disparity: float, columns: int) -> str:
    """A disparity over the baseline, and per captured view of a grid with so many columns."""
    return f"{number(disparity, 2)} px, {number(disparity / (columns - 1), 3)} per view"


def decibels(value: float) -> str:
    """A PSNR, which is infinite where two pictures are equal."""
    return f"{number(value, 2)} dB" if math.isfinite(value) else "equal"


def counted(count: int, one: str) -> str:
    """So many of something, whose plural has an s."""
    return f"{count} {one}" if count == 1 else f"{count} {one}s"


def milliseconds(value: float) -> str:
    """A duration with the digits that matter."""
    return f"{value:.1f} ms" if value < 10 else f"{value:,.0f} ms".replace(",", "\N{NO-BREAK SPACE}")


def em() -> float:
    """The height of the text: the unit of all spacing that goes with it."""
    return imgui.get_font_size()


@contextmanager
def window(name: str, rect: Rect, flags: int = FIXED, padding: ImVec2 | None = None) -> Iterator[None]:
    """A window at a fixed place. Where the frame is broken off inside it, imgui tidies up when the frame is ended, or never
    if the program ends: to end a window within a list or a style that nobody ends would be a fault of its own."""
    imgui.set_next_window_pos(ImVec2(rect.x, rect.y))
    imgui.set_next_window_size(ImVec2(rect.width, rect.height))
    if padding is not None:
        imgui.push_style_var(imgui.StyleVar_.window_padding, padding)
    imgui.begin(name, None, flags)
    if padding is not None:
        imgui.pop_style_var()
    yield
    imgui.end()


@contextmanager
def panel(name: str, rect: Rect) -> Iterator[None]:
    """A window at the side, whose scrollbar lies in its margin; contents stand in a `column`."""
    padding = imgui.get_style().window_padding
    inner = Rect(rect.x + padding.x, rect.y, rect.width - padding.x, rect.height)
    with window(name, inner, FIXED & ~imgui.WindowFlags_.no_scrollbar.value, ImVec2(0, padding.y)):
        yield


@contextmanager
def column(name: str, width: float) -> Iterator[None]:
    """Contents of this width, with a scrollbar beside them or without: so nothing moves when one appears."""
    imgui.push_style_var(imgui.StyleVar_.cell_padding, ImVec2(0, 0))
    shown = imgui.begin_table(name, 1, 0, ImVec2(width, 0))
    if shown:
        imgui.table_next_row()
        imgui.table_next_column()
    imgui.pop_style_var()
    yield
    if shown:
        imgui.end_table()


@contextmanager
def card(name: str, area: Rect, pivot: tuple[float, float], width: float, flags: int = CARD) -> Iterator[None]:
    """A card over the picture: `pivot` (0 to 1) is where it sits in the area, and which point of it sits there. A frame that is
    broken off is as in `window`."""
    margin = em()
    place = ImVec2(
        area.x + margin + (area.width - 2 * margin) * pivot[0],
        area.y + margin + (area.height - 2 * margin) * pivot[1],
    )
    imgui.set_next_window_pos(place, pivot=ImVec2(*pivot))
    width = max(min(width, area.width - 2 * margin), 4 * em())
    imgui.set_next_window_size_constraints(ImVec2(width, 0), ImVec2(width, max(area.height - 2 * margin, 3 * em())))
    imgui.push_style_color(imgui.Col_.window_bg, theme.CARD)
    imgui.push_style_var(imgui.StyleVar_.window_rounding, em() * 0.45)
    imgui.push_style_var(imgui.StyleVar_.window_border_size, 1.0)
    imgui.begin(name, None, flags)
    imgui.pop_style_var(2)
    imgui.pop_style_color()
    yield
    imgui.end()


@contextmanager
def font(face: imgui.ImFont, size: float = theme.FONT_SIZE) -> Iterator[None]:
    """Text in this face and size (before scaling)."""
    imgui.push_font(face, size)
    yield
    imgui.pop_font()


def text(words: str, colour: ImVec4 = theme.TEXT) -> None:
    """A line of text, as it stands."""
    imgui.push_style_color(imgui.Col_.text, colour)
    imgui.text_unformatted(readable(words))
    imgui.pop_style_color()


def wrapped(words: str, colour: ImVec4 = theme.TEXT) -> None:
    """Text broken into lines at the window's edge."""
    imgui.push_style_color(imgui.Col_.text, colour)
    _in_lines(words, imgui.get_content_region_avail().x)
    imgui.pop_style_color()


def _in_lines(words: str, width: float) -> None:
    """Text in lines of this width; a word that is wider is broken by imgui, wherever it likes."""
    imgui.push_text_wrap_pos(imgui.get_cursor_pos_x() + width)
    imgui.text_unformatted(broken(readable(words), width))
    imgui.pop_text_wrap_pos()


def broken(words: str, width: float) -> str:
    """The words in lines that are broken at spaces only, while imgui would also break them after the dots of file names."""
    if imgui.calc_text_size(words).x <= width:
        return words
    lines = []
    for paragraph in words.split("\n"):
        line, *rest = paragraph.split(" ")
        for word in rest:
            longer = f"{line} {word}"
            if imgui.calc_text_size(longer).x <= width:
                line = longer
            else:
                lines.append(line)
                line = word
        lines.append(line)
    return "\n".join(lines)


def heading(words: str, fonts: theme.Fonts) -> None:
    """The title of a section, with a rule above it."""
    rule()
    title(words, fonts)


def rule() -> None:
    """A line between sections."""
    spacing = imgui.get_style().item_spacing
    imgui.push_style_var(imgui.StyleVar_.item_spacing, ImVec2(spacing.x, em() * 0.38))
    imgui.dummy(ImVec2(0, 0))
    imgui.separator()
    imgui.pop_style_var()


def title(words: str, fonts: theme.Fonts) -> None:
    """The title alone, of the first section in a tab, or of a table."""
    with font(fonts.bold, theme.SMALL):
        text(words, theme.TEXT_SOFT)


def tooltip(words: str) -> None:
    """Words beside the mouse when it rests on the last control."""
    if imgui.is_item_hovered(imgui.HoveredFlags_.for_tooltip.value):
        imgui.push_style_var(imgui.StyleVar_.window_padding, ImVec2(em() * 0.6, em() * 0.45))
        if imgui.begin_tooltip():
            _in_lines(words, em() * 21.4)
            imgui.end_tooltip()
        imgui.pop_style_var()


def button(label: str, command: str, context: commands.Context, width: float = 0.0) -> None:
    """A button that runs the named command; its tooltip tells the key."""
    if imgui.button(f"{label}##{command}", ImVec2(width, 0)):
        commands.run(command, context)
    tooltip(commands.COMMANDS[command].tooltip)


def tile(label: str, command: str, selected: bool, context: commands.Context, width: float, why_not: str = "") -> None:
    """A button of this width that runs the named command, with the key at its right end; one of several to choose from.
    why_not: why it cannot be pressed."""
    imgui.begin_disabled(bool(why_not))
    height = imgui.get_frame_height()
    corner = imgui.get_cursor_screen_pos()
    if imgui.invisible_button(f"{label}##{command}", ImVec2(width, height)):
        commands.run(command, context)
    fill = theme.ACCENT_DEEP if selected else theme.FIELD_HOVERED if imgui.is_item_hovered() else theme.FIELD
    tooltip(why_not or commands.COMMANDS[command].tooltip)
    brush = imgui.get_window_draw_list()
    end = ImVec2(corner.x + width, corner.y + height)
    brush.add_rect_filled(corner, end, packed(fill), imgui.get_style().frame_rounding)
    pad = em() * 0.55
    y = corner.y + (height - em()) / 2
    brush.add_text(ImVec2(corner.x + pad, y), packed(theme.TEXT), label)
    key = commands.COMMANDS[command].keys[0]
    x = end.x - pad - imgui.calc_text_size(key).x
    if x - corner.x - pad > imgui.calc_text_size(label).x:  # the tooltip tells it in any case
        brush.add_text(ImVec2(x, y), packed(theme.TEXT_SOFT if selected else theme.TEXT_FAINT), key)
    imgui.end_disabled()


def tab(label: str, command: str, selected: bool, context: commands.Context, width: float, fonts: theme.Fonts) -> None:
    """One of a row of tabs that run the named command: its name in the middle, a line under the chosen one."""
    height = imgui.get_frame_height()
    corner = imgui.get_cursor_screen_pos()
    if imgui.invisible_button(f"{label}##{command}", ImVec2(width, height)):
        commands.run(command, context)
    hovered = imgui.is_item_hovered()
    tooltip(commands.COMMANDS[command].tooltip)
    brush = imgui.get_window_draw_list()
    end = ImVec2(corner.x + width, corner.y + height)
    brush.add_rect_filled(
        corner, end, packed(theme.FIELD_HOVERED if hovered else theme.FIELD), imgui.get_style().frame_rounding
    )
    if selected:
        line = ImVec2(corner.x + em() * 0.3, end.y - em() * 0.13)
        brush.add_rect_filled(line, ImVec2(end.x - em() * 0.3, end.y), packed(theme.ACCENT))
    with font(fonts.bold if selected else fonts.regular, theme.SMALL):
        size = imgui.calc_text_size(label)
        middle = ImVec2(corner.x + (width - size.x) / 2, corner.y + (height - size.y) / 2)
        brush.add_text(middle, packed(theme.TEXT if selected else theme.TEXT_SOFT), label)


def pairs(name: str, rows: Sequence[tuple[str, str]]) -> None:
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


def switch(label: str, command: str, on: bool, context: commands.Context) -> None:
    """A box to tick that runs the named command, with the key at the right end of the line."""
    right = imgui.get_cursor_pos_x() + imgui.get_content_region_avail().x - em() * 0.55
    clicked, _ = imgui.checkbox(f"{label}##{command}", on)
    if clicked:
        commands.run(command, context)
    tooltip(commands.COMMANDS[command].tooltip)
    imgui.same_line()
    key = commands.COMMANDS[command].keys[0]
    imgui.set_cursor_pos_x(right - imgui.calc_text_size(key).x)
    text(key, theme.TEXT_FAINT)


def labelled(words: str) -> None:
    """The label of the control that comes next, which stands in line with all others."""
    imgui.align_text_to_frame_padding()
    text(words, theme.TEXT_SOFT)
    imgui.same_line(imgui.get_cursor_start_pos().x + LABELS * em())


def choice(label: str, value: str, choices: Sequence[str], hint: str, shown_as: Callable[[str], str] = str) -> str:
    """A list that opens, behind its label. Returns what is chosen. shown_as: what an entry is called on screen."""
    labelled(label)
    imgui.set_next_item_width(imgui.get_content_region_avail().x)
    shown = choices.index(value) if value in choices else 0
    _, index = imgui.combo(f"##{label}", shown, [shown_as(each) for each in choices])
    tooltip(hint)
    return choices[index]


def slider(label: str, value: float, limits: tuple[float, float], shown: str, hint: str, flags: int = 0) -> float:
    """A slider between its label and its value, which stay clear of the grab. Returns the value."""
    labelled(label)
    value_width = max(_VALUES * em(), imgui.calc_text_size(shown).x + 0.5 * em())
    imgui.set_next_item_width(imgui.get_content_region_avail().x - value_width)
    changed, moved = imgui.slider_float(f"##{label}", value, *limits, "", flags | imgui.SliderFlags_.always_clamp.value)
    tooltip(hint)
    imgui.same_line()
    right = imgui.get_cursor_pos_x() + imgui.get_content_region_avail().x
    imgui.set_cursor_pos_x(right - imgui.calc_text_size(shown).x)
    text(shown)
    return typed(moved, value, limits) if changed else value  # not as imgui has rounded it


def typed(value: float, before: float, limits: tuple[float, float]) -> float:
    """What was typed into a field, within its limits; what was there before where that is no number ("nan", "inf")."""
    return within(value, limits) if math.isfinite(value) else before


def packed(colour: ImVec4) -> int:
    """The colour as imgui's draw lists take it."""
    return imgui.get_color_u32(colour)


def ticks(low: float, high: float, decimals: int = 2) -> tuple[str, str, str]:
    """What stands at both ends of a scale and in its middle."""
    return number(low, decimals), number((low + high) / 2, decimals), number(high, decimals)


def bring_into_sight(y: float, height: float) -> None:
    """Scroll the window only as far as it takes to see what lies there."""
    top, room = imgui.get_scroll_y(), imgui.get_window_height()
    if y < top:
        imgui.set_scroll_y(y)
    elif y + height > top + room:
        imgui.set_scroll_y(y + height - room)


TAG_GAP = "   "  # between a tag's name and what is left out first where there is no room


def fitting_tag(words: str, room: float) -> tuple[str, float] | None:
    """As much of a tag's words as there is room for, and its width; None where there is none."""
    around = 1.3 * em()
    if imgui.calc_text_size(words).x + around > room:
        words = elided(words.partition(TAG_GAP)[0], room - around)
    width = imgui.calc_text_size(words).x + around
    return (words, width) if width <= room else None


def tag(words: str, colour: ImVec4, x: float, y: float, width: float) -> None:
    """Words on a plate over the picture, so wide, from this corner on."""
    brush = imgui.get_background_draw_list()
    height = imgui.calc_text_size(words).y + 0.64 * em()
    brush.add_rect_filled(ImVec2(x, y), ImVec2(x + width, y + height), packed(theme.LABEL), em() * 0.35)
    brush.add_text(ImVec2(x + 0.65 * em(), y + 0.32 * em()), packed(colour), words)


def elided(words: str, width: float) -> str:
    """The words, their middle left out where they are wider than `width`."""
    words = readable(words)
    if imgui.calc_text_size(words).x <= width:
        return words
    low, high = 0, len(words)
    while low < high:  # the most characters that fit
        kept = (low + high + 1) // 2
        if imgui.calc_text_size(_shortened(words, kept)).x <= width:
            low = kept
        else:
            high = kept - 1
    return _shortened(words, low)


def _shortened(words: str, kept: int) -> str:
    head = (kept + 1) // 2
    tail = kept - head
    return words[:head] + "\N{HORIZONTAL ELLIPSIS}" + (words[-tail:] if tail else "")
