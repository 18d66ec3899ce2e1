"""What the picture on screen is compared with, and how, as plain values."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum

from app.limits import within

# Partners that are no model; the texts are their names on screen.
CAPTURED_VIEW = "captured view"
INSTANT = "instant"
NO_CAPTURED_VIEW = "No captured view here"

BLOCK_RANGE = (50.0, 20.0)  # dB of the first and the last colour of PSNR by block
WIPE_STEP = 0.02  # of the width of the picture's area, by a key


class Arrangement(Enum):
    """How the picture and its partner lie beside each other."""

    ALONE = "alone"
    WIPE = "wipe"
    SIDE_BY_SIDE = "side by side"


class Difference(Enum):
    """How a difference from the partner is drawn; the value is its name on screen."""

    ABSOLUTE = "absolute"
    SIGNED = "signed"
    SQUARED = "squared"
    FALSE_COLOUR = "false colour"
    SIMILARITY = "map of SSIM"
    BLOCKS = "PSNR by block"

    @property
    def measured(self) -> bool:
        """Whether it is a map that is computed from the two pictures beforehand, not by the graphics."""
        return self in (Difference.SIMILARITY, Difference.BLOCKS)


class Source(Enum):
    """Which picture of a viewpoint is meant."""

    SYNTHESIS = "the best synthesis at hand"
    CAPTURED = "the camera's own view"
    INSTANT = "the corner views warped by the newest disparity"
    MODEL = "the synthesis by another model"


@dataclass(frozen=True)
class Comparison:
    """How the picture on screen is compared. `partner` is CAPTURED_VIEW, INSTANT or the name of a model."""

    partner: str = CAPTURED_VIEW
    arrangement: Arrangement = Arrangement.ALONE
    wipe: float = 0.5  # where the handle lies, as a fraction of the width of the picture's area
    difference: Difference = Difference.ABSOLUTE
    rule: str = "K16"  # by which the picture is scored; a name of app.scoring

    @property
    def source(self) -> Source:
        """Which picture the partner is."""
        return {CAPTURED_VIEW: Source.CAPTURED, INSTANT: Source.INSTANT}.get(self.partner, Source.MODEL)

    @property
    def model(self) -> str | None:
        """The model that makes the partner, or None."""
        return self.partner if self.source is Source.MODEL else None

    def bounded(self) -> Comparison:
        """The same with the handle within the picture's area."""
        return replace(self, wipe=within(self.wipe, (0.0, 1.0)))


def partners(models: Sequence[str], model: str) -> tuple[str, ...]:
    """What a synthesis by `model` can be compared with."""
    return CAPTURED_VIEW, INSTANT, *(name for name in models if name != model)
