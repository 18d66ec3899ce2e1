"""Paths and exports."""

from __future__ import annotations

from app.commands.kinds import EXPORTING, Command, Context, Needs, Run, request
from app.export_requests import ExportAction
from app.state import Look


def _add(context: Context) -> None:
    """With the focus of the tab Focus; where the picture is refocused, the path is too."""
    state = context.state
    state.export.add_key_frame(state.u, state.v, state.focusing.focus)
    if state.look is Look.REFOCUS:
        state.export.refocus, state.export.aperture = True, state.focusing.aperture


def _remove(context: Context) -> None:
    context.state.export.remove_last_key_frame()


def _play(context: Context) -> None:
    context.state.swaying = False
    context.state.export.play()


def _asked(action: ExportAction) -> Run:
    """What asks for an action, unless nothing can be exported as chosen."""

    def run(context: Context) -> None:
        if not context.state.export.fault:
            context.requests.append(action)

    return run


COMMANDS: dict[str, Command] = {
    "add key frame": Command(("K",), "Add a key frame to the path at this viewpoint", EXPORTING, _add),
    "remove key frame": Command(("Shift+K",), "Remove the last key frame", EXPORTING, _remove),
    "play path": Command(("Ctrl+Shift+K",), "Play the path on screen, or stop", EXPORTING, _play),
    "export": Command(("Ctrl+Shift+E",), "Export as chosen", EXPORTING, _asked(ExportAction.EXPORT)),
    "save path": Command(("Ctrl+Shift+S",), "Save the path as JSON", EXPORTING, _asked(ExportAction.SAVE_PATH)),
    "save picture": Command(
        ("Ctrl+S",), "Save the picture as shown, as PNG", EXPORTING, request(ExportAction.SAVE_PICTURE), Needs.PICTURE
    ),
}
