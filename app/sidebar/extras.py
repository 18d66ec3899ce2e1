"""The panel at the right for a Lytro file without raw: what it is, the focus of its refocus stack, the list of its pictures."""

from __future__ import annotations

from imgui_bundle import imgui

from app import theme
from app.commands import Context
from app.geometry import Rect
from app.readout import Caption, Readout
from app.sidebar.header import open_and_close
from app.state import ViewState
from app.widgets import button, column, elided, font, heading, number, panel, slider, text, tooltip, wrapped


def draw(rect: Rect, context: Context, readout: Readout, fonts: theme.Fonts) -> None:
    """The whole panel; the readout has at least one caption."""
    width = rect.width - 2 * imgui.get_style().window_padding.x
    with panel("extras panel", rect), column("file", width):
        _file(context, readout, fonts)
        stack = [caption.focus for caption in readout.captions if caption.focus is not None]  # the first captions are its
        if len(stack) > 1:
            _focus(context.state, stack, fonts)
        _list(context, readout, len(stack), fonts)


def focus_text(focus: float) -> str:
    """A focus in the cameras' own measure."""
    return f"{number(focus, 1)} λ"


def _file(context: Context, readout: Readout, fonts: theme.Fonts) -> None:
    with font(fonts.bold, theme.LARGE):
        text(elided(readout.name, imgui.get_content_region_avail().x))
    tooltip(readout.source)
    wrapped(readout.kind, theme.TEXT_SOFT)
    open_and_close(context, True)


def _focus(state: ViewState, stack: list[float], fonts: theme.Fonts) -> None:
    heading("Refocus stack", fonts)
    in_stack = state.exhibit < len(stack)
    before = stack[state.exhibit] if in_stack else 0.0
    hint = f"{len(stack)} pictures focused from near to far. 0 is where the lens was focused, negative is nearer.  (P and N)"
    after = slider("Focus", before, (stack[0], stack[-1]), focus_text(before) if in_stack else "", hint)
    if after != before:
        state.exhibit = min(range(len(stack)), key=lambda index: abs(stack[index] - after))


def _list(context: Context, readout: Readout, stacked: int, fonts: theme.Fonts) -> None:
    """A row for the stack, and one for each other picture and map; buttons to step through all of them."""
    heading("Pictures and maps", fonts)
    state = context.state
    if stacked:
        shown = state.exhibit if state.exhibit < stacked else stacked // 2
        if _row(f"{readout.captions[0].label}, {stacked}", readout.captions[shown], state.exhibit < stacked, 0):
            state.exhibit = shown
    for index, caption in enumerate(readout.captions):
        if index >= stacked and _row(caption.label, caption, index == state.exhibit, index):
            state.exhibit = index
    half = (imgui.get_content_region_avail().x - imgui.get_style().item_spacing.x) / 2
    button("Previous", "previous", context, half)
    imgui.same_line()
    button("Next", "next", context, half)


def _row(label: str, caption: Caption, selected: bool, index: int) -> bool:
    clicked, _ = imgui.selectable(f"{label}##{index}", selected)
    tooltip(f"{caption.width} × {caption.height} px")
    return bool(clicked)
