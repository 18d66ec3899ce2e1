"""Ways of looking at the viewpoint."""

from __future__ import annotations

from app.commands.kinds import LOOKING, Command, Context, Run, toggle
from app.state import Look


def look_at(look: Look) -> Run:
    """What makes this the look."""

    def run(context: Context) -> None:
        context.state.look = look

    return run


def _next_model(context: Context) -> None:
    if context.models:
        at = context.models.index(context.model) if context.model in context.models else -1
        context.state.model = context.models[(at + 1) % len(context.models)]


COMMANDS: dict[str, Command] = {
    "synthesis": Command(("1",), "The synthesis", LOOKING, look_at(Look.SYNTHESIS)),
    "disparity": Command(("2",), "Its disparity, in colours", LOOKING, look_at(Look.DISPARITY)),
    "error": Command(("3",), "The difference from the captured view, or from another partner", LOOKING, look_at(Look.ERROR)),
    "captured": Command(("C",), "Show the camera's own view where the viewpoint falls on one", LOOKING, toggle("captured")),
    "inspector": Command(("V",), "Values of the pixel under the cursor", LOOKING, toggle("inspector")),
    "model": Command(("M",), "The next model for a hand at rest", LOOKING, _next_model),
}
