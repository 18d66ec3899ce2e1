"""Surfaces: disparity as a smooth function on the surface, held on a coarse grid over the layer's own plane.

Layers are drawn in the coordinates of the middle viewpoint, with a margin all around. A surface point at p is seen in the view
at offset d from the middle at s = p + d D(p): positive disparity moves content to larger x as u grows (lfcore.warp).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

CELL = 4  # px between the points of the coarse grid
_ITERATIONS = 7


@dataclass(frozen=True)
class Canvas:
    """The area that layers are drawn on: a view of height x width with a margin, a multiple of CELL, on all sides."""

    height: int
    width: int
    margin: int

    @property
    def full(self) -> tuple[int, int]:
        """Rows and columns of a layer."""
        return self.height + 2 * self.margin, self.width + 2 * self.margin

    @property
    def coarse(self) -> tuple[int, int]:
        """Rows and columns of the coarse grid that spans a layer."""
        rows, columns = self.full
        return math.ceil(rows / CELL) + 1, math.ceil(columns / CELL) + 1

    def coarse_coordinates(self) -> tuple[Tensor, Tensor]:
        """x and y of the coarse grid's points, from -1 to 1 over the longer side of the view, each (rows, columns)."""
        rows, columns = self.coarse
        unit = max(self.height, self.width) / 2
        y = (torch.arange(rows) * CELL - self.full[0] / 2) / unit
        x = (torch.arange(columns) * CELL - self.full[1] / 2) / unit
        grid_y, grid_x = torch.meshgrid(y, x, indexing="ij")
        return grid_x, grid_y

    def shrink(self, plane: Tensor) -> Tensor:
        """A plane (H, W) of a layer at the points of the coarse grid."""
        rows, columns = self.coarse
        beyond = (columns - 1) * CELL + 1 - plane.shape[1], (rows - 1) * CELL + 1 - plane.shape[0]
        padded = functional.pad(plane[None, None], (0, beyond[0], 0, beyond[1]), "replicate")
        shrunk = functional.interpolate(padded, size=(rows, columns), mode="bilinear", align_corners=True)
        return shrunk[0, 0]

    def enlarge(self, grid: Tensor) -> Tensor:
        """Values on the coarse grid at every pixel of a layer (H, W)."""
        rows, columns = self.coarse
        size = (rows - 1) * CELL + 1, (columns - 1) * CELL + 1
        large = functional.interpolate(grid[None, None], size=size, mode="bilinear", align_corners=True)
        return large[0, 0, : self.full[0], : self.full[1]]


def plane(canvas: Canvas, slope_x: float, slope_y: float) -> Tensor:
    """A slanted plane, 0 in the middle, slopes per half side of the view."""
    x, y = canvas.coarse_coordinates()
    return slope_x * x + slope_y * y


def waves(canvas: Canvas, rng: np.random.Generator) -> Tensor:
    """Gentle folds of about -1 to 1: a few sine waves at least a third of the view long."""
    x, y = canvas.coarse_coordinates()
    total = torch.zeros_like(x)
    for _ in range(3):
        angle, length, phase = rng.uniform(0, 2 * np.pi), rng.uniform(0.7, 2.5), rng.uniform(0, 2 * np.pi)
        total += torch.sin(2 * np.pi / length * (x * math.cos(angle) + y * math.sin(angle)) + phase)
    return total / 3


def ridge(canvas: Canvas, rng: np.random.Generator) -> Tensor:
    """A rounded ridge from -1 (along its crest, nearest) to 0 (at its foot), in a random direction."""
    x, y = canvas.coarse_coordinates()
    angle, radius = rng.uniform(0, np.pi), rng.uniform(0.3, 1.0)
    across = (x - rng.uniform(-0.4, 0.4)) * math.cos(angle) + (y - rng.uniform(-0.4, 0.4)) * math.sin(angle)
    return -torch.cos(np.pi / 2 * (across / radius).clamp(-1, 1)).square()


def steepness(surface: Tensor) -> float:
    """Largest change of a surface per px, along x and y together."""
    along_x, along_y = surface.diff(dim=1).abs().max(), surface.diff(dim=0).abs().max()
    return float(along_x + along_y) / CELL


def disparity_in_views(canvas: Canvas, surface: Tensor, positions: Tensor, shifts: Tensor) -> Tensor:
    """Disparity of a surface as each view sees it, on the views' own coarse grid: (N, h, w) with points every CELL px.

    surface: coarse grid of the layer. positions: (N, 2) offsets (u, v) from the middle viewpoint, in baselines. shifts: (N, 2)
    px by which the view's picture sits aside. Solves p = s - d D(p) by fixed point, which converges fast since D varies slowly.
    """
    h, w = canvas.height // CELL + 2, canvas.width // CELL + 2
    s_y = (torch.arange(h) * CELL + canvas.margin).float().view(1, h, 1) - shifts[:, 1].view(-1, 1, 1)
    s_x = (torch.arange(w) * CELL + canvas.margin).float().view(1, 1, w) - shifts[:, 0].view(-1, 1, 1)
    du, dv = positions[:, 0].view(-1, 1, 1), positions[:, 1].view(-1, 1, 1)
    rows, columns = surface.shape
    planes = surface[None, None].expand(len(positions), 1, rows, columns)
    disparity = surface.mean().expand(len(positions), h, w)
    for _ in range(_ITERATIONS):
        x, y = (s_x - du * disparity) / CELL, (s_y - dv * disparity) / CELL
        grid = torch.stack((x * (2 / (columns - 1)) - 1, y * (2 / (rows - 1)) - 1), -1)  # (N, h, w, 2)
        disparity = functional.grid_sample(planes, grid, mode="bilinear", padding_mode="border", align_corners=True)[:, 0]
    return disparity
