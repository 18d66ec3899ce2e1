"""Paths and exports."""

from __future__ import annotations

from app.commands.kinds import EXPORTING, Command, Context, Needs, Run, request
from app.export_choices import LAYERS, RADIUS_LIMITS, SHAPES, SIZES, Format, Product
from app.export_requests import ExportAction
from app.limits import within
from app.state import Look, Tab


def _add(context: Context) -> None:
    """With the focus of the tab Focus; where the picture is refocused, the path is too. The tab shows what has become of it."""
    state = context.state
    state.tab, state.panel = Tab.EXPORT, True
    state.export.add_key_frame(state.u, state.v, state.focusing.focus)
    if state.look is Look.REFOCUS:
        state.export.refocus, state.export.aperture = True, state.focusing.aperture


def _remove(context: Context) -> None:
    context.state.tab, context.state.panel = Tab.EXPORT, True
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


def _set(field: str, value: object) -> Run:
    """What chooses a value in the tab Export, and shows it there."""

    def run(context: Context) -> None:
        setattr(context.state.export, field, value)
        context.state.tab, context.state.panel = Tab.EXPORT, True

    return run


def _toggled(field: str) -> Run:
    def run(context: Context) -> None:
        _set(field, not getattr(context.state.export, field))(context)

    return run


def _reach(step: float) -> Run:
    def run(context: Context) -> None:
        _set("radius", within(context.state.export.radius + step, RADIUS_LIMITS))(context)

    return run


def _choices() -> dict[str, Run]:
    """Everything that the tab lets one choose, by what it is called in the command palette."""
    values: dict[str, tuple[str, object]] = {
        **{f"Export: {each.value}": ("product", each) for each in Product},
        **{f"Export as {each.value}": ("format", each) for each in Format},
        **{f"Path of the export: {each}": ("shape", each) for each in SHAPES},
        **{f"Exported frames show: {name}": ("layer", layer) for name, layer in LAYERS.items()},
        **{f"Size of the export: {name}": ("scale", scale) for name, scale in SIZES.items()},
        **{f"Frames of the export: {count}": ("frames", count) for count in (24, 60, 120, 240)},
        **{f"Frames per second of the export: {rate}": ("fps", float(rate)) for rate in (12, 24, 30, 60)},
        **{f"Views along each side of the exported grid: {side}": ("side", side) for side in (5, 7, 9, 14)},
        "Type the folder of the export": ("typing", "Folder"),
        "Type the name of the export": ("typing", "Name"),
    }
    switches = {
        "Labels on exported frames, or none": "labels",
        "Brighten exported frames, or not": "brighten",
        "Refocus exported frames, or not": "refocus",
        "Close the path of key frames, or not": "closed",
    }
    return {
        **{text: _set(field, value) for text, (field, value) in values.items()},
        **{text: _toggled(field) for text, field in switches.items()},
        "A wider path of the export": _reach(0.05),
        "A narrower path of the export": _reach(-0.05),
        "Choose the place of the export": request(ExportAction.CHOOSE_FOLDER),
        "Give up all exports": request(ExportAction.CANCEL_ALL),
        "Forget the exports that are over": request(ExportAction.CLEAR),
    }


COMMANDS: dict[str, Command] = {
    "add key frame": Command(("K",), "Add a key frame to the path at this viewpoint", EXPORTING, _add),
    "remove key frame": Command(("Shift+K",), "Remove the last key frame", EXPORTING, _remove),
    "play path": Command(("Ctrl+Shift+K",), "Play the path on screen, or stop", EXPORTING, _play),
    "export": Command(("Ctrl+Shift+E",), "Export as chosen", EXPORTING, _asked(ExportAction.EXPORT)),
    "save path": Command(("Ctrl+Shift+S",), "Save the path as JSON", EXPORTING, _asked(ExportAction.SAVE_PATH)),
    "save picture": Command(
        ("Ctrl+S",), "Save the picture as shown, as PNG", EXPORTING, request(ExportAction.SAVE_PICTURE), Needs.PICTURE
    ),
    **{text: Command((), text, EXPORTING, run) for text, run in _choices().items()},
}
