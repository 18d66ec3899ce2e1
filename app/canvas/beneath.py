"""What fills a window that the processor paints, beneath its panels: grounds and the enlarged picture (app.repainting)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from app.canvas.copying import enlarge
from app.canvas.placing import Pixels
from app.geometry import Placement
from app.painting import Box
from lfcore.synthesis import ByteArray


@dataclass(frozen=True)
class Fill:
    """One colour (red, green, blue, 0 to 1)."""

    box: Box
    colour: tuple[float, float, float]

    @property
    def mark(self) -> int:
        """See app.repainting.Layer."""
        return hash(self.colour)

    def paint(self, sheet: ByteArray, box: Box) -> None:
        """See app.repainting.Layer."""
        pixel = np.array([*(round(255 * value) for value in reversed(self.colour)), 255], np.uint8)
        whole = sheet.view(np.uint32)[..., 0]  # (H, W): filled much faster than byte by byte
        whole[box.top : box.bottom, box.left : box.right] = pixel.view(np.uint32)


@dataclass(frozen=True)
class Enlarged:
    """A picture (H, W, 4) at a placement. number: another one for each picture."""

    box: Box
    picture: ByteArray
    placement: Placement
    number: tuple[int, ...]

    @property
    def mark(self) -> int:
        """See app.repainting.Layer."""
        return hash((self.number, self.placement))

    def paint(self, sheet: ByteArray, box: Box) -> None:
        """See app.repainting.Layer."""
        inside = Pixels(box.left, box.top, box.right - box.left, box.bottom - box.top)
        enlarge(self.picture, inside, self.placement, sheet[box.top : box.bottom, box.left : box.right])
