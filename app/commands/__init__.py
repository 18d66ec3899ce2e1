"""Everything that can be done by a key: one table for the keys themselves, the tooltips of the controls and the F1 page."""

from __future__ import annotations

from app.commands import around, comparing, exporting, focusing, inside, looking, moving, program, tabs, tones, zooming
from app.commands.kinds import (
    COMPARING,
    EXPORTING,
    FOCUSING,
    INSIDE,
    LOOKING,
    MOVING,
    PROGRAM,
    TONES,
    ZOOMING,
    Action,
    Ask,
    Browse,
    Command,
    Context,
    Needs,
    OpenPath,
    OpenTyped,
    Request,
)
from app.commands.moving import NUDGE

__all__ = [
    "COMMANDS",
    "COMPARING",
    "EXPORTING",
    "FOCUSING",
    "GESTURES",
    "INSIDE",
    "LOOKING",
    "MOVING",
    "NUDGE",
    "PROGRAM",
    "TONES",
    "ZOOMING",
    "Action",
    "Ask",
    "Browse",
    "Command",
    "Context",
    "Needs",
    "OpenPath",
    "OpenTyped",
    "Request",
    "run",
]

COMMANDS: dict[str, Command] = {
    **looking.COMMANDS,
    **inside.COMMANDS,
    **tones.COMMANDS,
    **moving.COMMANDS,
    **zooming.COMMANDS,
    **comparing.COMMANDS,
    **focusing.COMMANDS,
    **tabs.COMMANDS,
    **exporting.COMMANDS,
    **around.COMMANDS,
    **program.COMMANDS,
}

# What the mouse does, for the F1 page.
GESTURES: tuple[tuple[str, str, str], ...] = (
    (MOVING, "Drag", "Move the viewpoint: turn the scene as if by hand"),
    (MOVING, "Click or drag in the pad", "Move the viewpoint there"),
    (FOCUSING, "Shift + click", "Focus on what is under the cursor; while refocusing, a click does"),
    (FOCUSING, "Click or drag in a slice", "Move u or v there"),
    (COMPARING, "Drag the handle", "Wipe"),
    (ZOOMING, "Wheel", "Zoom about the cursor"),
    (ZOOMING, "Double click", "Fit, or 1:1 about the cursor"),
    (ZOOMING, "Right drag, middle drag, Space + drag", "Move the picture"),
    (EXPORTING, "Right click in the pad", "In the tab Export: add or remove a key frame"),
    (PROGRAM, "Ctrl + click on a slider", "Type its value"),
    (PROGRAM, "Drop", "Open a file or folder, or choose from several"),
)


def run(name: str, context: Context) -> None:
    """Do the named thing, unless what it needs is not open."""
    command = COMMANDS[name]
    if command.needs in context.met:
        command.run(context)
