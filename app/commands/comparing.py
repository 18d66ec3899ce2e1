"""The picture against its partner: the camera's own view, another model, another step."""

from __future__ import annotations

from dataclasses import replace

from app.commands.kinds import COMPARING, Command, Context, Run, toggle
from app.comparison import WIPE_STEP, Arrangement, Difference, partners
from app.limits import within
from app.scoring import RULES
from app.state import Look, Tab


def _flip_back(context: Context) -> None:
    context.state.flipped = False


def _arrange(arrangement: Arrangement) -> Run:
    def run(context: Context) -> None:
        comparison = context.state.comparison
        wanted = Arrangement.ALONE if comparison.arrangement is arrangement else arrangement
        context.state.comparison = replace(comparison, arrangement=wanted)

    return run


def _wipe(step: float) -> Run:
    def run(context: Context) -> None:
        comparison = context.state.comparison
        if comparison.arrangement is Arrangement.WIPE:
            context.state.comparison = replace(comparison, wipe=within(comparison.wipe + step, (0.0, 1.0)))

    return run


def _partner(step: int) -> Run:
    def run(context: Context) -> None:
        comparison = context.state.comparison
        offered = partners(context.models, context.model)
        at = offered.index(comparison.partner) if comparison.partner in offered else -1
        context.state.comparison = replace(comparison, partner=offered[(at + step) % len(offered)])

    return run


def _next_difference(context: Context) -> None:
    """The first time it shows the difference, then goes on to the next kind."""
    state = context.state
    if state.look is not Look.ERROR:
        state.look = Look.ERROR
        return
    kinds = list(Difference)
    following = kinds[(kinds.index(state.comparison.difference) + 1) % len(kinds)]
    state.comparison = replace(state.comparison, difference=following)


def _score_all(context: Context) -> None:
    state = context.state
    state.score_all = not state.score_all
    if state.score_all:
        state.tab, state.panel = Tab.COMPARE, True


def _rule(rule: str) -> Run:
    def run(context: Context) -> None:
        context.state.comparison = replace(context.state.comparison, rule=rule)
        context.state.tab, context.state.panel = Tab.COMPARE, True

    return run


COMMANDS: dict[str, Command] = {
    "flip": Command(
        ("R",), "Hold to see the partner in place of the picture", COMPARING, toggle("flipped"), released=_flip_back
    ),
    "wipe": Command(("W",), "Wipe between the picture and its partner", COMPARING, _arrange(Arrangement.WIPE)),
    "wipe left": Command(("Shift+Left",), "Move the wipe's handle to the left", COMPARING, _wipe(-WIPE_STEP)),
    "wipe right": Command(("Shift+Right",), "Move the wipe's handle to the right", COMPARING, _wipe(WIPE_STEP)),
    "side by side": Command(
        ("D",), "The picture and its partner side by side, magnified alike", COMPARING, _arrange(Arrangement.SIDE_BY_SIDE)
    ),
    "next partner": Command(("Q",), "The next partner: captured view, instant, other models", COMPARING, _partner(1)),
    "previous partner": Command(("Shift+Q",), "The partner before", COMPARING, _partner(-1)),
    "difference": Command(
        ("E",), "The difference from the partner; again: absolute, signed, squared, ...", COMPARING, _next_difference
    ),
    "score all": Command(("H",), "Score all captured views while the hand rests, or not", COMPARING, _score_all),
    **{f"scores by {rule}": Command((), f"Scores by {rule}", COMPARING, _rule(rule)) for rule in RULES},
}
