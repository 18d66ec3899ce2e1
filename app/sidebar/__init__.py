"""The panel at the right: the light field, the viewpoint, and under four tabs all that can be done with them."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from app import theme
from app.commands import Context
from app.geometry import Rect
from app.readout import Readout
from app.sidebar import compare, export, focus, header, look, viewpoint
from app.state import Tab
from app.widgets import FIXED, em, tab, window

_TABS = {
    Tab.LOOK: ("look tab", look.draw),
    Tab.COMPARE: ("compare tab", compare.draw),
    Tab.FOCUS: ("focus tab", focus.draw),
    Tab.EXPORT: ("export tab", export.draw),
}


def draw(rect: Rect, context: Context, readout: Readout, fonts: theme.Fonts) -> None:
    """The whole panel."""
    with window("panel", rect, FIXED & ~imgui.WindowFlags_.no_scrollbar.value):
        header.draw(context, readout, fonts)
        if readout.grid is None:
            return
        viewpoint.draw(context, readout, fonts)
        _tabs(context, fonts)
        _TABS[context.state.tab][1](context, readout, fonts)


def _tabs(context: Context, fonts: theme.Fonts) -> None:
    gap = em() * 0.25
    imgui.dummy(ImVec2(0, em() * 0.1))
    width = (imgui.get_content_region_avail().x - gap * (len(_TABS) - 1)) / len(_TABS)
    for index, (each, (command, _)) in enumerate(_TABS.items()):
        if index:
            imgui.same_line(0, gap)
        tab(each.value, command, context.state.tab is each, context, width, fonts)
