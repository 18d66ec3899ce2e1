"""The line at the bottom: which step is on screen and how long it took, the cache, the viewpoint, what is under the cursor."""

from __future__ import annotations

from dataclasses import dataclass

from imgui_bundle import ImVec2, ImVec4, imgui

from app import theme
from app.geometry import Rect
from app.readout import Readout
from app.sidebar.extras import focus_text
from app.state import STEP_MEANING, Step, ViewState
from app.widgets import counted, disparity_words, em, milliseconds, number, packed, text, tooltip, window

STEP_COLOURS = {
    Step.BLEND: theme.TEXT_FAINT,
    Step.INSTANT: theme.WARNING,
    Step.REALTIME: theme.REALTIME,
    Step.FULL: theme.ACCENT,
    Step.CAPTURED: theme.GOOD,
}


@dataclass(frozen=True)
class _Part:
    words: str
    hint: str
    colour: ImVec4 = theme.TEXT_SOFT


def draw(rect: Rect, state: ViewState, readout: Readout, zoom: float, no_room: bool) -> None:
    """The line; parts that find no room are left out, the least important first. no_room: for the panel, which is wanted."""
    pad = em() * 0.8
    with window("status", rect, padding=ImVec2(pad, 0)):
        y = (rect.height - em()) / 2
        imgui.set_cursor_pos(ImVec2(pad, y))
        right = rect.width - pad
        if readout.grid is None and not readout.captions:
            text(_idle_words(readout), theme.TEXT_SOFT)
            return
        left = _exhibit(state, readout, pad, y) if readout.captions else _step(readout, pad, y)
        gap = em() * 1.6
        for part in reversed(_right_parts(state, readout, zoom)):
            width = imgui.calc_text_size(part.words).x
            if right - width < left + gap:
                break
            right -= width
            _put(part, right, y)
            right -= gap
        for part in _left_parts(state, readout, no_room):
            width = imgui.calc_text_size(part.words).x
            if left + gap + width > right:
                break
            _put(part, left + gap, y)
            left += gap + width


def _idle_words(readout: Readout) -> str:
    return "Opening" if readout.loading is not None else "Nothing is open"


def _step(readout: Readout, x: float, y: float) -> float:
    """The step on screen with its dot; returns where it ends."""
    step = readout.step
    words = step.value
    if step is Step.FULL and readout.model:
        words = readout.model  # the step of a hand at rest has its model's name
    if readout.step_ms is not None:
        words += f"  {milliseconds(readout.step_ms)}"
    if readout.from_cache:
        words += " (kept)"
    corner = imgui.get_window_pos()
    radius = em() * 0.28
    middle = ImVec2(corner.x + x + radius, corner.y + y + em() / 2)
    imgui.get_window_draw_list().add_circle_filled(middle, radius, packed(STEP_COLOURS[step]))
    start = x + 2 * radius + em() * 0.5
    stages = ", ".join(f"{name} {milliseconds(1e3 * seconds)}" for name, seconds in readout.timings if name != "total")
    hint = f"The step on screen: {STEP_MEANING[step]}." + (f"  Newest synthesis: {stages}." if stages else "")
    if readout.from_cache:
        hint += "  It was kept, in memory or on disk; the time is what it took when it was made."
    _put(_Part(words, hint, theme.TEXT), start, y)
    return start + imgui.calc_text_size(words).x


def _exhibit(state: ViewState, readout: Readout, x: float, y: float) -> float:
    """Which picture or map of a file is on screen; returns where it ends."""
    caption = readout.captions[state.exhibit]
    words = f"{caption.label}  {state.exhibit + 1} of {len(readout.captions)}"
    if caption.focus is not None:
        words += f"  focus {focus_text(caption.focus)}"
    _put(_Part(words, "What is on screen of this file", theme.TEXT), x, y)
    return x + imgui.calc_text_size(words).x


def _left_parts(state: ViewState, readout: Readout, no_room: bool) -> list[_Part]:
    parts = []
    if no_room:
        hint = "The panel with its tabs appears in a window that is wider, or higher; all commands are found by Ctrl+P"
        parts.append(_Part("no room for the panel", hint))
    if readout.exporting:
        parts.append(_Part(readout.exporting, "What is being exported, or has just been; see the tab Export  (Ctrl+E)"))
    if readout.captions:
        return parts
    if readout.busy:
        parts.append(_Part(readout.busy, "What the synthesis thread is doing now"))
    parts.append(_Part(f"model {readout.model}", "The model that synthesizes when the hand rests"))
    used, limit = readout.cache_bytes / 2**20, readout.cache_limit / 2**20
    held = f"{counted(len(readout.cached), 'view')}, {counted(readout.cache_hits, 'hit')}"
    ahead = "" if state.foresight else ", none ahead"
    more = "are computed ahead" if state.foresight else "are not computed ahead"
    parts.append(
        _Part(
            f"memory {used:.0f} of {limit:.0f} MiB: {held}{ahead}",
            f"Views in memory are shown at once, which is a hit; while nothing else is to be done, more {more}  (A)",
        )
    )
    return parts


def _right_parts(state: ViewState, readout: Readout, zoom: float) -> list[_Part]:
    parts = []
    if state.cursor is not None:
        x, y = int(state.cursor[0]), int(state.cursor[1])
        words = f"x {x}  y {y}"
        if readout.disparity_under_cursor is not None and readout.grid is not None:
            words += f"  D {disparity_words(readout.disparity_under_cursor, readout.grid.columns)}"
        hint = "Pixel under the cursor, and its disparity: over the baseline, and per captured view"
        if readout.captions:
            hint = "Pixel under the cursor, and its value in a map"
            if readout.value_under_cursor is not None:
                words += f"  {number(readout.value_under_cursor, 2)}"
        parts.append(_Part(words, hint))
    parts.append(_Part(f"{100 * zoom:.0f} %", "Screen pixels per picture pixel"))
    if readout.captions:
        return parts
    parts.append(_Part(f"(u, v)  {number(state.u, 3)}  {number(state.v, 3)}", "The viewpoint; corner views at 0 and 1"))
    return parts


def _put(part: _Part, x: float, y: float) -> None:
    imgui.set_cursor_pos(ImVec2(x, y))
    text(part.words, part.colour)
    tooltip(part.hint)
