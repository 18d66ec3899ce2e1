"""The viewpoint."""

from __future__ import annotations

from app.commands.kinds import MOVING, Command, Context, Needs, Run, toggle

NUDGE = 0.02  # of the baseline, by an arrow key


def _nudge(du: float, dv: float) -> Run:
    def run(context: Context) -> None:
        context.state.move_to(context.state.u + du, context.state.v + dv)

    return run


def _step(step: int) -> Run:
    def run(context: Context) -> None:
        if context.grid is not None:
            state = context.state
            state.move_to(*context.grid.position(context.grid.stepped(state.u, state.v, step)))
        elif context.exhibits:
            context.state.exhibit = (context.state.exhibit + step) % context.exhibits

    return run


def _end(index: int) -> Run:
    """To the first (0) or the last (-1) of the captured views, or of a file's pictures."""

    def run(context: Context) -> None:
        grid = context.grid
        if grid is not None:
            context.state.move_to(*grid.position(index % (grid.rows * grid.columns)))
        elif context.exhibits:
            context.state.exhibit = index % context.exhibits

    return run


def _centre(context: Context) -> None:
    context.state.move_to(0.5, 0.5)


COMMANDS: dict[str, Command] = {
    "left": Command(("Left",), "Move the viewpoint to the left", MOVING, _nudge(-NUDGE, 0)),
    "right": Command(("Right",), "Move the viewpoint to the right", MOVING, _nudge(NUDGE, 0)),
    "up": Command(("Up",), "Move the viewpoint up", MOVING, _nudge(0, -NUDGE)),
    "down": Command(("Down",), "Move the viewpoint down", MOVING, _nudge(0, NUDGE)),
    "previous": Command(("P",), "Go to the previous captured view, or picture of a file", MOVING, _step(-1), Needs.PICTURE),
    "next": Command(("N",), "Go to the next captured view, or picture of a file", MOVING, _step(1), Needs.PICTURE),
    "first": Command(("Shift+Home",), "Go to the first captured view, or picture of a file", MOVING, _end(0), Needs.PICTURE),
    "last": Command(("End",), "Go to the last captured view, or picture of a file", MOVING, _end(-1), Needs.PICTURE),
    "nearest": Command(("S",), "Snap to the nearest captured view", MOVING, _step(0)),
    "centre": Command(("Home",), "Go to the centre", MOVING, _centre),
    "sway": Command(("B",), "Let the viewpoint sway by itself; a drag or a key stops it", MOVING, toggle("swaying")),
}
