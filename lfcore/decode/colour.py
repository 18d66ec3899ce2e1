"""Camera colours to those of a screen: white balance, colour matrix, exposure, highlights, the sRGB curve, orientation."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt
import torch

from lfcore.formats.lytro.metadata import CaptureFacts, Quad, RawImage

Matrix = tuple[tuple[float, ...], ...]

_SHOULDER = 0.96  # linear light above this is bent towards white instead of being cut off there
_TABLE_BITS = 15  # of the curve's table over linear light 0 to 1


def gains(facts: CaptureFacts, raw: RawImage) -> Quad:
    """White balance for the pixels [0, 0], [0, 1], [1, 0], [1, 1] of the mosaic, the least gain being 1."""
    red, green_r, green_b, blue = facts.white_balance
    greens = iter((green_r, green_b) if raw.cfa[:2].count("R") else (green_b, green_r))
    values = [red if colour == "R" else blue if colour == "B" else next(greens) for colour in raw.cfa]
    least = min(values)
    first, second, third, fourth = (value / least for value in values)
    return first, second, third, fourth


def exposure(facts: CaptureFacts) -> float:
    """What linear light is multiplied by: 2^bias as the camera wishes, but never so dark that what burnt out turns grey."""
    return float(max(2.0**facts.modulation_bias, 1.0))


def camera_to_screen(facts: CaptureFacts) -> Matrix:
    """Camera RGB, white balanced, to linear sRGB with the exposure, as a matrix (3, 3)."""
    factor = exposure(facts)
    return tuple(tuple(round(factor * value, 7) for value in row) for row in facts.colour_matrix)


def stored_values(light: torch.Tensor, linear: bool, depth: int) -> npt.NDArray[np.generic]:
    """Linear light (..., 3) to 8 or 16 bits, with the sRGB curve unless `linear`; `light` is overwritten."""
    scale = (1 << _TABLE_BITS) - 1
    excess = light > _SHOULDER
    if bool(excess.any()):
        room = 1 - _SHOULDER
        light[excess] = 1 - room * torch.exp(-(light[excess] - _SHOULDER) / room)
    top = (1 << depth) - 1
    if linear:
        return _as_integers(light.clamp_(0, 1).mul_(top).add_(0.5), depth)
    if depth == 16:
        return _as_integers(_srgb(light.clamp_(0, 1)).mul_(top).add_(0.5), depth)
    indices = light.clamp_(0, 1).mul_(scale).add_(0.5).to(torch.int32)
    return np.asarray(torch.index_select(_table(), 0, indices.flatten()).reshape(light.shape).numpy())


def _as_integers(values: torch.Tensor, depth: int) -> npt.NDArray[np.generic]:
    return values.numpy().astype(np.uint8 if depth == 8 else np.uint16)


@lru_cache(maxsize=1)
def _table() -> torch.Tensor:
    light = torch.linspace(0, 1, 1 << _TABLE_BITS, dtype=torch.float64)
    return torch.round(255 * _srgb(light)).to(torch.uint8)


def _srgb(light: torch.Tensor) -> torch.Tensor:
    """The sRGB curve of IEC 61966-2-1."""
    return torch.where(light <= 0.0031308, 12.92 * light, 1.055 * light.clamp(min=1e-6) ** (1 / 2.4) - 0.055)


def upright(views: npt.NDArray[np.generic], orientation: int) -> npt.NDArray[np.generic]:
    """Views (V, U, H, W, 3) turned as EXIF's orientation (1 to 8) says, the grid of views together with each picture."""
    mirrored = orientation in (2, 4, 5, 7)
    quarter_turns = {1: 0, 2: 0, 3: 2, 4: 2, 5: 1, 6: 3, 7: 3, 8: 1}[orientation]  # anticlockwise, after mirroring
    if mirrored:
        views = views[:, ::-1, :, ::-1]
    views = np.rot90(np.rot90(views, quarter_turns, axes=(0, 1)), quarter_turns, axes=(2, 3))
    return np.ascontiguousarray(views)
