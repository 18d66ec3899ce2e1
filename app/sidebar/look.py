"""The tab Look: the ways of looking, the model, the time that its stages took."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from app import theme
from app.commands import Context
from app.readout import Readout
from app.state import GAIN_LIMITS, TAIL_LIMITS, Look
from app.tone import Curve
from app.widgets import DASH, choice, em, heading, milliseconds, pairs, row, slider, switch, tile

_TILES = (
    ("Top left", "top left", Look.WARPED_TOP_LEFT),
    ("Top right", "top right", Look.WARPED_TOP_RIGHT),
    ("Bottom left", "bottom left", Look.WARPED_BOTTOM_LEFT),
    ("Bottom right", "bottom right", Look.WARPED_BOTTOM_RIGHT),
)


def draw(context: Context, readout: Readout, fonts: theme.Fonts) -> None:
    """The whole tab."""
    _looks(context, fonts)
    _model(context, readout)
    heading("Time of the synthesis", fonts)
    stages = [(name, milliseconds(1e3 * seconds)) for name, seconds in readout.timings if name != "total"]
    pairs("timings", stages or [(DASH, DASH)])


def _looks(context: Context, fonts: theme.Fonts) -> None:
    heading("Look at", fonts)
    state = context.state
    spacing = imgui.get_style().item_spacing
    imgui.push_style_var(imgui.StyleVar_.item_spacing, ImVec2(spacing.x, em() * 0.12))
    row("Synthesis", "synthesis", state.look is Look.SYNTHESIS, context)
    row("Disparity", "disparity", state.look is Look.DISPARITY, context)
    row("Error", "error", state.look is Look.ERROR, context)
    row("Warped inputs", "warped", state.look is Look.WARPED_ALL, context)
    imgui.pop_style_var()
    imgui.push_style_var(imgui.StyleVar_.item_spacing, ImVec2(em() * 0.25, em() * 0.25))
    half = (imgui.get_content_region_avail().x - em() * 0.25) / 2
    for index, (label, command, look) in enumerate(_TILES):
        if index % 2:
            imgui.same_line()
        tile(label, command, state.look is look, context, half)
    imgui.pop_style_var()
    imgui.dummy(ImVec2(0, em() * 0.1))
    switch("Captured view", "captured", state.captured, context)
    switch("Brighten", "tone", state.looking.tone.curve is Curve.AUTHORS, context)
    _contrast(context)


def _contrast(context: Context) -> None:
    """The slider that belongs to the look; its place stays empty where the look has none, so that nothing below jumps."""
    state = context.state
    if state.look is Look.ERROR:
        hint = "The error is shown this many times as bright.  (, and .)"
        logarithmic = imgui.SliderFlags_.logarithmic.value
        state.gain = slider("Gain", state.gain, GAIN_LIMITS, f"× {state.gain:.1f}", hint, logarithmic)
    elif state.look is Look.DISPARITY:
        hint = "So many per cent of the disparities at either end of the range share the last colour.  (, and .)"
        state.tail = slider("Cut off", state.tail, TAIL_LIMITS, f"{state.tail:.1f} %", hint)
    else:
        imgui.dummy(ImVec2(0, imgui.get_frame_height()))


def _model(context: Context, readout: Readout) -> None:
    """Which model makes the picture for a hand at rest."""
    if readout.models:
        hint = "The model that makes the picture when the hand rests.  (M: the next one)"
        chosen = choice("Model", readout.model, readout.models, hint)
        if chosen != readout.model:
            context.state.model = chosen
