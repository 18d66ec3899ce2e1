"""Ways of looking at the viewpoint."""

from __future__ import annotations

from dataclasses import replace

from app.commands.kinds import LOOKING, Command, Context, Run, toggle
from app.state import Look
from app.tone import STOPS_STEP


def _look(look: Look) -> Run:
    def run(context: Context) -> None:
        context.state.look = look

    return run


def _contrast(factor: float) -> Run:
    def run(context: Context) -> None:
        context.state.change_contrast(factor)

    return run


def _brighten(context: Context) -> None:
    context.state.looking = context.state.looking.brightened_or_not()


def _next_tone(context: Context) -> None:
    looking = context.state.looking
    context.state.looking = replace(looking, tone=looking.tone.next_curve())


def _expose(stops: float) -> Run:
    def run(context: Context) -> None:
        looking = context.state.looking
        context.state.looking = replace(looking, tone=looking.tone.exposed(stops))

    return run


def _next_model(context: Context) -> None:
    if context.models:
        at = context.models.index(context.model) if context.model in context.models else -1
        context.state.model = context.models[(at + 1) % len(context.models)]


COMMANDS: dict[str, Command] = {
    "synthesis": Command(("1",), "The synthesis", LOOKING, _look(Look.SYNTHESIS)),
    "disparity": Command(("2",), "Its disparity, in colours", LOOKING, _look(Look.DISPARITY)),
    "error": Command(("3",), "The error against the captured view", LOOKING, _look(Look.ERROR)),
    "warped": Command(("4",), "The four warped inputs on one sheet", LOOKING, _look(Look.WARPED_ALL)),
    "top left": Command(("5",), "The top left input, warped", LOOKING, _look(Look.WARPED_TOP_LEFT)),
    "top right": Command(("6",), "The top right input, warped", LOOKING, _look(Look.WARPED_TOP_RIGHT)),
    "bottom left": Command(("7",), "The bottom left input, warped", LOOKING, _look(Look.WARPED_BOTTOM_LEFT)),
    "bottom right": Command(("8",), "The bottom right input, warped", LOOKING, _look(Look.WARPED_BOTTOM_RIGHT)),
    "captured": Command(("C",), "Show the camera's own view where the viewpoint falls on one", LOOKING, toggle("captured")),
    "tone": Command(("T",), "Brighten dark captures as the authors do: ^(1/1.5), saturation × 1.5", LOOKING, _brighten),
    "next tone": Command(("G",), "The next tone: as stored, linear to sRGB, gamma, the authors'", LOOKING, _next_tone),
    "expose more": Command(("X",), "Half a stop lighter", LOOKING, _expose(STOPS_STEP)),
    "expose less": Command(("Shift+X",), "Half a stop darker", LOOKING, _expose(-STOPS_STEP)),
    "less contrast": Command((",",), "Less gain of the error, wider range of the disparity", LOOKING, _contrast(0.5)),
    "more contrast": Command((".",), "More gain of the error, narrower range of the disparity", LOOKING, _contrast(2.0)),
    "model": Command(("M",), "The next model for a hand at rest", LOOKING, _next_model),
}
