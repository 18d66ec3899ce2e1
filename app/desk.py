"""What lies around the picture, as plain values: cards on top of it, the theme, files to choose from."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path

from app.geometry import Point
from app.limits import within
from app.settings import SCALE_LIMITS, Theme

SCALE_STEP = 0.25


class Card(Enum):
    """A card that covers the picture and takes the keys; only one at a time."""

    PALETTE = "all commands"
    BROWSER = "the light fields of a folder"
    SETTINGS = "settings"


@dataclass
class Desk:
    """What the person has chosen of all that. `scale` of the interface: None is the monitor's own."""

    card: Card | None = None
    query: str = ""  # typed in the palette
    chosen: int = 0  # row of the palette, or tile of the browser
    theme: Theme = Theme.DARK
    scale: float | None = None

    def show(self, card: Card) -> None:
        """Put this card on top, in place of another."""
        if self.card is not card:
            self.card, self.query, self.chosen = card, "", 0

    def toggle(self, card: Card) -> None:
        """Put this card on top, or away."""
        if self.card is card:
            self.card = None
        else:
            self.show(card)

    def change_scale(self, steps: int, present: float) -> None:
        """Larger or smaller by so many steps, from the scale at present."""
        scale = (round(present / SCALE_STEP) + steps) * SCALE_STEP
        self.scale = within(scale, SCALE_LIMITS)


@dataclass(frozen=True)
class Placed:
    """Where a small picture lies: the texture's number, the two corners in it (0 to 1), and its own size in pixels."""

    texture: int
    first: Point
    last: Point
    width: int
    height: int


@dataclass(frozen=True)
class Thumbnail:
    """What a list shows of a light field: what it is, or why it cannot be opened; its picture once it is there."""

    caption: str = ""
    reason: str = ""
    placed: Placed | None = None


def _nothing_yet(path: Path) -> Thumbnail:
    return Thumbnail()


@dataclass(frozen=True)
class Folder:
    """A folder, and what in it may be a light field; the folder is None for files that were dropped together."""

    path: Path | None
    members: tuple[Path, ...]

    def member_with(self, path: Path) -> int | None:
        """Number of the member that is this path, or holds it, or None."""
        return next((number for number, each in enumerate(self.members) if path == each or each in path.parents), None)


@dataclass(frozen=True)
class Shelf:
    """Files to choose from: opened lately, and those of a folder. `thumbnail` tells what is known of one by now; those that
    are asked for in a frame are looked at next. `listing`: a folder is being listed."""

    recent: tuple[Path, ...] = ()
    folder: Folder | None = None
    listing: bool = False
    thumbnail: Callable[[Path], Thumbnail] = field(default=_nothing_yet)
