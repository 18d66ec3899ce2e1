"""Tone of pictures, colours of maps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from app.commands.kinds import TONES, Command, Context, Needs, Run
from app.looking import Looking
from app.state import Look
from app.tone import STOPS_STEP, Curve


def _changed(change: Callable[[Looking], Looking]) -> Run:
    def run(context: Context) -> None:
        context.state.looking = change(context.state.looking)

    return run


def _exposed(stops: float) -> Run:
    return _changed(lambda looking: replace(looking, tone=looking.tone.exposed(stops)))


def _gamma(step: float) -> Run:
    """A larger or smaller gamma, which is then the curve."""
    return _changed(
        lambda looking: replace(
            looking, tone=replace(looking.tone, curve=Curve.GAMMA, gamma=looking.tone.gamma + step).bounded()
        )
    )


def _contrast(factor: float) -> Run:
    def run(context: Context) -> None:
        context.state.change_contrast(factor)

    return run


def _range_by_hand(context: Context) -> None:
    """The range goes on as it is, and is the hand's from now on; or by percentiles again."""
    state = context.state
    if state.looking.hand_range is not None:
        state.looking = replace(state.looking, hand_range=None)
    elif context.disparity_range is not None:
        state.looking = state.looking.with_range(*context.disparity_range)
        state.look = Look.DISPARITY


COMMANDS: dict[str, Command] = {
    "next tone": Command(
        ("G",),
        "The next tone: as stored, linear to sRGB, gamma, the authors'",
        TONES,
        _changed(lambda looking: replace(looking, tone=looking.tone.next_curve())),
    ),
    "tone": Command(("T",), "The authors' tone for dark captures, or as stored", TONES, _changed(Looking.brightened_or_not)),
    "expose more": Command(("X",), "Half a stop lighter", TONES, _exposed(STOPS_STEP)),
    "expose less": Command(("Shift+X",), "Half a stop darker", TONES, _exposed(-STOPS_STEP)),
    "colour map": Command(("L",), "The next colour map", TONES, _changed(Looking.next_colour_map), Needs.PICTURE),
    "hand range": Command(("Shift+L",), "Range of the disparity by hand, or by percentiles", TONES, _range_by_hand),
    "less contrast": Command((",",), "Less gain, or a wider range of the disparity", TONES, _contrast(0.5)),
    "more contrast": Command((".",), "More gain, or a narrower range of the disparity", TONES, _contrast(2.0)),
    "larger gamma": Command((), "A larger gamma", TONES, _gamma(0.1)),
    "smaller gamma": Command((), "A smaller gamma", TONES, _gamma(-0.1)),
}
