"""Everything that can be done by a key: one table for the keys themselves, the tooltips of the controls and the F1 page."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum

from app.geometry import Rect, Size, Zoom, zoom_about
from app.state import Grid, Look, ViewState

NUDGE = 0.02  # of the baseline, by an arrow key
ZOOM_STEP = 1.25


class Action(Enum):
    """What the panels ask of the program, beyond the view state."""

    CLOSE = "close"
    OPEN_SAMPLE = "sample"
    CANCEL_OPEN = "cancel"
    DISMISS = "dismiss"
    QUIT = "quit"


@dataclass(frozen=True)
class OpenPath:
    """Open the light field at this path, as it was typed or dropped."""

    text: str


Request = Action | OpenPath


class Needs(Enum):
    """What must be open for a command to do anything."""

    NOTHING = "nothing"
    PICTURE = "a light field, or the pictures of a Lytro file without raw"
    LIGHT_FIELD = "a light field"


@dataclass
class Context:
    """What a command works on; requests to the program are gathered in `requests`. `exhibits`: how many pictures and maps
    a Lytro file without raw shows, 0 where none is open."""

    state: ViewState
    grid: Grid | None
    picture: Size
    area: Rect
    loading: bool = False
    messages: bool = False
    exhibits: int = 0
    models: tuple[str, ...] = ()  # to choose from
    model: str = ""
    requests: list[Request] = field(default_factory=list)

    @property
    def met(self) -> frozenset[Needs]:
        """The needs of commands that are met by what is open."""
        if self.grid is not None:
            return frozenset(Needs)
        return frozenset((Needs.NOTHING, Needs.PICTURE) if self.exhibits else (Needs.NOTHING,))


@dataclass(frozen=True)
class Command:
    """One thing to do: its keys as on the keyboard's caps, what it does in words, and how."""

    keys: tuple[str, ...]
    text: str
    group: str
    run: Callable[[Context], None]
    needs: Needs = Needs.LIGHT_FIELD

    @property
    def tooltip(self) -> str:
        """The words with the keys."""
        return f"{self.text}  ({' or '.join(self.keys)})"


def _look(look: Look) -> Callable[[Context], None]:
    def run(context: Context) -> None:
        context.state.look = look

    return run


def _nudge(du: float, dv: float) -> Callable[[Context], None]:
    def run(context: Context) -> None:
        context.state.move_to(context.state.u + du, context.state.v + dv)

    return run


def _step(step: int) -> Callable[[Context], None]:
    def run(context: Context) -> None:
        if context.grid is not None:
            state = context.state
            state.move_to(*context.grid.position(context.grid.stepped(state.u, state.v, step)))
        elif context.exhibits:
            context.state.exhibit = (context.state.exhibit + step) % context.exhibits

    return run


def _centre(context: Context) -> None:
    context.state.move_to(0.5, 0.5)


def _zoom_by(factor: float) -> Callable[[Context], None]:
    def run(context: Context) -> None:
        area = context.area
        middle = (area.x + area.width / 2, area.y + area.height / 2)
        context.state.zoom = zoom_about(context.state.zoom, factor, middle, context.picture, area)

    return run


def _fit(context: Context) -> None:
    context.state.zoom = Zoom()


def _one_to_one(context: Context) -> None:
    context.state.zoom = Zoom(1.0, context.state.zoom.centre)


def _toggle_captured(context: Context) -> None:
    context.state.captured = not context.state.captured


def _toggle_tone(context: Context) -> None:
    context.state.display_tone = not context.state.display_tone


def _toggle_panel(context: Context) -> None:
    context.state.panel = not context.state.panel


def _toggle_foresight(context: Context) -> None:
    context.state.foresight = not context.state.foresight


def _next_model(context: Context) -> None:
    if context.models:
        at = context.models.index(context.model) if context.model in context.models else -1
        context.state.model = context.models[(at + 1) % len(context.models)]


def _toggle_help(context: Context) -> None:
    context.state.help = not context.state.help


def _contrast(factor: float) -> Callable[[Context], None]:
    def run(context: Context) -> None:
        context.state.change_contrast(factor)

    return run


def _show_path_field(context: Context) -> None:
    context.state.path_field = True
    context.state.help = False


def _escape(context: Context) -> None:
    """Put away what lies on top."""
    state = context.state
    if state.help:
        state.help = False
    elif state.path_field:
        state.path_field = False
    elif context.loading:
        context.requests.append(Action.CANCEL_OPEN)
    elif context.messages:
        context.requests.append(Action.DISMISS)


def _request(action: Action) -> Callable[[Context], None]:
    def run(context: Context) -> None:
        context.requests.append(action)

    return run


LOOKING, MOVING, ZOOMING, PROGRAM = "Ways of looking", "Viewpoint", "Picture", "Program"

