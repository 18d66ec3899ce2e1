"""The panel at the right: the light field, the viewpoint, and under four tabs all that can be done with them."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from app import theme
from app.commands import Context
from app.geometry import Rect
from app.readout import Readout
from app.sidebar import compare, export, focus, header, look, viewpoint
from app.state import Tab
from app.widgets import column, em, panel, tab

_TABS = {
    Tab.LOOK: ("look tab", look.draw),
    Tab.COMPARE: ("compare tab", compare.draw),
    Tab.FOCUS: ("focus tab", focus.draw),
    Tab.EXPORT: ("export tab", export.draw),
}
_LEAST = 10.0  # em: where there is less room below the tabs, all of the panel scrolls


def draw(rect: Rect, context: Context, readout: Readout, fonts: theme.Fonts) -> None:
    """The whole panel: below the tabs, each of which scrolls for itself, or all of it where that leaves too little room."""
    width = rect.width - 2 * imgui.get_style().window_padding.x
    with panel("panel", rect):
        with column("head", width):
            header.draw(context, readout, fonts)
            if readout.grid is not None:
                viewpoint.draw(context, readout, fonts)
                _tabs(context, fonts)
        if readout.grid is None:
            return
        if imgui.get_content_region_avail().y >= _LEAST * em():
            imgui.begin_child(f"tab {context.state.tab.name}", ImVec2(0, 0), 0, imgui.WindowFlags_.no_nav.value)
            _tab(context, readout, fonts, width)
            imgui.end_child()
        else:
            _begin_at_the_top(context.state.tab)
            _tab(context, readout, fonts, width)


def _tab(context: Context, readout: Readout, fonts: theme.Fonts, width: float) -> None:
    with column("tab", width):
        _TABS[context.state.tab][1](context, readout, fonts)


def _begin_at_the_top(chosen: Tab) -> None:
    """Where all of the panel scrolls, a tab that has just been chosen is seen from its beginning, below the tabs."""
    storage, name = imgui.get_state_storage(), imgui.get_id("tab that is shown")
    number = list(_TABS).index(chosen) + 1
    if storage.get_int(name) not in (0, number):
        tabs = imgui.get_cursor_pos_y() - imgui.get_frame_height_with_spacing()
        imgui.set_scroll_y(min(imgui.get_scroll_y(), tabs))
    storage.set_int(name, number)


def _tabs(context: Context, fonts: theme.Fonts) -> None:
    gap = em() * 0.25
    imgui.dummy(ImVec2(0, em() * 0.1))
    width = (imgui.get_content_region_avail().x - gap * (len(_TABS) - 1)) / len(_TABS)
    for index, (each, (command, _)) in enumerate(_TABS.items()):
        if index:
            imgui.same_line(0, gap)
        tab(each.value, command, context.state.tab is each, context, width, fonts)
