"""Epipolar slices in the window: lines over them and over the picture, and the mouse that moves the viewpoint in them."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from app import theme
from app.focusing import place_in_slice, share_of_slice
from app.geometry import Placement, Point, Rect
from app.layout import Strips
from app.readout import Readout
from app.state import ViewState
from app.widgets import em, packed, tooltip, window

_HINTS = {
    "below": "The line of the picture through the cursor, seen from u = 0 (above) to 1 (below). Points slope by their "
    "disparity. Click or drag to move u.  (U)",
    "beside": "The column of the picture through the cursor, seen from v = 0 (left) to 1 (right). Points slope by their "
    "disparity. Click or drag to move v.  (U)",
}


def draw(strips: Strips, area: Rect, state: ViewState, readout: Readout, placement: Placement) -> None:
    """What lies over the strips and the picture, in the area and at the placement, between which they are shared."""
    _move(strips, state)
    through = state.sliced
    if through is None:
        return
    x, y = placement.to_window(through)
    brush = imgui.get_background_draw_list()
    _lines(brush, area, (x, y), pinned=state.focusing.pin is not None)
    below, beside = strips.below, strips.beside
    disparity = readout.focus.under
    for strip, at in ((below, state.u), (beside, state.v)):
        across = strip is below
        line = Rect(area.x, strip.y, area.width, strip.height) if across else Rect(strip.x, area.y, strip.width, area.height)
        brush.push_clip_rect(ImVec2(line.x, line.y), ImVec2(line.x + line.width, line.y + line.height), True)
        here = (strip.y + share_of_slice(at) * strip.height) if across else (strip.x + share_of_slice(at) * strip.width)
        start, end = ((line.x, here), (line.x + line.width, here)) if across else ((here, line.y), (here, line.y + line.height))
        brush.add_line(ImVec2(*start), ImVec2(*end), packed(theme.ACCENT), em() * 0.08)
        if disparity is not None:
            moved = [(place_in_slice(share) - at) * disparity * placement.scale for share in (0.0, 1.0)]
            if across:
                a, b = ImVec2(x + moved[0], strip.y), ImVec2(x + moved[1], strip.y + strip.height)
            else:
                a, b = ImVec2(strip.x, y + moved[0]), ImVec2(strip.x + strip.width, y + moved[1])
            brush.add_line(a, b, packed(theme.WARNING), em() * 0.1)
        _name("u" if across else "v", brush, ImVec2(line.x, line.y))
        brush.pop_clip_rect()


def _move(strips: Strips, state: ViewState) -> None:
    """A click or a drag in a slice goes to the u, or v, under the mouse."""
    for name, strip in (("below", strips.below), ("beside", strips.beside)):
        with window(f"slice {name}", strip, padding=ImVec2(0, 0)):
            imgui.invisible_button("slice", ImVec2(strip.width, strip.height))
            if imgui.is_item_active() or imgui.is_item_deactivated():
                mouse = imgui.get_mouse_pos()
                if name == "below":
                    state.drag_to(place_in_slice((mouse.y - strip.y) / strip.height), state.v)
                else:
                    state.drag_to(state.u, place_in_slice((mouse.x - strip.x) / strip.width))
            else:
                tooltip(_HINTS[name])


def _lines(brush: imgui.ImDrawList, area: Rect, point: Point, pinned: bool) -> None:
    """Where the picture is cut: faint lines through the point; a pinned point has a ring."""
    x, y = round(point[0]) + 0.5, round(point[1]) + 0.5
    brush.push_clip_rect(ImVec2(area.x, area.y), ImVec2(area.x + area.width, area.y + area.height), True)
    colour = imgui.get_color_u32((1.0, 1.0, 1.0, 0.35))
    brush.add_line(ImVec2(area.x, y), ImVec2(area.x + area.width, y), colour)
    brush.add_line(ImVec2(x, area.y), ImVec2(x, area.y + area.height), colour)
    if pinned:
        brush.add_circle(ImVec2(x, y), em() * 0.4, packed(theme.ACCENT), 0, em() * 0.12)
    brush.pop_clip_rect()


def _name(words: str, brush: imgui.ImDrawList, corner: ImVec2) -> None:
    """Along what the slice goes, in its corner."""
    size = imgui.calc_text_size(words)
    pad = em() * 0.3
    end = ImVec2(corner.x + size.x + 2 * pad, corner.y + size.y + pad)
    brush.add_rect_filled(corner, end, packed(theme.LABEL))
    brush.add_text(ImVec2(corner.x + pad, corner.y + pad / 2), packed(theme.TEXT), words)
