"""Over the pictures that are compared: their names, the wipe's handle, the cursor in each, the scale of a difference."""

from __future__ import annotations

import functools
from dataclasses import replace

from imgui_bundle import ImVec2, ImVec4, imgui

from app import theme
from app.comparison import BLOCK_RANGE, CAPTURED_VIEW, INSTANT, NO_CAPTURED_VIEW, Arrangement, Difference
from app.geometry import Rect, Size
from app.limits import within
from app.panes import Pane, handle
from app.readout import Readout, ScoreText
from app.state import Look, Step, ViewState
from app.widgets import FIXED, TAG_GAP, decibels, em, fitting_tag, number, packed, tag, ticks, tooltip, window
from lfcore import colormaps

_STEPS = 32
_REACH = 6.0  # window units to either side of the handle at which it can be taken


def names(panes: tuple[Pane, ...], state: ViewState, readout: Readout) -> None:
    """What each picture is, beside the line between them."""
    if len(panes) == 1:
        return
    own, partner = panes
    named = ((own_name(state, readout), own.clip, True), (partner_name(state, readout), partner.clip, False))
    for words, area, at_right in named:
        fitting = fitting_tag(words, area.width - em())
        if fitting is None or area.height < 6 * em():
            continue
        shown, width = fitting
        x = area.x + area.width - em() * 0.5 - width if at_right else area.x + em() * 0.5
        tag(shown, theme.TEXT, x, area.y + em(), width)


def own_name(state: ViewState, readout: Readout) -> str:
    """What the picture itself is."""
    if state.look is Look.ERROR:
        score = readout.compared.score if readout.compared.there else None
        return difference_name(state) + (f"{TAG_GAP}{score_words(score)}" if score is not None else "")
    if state.look is not Look.SYNTHESIS:
        return state.look.value
    if readout.step is Step.CAPTURED:
        return CAPTURED_VIEW
    return readout.model if readout.step is Step.FULL and readout.model else readout.step.value


def partner_name(state: ViewState, readout: Readout) -> str:
    """What the picture is compared with, and whether that is there."""
    partner, score = state.comparison.partner, readout.compared.score
    if readout.compared.there:
        of_what_is_shown = state.look is Look.SYNTHESIS and readout.step is not Step.CAPTURED
        return f"{partner}{TAG_GAP}{score_words(score)}" if score is not None and of_what_is_shown else partner
    if partner == CAPTURED_VIEW:
        return NO_CAPTURED_VIEW
    return f"{partner}: not yet" if partner != INSTANT else "no disparity yet"


def score_words(score: ScoreText) -> str:
    """How far two pictures are apart, and by which protocol."""
    return f"PSNR {decibels(score.psnr)}, SSIM {number(score.ssim, 4)}, {score.protocol.partition(':')[0]}"


def difference_name(state: ViewState) -> str:
    """What the picture of a difference shows."""
    comparison = state.comparison
    partner = f"the {CAPTURED_VIEW}" if comparison.partner == CAPTURED_VIEW else comparison.partner
    if comparison.difference.measured:
        return f"{comparison.difference.value} against {partner}"
    return f"difference from {partner}, {comparison.difference.value}"


def cross_hairs(panes: tuple[Pane, ...], state: ViewState, picture: Size) -> None:
    """The point under the mouse, in the pictures beside each other."""
    if state.cursor is None or state.comparison.arrangement is not Arrangement.SIDE_BY_SIDE or len(panes) == 1:
        return
    brush = imgui.get_background_draw_list()
    inner, outer = em() * 0.3, em() * 0.9
    for pane in panes:
        x, y = pane.placement(state.zoom, picture).to_window(state.cursor)
        brush.push_clip_rect(
            ImVec2(pane.clip.x, pane.clip.y),
            ImVec2(pane.clip.x + pane.clip.width, pane.clip.y + pane.clip.height),
            True,
        )
        for colour, thickness in ((ImVec4(0, 0, 0, 0.7), 3.0), (ImVec4(1, 1, 1, 0.9), 1.0)):
            for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1)):
                start, end = ImVec2(x + inner * dx, y + inner * dy), ImVec2(x + outer * dx, y + outer * dy)
                brush.add_line(start, end, packed(colour), thickness)
        brush.pop_clip_rect()


