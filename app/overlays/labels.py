"""Over the picture: what is looked at, and why there may be nothing to see."""

from __future__ import annotations

from imgui_bundle import ImVec4

from app import theme
from app.commands import Context
from app.comparison import CAPTURED_VIEW, INSTANT, Arrangement
from app.geometry import Rect
from app.overlays import comparison
from app.readout import Readout
from app.state import Look, Step, ViewState
from app.widgets import PASSIVE, button, card, em, fitting_tag, number, tag, wrapped
from lfcore.lightfield import is_extrapolated


def notices(area: Rect, state: ViewState, readout: Readout) -> None:
    """Short labels at the top of the picture: what is looked at, and whether it is extrapolated."""
    labels: list[tuple[str, ImVec4]] = []
    if state.flipped:
        labels.append((_capital(comparison.partner_name(state, readout)), theme.GOOD))
    elif state.comparison.arrangement is not Arrangement.ALONE:
        pass  # each picture has its own name
    elif readout.step is Step.CAPTURED:
        labels.append(("Captured view", theme.GOOD))
    elif state.look is not Look.SYNTHESIS:
        labels.append((_capital(comparison.own_name(state, readout)), theme.TEXT))
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
        labels.append(("No captured view here", theme.TEXT_SOFT))
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
    per_view = f"{number(focus / (columns - 1), 2)} per view"
    summed = f"; {readout.focus.summed}" if readout.focus.summed else ""
    return f"at {number(focus, 2)} px, {per_view}{summed}"


def _capital(words: str) -> str:
    return words[0].upper() + words[1:]


def missing(area: Rect, context: Context, readout: Readout) -> None:
    """Why the chosen look has nothing to show, and what to do."""
    look = context.state.look
    if look is Look.ERROR and not readout.compared.there:
        _no_partner(area, context)
    elif look is Look.ERROR and context.state.comparison.difference.measured and not readout.compared.mapped:
        with card("missing", area, (0.5, 0.5), 24 * em(), PASSIVE):
            wrapped("Computing the map" if readout.step is Step.FULL else "The map is computed when the picture is finished")
    elif look.needs_disparity and not readout.has_disparity:
        with card("missing", area, (0.5, 0.5), 24 * em(), PASSIVE):
            wrapped("No disparity yet")
            why = "It comes with the first synthesis." if readout.busy else f"The model {readout.model} has given none."
            wrapped(why, theme.TEXT_SOFT)


def _no_partner(area: Rect, context: Context) -> None:
    """Why there is no difference to see."""
    partner = context.state.comparison.partner
    if partner == CAPTURED_VIEW:
        with card("missing", area, (0.5, 0.5), 24 * em()):
            wrapped("No captured view at this viewpoint")
            wrapped("The error is measured against the camera's own views, which are the dots of the pad.", theme.TEXT_SOFT)
            button("Go to the nearest", "nearest", context)
        return
    with card("missing", area, (0.5, 0.5), 24 * em(), PASSIVE):
        wrapped("No disparity yet" if partner == INSTANT else f"No picture by {partner} yet")
        wrapped("It is synthesized when the hand rests.", theme.TEXT_SOFT)
