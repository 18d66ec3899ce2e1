"""From layers to views: each layer read at its exact sub-pixel place and laid over what is behind, in linear light."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn import functional

from lfcore.training.scenes.sampling import FINENESS, enlarge, read
from lfcore.training.scenes.surfaces import CELL, Canvas, disparity_in_views

# Coverage from which a layer counts as the front-most surface of a pixel.
OPAQUE = 0.5

_FAINT = 0.002  # coverage below which a layer is taken to be absent


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


@dataclass(frozen=True)
class _Box:
    """Rows and columns of a picture."""

    top: int
    bottom: int
    left: int
    right: int


def render(canvas: Canvas, layers: Sequence[Layer], positions: Tensor, shifts: Tensor) -> Views:
    """Render all views; `layers` from back to front, the first covering everything.

    positions: (N, 2), offsets (u, v) from the middle viewpoint in baselines. shifts: (N, 2) px, by which each view's picture
    sits aside. The disparity is that of the front-most surface which covers at least half of a pixel.
    """
    count = len(positions)
    light = torch.zeros(count, canvas.height, canvas.width, 4)
    disparity = torch.zeros(count, canvas.height, canvas.width)
    for layer in layers:
        _put_over(canvas, layer, positions, shifts, light, disparity)
    return Views(light[..., :3], disparity)


def _put_over(canvas: Canvas, layer: Layer, positions: Tensor, shifts: Tensor, light: Tensor, disparity: Tensor) -> None:
    part = _present(layer)
    reach = _reach(canvas, layer, part, positions, shifts) if part is not None else None
    if part is None or reach is None:
        return
    rows, columns = slice(reach.top, reach.bottom), slice(reach.left, reach.right)
    picture = _enlarged(layer.picture, part, layer.blur)
    coarse = disparity_in_views(canvas, layer.surface, positions, shifts)
    glint = layer.glint
    if glint is not None:
        glint_picture = _enlarged(glint.light, part, layer.blur)
        glint_coarse = disparity_in_views(canvas, glint.surface, positions, shifts)
    for k, (position, shift) in enumerate(zip(positions, shifts, strict=True)):
        own = _at_pixels(coarse[k], reach)
        rgba = read(picture, *_places(canvas, own, position, shift, reach, part)).clamp_min_(0)
        alpha = rgba[..., 3:].clamp_max_(1)
        if glint is not None:
            places = _places(canvas, _at_pixels(glint_coarse[k], reach), position, shift, reach, part)
            rgba[..., :3] += read(glint_picture, *places).clamp_min_(0) * alpha
        behind = light[k, rows, columns]
        torch.addcmul(rgba, behind, 1 - alpha, out=behind)
        known = disparity[k, rows, columns]
        torch.where(alpha[..., 0] >= OPAQUE, own, known, out=known)


def _present(layer: Layer) -> _Box | None:
    """The part of the layer that holds anything once it is blurred; it may lie beyond the layer's edge."""
    covered = layer.picture[..., 3] > _FAINT
    rows, columns = covered.any(1).nonzero().flatten(), covered.any(0).nonzero().flatten()
    if not len(rows):
        return None
    room = math.ceil(3 * layer.blur) + 3
    return _Box(int(rows[0]) - room, int(rows[-1]) + 1 + room, int(columns[0]) - room, int(columns[-1]) + 1 + room)


def _enlarged(picture: Tensor, part: _Box, sigma: float) -> Tensor:
    """A part of a picture (H, W, C), blurred and enlarged; beyond the picture its edge repeats."""
    # Opposite edges mix in the Fourier domain: they are cut away afterwards. Multiples of 16 are transformed quickly.
    spare = math.ceil(3 * sigma) + 5
    rows, columns = (
        torch.arange(first - spare, first - spare + math.ceil((end - first + 2 * spare) / 16) * 16).clamp_(0, size - 1)
        for first, end, size in ((part.top, part.bottom, picture.shape[0]), (part.left, part.right, picture.shape[1]))
    )
    whole = enlarge(picture.index_select(0, rows).index_select(1, columns), sigma)
    first, height, width = FINENESS * spare, FINENESS * (part.bottom - part.top), FINENESS * (part.right - part.left)
    return whole[:, :, first : first + height, first : first + width]


def _reach(canvas: Canvas, layer: Layer, part: _Box, positions: Tensor, shifts: Tensor) -> _Box | None:
    """The part of the views that the layer can get to, or None; top and left lie on the coarse grid."""
    motion = math.ceil(float(layer.surface.abs().max()) * float(positions.abs().max()) + float(shifts.abs().max()))
    top, left = (max(edge - motion - canvas.margin, 0) // CELL * CELL for edge in (part.top, part.left))
    bottom = min(part.bottom + motion - canvas.margin, canvas.height)
    right = min(part.right + motion - canvas.margin, canvas.width)
    return _Box(top, bottom, left, right) if bottom > top and right > left else None


def _at_pixels(coarse: Tensor, reach: _Box) -> Tensor:
    """Values on a view's coarse grid at the pixels within reach, (h, w)."""
    height, width = reach.bottom - reach.top, reach.right - reach.left
    rows, columns = (height - 1) // CELL + 2, (width - 1) // CELL + 2
    part = coarse[reach.top // CELL :, reach.left // CELL :][:rows, :columns]
    size = (rows - 1) * CELL + 1, (columns - 1) * CELL + 1
    fine = functional.interpolate(part[None, None], size=size, mode="bilinear", align_corners=True)
    return fine[0, 0, :height, :width]


def _places(
    canvas: Canvas, disparity: Tensor, position: Tensor, shift: Tensor, reach: _Box, part: _Box
) -> tuple[Tensor, Tensor]:
    """Where in the part of the layer the pixels within reach lie: p = s - d D."""
    y = torch.arange(reach.top, reach.bottom, dtype=torch.float32)[:, None] + (canvas.margin - part.top - float(shift[1]))
    x = torch.arange(reach.left, reach.right, dtype=torch.float32)[None] + (canvas.margin - part.left - float(shift[0]))
    return torch.sub(x, disparity, alpha=float(position[0])), torch.sub(y, disparity, alpha=float(position[1]))