COMMANDS: dict[str, Command] = {
    "synthesis": Command(("1",), "The synthesis", LOOKING, _look(Look.SYNTHESIS)),
    "disparity": Command(("2",), "Its disparity, in colours", LOOKING, _look(Look.DISPARITY)),
    "error": Command(("3",), "The error against the captured view", LOOKING, _look(Look.ERROR)),
    "warped": Command(("4",), "The four warped inputs on one sheet", LOOKING, _look(Look.WARPED_ALL)),
    "top left": Command(("5",), "The top left input, warped", LOOKING, _look(Look.WARPED_TOP_LEFT)),
    "top right": Command(("6",), "The top right input, warped", LOOKING, _look(Look.WARPED_TOP_RIGHT)),
    "bottom left": Command(("7",), "The bottom left input, warped", LOOKING, _look(Look.WARPED_BOTTOM_LEFT)),
    "bottom right": Command(("8",), "The bottom right input, warped", LOOKING, _look(Look.WARPED_BOTTOM_RIGHT)),
    "captured": Command(("C",), "Show the camera's own view where the viewpoint falls on one", LOOKING, _toggle_captured),
    "tone": Command(("T",), "Brighten dark captures for looking: ^(1/1.5), saturation × 1.5", LOOKING, _toggle_tone),
    "less contrast": Command((",",), "Less gain of the error, wider range of the disparity", LOOKING, _contrast(0.5)),
    "more contrast": Command((".",), "More gain of the error, narrower range of the disparity", LOOKING, _contrast(2.0)),
    "left": Command(("Left",), "Move the viewpoint to the left", MOVING, _nudge(-NUDGE, 0)),
    "right": Command(("Right",), "Move the viewpoint to the right", MOVING, _nudge(NUDGE, 0)),
    "up": Command(("Up",), "Move the viewpoint up", MOVING, _nudge(0, -NUDGE)),
    "down": Command(("Down",), "Move the viewpoint down", MOVING, _nudge(0, NUDGE)),
    "previous": Command(("P",), "Go to the previous captured view, or picture of a file", MOVING, _step(-1), Needs.PICTURE),
    "next": Command(("N",), "Go to the next captured view, or picture of a file", MOVING, _step(1), Needs.PICTURE),
    "nearest": Command(("S",), "Snap to the nearest captured view", MOVING, _step(0)),
    "centre": Command(("Home",), "Go to the centre", MOVING, _centre),
    "fit": Command(("F",), "Fit the picture into the window", ZOOMING, _fit, Needs.PICTURE),
    "1:1": Command(("Z",), "One screen pixel per picture pixel", ZOOMING, _one_to_one, Needs.PICTURE),
    "zoom in": Command(("+", "="), "Magnify", ZOOMING, _zoom_by(ZOOM_STEP), Needs.PICTURE),
    "zoom out": Command(("-",), "Make smaller", ZOOMING, _zoom_by(1 / ZOOM_STEP), Needs.PICTURE),
    "open": Command(("Ctrl+O",), "Open a light field by its path", PROGRAM, _show_path_field, Needs.NOTHING),
    "sample": Command(("Ctrl+L",), "Open the sample light field", PROGRAM, _request(Action.OPEN_SAMPLE), Needs.NOTHING),
    "close": Command(("Ctrl+W",), "Close what is open", PROGRAM, _request(Action.CLOSE), Needs.PICTURE),
    "model": Command(("M",), "The next model for a hand at rest", LOOKING, _next_model),
    "foresight": Command(("A",), "Compute views ahead in idle time, or not", PROGRAM, _toggle_foresight, Needs.NOTHING),
    "panel": Command(("Tab",), "Show or hide the panel", PROGRAM, _toggle_panel, Needs.NOTHING),
    "help": Command(("F1", "?"), "Show or hide this page", PROGRAM, _toggle_help, Needs.NOTHING),
    "escape": Command(("Esc",), "Put away what lies on top: page, field, message, loading", PROGRAM, _escape, Needs.NOTHING),
    "quit": Command(("Ctrl+Q",), "End the program", PROGRAM, _request(Action.QUIT), Needs.NOTHING),
}

# What the mouse does, for the F1 page.
GESTURES: tuple[tuple[str, str, str], ...] = (
    (MOVING, "Drag", "Move the viewpoint: turn the scene as if by hand"),
    (ZOOMING, "Wheel", "Zoom about the cursor"),
    (ZOOMING, "Right drag, Space + drag", "Move the picture"),
    (PROGRAM, "Drop", "Open a file or folder"),
)


def run(name: str, context: Context) -> None:
    """Do the named thing, unless what it needs is not open."""
    command = COMMANDS[name]
    if command.needs in context.met:
        command.run(context)
