"""The start picture: what to do when nothing is open."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from app import theme
from app.commands import COMMANDS, Context, OpenPath
from app.desk import Shelf
from app.geometry import Rect
from app.overlays import tiles
from app.widgets import CARD, button, card, em, font, text, wrapped

_TILES = 8  # recent files at most, in rows of _ACROSS
_ACROSS = 4


def start(area: Rect, context: Context, shelf: Shelf, fonts: theme.Fonts) -> None:
    """Three things to do, and the files opened lately."""
    one, gap = tiles.size(), 0.3 * em()
    padding = imgui.get_style().window_padding.x
    across = max(min(_ACROSS, int((area.width - 2 * em() - 2 * padding + gap) // (one.x + gap))), 1)
    shown = _recent_to_show(shelf, across, area.height - 15 * em())
    width = max(min(across, shown) * (one.x + gap) - gap + 2 * padding, 25 * em())
    with card("start", area, (0.5, 0.45), width, CARD & ~imgui.WindowFlags_.no_scrollbar.value):
        with font(fonts.bold, theme.LARGE):
            text("Open a light field")
        wrapped("Drag in it, and see any view in between the captured ones.", theme.TEXT_SOFT)
        imgui.dummy(ImVec2(0, em() * 0.3))
        for label, command in (("Open a file", "open"), ("Browse a folder", "open folder"), ("See the sample", "sample")):
            button(label, command, context, 8.5 * em())
            imgui.same_line(0, em())
            imgui.align_text_to_frame_padding()
            text(COMMANDS[command].keys[0], theme.TEXT_SOFT)
        imgui.dummy(ImVec2(0, em() * 0.3))
        wrapped("Or drop files and folders on this window. F1 shows all keys.", theme.TEXT_FAINT)
        if shown:
            _recent(shelf, shown, across, context, fonts)


def _recent_to_show(shelf: Shelf, across: int, height: float) -> int:
    """How many recent files there is room for, in whole rows."""
    rows = min(int(height // tiles.size().y), _TILES // across)
    return min(len(shelf.recent), rows * across) if rows > 0 else 0


def _recent(shelf: Shelf, count: int, across: int, context: Context, fonts: theme.Fonts) -> None:
    """Files opened lately; those that are not there any more come last."""
    imgui.dummy(ImVec2(0, em() * 0.2))
    with font(fonts.bold, theme.SMALL):
        text("Recent", theme.TEXT_SOFT)
    ordered = sorted(shelf.recent, key=lambda path: bool(shelf.thumbnail(path).reason))
    gap = 0.3 * em()
    for index, path in enumerate(ordered[:count]):
        if index % across:
            imgui.same_line(0, gap)
        if tiles.tile(path, shelf.thumbnail(path), False):
            context.requests.append(OpenPath(path))
