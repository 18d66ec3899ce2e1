"""Files, the window, and the program itself."""

from __future__ import annotations

from app.commands.kinds import PROGRAM, Action, Command, Context, Needs, request, toggle


def _escape(context: Context) -> None:
    """Put away what lies on top."""
    state = context.state
    if state.help:
        state.help = False
    elif state.path_field:
        state.path_field = False
    elif state.desk.card is not None:
        state.desk.card = None
    elif context.loading:
        context.requests.append(Action.CANCEL_OPEN)
    elif context.messages:
        context.requests.append(Action.DISMISS)


COMMANDS: dict[str, Command] = {
    "sample": Command(("Ctrl+L",), "Open the sample light field", PROGRAM, request(Action.OPEN_SAMPLE), Needs.NOTHING),
    "close": Command(("Ctrl+W",), "Close what is open", PROGRAM, request(Action.CLOSE), Needs.PICTURE),
    "foresight": Command(("A",), "Compute views ahead in idle time, or not", PROGRAM, toggle("foresight"), Needs.NOTHING),
    "panel": Command(("Tab",), "Show or hide the panel", PROGRAM, toggle("panel"), Needs.NOTHING),
    "help": Command(("F1", "?"), "Show or hide this page", PROGRAM, toggle("help"), Needs.NOTHING),
    "escape": Command(("Esc",), "Put away what lies on top: page, card, message, loading", PROGRAM, _escape, Needs.NOTHING),
    "quit": Command(("Ctrl+Q",), "End the program", PROGRAM, request(Action.QUIT), Needs.NOTHING),
}
