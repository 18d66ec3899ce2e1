"""The interface over the view state, in imgui: no GL, no torch.

`draw` lays out one frame: it changes the ViewState by mouse and keys, and returns what the program is asked to do.
"""

from __future__ import annotations

from collections.abc import Callable

from imgui_bundle import imgui

from app import keyboard, overlays, picture, sidebar, statusbar, strips, theme
from app.commands import Context, Request
from app.geometry import Size
from app.layout import Layout, lay_out, with_strips
from app.panes import arrange
from app.readout import Readout
from app.sidebar import extras
from app.state import ViewState

_NO_PICTURE: Size = (1, 1)


def draw(
    state: ViewState,
    readout: Readout,
    window: tuple[float, float],
    scale: float,
    fonts: theme.Fonts,
    begin: Callable[[Layout], None],
) -> tuple[Layout, list[Request]]:
    """Draw everything but the picture itself, between imgui's new_frame and render.

    window: (width, height) in imgui's units. scale: content scale of text. begin: called with the layout as soon as the state
    knows what keys and the mouse on the picture have done in this frame, long before the panels are drawn; they may still
    change it. Returns the layout, in which the caller draws the picture, and the requests.
    """
    layout = lay_out(*window, scale, state.panel and (readout.grid is not None or bool(readout.captions)))
    if state.focusing.slices and readout.grid is not None and state.look.tiles == (1, 1):
        layout = with_strips(layout, scale)
    size = picture_size(readout, state)
    area = layout.picture
    panes = arrange(state, area)
    context = Context(
        state, readout.grid, size, panes[0].frame, readout.loading is not None, bool(readout.messages), len(readout.captions)
    )
    context.models, context.model, context.scale = readout.models, readout.model, scale
    context.disparity_range = readout.disparity_range
    keyboard.run_pressed(context)
    state.dragging = state.dragging and imgui.is_mouse_down(0)
    size = picture_size(readout, state)
    covered = state.path_field or state.help or state.desk.card is not None
    if readout.grid is not None:
        panes = arrange(state, area)
        picture.draw(area, panes, state, size, scale)
    elif readout.captions:
        picture.draw_still(area, state, size)
    begin(layout)
    if readout.grid is not None:
        overlays.pixels(panes, state, readout, size, scale)
        overlays.names(panes, state, readout)
        overlays.cross_hairs(panes, state, size)
        if layout.strips is not None:
            state.sliced = state.focusing.pin or state.cursor or state.sliced or (size[0] / 2, size[1] / 2)
            strips.draw(layout.strips, panes[0].frame, state, readout, panes[0].placement(state.zoom, size))
        overlays.wipe_handle(area, panes, state, readout)
        overlays.notices(area, state, readout)
        overlays.legend(area, state, readout)
        overlays.inspector(area, state, readout)
        if not covered:
            overlays.missing(area, panes, context, readout)
    elif readout.captions:
        overlays.legend(area, state, readout)
    elif readout.loading is None and not covered:
        overlays.start(area, context, readout.shelf, fonts)
    if layout.panel is not None:
        panel = extras if readout.captions else sidebar
        panel.draw(layout.panel, context, readout, fonts)
    no_room = state.panel and layout.panel is None and (readout.grid is not None or bool(readout.captions))
    statusbar.draw(layout.status, state, readout, panes[0].placement(state.zoom, size).scale, no_room)
    overlays.browser(area, context, readout.shelf, fonts)
    overlays.settings(area, context, readout, fonts)
    overlays.palette(area, context)
    overlays.loading(area, context, readout)
    overlays.path_field(area, context)
    overlays.key_page(area, context, fonts)
    overlays.messages(area, context, readout)
    return layout, context.requests


def picture_size(readout: Readout, state: ViewState) -> Size:
    """(width, height) in pixels of what is shown of the open light field or the Lytro file without raw."""
    if readout.captions:
        caption = readout.captions[state.exhibit]
        return caption.width, caption.height
    grid = readout.grid
    if grid is None:
        return _NO_PICTURE
    columns, rows = state.look.tiles
    return columns * grid.width, rows * grid.height