def wipe_handle(area: Rect, panes: tuple[Pane, ...], state: ViewState, readout: Readout) -> None:
    """The line between the two pictures, which the mouse can take; none where there is but one."""
    comparison = state.comparison
    if len(panes) == 1 or comparison.arrangement is not Arrangement.WIPE or not readout.compared.there:
        return
    reach = _REACH * em() / theme.FONT_SIZE
    x = handle(comparison, area)
    strip = Rect(x - reach, area.y, 2 * reach, area.height)
    with window("wipe", strip, FIXED & ~imgui.WindowFlags_.no_bring_to_front_on_focus.value, padding=ImVec2(0, 0)):
        imgui.invisible_button("handle", ImVec2(strip.width, strip.height))
        held, hovered = imgui.is_item_active(), imgui.is_item_hovered()
        if held or imgui.is_item_deactivated():
            share = (imgui.get_mouse_pos().x - area.x) / area.width
            state.comparison = replace(comparison, wipe=within(share, (0.0, 1.0)))
            x = handle(state.comparison, area)
        else:
            tooltip("Drag to wipe between the picture and its partner  (Shift+Left and Shift+Right)")
        if held or hovered:
            imgui.set_mouse_cursor(imgui.MouseCursor_.resize_ew)
        brush = imgui.get_window_draw_list()
        colour = packed(theme.ACCENT if held or hovered else ImVec4(1, 1, 1, 0.9))
        middle = area.y + area.height / 2
        brush.push_clip_rect(ImVec2(area.x, area.y), ImVec2(area.x + area.width, area.y + area.height), False)
        brush.add_line(ImVec2(x, area.y), ImVec2(x, area.y + area.height), packed(ImVec4(0, 0, 0, 0.5)), 3.0)
        brush.add_line(ImVec2(x, area.y), ImVec2(x, area.y + area.height), colour, 1.0)
        brush.add_circle_filled(ImVec2(x, middle), em() * 0.5, packed(theme.LABEL))
        brush.add_circle(ImVec2(x, middle), em() * 0.5, colour)
        brush.pop_clip_rect()


Scale = tuple[tuple[ImVec4, ...], list[tuple[str, tuple[str, str, str]]]]


def difference_scale(state: ViewState) -> Scale:
    """The colours of the difference that is looked at, from low to high, and rows of a unit with the values at both ends and
    in the middle."""
    difference, top = state.comparison.difference, 1 / state.gain
    black, grey, white = (theme.colour(code) for code in (0x000000, 0x808080, 0xFFFFFF))
    if difference is Difference.SIGNED:
        return (black, grey, white), [("of white", ticks(-top, top, 3)), ("of 255", ticks(-255 * top, 255 * top, 1))]
    if difference is Difference.SQUARED:
        roots = (number(0, 1), number(255 * top * 0.5**0.5, 1), number(255 * top, 1))
        return (black, white), [("of white, squared", ticks(0, top**2, 5)), ("of 255, the root", roots)]
    if difference is Difference.SIMILARITY:
        return _error_stops(), [("SSIM", ticks(1, 1 - top, 3))]
    if difference is Difference.BLOCKS:
        return _error_stops(), [("dB in 16 × 16 px", ticks(*BLOCK_RANGE, 0))]
    rows = [("of white", ticks(0, top, 3)), ("of 255", ticks(0, 255 * top, 1))]
    return (_error_stops(), rows) if difference is Difference.FALSE_COLOUR else ((black, white), rows)


@functools.cache
def _error_stops() -> tuple[ImVec4, ...]:
    table = colormaps.error_colours()  # (256, 3)
    places = [round(i * 255 / _STEPS) for i in range(_STEPS + 1)]
    colours = [[float(value) / 255 for value in table[place]] for place in places]
    return tuple(ImVec4(red, green, blue, 1.0) for red, green, blue in colours)
