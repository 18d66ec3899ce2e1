"""What a command is, what it works on, and what it can ask of the program."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path

from app.dialogs import Purpose
from app.export_requests import ExportRequest
from app.geometry import Rect, Size
from app.state import Grid, ViewState

# Groups of the F1 page.
LOOKING, INSIDE, TONES = "Ways of looking", "Inside the synthesis", "Tone and colours"
COMPARING, FOCUSING, EXPORTING = "Comparing", "Focus, slices, stereo", "Export"
MOVING, ZOOMING, PROGRAM = "Viewpoint", "Picture", "Program"


class Action(Enum):
    """What the panels ask of the program, beyond the view state."""

    CLOSE = "close"
    OPEN_SAMPLE = "sample"
    CANCEL_OPEN = "cancel"
    DISMISS = "dismiss"
    UNDO = "undo"
    REDO = "redo"
    FORGET = "forget"
    REOPEN = "reopen"
    QUIT = "quit"


@dataclass(frozen=True)
class OpenPath:
    """Open the light field at this path."""

    path: Path


@dataclass(frozen=True)
class OpenTyped:
    """Open the light field at a path, as it was typed or pasted."""

    text: str


@dataclass(frozen=True)
class Ask:
    """Ask for a path by the system's own dialog, or in the window where there is none."""

    purpose: Purpose


@dataclass(frozen=True)
class Browse:
    """List the light fields of this folder; None: of the one around what is open, or was opened last."""

    folder: Path | None


Request = Action | OpenPath | OpenTyped | Ask | Browse | ExportRequest


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
    disparity_range: tuple[float, float] | None = None  # of the colours, px over the baseline
    scale: float = 1.0  # of the interface
    requests: list[Request] = field(default_factory=list)

    @property
    def met(self) -> frozenset[Needs]:
        """The needs of commands that are met by what is open."""
        if self.grid is not None:
            return frozenset(Needs)
        return frozenset((Needs.NOTHING, Needs.PICTURE) if self.exhibits else (Needs.NOTHING,))


Run = Callable[[Context], None]


@dataclass(frozen=True)
class Command:
    """One thing to do: its keys as on the keyboard's caps (with Ctrl+, Shift+ or Ctrl+Shift+ before them; none: it is found
    in the palette), what it does in words, the group of the F1 page in which it stands, how it is done, and what is done when
    the key comes up again."""

    keys: tuple[str, ...]
    text: str
    group: str
    run: Run
    needs: Needs = Needs.LIGHT_FIELD
    released: Run | None = None

    @property
    def tooltip(self) -> str:
        """The words with the keys."""
        return f"{self.text}  ({' or '.join(self.keys)})" if self.keys else self.text


def request(wanted: Request) -> Run:
    """What asks the program for something."""

    def run(context: Context) -> None:
        context.requests.append(wanted)

    return run


def toggle(name: str) -> Run:
    """What turns a field of the view state, of that name, on or off."""

    def run(context: Context) -> None:
        setattr(context.state, name, not getattr(context.state, name))

    return run
