"""How the picture is magnified."""

from __future__ import annotations

from app.commands.kinds import ZOOMING, Command, Context, Needs, Run
from app.geometry import Zoom, zoom_about

ZOOM_STEP = 1.25


def _zoom_by(factor: float) -> Run:
    def run(context: Context) -> None:
        area = context.area
        middle = (area.x + area.width / 2, area.y + area.height / 2)
        context.state.zoom = zoom_about(context.state.zoom, factor, middle, context.picture, area)

    return run


def _fit(context: Context) -> None:
    context.state.zoom = Zoom()


def _one_to_one(context: Context) -> None:
    context.state.zoom = Zoom(1.0, context.state.zoom.centre)


COMMANDS: dict[str, Command] = {
    "fit": Command(("F",), "Fit the picture into the window", ZOOMING, _fit, Needs.PICTURE),
    "1:1": Command(("Z",), "One screen pixel per picture pixel", ZOOMING, _one_to_one, Needs.PICTURE),
    "zoom in": Command(("+", "="), "Magnify", ZOOMING, _zoom_by(ZOOM_STEP), Needs.PICTURE),
    "zoom out": Command(("-",), "Make smaller", ZOOMING, _zoom_by(1 / ZOOM_STEP), Needs.PICTURE),
}
