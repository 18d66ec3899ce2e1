"""The (u, v) pad: captured views as dots, cached viewpoints as a trail, the viewpoint on screen as a ring."""

from __future__ import annotations

import functools

from imgui_bundle import ImVec2, ImVec4, imgui

from app import theme
from app.export_choices import KEY_FRAMES, drawn_path
from app.geometry import Point
from app.readout import Readout
from app.state import Grid, Tab, ViewState
from app.widgets import em, packed, tooltip
from lfcore.cache import rounded
from lfcore.lightfield import EXTRAPOLATION_LIMIT

_SPAN = 1 + 2 * EXTRAPOLATION_LIMIT
_DOT_SIDES = 8  # of hundreds of dots a few pixels wide, whose corners nobody sees


def draw(state: ViewState, readout: Readout, size: float) -> None:
    """The pad as a square of `size`; a click or a drag in it moves the viewpoint."""
    corner = imgui.get_cursor_screen_pos()
    imgui.invisible_button("viewpoint pad", ImVec2(size, size))
    mouse = imgui.get_mouse_pos()
    u = (mouse.x - corner.x) / size * _SPAN - EXTRAPOLATION_LIMIT
    v = (mouse.y - corner.y) / size * _SPAN - EXTRAPOLATION_LIMIT
    if imgui.is_item_active() or imgui.is_item_deactivated():  # what moved in the frame of the release counts
        state.drag_to(u, v)
    exporting = state.tab is Tab.EXPORT or state.export.playing
    if exporting and imgui.is_item_clicked(imgui.MouseButton_.right):
        state.export.add_or_remove_key_frame(u, v, state.focusing.focus)
    if exporting and not imgui.is_item_active():
        tooltip("Drag to move the viewpoint. Line: the path; a right click adds or removes a key frame.  (K, Shift+K)")
    elif not imgui.is_item_active():
        tooltip(
            "Click or drag to move the viewpoint. Dots: captured views, the larger ones the inputs. Blue: what is in memory; "
            "rim: extrapolated.  (Arrows)"
        )

    def at(point: Point) -> ImVec2:
        return ImVec2(
            corner.x + (point[0] + EXTRAPOLATION_LIMIT) / _SPAN * size,
            corner.y + (point[1] + EXTRAPOLATION_LIMIT) / _SPAN * size,
        )

    brush = imgui.get_window_draw_list()
    rounding = imgui.get_style().frame_rounding
    brush.push_clip_rect(corner, ImVec2(corner.x + size, corner.y + size), True)
    brush.add_rect_filled(corner, ImVec2(corner.x + size, corner.y + size), packed(theme.BACKGROUND), rounding)
    brush.add_rect_filled(at((0, 0)), at((1, 1)), packed(theme.FIELD), rounding / 2)
    brush.add_rect(at((0, 0)), at((1, 1)), packed(theme.FIELD_ACTIVE), rounding / 2)
    here = at((state.u, state.v))
    brush.add_line(ImVec2(here.x, corner.y), ImVec2(here.x, corner.y + size), packed(theme.LINE))
    brush.add_line(ImVec2(corner.x, here.y), ImVec2(corner.x + size, here.y), packed(theme.LINE))
    for point in readout.cached:
        brush.add_circle_filled(at(point), em() * 0.17, packed(theme.ACCENT_DEEP), _DOT_SIDES)
    grid = readout.grid
    if grid is not None:
        radius = min(em() * 0.14, size / _SPAN / max(grid.rows, grid.columns) * 0.25)
        for index, colour in enumerate(dot_colours(grid, readout.cached, readout.inputs)):
            given = divmod(index, grid.columns) in readout.inputs
            brush.add_circle_filled(at(grid.position(index)), (1.7 if given else 1.0) * radius, packed(colour), _DOT_SIDES)
    if exporting:
        for stop in drawn_path(state.export):
            brush.path_line_to(at((stop.u, stop.v)))
        brush.path_stroke(packed(theme.ACCENT), em() * 0.12)
        if state.export.shape == KEY_FRAMES:
            for key in state.export.key_frames:
                brush.add_circle_filled(at((key.u, key.v)), em() * 0.22, packed(theme.WARNING))
    on_captured = readout.captured_here is not None
    brush.add_circle_filled(here, em() * 0.3, packed(theme.ACCENT))
    brush.add_circle(here, em() * 0.3, packed(theme.TEXT if on_captured else theme.BACKGROUND), 0, em() * 0.1)
    brush.pop_clip_rect()


@functools.lru_cache(maxsize=2)  # in most frames all is as in the one before
def dot_colours(grid: Grid, cached: tuple[Point, ...], inputs: frozenset[tuple[int, int]]) -> tuple[ImVec4, ...]:
    """Of the captured views, of which those at `cached` viewpoints are in memory, and those in the rows and columns of `inputs`
    are given to the model."""
    kept = frozenset(cached)
    places = (divmod(index, grid.columns) for index in range(grid.rows * grid.columns))
    return tuple(
        _colour(place in grid.dark, rounded(*grid.position(index)) in kept, place in inputs)
        for index, place in enumerate(places)
    )


def _colour(dark: bool, kept: bool, given: bool) -> ImVec4:
    if dark:
        return theme.FIELD_ACTIVE
    if kept:
        return theme.ACCENT
    return theme.TEXT if given else theme.TEXT_SOFT
