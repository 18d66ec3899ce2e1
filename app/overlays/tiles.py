"""Light fields as tiles with pictures, for the browser and the start picture."""

from __future__ import annotations

from pathlib import Path

from imgui_bundle import ImVec2, imgui

from app import theme
from app.desk import Thumbnail
from app.geometry import Rect
from app.readable import readable
from app.widgets import elided, em, packed, tooltip

WIDTH, PICTURE_HEIGHT = 11.5, 8.2  # em
_PAD = 0.5  # em, around all of a tile's contents


def size() -> ImVec2:
    """Width and height of a tile."""
    return ImVec2(WIDTH * em(), (PICTURE_HEIGHT + 3.4 + 2 * _PAD) * em())


def tile(path: Path, thumbnail: Thumbnail, chosen: bool) -> bool:
    """One tile at the cursor; whether it was clicked."""
    corner, (width, height) = imgui.get_cursor_screen_pos(), size()
    clicked = bool(imgui.invisible_button(f"tile {str(path)!a}", ImVec2(width, height)))
    hovered = imgui.is_item_hovered()
    said = thumbnail.reason or thumbnail.caption
    tooltip(said if said.startswith(str(path)) else f"{path}\n{said}".strip())
    brush = imgui.get_window_draw_list()
    if chosen or hovered:
        fill = theme.ACCENT_DEEP if chosen else theme.FIELD_HOVERED
        brush.add_rect_filled(corner, ImVec2(corner.x + width, corner.y + height), packed(fill), em() * 0.4)
    pad = _PAD * em()
    frame = Rect(corner.x + pad, corner.y + pad, width - 2 * pad, PICTURE_HEIGHT * em())
    _picture(frame, thumbnail)
    dead = bool(thumbnail.reason)
    y = frame.y + frame.height + 0.4 * em()
    name = elided(path.name or str(path), frame.width)
    brush.add_text(ImVec2(frame.x, y), packed(theme.TEXT_FAINT if dead else theme.TEXT), name)
    said = _beginning(_without_path(thumbnail.reason, path), frame.width) if dead else elided(thumbnail.caption, frame.width)
    brush.add_text(ImVec2(frame.x, y + 1.35 * em()), packed(theme.TEXT_FAINT if dead else theme.TEXT_SOFT), said)
    return clicked


def _picture(frame: Rect, thumbnail: Thumbnail) -> None:
    brush = imgui.get_window_draw_list()
    placed = thumbnail.placed
    if placed is None:
        end = ImVec2(frame.x + frame.width, frame.y + frame.height)
        brush.add_rect_filled(ImVec2(frame.x, frame.y), end, packed(theme.FIELD), em() * 0.25)
        sign = "" if not thumbnail.reason and not thumbnail.caption else "Cannot be opened" if thumbnail.reason else "Folder"
        room = imgui.calc_text_size(sign)
        middle = ImVec2(frame.x + (frame.width - room.x) / 2, frame.y + (frame.height - room.y) / 2)
        brush.add_text(middle, packed(theme.TEXT_FAINT), sign)
        return
    scale = min(frame.width / placed.width, frame.height / placed.height)
    width, height = round(placed.width * scale), round(placed.height * scale)
    x, y = round(frame.x + (frame.width - width) / 2), round(frame.y + (frame.height - height) / 2)
    texture = imgui.ImTextureRef(placed.texture)
    brush.add_image(texture, ImVec2(x, y), ImVec2(x + width, y + height), ImVec2(*placed.first), ImVec2(*placed.last))


def _beginning(words: str, width: float) -> str:
    """As many of the words as there is room for."""
    words = readable(words)
    kept = words.split()
    while len(kept) > 1 and imgui.calc_text_size(" ".join(kept) + " …").x > width:
        kept.pop()
    shown = " ".join(kept)
    return elided(shown if len(shown) == len(words) else f"{shown} …", width)


def _without_path(reason: str, path: Path) -> str:
    """The reason as it stands beside the name: the path it begins with left out."""
    return reason.removeprefix(str(path)).lstrip(": ") or reason
