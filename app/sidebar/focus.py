"""The tab Focus: refocusing, slices and stereo."""

from __future__ import annotations

from dataclasses import replace

from imgui_bundle import imgui

from app import theme
from app.commands import Context
from app.focusing import APERTURE_LIMITS, BASELINE_LIMITS, Choice
from app.readout import Readout
from app.state import Look
from app.widgets import button, capital, choice, font, heading, number, slider, switch, text, title

_STEREO = {
    Look.SYNTHESIS: "None",
    Look.ANAGLYPH: "Red and cyan glasses",
    Look.STEREO_PARALLEL: "Side by side",
    Look.STEREO_CROSSED: "For crossed eyes",
}
_CHOICES = tuple(each.value for each in Choice)


def draw(context: Context, readout: Readout, fonts: theme.Fonts) -> None:
    """The whole tab."""
    _refocus(context, readout, fonts)
    _slices(context, fonts)
    _stereo(context, readout, fonts)


def _refocus(context: Context, readout: Readout, fonts: theme.Fonts) -> None:
    title("Refocus", fonts)
    state = context.state
    switch("Refocus", "refocus", state.look is Look.REFOCUS, context)
    before = state.focusing
    hint = (
        "The disparity that is sharp, in px over the baseline; negative is nearer. Shift+click in the picture, or a click "
        "while refocusing, takes that of what is under it.  ([ and ])"
    )
    focus = slider("Focus", before.focus, readout.focus.limits, f"{number(before.focus, 2)} px", hint)
    if _moved(before.focus, focus):
        state.refocus_at(focus)
    hint = "Diameter of the aperture in baselines. 0 is a pinhole; at 1 it reaches the outermost views.  (Y and Shift+Y)"
    aperture = slider("Aperture", before.aperture, APERTURE_LIMITS, number(before.aperture, 2), hint)
    if _moved(before.aperture, aperture):
        state.focusing = replace(state.focusing, aperture=aperture)
        state.look = Look.REFOCUS
    hint = (
        "The views that are summed up. Captured: the camera's own. Synthesized: 9 × 9, carried from the newest synthesis by "
        "its disparity. Automatic: captured ones where they lie so close that what is out of focus is smooth.  (Shift+V)"
    )
    views = Choice(choice("Views", before.views.value, _CHOICES, hint, capital))
    if views is not before.views:
        state.focusing = replace(state.focusing, views=views)
    with font(fonts.regular, theme.SMALL):
        text(f"Sums up {readout.focus.summed}" if state.look is Look.REFOCUS and readout.focus.summed else "", theme.TEXT_FAINT)
    button("All in focus", "all in focus", context, imgui.get_content_region_avail().x)


def _slices(context: Context, fonts: theme.Fonts) -> None:
    heading("Epipolar slices", fonts)
    switch("Slices", "slices", context.state.focusing.slices, context)
    switch("Pinned", "pin", context.state.focusing.pin is not None, context)


def _stereo(context: Context, readout: Readout, fonts: theme.Fonts) -> None:
    heading("Stereo", fonts)
    state = context.state
    focusing = state.focusing
    before = state.look if state.look in _STEREO else Look.SYNTHESIS
    hint = "What the two eyes see is carried from the newest synthesis by its disparity.  (J: the next)"
    chosen = choice("Stereo", _STEREO[before], tuple(_STEREO.values()), hint)
    if chosen != _STEREO[before]:
        state.look = next(look for look, name in _STEREO.items() if name == chosen)
    hint = "Between the eyes, in baselines of the light field.  (Shift+J: the next)"
    baseline = slider("Baseline", focusing.baseline, BASELINE_LIMITS, number(focusing.baseline, 2), hint)
    hint = "The disparity that both eyes see at the same place, on the screen's own plane; px over the baseline.  ([ and ])"
    convergence = slider("Screen", focusing.convergence, readout.focus.limits, f"{number(focusing.convergence, 2)} px", hint)
    if _moved(focusing.baseline, baseline) or _moved(focusing.convergence, convergence):
        state.focusing = replace(state.focusing, baseline=baseline, convergence=convergence)


def _moved(before: float, after: float) -> bool:
    """Whether a slider has been moved: it gives what it was given in single precision."""
    return abs(after - before) > 1e-5 * max(abs(before), 1.0)
