"""The command palette: all that can be done, filtered by what is typed."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from app import commands, theme
from app.commands import COMMANDS, Command, Context
from app.desk import Card
from app.geometry import Rect
from app.limits import within
from app.widgets import bring_into_sight, card, elided, em, packed, text

_ROWS = 12


def matches(query: str, context: Context) -> list[str]:
    """The names of the commands that can be run now and hold every word of the query; those that begin with it first."""
    words = query.casefold().split()
    met = context.met
    found = []
    for order, (name, command) in enumerate(COMMANDS.items()):
        said = f"{command.text} {name} {command.group} {' '.join(command.keys)}".casefold()
        if command.needs in met and name != "palette" and all(word in said for word in words):
            found.append((_rank(words, command), order, name))
    return [name for _, _, name in sorted(found)]


def _rank(words: list[str], command: Command) -> int:
    """0 where the command's own text begins with the first word, 1 where one of its words does, else 2."""
    if not words:
        return 0
    said = command.text.casefold()
    if said.startswith(words[0]):
        return 0
    return 1 if any(word.startswith(words[0]) for word in said.split()) else 2


def palette(area: Rect, context: Context) -> None:
    """The field and the list; Enter runs the chosen command, Esc puts the palette away."""
    desk = context.state.desk
    if desk.card is not Card.PALETTE:
        return
    with card("palette", area, (0.5, 0.1), 34 * em()):
        if imgui.is_window_appearing():
            imgui.set_keyboard_focus_here()
        imgui.set_next_item_width(imgui.get_content_region_avail().x)
        flags = imgui.InputTextFlags_.enter_returns_true.value
        before = desk.query
        entered, desk.query = imgui.input_text_with_hint("##query", "What do you want to do?", desk.query, flags)
        if desk.query != before:
            desk.chosen = 0
        found = matches(desk.query, context)
        rows = max(min(len(found), _ROWS, int((0.85 * area.height - 5 * em()) // imgui.get_frame_height())), 1)
        moved = _steps()
        desk.chosen = within(desk.chosen + moved, (0, max(len(found) - 1, 0)))
        clicked = _list(found, rows, desk.chosen, moved != 0) if found else None
        if not found:
            text("No command has these words", theme.TEXT_SOFT)
        run = found[desk.chosen] if entered and found else clicked
        if run is not None:
            desk.card = None
            commands.run(run, context)


def _steps() -> int:
    """How far the arrow keys move the choice in this frame."""
    pressed = imgui.is_key_pressed
    step = int(pressed(imgui.Key.down_arrow)) - int(pressed(imgui.Key.up_arrow))
    return step + _ROWS * (int(pressed(imgui.Key.page_down)) - int(pressed(imgui.Key.page_up)))


def _list(found: list[str], rows: int, chosen: int, moved: bool) -> str | None:
    """The list, so many rows high; the name of the command that is clicked."""
    height = imgui.get_frame_height()
    clicked = None
    imgui.push_style_var(imgui.StyleVar_.item_spacing, ImVec2(0, 0))
    imgui.begin_child("commands", ImVec2(0, rows * height))
    clipper = imgui.ListClipper()
    clipper.begin(len(found), height)
    if moved:
        bring_into_sight(chosen * height, height)
    while clipper.step():
        for index in range(clipper.display_start, clipper.display_end):
            if _row(found[index], index == chosen):
                clicked = found[index]
    imgui.end_child()
    imgui.pop_style_var()
    return clicked


def _row(name: str, chosen: bool) -> bool:
    command = COMMANDS[name]
    corner, width, height = imgui.get_cursor_screen_pos(), imgui.get_content_region_avail().x, imgui.get_frame_height()
    clicked = imgui.invisible_button(f"run {name}", ImVec2(width, height))
    fill = theme.ACCENT_DEEP if chosen else theme.FIELD_HOVERED if imgui.is_item_hovered() else None
    brush = imgui.get_window_draw_list()
    end = ImVec2(corner.x + width, corner.y + height)
    if fill is not None:
        brush.add_rect_filled(corner, end, packed(fill), imgui.get_style().frame_rounding)
    pad, y = em() * 0.55, corner.y + (height - em()) / 2
    keys = "  ".join(command.keys[:1])
    keys_width = imgui.calc_text_size(keys).x
    words = elided(command.text, width - keys_width - 3 * pad)
    brush.add_text(ImVec2(corner.x + pad, y), packed(theme.TEXT), words)
    brush.add_text(ImVec2(end.x - pad - keys_width, y), packed(theme.TEXT_SOFT if chosen else theme.TEXT_FAINT), keys)
    return bool(clicked)
