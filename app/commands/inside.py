"""Looking inside the synthesis: its warped inputs, and the plane sweep that its disparity is found by."""

from __future__ import annotations

from app.commands.kinds import INSIDE, Command, Context, Run
from app.commands.looking import look_at
from app.looking import level_limits
from app.state import Look


def _level(step: int) -> Run:
    """Another level of the sweep, which is then looked at."""

    def run(context: Context) -> None:
        state = context.state
        state.looking = state.looking.at_next_level(step, level_limits(context.disparity_range))
        if not state.look.is_sweep:
            state.look = Look.SWEEP_MEAN

    return run


COMMANDS: dict[str, Command] = {
    "warped": Command(("4",), "The four warped inputs on one sheet", INSIDE, look_at(Look.WARPED_ALL)),
    "top left": Command(("5",), "The top left input, warped", INSIDE, look_at(Look.WARPED_TOP_LEFT)),
    "top right": Command(("6",), "The top right input, warped", INSIDE, look_at(Look.WARPED_TOP_RIGHT)),
    "bottom left": Command(("7",), "The bottom left input, warped", INSIDE, look_at(Look.WARPED_BOTTOM_LEFT)),
    "bottom right": Command(("8",), "The bottom right input, warped", INSIDE, look_at(Look.WARPED_BOTTOM_RIGHT)),
    "lean": Command(("9",), "Which warped input the picture leans on, in four colours", INSIDE, look_at(Look.LEAN)),
    "disagreement": Command(("0",), "Where the warped inputs disagree: occlusions", INSIDE, look_at(Look.DISAGREEMENT)),
    "sweep mean": Command(
        ("Shift+9",), "The plane sweep: mean of the inputs at one disparity", INSIDE, look_at(Look.SWEEP_MEAN)
    ),
    "sweep deviation": Command(
        ("Shift+0",), "The plane sweep: their deviation, dark where they match", INSIDE, look_at(Look.SWEEP_DEVIATION)
    ),
    "level up": Command(("PgUp",), "The next level of the plane sweep, farther", INSIDE, _level(1)),
    "level down": Command(("PgDn",), "The level before, nearer", INSIDE, _level(-1)),
}
