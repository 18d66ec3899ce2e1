"""Over a picture that is magnified so much that single pixels are seen: a grid between them, and their values on them."""

from __future__ import annotations

import math

from imgui_bundle import ImVec2, imgui

from app import theme
from app.geometry import Placement, Rect, Size
from app.limits import within
from app.panes import Pane
from app.readout import Readout
from app.samples import Part, Patch
from app.state import ViewState
from app.widgets import packed

GRID_SCALE = 16.0  # window units a pixel from which on the grid is drawn
VALUE_SCALE = 32.0  # and the values
_LINES = 3  # a colour's values stand below each other
_SMALLEST, _LARGEST = 9.0, 15.0  # height of the digits, window units at scale 1

_GRID = theme.colour(0x808080, 0.45)
_ON_LIGHT, _ON_DARK = theme.colour(0x000000, 0.85), theme.colour(0xFFFFFF, 0.85)


def pixels(panes: tuple[Pane, ...], state: ViewState, readout: Readout, picture: Size, scale: float) -> None:
    """Grid and values, as far as there is room for them. scale: content scale of text."""
    brush = imgui.get_background_draw_list()
    for pane in panes:
        placement = pane.placement(state.zoom, picture)
        if placement.scale < GRID_SCALE * scale:
            return
        clip = pane.clip
        part = seen(placement, picture, clip)
        if part is None:
            continue
        brush.push_clip_rect(ImVec2(clip.x, clip.y), ImVec2(clip.x + clip.width, clip.y + clip.height), True)
        _grid(brush, placement, part)
        if placement.scale >= VALUE_SCALE * scale and not pane.partner and readout.samples is not None:
            span = readout.disparity_range or (0.0, 1.0)
            patch = readout.samples.patch(state.look, part, state.looking, state.gain, span)
            if patch is not None:
                _values(brush, placement, patch, scale)
        brush.pop_clip_rect()


def seen(placement: Placement, picture: Size, clip: Rect) -> Part | None:
    """The pixels of a picture that are seen, if only in part, inside the clip; None where there is none."""
    left, top = placement.to_picture((clip.x, clip.y))
    right, bottom = placement.to_picture((clip.x + clip.width, clip.y + clip.height))
    part = Part(
        max(math.floor(left), 0),
        max(math.floor(top), 0),
        min(math.ceil(right), picture[0]),
        min(math.ceil(bottom), picture[1]),
    )
    return part if part.left < part.right and part.top < part.bottom else None


def _grid(brush: imgui.ImDrawList, placement: Placement, part: Part) -> None:
    colour = packed(_GRID)
    left, top = placement.to_window((part.left, part.top))
    right, bottom = placement.to_window((part.right, part.bottom))
    for x in range(part.left, part.right + 1):
        at = round(placement.origin[0] + x * placement.scale)
        brush.add_rect_filled(ImVec2(at, top), ImVec2(at + 1, bottom), colour)
    for y in range(part.top, part.bottom + 1):
        at = round(placement.origin[1] + y * placement.scale)
        brush.add_rect_filled(ImVec2(left, at), ImVec2(right, at + 1), colour)


def _values(brush: imgui.ImDrawList, placement: Placement, patch: Patch, scale: float) -> None:
    rows = patch.values.shape[2]
    lines = max(rows, _LINES)
    if placement.scale < lines * _SMALLEST * scale:
        return
    size = within(placement.scale / (lines + 0.55), (_SMALLEST * scale, _LARGEST * scale))
    drop = (placement.scale - rows * size) / 2
    on_light, on_dark = packed(_ON_LIGHT), packed(_ON_DARK)
    face, indent = imgui.get_font(), placement.scale * 0.14
    step, (origin_x, origin_y) = placement.scale, placement.origin
    for x, y, words, light in patch.labels:
        at = ImVec2(origin_x + x * step + indent, origin_y + y * step + drop)
        brush.add_text(face, size, at, on_light if light else on_dark, words)
