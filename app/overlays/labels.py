"""Over the picture: what is looked at, and why there may be nothing to see."""

from __future__ import annotations

from imgui_bundle import ImVec4, imgui

from app import theme
from app.commands import Context
from app.comparison import CAPTURED_VIEW, INSTANT, NO_CAPTURED_VIEW, Arrangement
from app.geometry import Rect
from app.overlays import comparison
from app.panes import Pane
from app.readout import Readout
from app.state import Look, Step, ViewState
from app.widgets import PASSIVE, button, capital, card, disparity_words, em, fitting_tag, tag, wrapped
from lfcore.lightfield import is_extrapolated

_LEAST_HALF = 14.0  # em, that a card asks for in the half of the picture that is missing


def notices(area: Rect, state: ViewState, readout: Readout) -> None:
    """Short labels at the top of the picture: what is looked at, and whether it is extrapolated."""
    labels: list[tuple[str, ImVec4]] = []
    if state.flipped:
        labels.append((capital(comparison.partner_name(state, readout)), theme.GOOD))
    elif state.comparison.arrangement is not Arrangement.ALONE:
        pass  # each picture has its own name
    elif readout.step is Step.CAPTURED:
        labels.append(("Captured view", theme.GOOD))
    elif state.look is not Look.SYNTHESIS:
        labels.append((capital(comparison.own_name(state, readout)), theme.TEXT))
    if state.look is Look.REFOCUS:
        labels.append((_focus_words(state, readout), theme.TEXT_SOFT))
    elif state.look.is_stereo:
        labels.append(("both eyes synthesized" if readout.focus.exact_eyes else "carried to both eyes", theme.TEXT_SOFT))
    tone = state.looking.tone.words()
    if tone and state.look.is_toned:
        labels.append((f"Tone: {tone}", theme.TEXT_SOFT))
    if is_extrapolated(state.u, state.v):
        labels.append(("Extrapolated", theme.WARNING))
    if state.captured and state.look is Look.SYNTHESIS and readout.captured_here is None:
        labels.append((NO_CAPTURED_VIEW, theme.TEXT_SOFT))
    if not labels or area.height < 6 * em():
        return
    x, end = area.x + em(), area.x + area.width
    for words, colour in labels:
        fitting = fitting_tag(words, end - x)
        if fitting is None:
            break
        tag(fitting[0], colour, x, area.y + em(), fitting[1])
        x += fitting[1] + em() * 0.5


def _focus_words(state: ViewState, readout: Readout) -> str:
    focus, columns = state.focusing.focus, readout.grid.columns if readout.grid is not None else 2
    summed = f"; {readout.focus.summed}" if readout.focus.summed else ""
    return f"at {disparity_words(focus, columns)}{summed}"


def missing(area: Rect, panes: tuple[Pane, ...], context: Context, readout: Readout) -> None:
    """Why the chosen look, or what the picture is compared with, has nothing to show, and what to do."""
    state, look = context.state, context.state.look
    if look is Look.ERROR and not readout.compared.there:
        _no_partner(area, context)
    elif len(panes) > 1 and not readout.compared.there and state.comparison.partner == CAPTURED_VIEW:
        half = panes[1].clip
        if half.width >= _LEAST_HALF * em():
            _no_partner(half, context)
        else:
            _no_partner(area, context, 1.0)
    elif look is Look.ERROR and state.comparison.difference.measured and not readout.compared.mapped:
        with card("missing", area, (0.5, 0.5), 24 * em(), PASSIVE):
            wrapped("Computing the map" if readout.step is Step.FULL else "The map is computed when the picture is finished")
    elif look.needs_disparity and not readout.has_disparity:
        with card("missing", area, (0.5, 0.5), 24 * em(), PASSIVE):
            wrapped("No disparity yet")
            why = "It comes with the first synthesis." if readout.busy else f"The model {readout.model} has given none."
            wrapped(why, theme.TEXT_SOFT)


def _no_partner(area: Rect, context: Context, low: float = 0.5) -> None:
    """Why there is nothing to compare the picture with, and the ways out. low: 0 at the top of the area, 1 at its bottom."""
    partner = context.state.comparison.partner
    if partner == CAPTURED_VIEW:
        with card("missing", area, (0.5, low), 24 * em()):
            wrapped(NO_CAPTURED_VIEW)
            why = "The camera's own views are the dots of the pad. Other partners have a picture of every viewpoint."
            wrapped(why, theme.TEXT_SOFT)
            button("Go to the nearest", "nearest", context)
            imgui.same_line()
            button("Another partner", "next partner", context)
        return
    with card("missing", area, (0.5, 0.5), 24 * em(), PASSIVE):
        wrapped("No disparity yet" if partner == INSTANT else f"No picture by {partner} yet")
        wrapped("It is synthesized when the hand rests.", theme.TEXT_SOFT)
