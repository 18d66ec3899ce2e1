"""Whether the grid that the metadata tells is the one on the sensor, and in which way it is wrong where it is not."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from lfcore.decode.grid import LensGrid, regular_grid
from lfcore.formats.lytro.metadata import LensletGeometry

# Grids this far apart (in pitches, root mean square over the sensor) count as the same: the metadata leaves out how much
# farther apart the pictures of the microlenses lie than the microlenses, which is 2 px at the edges of an Illum's sensor.
_SAME = 0.15


@dataclass(frozen=True)
class GridCheck:
    """What was found, as a sentence, and the distance in px of the told grid from the one in the picture."""

    agrees: bool
    distance: float
    sentence: str


def check_metadata(found: LensGrid, told: LensletGeometry, sensor: tuple[int, int]) -> GridCheck:
    """Compare the grid fitted to a picture of (height, width) px with the metadata's, as told and with its usual mistakes."""
    distances = {reading: _distance(found, grid, sensor) for reading, grid in _readings(told, sensor).items()}
    plain, *_ = distances
    if distances[plain] <= _SAME * found.pitch:
        return GridCheck(True, distances[plain], f"as the metadata has it, to {distances[plain]:.1f} px.")
    best = min(distances, key=lambda reading: distances[reading])
    off = f"the metadata's grid is off by {distances[plain]:.1f} px"
    if distances[best] <= _SAME * found.pitch:
        off += f"; {best} it is off by {distances[best]:.1f} px"
    return GridCheck(False, distances[plain], f"{off}. The picture's is used.")


def _readings(told: LensletGeometry, sensor: tuple[int, int]) -> dict[str, LensGrid]:
    """The metadata's grid as told (first), and read in other ways."""
    height, width = sensor
    x, y = told.offset[0] / told.pixel_pitch, told.offset[1] / told.pixel_pitch
    grids = {}
    turns = {"": told.rotation, "the rotation's sign changed": -told.rotation}
    offsets = {"": (x, y), "x and y of the offset swapped": (y, x), "the offset's sign changed": (-x, -y)}
    for turn, rotation in turns.items():
        for shift, (dx, dy) in offsets.items():
            origin = (width - 1) / 2 + dx, (height - 1) / 2 + dy
            words = " and ".join(part for part in (turn, shift) if part)
            name = f"with {words}" if words else "as told"
            grids[name] = regular_grid(origin, told.lens_pitch / told.pixel_pitch, rotation, told.scale)
    return grids


def _distance(found: LensGrid, told: LensGrid, sensor: tuple[int, int]) -> float:
    """Root mean square distance in px of the told microlenses, over the sensor, from the nearest that were found."""
    y, x = np.meshgrid(*(np.linspace(0, side - 1, 5) for side in sensor), indexing="ij")
    centres = told.centres(*told.nearest(x, y))
    nearest = found.centres(*found.nearest(centres[..., 0], centres[..., 1]))
    return math.sqrt(float(((nearest - centres) ** 2).sum(axis=-1).mean()))
