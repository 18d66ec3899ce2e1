"""What the viewer shows of a Lytro file without raw: its refocus stack, its maps and its other pictures, one at a time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from app.readout import Caption

if TYPE_CHECKING:
    from lfcore.formats.lytro.extras import Extras

Pixels = npt.NDArray[np.uint8] | npt.NDArray[np.float32]


@dataclass(frozen=True)
class Exhibit:
    """A picture (H, W, 3), uint8 sRGB, or a map (H, W), float32, and what is said about it."""

    caption: Caption
    pixels: Pixels


@dataclass(frozen=True)
class Exhibition:
    """All that a file shows, at least one exhibit: those of the refocus stack first, from near to far."""

    name: str
    source: str
    sentence: str
    exhibits: tuple[Exhibit, ...]

    @property
    def first(self) -> int:
        """Number of the exhibit to begin with: of a refocus stack the one focused nearest to where the lens was."""
        focus = [abs(each.caption.focus) for each in self.exhibits if each.caption.focus is not None]
        return int(np.argmin(focus)) if focus else 0


def open_exhibition(path: Path) -> Exhibition | None:
    """What a Lytro file without raw shows; None for any other file, and for one that has only metadata.

    Raises InputError where the file is damaged.
    """
    from lfcore.formats.lytro.container import is_container, open_container
    from lfcore.formats.lytro.contents import Kind, read_contents

    if not path.is_file() or not is_container(path):
        return None
    container = open_container(path)
    contents = read_contents(container)
    if contents.kind in (Kind.CAPTURE, Kind.CALIBRATION):
        return None
    from lfcore.formats.lytro.extras import read_extras  # loads the decoder of videos, which captures do not need

    return exhibition(read_extras(container, contents), str(path))


def exhibition(extras: Extras, source: str) -> Exhibition | None:
    """The extras in the order in which they are shown; None where there is nothing to see."""
    exhibits = tuple(_exhibits(extras))
    return Exhibition(extras.name, source, extras.sentence, exhibits) if exhibits else None


def _exhibits(extras: Extras) -> Iterator[Exhibit]:
    if extras.stack is not None:
        for picture, focus in zip(extras.stack.images, extras.stack.focus, strict=True):
            yield _picture("Refocus stack", picture, float(focus))
    if extras.depth is not None:
        yield _map("Depth", extras.depth.depth, "lambda, negative is nearer")
        if extras.depth.confidence is not None:
            yield _map("Confidence", extras.depth.confidence, "confidence")
    for label, picture in extras.pictures:
        yield _picture(label.capitalize(), picture)


def _picture(label: str, pixels: npt.NDArray[np.uint8], focus: float | None = None) -> Exhibit:
    height, width = pixels.shape[:2]
    return Exhibit(Caption(label, width, height, focus), pixels)


def _map(label: str, values: npt.NDArray[np.float32], unit: str) -> Exhibit:
    height, width = values.shape
    finite = values[np.isfinite(values)]
    span = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 0.0)
    return Exhibit(Caption(label, width, height, span=span, unit=unit), values)
