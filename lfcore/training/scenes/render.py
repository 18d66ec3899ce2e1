"""From layers to views: each layer sampled at its exact sub-pixel place in each view, laid over what is behind, in linear light."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn import functional

from lfcore.training.scenes.sampling import sample_spline, spline_coefficients
from lfcore.training.scenes.surfaces import CELL, Canvas, disparity_in_views

# Coverage from which a layer counts as the front-most surface of a pixel.
OPAQUE = 0.5


@dataclass(frozen=True)
class Glint:
    """A highlight: light that is added on a layer but moves with a disparity of its own, as reflections do."""

    light: Tensor  # (H, W, 3), linear
    surface: Tensor  # coarse grid, px


@dataclass(frozen=True)
class Layer:
    """A thing: colours times coverage and coverage in linear light, and the disparity of its surface."""

    picture: Tensor  # (H, W, 4)
    surface: Tensor  # coarse grid, px over the full baseline
    blur: float  # px, of the camera and of its focus together
    glint: Glint | None = None


@dataclass(frozen=True)
class Views:
    """What the camera's views would hold without its faults: linear light (N, H, W, 3), and disparity (N, H, W)."""

    light: Tensor
    disparity: Tensor


def render(canvas: Canvas, layers: Sequence[Layer], positions: Tensor, shifts: Tensor) -> Views:
    """Render all views; `layers` from back to front, the first covering everything.

    positions: (N, 2), offsets (u, v) from the middle viewpoint in baselines. shifts: (N, 2) px, by which each view's picture sits
    aside. The disparity is that of the front-most surface which covers at least half of a pixel.
    """
    count = len(positions)
    light = torch.zeros(count, canvas.height, canvas.width, 4)
    disparity = torch.zeros(count, canvas.height, canvas.width)
    for layer in layers:
        _put_over(canvas, layer, positions, shifts, light, disparity)
    return Views(light[..., :3], disparity)


def _put_over(
    canvas: Canvas, layer: Layer, positions: Tensor, shifts: Tensor, light: Tensor, disparity: Tensor
) -> None:
    area = _reach(canvas, layer, positions, shifts)
    if area is None:
        return
    top, bottom, left, right = area
    coefficients = spline_coefficients(layer.picture, layer.blur)
    coarse = disparity_in_views(canvas, layer.surface, positions, shifts)
    glint = layer.glint
    if glint is not None:
        glint_coefficients = spline_coefficients(glint.light, layer.blur)
        glint_coarse = disparity_in_views(canvas, glint.surface, positions, shifts)
    for k, (position, shift) in enumerate(zip(positions, shifts, strict=True)):
        own = _at_pixels(coarse[k], area)
        rgba = sample_spline(coefficients, *_places(canvas, own, position, shift, area)).clamp_min_(0)
        alpha = rgba[..., 3:].clamp_max_(1)
        if glint is not None:
            places = _places(canvas, _at_pixels(glint_coarse[k], area), position, shift, area)
            rgba[..., :3] += sample_spline(glint_coefficients, *places).clamp_min_(0) * alpha
        behind = light[k, top:bottom, left:right]
        behind.mul_(1 - alpha).add_(rgba)
        known = disparity[k, top:bottom, left:right]
        known.copy_(torch.where(alpha[..., 0] >= OPAQUE, own, known))


def _reach(
    canvas: Canvas, layer: Layer, positions: Tensor, shifts: Tensor
) -> tuple[int, int, int, int] | None:
    """Rows and columns of a view (top, bottom, left, right) that the layer can reach, or None; top and left fit the coarse grid."""
    covered = layer.picture[..., 3] > 0.002
    rows, columns = covered.any(1).nonzero().flatten(), covered.any(0).nonzero().flatten()
    if not len(rows):
        return None
    motion = float(layer.surface.abs().max()) * float(positions.abs().max()) + float(shifts.abs().max()) + 3 * layer.blur + 2
    top, bottom = int(rows[0] - motion) - canvas.margin, int(rows[-1] + motion) + 2 - canvas.margin
    left, right = int(columns[0] - motion) - canvas.margin, int(columns[-1] + motion) + 2 - canvas.margin
    top, left = max(top, 0) // CELL * CELL, max(left, 0) // CELL * CELL
    bottom, right = min(bottom, canvas.height), min(right, canvas.width)
    return (top, bottom, left, right) if bottom > top and right > left else None


def _at_pixels(coarse: Tensor, area: tuple[int, int, int, int]) -> Tensor:
    """Values on a view's coarse grid at the pixels of the area, (h, w)."""
    top, bottom, left, right = area
    rows, columns = (bottom - top - 1) // CELL + 2, (right - left - 1) // CELL + 2
    part = coarse[top // CELL :, left // CELL :][:rows, :columns]
    size = (rows - 1) * CELL + 1, (columns - 1) * CELL + 1
    fine = functional.interpolate(part[None, None], size=size, mode="bilinear", align_corners=True)
    return fine[0, 0, : bottom - top, : right - left]


def _places(
    canvas: Canvas, disparity: Tensor, position: Tensor, shift: Tensor, area: tuple[int, int, int, int]
) -> tuple[Tensor, Tensor]:
    """Where on the layer the pixels of the area lie: p = s - d D."""
    top, bottom, left, right = area
    y = torch.arange(top, bottom, dtype=torch.float32)[:, None] + (canvas.margin - float(shift[1]))
    x = torch.arange(left, right, dtype=torch.float32)[None] + (canvas.margin - float(shift[0]))
    return x - float(position[0]) * disparity, y - float(position[1]) * disparity
