"""The mouse in the picture: dragging moves the viewpoint or the picture, the wheel zooms."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from app.geometry import Point, Rect, Size, Zoom, fit_scale, pan_by, place, zoom_about
from app.panes import Pane, under
from app.state import Look, ViewState
from app.widgets import FIXED, window

# Window units (at scale 1) of a drag from corner view to corner view.
DRAG_SPAN = 360.0
WHEEL_STEP = 1.2
CLICK_REACH = 3.0  # window units that the mouse may move between press and release of a click


def draw(area: Rect, panes: tuple[Pane, ...], state: ViewState, picture: Size, scale: float) -> None:
    """The invisible window over the pictures that takes the mouse; it acts on the one under it, and so on all of them."""
    delta, hovered = _mouse_in(area)
    mouse = imgui.get_mouse_pos()
    area = under(panes, (mouse.x, mouse.y)).frame
    if delta is not None:
        _drag(state, delta, picture, area, scale)
    _hover(state, picture, area, hovered)
    columns, rows = state.look.tiles
    if state.cursor is not None:
        column, x = divmod(state.cursor[0], picture[0] / columns)
        row, y = divmod(state.cursor[1], picture[1] / rows)
        state.cursor, state.tile = (x, y), (int(column), int(row))
    if delta is not None:
        _pick(state)


def draw_still(area: Rect, state: ViewState, picture: Size) -> None:
    """The same over a picture without other viewpoints: every drag moves the picture."""
    delta, hovered = _mouse_in(area)
    if delta is not None and delta != (0.0, 0.0):
        state.zoom = pan_by(state.zoom, delta, picture, area)
    _hover(state, picture, area, hovered)


def _mouse_in(area: Rect) -> tuple[Point | None, bool]:
    """By how much a drag has gone in this frame, None where there is no drag; and whether the mouse is over the area."""
    flags = FIXED | imgui.WindowFlags_.no_scroll_with_mouse.value
    with window("picture", area, flags, padding=ImVec2(0, 0)):
        buttons = (
            imgui.ButtonFlags_.mouse_button_left.value
            | imgui.ButtonFlags_.mouse_button_right.value
            | imgui.ButtonFlags_.mouse_button_middle.value
        )
        imgui.invisible_button("canvas", ImVec2(area.width, area.height), buttons)
        hovered = imgui.is_item_hovered()
        # What imgui takes in one frame ends with at most one press or release: in the frame of a press the movement came
        # before it and is not yet the drag's, in the frame of a release it still is.
        held = imgui.is_item_active() or imgui.is_item_deactivated()
        pressed = imgui.is_item_activated()
    io = imgui.get_io()
    if not held:
        return None, hovered
    return ((0.0, 0.0) if pressed else (io.mouse_delta.x, io.mouse_delta.y)), hovered


def _hover(state: ViewState, picture: Size, area: Rect, hovered: bool) -> None:
    """The wheel zooms, a double click fits or goes to 1:1; the pixel under the mouse is noted."""
    io = imgui.get_io()
    mouse = (io.mouse_pos.x, io.mouse_pos.y)
    if hovered and imgui.is_mouse_double_clicked(0):
        fitted = state.zoom.scale is None
        factor = 1 / fit_scale(picture, area)
        state.zoom = zoom_about(state.zoom, factor, mouse, picture, area) if fitted else Zoom()
    if hovered and io.mouse_wheel:
        state.zoom = zoom_about(state.zoom, WHEEL_STEP**io.mouse_wheel, mouse, picture, area)
    state.cursor = _under(mouse, state, picture, area) if hovered else None


def _drag(state: ViewState, delta: tuple[float, float], picture: Size, area: Rect, scale: float) -> None:
    turns = imgui.is_mouse_down(0) or imgui.is_mouse_released(0)
    if turns and imgui.get_io().key_shift:
        return  # it focuses
    if not turns or imgui.is_key_down(imgui.Key.space):
        if delta != (0.0, 0.0):
            state.zoom = pan_by(state.zoom, delta, picture, area)
        return
    # u is the camera's own position to the right, so to turn the scene to the right the camera goes to the left.
    state.drag_by(-delta[0] / (DRAG_SPAN * scale), -delta[1] / (DRAG_SPAN * scale))


def _pick(state: ViewState) -> None:
    """Focus on what is under the mouse: while it is pressed with Shift, or at a click while refocusing."""
    if imgui.get_io().key_shift and imgui.is_mouse_down(0):
        state.pick = state.cursor
        return
    moved = imgui.get_mouse_drag_delta(0, 0.0)
    if state.look is Look.REFOCUS and imgui.is_mouse_released(0) and max(abs(moved.x), abs(moved.y)) <= CLICK_REACH:
        state.pick = state.cursor


def _under(mouse: tuple[float, float], state: ViewState, picture: Size, area: Rect) -> tuple[float, float] | None:
    """The pixel of the picture under the mouse, or None beside it."""
    x, y = place(state.zoom, picture, area).to_picture(mouse)
    if not (0 <= x < picture[0] and 0 <= y < picture[1]):
        return None
    return x, y
