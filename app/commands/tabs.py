"""The tabs of the panel."""

from __future__ import annotations

from app.commands.kinds import PROGRAM, Command, Context, Run
from app.state import Tab


def _tab(tab: Tab) -> Run:
    def run(context: Context) -> None:
        context.state.tab = tab
        context.state.panel = True

    return run


COMMANDS: dict[str, Command] = {
    "look tab": Command(("Ctrl+1",), "Ways of looking", PROGRAM, _tab(Tab.LOOK)),
    "compare tab": Command(("Ctrl+2",), "Comparing with captured views and models", PROGRAM, _tab(Tab.COMPARE)),
    "focus tab": Command(("Ctrl+3",), "Refocusing, slices and stereo", PROGRAM, _tab(Tab.FOCUS)),
    "export tab": Command(("Ctrl+4", "Ctrl+E"), "Paths and export", PROGRAM, _tab(Tab.EXPORT)),
}
