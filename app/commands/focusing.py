"""What light fields are for: refocusing, slices, stereo."""

from __future__ import annotations

from dataclasses import replace

from app.commands.kinds import FOCUSING, Command, Context, Run
from app.focusing import BASELINES, FOCUS_STEP, Choice
from app.state import Look

_STEREO = (Look.ANAGLYPH, Look.STEREO_PARALLEL, Look.STEREO_CROSSED)  # in the order of the key


def _refocus(context: Context) -> None:
    state = context.state
    state.look = Look.SYNTHESIS if state.look is Look.REFOCUS else Look.REFOCUS


def _all_in_focus(context: Context) -> None:
    context.state.look = Look.SYNTHESIS


def _focus(step: float) -> Run:
    """Another focus, which is then looked at; of a stereo pair, another disparity that both eyes see at the same place."""

    def run(context: Context) -> None:
        state = context.state
        focusing = state.focusing
        if state.look in _STEREO:
            state.focusing = replace(focusing, convergence=focusing.convergence + step).bounded()
        else:
            state.refocus_at(focusing.focus + step)

    return run


def _aperture(steps: int) -> Run:
    def run(context: Context) -> None:
        state = context.state
        state.focusing = state.focusing.with_aperture_scaled(steps)
        state.look = Look.REFOCUS

    return run


def _views(context: Context) -> None:
    """The next choice of views to be summed up, or sliced."""
    state = context.state
    choices = list(Choice)
    following = choices[(choices.index(state.focusing.views) + 1) % len(choices)]
    state.focusing = replace(state.focusing, views=following)


def _slices(context: Context) -> None:
    state = context.state
    state.focusing = replace(state.focusing, slices=not state.focusing.slices)


def _pin(context: Context) -> None:
    """Pin slices where the cursor is, which are then shown, or let them follow it again."""
    state = context.state
    middle = (context.picture[0] / 2, context.picture[1] / 2)
    pin = None if state.focusing.pin is not None else state.cursor or middle
    state.focusing = replace(state.focusing, pin=pin, slices=state.focusing.slices or pin is not None)


def _stereo(context: Context) -> None:
    """The next kind of stereo; after the last the synthesis again."""
    state = context.state
    kinds = (*_STEREO, Look.SYNTHESIS)
    state.look = kinds[(kinds.index(state.look) + 1) % len(kinds)] if state.look in _STEREO else _STEREO[0]


def _baseline(context: Context) -> None:
    state = context.state
    wider = next((each for each in BASELINES if each > state.focusing.baseline + 1e-6), BASELINES[0])
    state.focusing = replace(state.focusing, baseline=wider)


COMMANDS: dict[str, Command] = {
    "refocus": Command(("O",), "Refocus: then a click focuses what is under it", FOCUSING, _refocus),
    "all in focus": Command(("Shift+O",), "All in focus: the synthesis itself", FOCUSING, _all_in_focus),
    "nearer": Command(("[",), "Focus, or let stereo converge, nearer", FOCUSING, _focus(-FOCUS_STEP)),
    "farther": Command(("]",), "Focus, or let stereo converge, farther", FOCUSING, _focus(FOCUS_STEP)),
    "smaller aperture": Command(("Y",), "A smaller aperture: more is sharp", FOCUSING, _aperture(-1)),
    "larger aperture": Command(("Shift+Y",), "A larger aperture: less is sharp", FOCUSING, _aperture(1)),
    "views": Command(("Shift+V",), "Sum up, and slice, other views: captured, synthesized, automatic", FOCUSING, _views),
    "slices": Command(("U",), "Epipolar slices through the cursor, below and beside the picture", FOCUSING, _slices),
    "pin": Command(("Shift+U",), "Pin the slices where the cursor is, or let them follow it", FOCUSING, _pin),
    "stereo": Command(("J",), "Stereo: red and cyan, side by side, crossed, none", FOCUSING, _stereo),
    "baseline": Command(("Shift+J",), "Stereo: the next distance between the eyes", FOCUSING, _baseline),
}
