"""The tab Look: the ways of looking, the tone, the model, and what belongs to the look that is chosen."""

from __future__ import annotations

from dataclasses import replace

from imgui_bundle import ImVec2, imgui

from app import theme
from app.commands import Context
from app.looking import RANGE_LIMITS, level_limits
from app.readout import Readout
from app.state import GAIN_LIMITS, TAIL_LIMITS, Look
from app.tone import CURVE_MEANING, GAMMA_LIMITS, STOPS_LIMITS, Curve
from app.widgets import choice, em, heading, labelled, number, slider, switch, tile, tooltip, typed
from lfcore.colormaps import ColourMap
from lfcore.nearest_inputs import NEIGHBOURS

_TILES = (
    ("Synthesis", "synthesis", Look.SYNTHESIS),
    ("Disparity", "disparity", Look.DISPARITY),
    ("Difference", "error", Look.ERROR),
    ("Warped inputs", "warped", Look.WARPED_ALL),
    ("Top left", "top left", Look.WARPED_TOP_LEFT),
    ("Top right", "top right", Look.WARPED_TOP_RIGHT),
    ("Bottom left", "bottom left", Look.WARPED_BOTTOM_LEFT),
    ("Bottom right", "bottom right", Look.WARPED_BOTTOM_RIGHT),
    ("Leaning", "lean", Look.LEAN),
    ("Disagreement", "disagreement", Look.DISAGREEMENT),
    ("Sweep", "sweep mean", Look.SWEEP_MEAN),
    ("Deviation", "sweep deviation", Look.SWEEP_DEVIATION),
)
_LOGARITHMIC = imgui.SliderFlags_.logarithmic.value


def draw(context: Context, readout: Readout, fonts: theme.Fonts) -> None:
    """The whole tab. What changes with the look stands last, so that nothing jumps."""
    _looks(context)
    heading("Tone", fonts)
    _tone(context)
    _model(context, readout)
    _of_this_look(context, readout, fonts)


def _looks(context: Context) -> None:
    state = context.state
    gap = em() * 0.25
    half = (imgui.get_content_region_avail().x - gap) / 2
    imgui.push_style_var(imgui.StyleVar_.item_spacing, ImVec2(gap, gap))
    for index, (label, command, look) in enumerate(_TILES):
        if index % 2:
            imgui.same_line()
        tile(label, command, state.look is look, context, half)
    imgui.dummy(ImVec2(0, 0))
    tile("Captured view", "captured", state.captured, context, half)
    imgui.same_line()
    tile("Inspector", "inspector", state.inspector, context, half)
    imgui.pop_style_var()


def _tone(context: Context) -> None:
    state = context.state
    tone = state.looking.tone
    hint = f"{CURVE_MEANING[tone.curve]}  (G: the next one, T: the authors')"
    curve = Curve(choice("Curve", tone.curve.value, [each.value for each in Curve], hint))
    stops = slider(
        "Stops",
        tone.stops,
        STOPS_LIMITS,
        number(tone.stops, 1) if tone.stops <= 0 else f"+{tone.stops:.1f}",
        "Exposure in stops: each makes the picture twice as light, before the curve. Right click: 0.  (X and Shift+X)",
    )
    if imgui.is_item_clicked(1):
        stops = 0.0
    imgui.begin_disabled(curve is not Curve.GAMMA)
    hint = "Values are shown to the power of one over this."
    gamma = slider("Gamma", tone.gamma, GAMMA_LIMITS, number(tone.gamma, 2), hint)
    imgui.end_disabled()
    changed = replace(tone, curve=curve, stops=stops, gamma=gamma)
    if changed != tone:
        state.looking = replace(state.looking, tone=changed)


def _model(context: Context, readout: Readout) -> None:
    """Which model makes the picture for a hand at rest."""
    if readout.models:
        hint = f"The model that makes the picture when the hand rests; {NEIGHBOURS}: the small networks of realtime, from the "
        hint += "four captured views around the viewpoint in place of the corners.  (M: the next one)"
        chosen = choice("Model", readout.model, readout.models, hint)
        if chosen != readout.model:
            context.state.model = chosen


def _of_this_look(context: Context, readout: Readout, fonts: theme.Fonts) -> None:
    look = context.state.look
    if look is Look.DISPARITY:
        heading("Colours of the disparity", fonts)
        _colour_map(context)
        _range(context, readout)
    elif look.is_deviation:
        heading("Colours of the deviation", fonts)
        _colour_map(context)
        _gain(context, "The map goes up to white divided by this.  (, and .)")
    elif look is Look.ERROR:
        heading("Difference", fonts)
        _gain(context, "The difference is shown this many times as bright.  (, and .)")
    elif look is Look.LEAN and readout.weighed:
        heading("Weights", fonts)
        _gain(context, "Weights are raised to this power, so that small differences are seen.  (, and .)", "Contrast", "^")
    elif look is Look.SWEEP_MEAN:
        heading("Plane sweep", fonts)
    if look.is_sweep:
        _level(context)


def _gain(context: Context, hint: str, label: str = "Gain", sign: str = "×") -> None:
    state = context.state
    state.gain = slider(label, state.gain, GAIN_LIMITS, f"{sign} {state.gain:.1f}", hint, _LOGARITHMIC)


def _colour_map(context: Context) -> None:
    state = context.state
    before = state.looking.colour_map
    hint = "Colours from low to high. But for Turbo, lightness rises evenly.  (L: the next ones)"
    chosen = ColourMap(choice("Colours", before.value, [each.value for each in ColourMap], hint))
    if chosen is not before:
        state.looking = replace(state.looking, colour_map=chosen)


def _range(context: Context, readout: Readout) -> None:
    state = context.state
    hand_range = state.looking.hand_range
    if hand_range is None:
        hint = "So many per cent of the disparities at either end of the range share the last colour.  (, and .)"
        state.tail = slider("Cut off", state.tail, TAIL_LIMITS, f"{state.tail:.1f} %", hint)
    else:
        labelled("From, to")
        imgui.set_next_item_width(imgui.get_content_region_avail().x)
        changed, low, high = imgui.drag_float_range2("##range", *hand_range, 0.02, *RANGE_LIMITS, "%.2f", "%.2f")
        tooltip("Disparities of the first and the last colour, px over the baseline: drag, or Ctrl + click and type.")
        if changed:
            low, high = (typed(now, before, RANGE_LIMITS) for now, before in zip((low, high), hand_range, strict=True))
            state.looking = state.looking.with_range(low, high)
    imgui.begin_disabled(hand_range is None and readout.disparity_range is None)
    switch("Range by hand", "hand range", hand_range is not None, context)
    imgui.end_disabled()


def _level(context: Context) -> None:
    state = context.state
    before = state.looking.level
    hint = "Disparity by which the inputs are warped, px over the baseline; small is near.  (PgUp and PgDn)"
    level = slider("Level", before, level_limits(context.disparity_range), f"{number(before, 2)}", hint)
    if level != before:
        state.looking = replace(state.looking, level=level)
