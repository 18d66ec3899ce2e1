"""The browser: the light fields of a folder, with pictures."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from app import theme
from app.commands import Browse, Context, OpenPath
from app.desk import Card, Folder, Shelf
from app.geometry import Rect
from app.limits import within
from app.overlays import tiles
from app.widgets import BARE, bring_into_sight, button, elided, em, font, text, tooltip

_AHEAD = 3  # rows of tiles beyond those in sight that are looked at too


def browser(area: Rect, context: Context, shelf: Shelf, fonts: theme.Fonts) -> None:
    """The folder over all of the picture; arrow keys choose, Enter opens, Backspace goes up, Esc puts it away."""
    if context.state.desk.card is not Card.BROWSER:
        return
    imgui.set_next_window_pos(ImVec2(area.x, area.y))
    imgui.set_next_window_size(ImVec2(area.width, area.height))
    imgui.push_style_color(imgui.Col_.window_bg, theme.PANEL)
    imgui.begin("browser", None, BARE)
    imgui.pop_style_color()
    folder = shelf.folder
    _head(context, shelf, fonts)
    if folder is not None:
        _tiles(folder, context, shelf)
    imgui.end()


def _head(context: Context, shelf: Shelf, fonts: theme.Fonts) -> None:
    folder = shelf.folder
    width = imgui.get_content_region_avail().x
    with font(fonts.bold, theme.LARGE):
        text(elided(_name(folder), width))
    if folder is not None:
        where = f" in {folder.path}" if folder.path is not None else ""
        text(elided(f"{len(folder.members)} to choose from{where}", width), theme.TEXT_SOFT)
        tooltip(str(folder.path or ""))
    else:
        text("Listing the folder" if shelf.listing else "No folder is listed", theme.TEXT_SOFT)
    imgui.begin_disabled(folder is None or folder.path is None or folder.path.parent == folder.path)
    if imgui.button("Up"):
        _go_up(context, shelf)
    imgui.end_disabled()
    tooltip("The folder above  (Backspace)")
    imgui.same_line()
    button("Another folder", "open folder", context)
    imgui.same_line()
    if imgui.button("Done"):
        context.state.desk.card = None
    tooltip("Put this away  (Esc)")


def _name(folder: Folder | None) -> str:
    if folder is None or folder.path is None:
        return "Light fields"
    return folder.path.name or str(folder.path)


def _go_up(context: Context, shelf: Shelf) -> None:
    if shelf.folder is not None and shelf.folder.path is not None:
        context.requests.append(Browse(shelf.folder.path.parent))


def _tiles(folder: Folder, context: Context, shelf: Shelf) -> None:
    """The tiles in rows; only those in sight are drawn, so that thousands scroll as fast as ten."""
    desk, members = context.state.desk, folder.members
    imgui.begin_child("tiles", ImVec2(0, 0))
    one, gap, room = tiles.size(), 0.4 * em(), imgui.get_content_region_avail().x
    columns = max(int((room + gap) // (one.x + gap)), 1)
    step = one.x + (room - columns * one.x) / max(columns - 1, 1)  # from column to column, so that they fill the width
    rows = -(-len(members) // columns)
    moved = _moved(columns, imgui.get_window_height() // (one.y + gap), len(members))
    desk.chosen = within(desk.chosen + moved, (0, len(members) - 1))
    if moved or imgui.is_window_appearing():
        bring_into_sight(desk.chosen // columns * (one.y + gap), one.y)
    first = max(int(imgui.get_scroll_y() // (one.y + gap)), 0)
    last = min(int((imgui.get_scroll_y() + imgui.get_window_height()) // (one.y + gap)), rows - 1)
    start = imgui.get_cursor_pos()
    chosen = None
    for index in range(first * columns, min((last + 1) * columns, len(members))):
        row, column = divmod(index, columns)
        imgui.set_cursor_pos(ImVec2(start.x + column * step, start.y + row * (one.y + gap)))
        path = members[index]
        if tiles.tile(path, shelf.thumbnail(path), index == desk.chosen):
            chosen = index
    for index in range((last + 1) * columns, min((last + 1 + _AHEAD) * columns, len(members))):
        shelf.thumbnail(members[index])
    imgui.set_cursor_pos(ImVec2(start.x, start.y + rows * (one.y + gap)))
    imgui.dummy(ImVec2(1, 1))  # so that imgui knows how far there is to scroll
    imgui.end_child()
    if imgui.is_key_pressed(imgui.Key.enter, False) or imgui.is_key_pressed(imgui.Key.keypad_enter, False):
        chosen = desk.chosen
    if chosen is not None:
        desk.chosen = chosen
        context.requests.append(OpenPath(members[chosen]))
    elif imgui.is_key_pressed(imgui.Key.backspace, False):
        _go_up(context, shelf)


def _moved(columns: int, rows_in_sight: float, count: int) -> int:
    """By how many of `count` tiles the keys move the choice in this frame."""
    pressed = imgui.is_key_pressed
    steps = int(pressed(imgui.Key.right_arrow)) - int(pressed(imgui.Key.left_arrow))
    steps += columns * (int(pressed(imgui.Key.down_arrow)) - int(pressed(imgui.Key.up_arrow)))
    page = columns * max(int(rows_in_sight), 1)
    steps += page * (int(pressed(imgui.Key.page_down)) - int(pressed(imgui.Key.page_up)))
    return steps + count * (int(pressed(imgui.Key.end)) - int(pressed(imgui.Key.home)))
