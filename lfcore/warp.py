"""Cubic interpolation and the backward warp by a disparity map (paper, Eq. 3 and the derivative of Section 3.3).

The kernel is Keys' cubic with a = -0.5, as in the authors' code. `torch.nn.functional.grid_sample` has a = -0.75 built in,
which is why the warp is put together here from bilinear samples. The sign of disparity is defined by `source_offset`, here
and nowhere else.
"""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor

from lfcore import kernels

CUBIC_A = -0.5
QUICK_A = -0.75  # built into torch
_BAND_SAMPLES = 2**18  # a warp works on bands of rows of so many samples, so that its temporaries stay small


def cubic_taps(fraction: Tensor) -> Tensor:
    """Weights of the samples at -1, 0, 1, 2 around a position `fraction` in [0, 1) past sample 0: (...) -> (..., 4).

    Keys (1981), a = -0.5. They sum to 1, and at fraction 0 are exactly (0, 1, 0, 0).
    """
    t = fraction.unsqueeze(-1)
    a = CUBIC_A
    near = torch.cat((t, 1 - t), -1)  # distance to samples 0 and 1
    far = torch.cat((1 + t, 2 - t), -1)  # distance to samples -1 and 2
    inner = ((a + 2) * near - (a + 3)) * near.square() + 1
    outer = ((a * far - 5 * a) * far + 8 * a) * far - 4 * a
    return torch.stack((outer[..., 0], inner[..., 0], inner[..., 1], outer[..., 1]), -1)


def source_offset(input_position: Tensor, novel_position: Tensor) -> Tensor:
    """p_i - q: what one pixel of disparity moves the sampling position in input i by. All (..., 2), ordered (u, v) = (x, y)."""
    return input_position - novel_position


def backward_warp(image: Tensor, disparity: Tensor, offset: Tensor, origin: tuple[float, float] = (0, 0)) -> Tensor:
    """Sample `image` at s + (p_i - q) D(s), differentiable in the disparity (paper, Eq. 3).

    image: (N, C, H, W) float32. disparity: (N or 1, 1, h, w) float32, px over the full baseline; one map may serve all images.
    offset: (N, 2) = p_i - q. origin: (y, x) in `image` of the disparity map's first pixel, where the map covers only a part of
    the image or lies between its pixels. Returns (N, C, h, w) float32; what falls outside the picture is 0, as in the authors'
    code.
    """
    _, _, height, width = image.shape
    x, y = _positions(disparity, offset, origin)
    if kernels.can_sample(image, x, y):
        return kernels.cubic_sample(image, x, y, CUBIC_A, outside=False)
    inside = (x >= 0) & (x <= width - 1) & (y >= 0) & (y <= height - 1)  # False for NaN
    return torch.where(inside.unsqueeze(1), _cubic_sample(image, x, y), 0)


def quick_warp(image: Tensor, disparity: Tensor, offset: Tensor, origin: tuple[float, float] = (0, 0)) -> Tensor:
    """The same warp by torch's own bicubic sampling: twice as fast, with a sharper kernel (a = -0.75).

    For models trained with it, not for the paper's. Arguments as for `backward_warp`. What falls outside
    the picture repeats its edge.
    """
    return quick_sample(image, *_positions(disparity, offset, origin))


def quick_sample(image: Tensor, x: Tensor, y: Tensor) -> Tensor:
    """Samples of (N, C, H, W) at the positions x and y, px, each (N, h, w), by torch's own bicubic kernel: (N, C, h, w)."""
    if kernels.can_sample(image, x, y):
        return kernels.cubic_sample(image, x, y, QUICK_A, outside=True)
    _, _, height, width = image.shape
    grid = torch.stack((_grid(x, width), _grid(y, height)), -1)
    return F.grid_sample(image, grid, mode="bicubic", padding_mode="border", align_corners=True)


def _positions(disparity: Tensor, offset: Tensor, origin: tuple[float, float]) -> tuple[Tensor, Tensor]:
    """Where to sample, x and y, px: both (N, h, w)."""
    h, w = disparity.shape[-2:]
    n = offset.shape[0]
    d = disparity[:, 0]  # (N or 1, h, w)
    rows = torch.arange(h, device=d.device, dtype=torch.float32).view(1, h, 1) + origin[0]
    columns = torch.arange(w, device=d.device, dtype=torch.float32).view(1, 1, w) + origin[1]
    return columns + offset[:, 0].view(n, 1, 1) * d, rows + offset[:, 1].view(n, 1, 1) * d


def _cubic_sample(image: Tensor, x: Tensor, y: Tensor) -> Tensor:
    """Keys' cubic interpolation of (N, C, H, W) at (x, y), each (N, h, w), as four bilinear samples: (N, C, h, w).

    Between samples 0 and 1 the cubic with a = -0.5 has their values f and central differences m, so that it is a blend of f by
    the smooth step 3 t^2 - 2 t^3, which is a linear interpolation at another place, plus t (1 - t) ((1 - t) m0 - t m1). Where
    the signs of m alternate from pixel to pixel, the bracket is, but for its sign, a linear interpolation of m at t.
    """
    _, _, height, width = image.shape
    slope_x, slope_y = _alternating_slope(image, -1), _alternating_slope(image, -2)
    slope_xy = _alternating_slope(slope_y, -1)
    band = max(_BAND_SAMPLES // (x.shape[0] * x.shape[2]), 1)  # rows

    def sampled(x: Tensor, y: Tensor) -> Tensor:
        smooth_x, plain_x, weight_x = _axis(x, width)
        smooth_y, plain_y, weight_y = _axis(y, height)
        across = _bilinear(image, smooth_x, smooth_y) + weight_x * _bilinear(slope_x, plain_x, smooth_y)
        return across + weight_y * (_bilinear(slope_y, smooth_x, plain_y) + weight_x * _bilinear(slope_xy, plain_x, plain_y))

    return torch.cat([sampled(*rows) for rows in zip(x.split(band, 1), y.split(band, 1), strict=True)], 2)


def _alternating_slope(image: Tensor, dim: int) -> Tensor:
    """Central differences along a dimension, where the edge is repeated, negative at odd places."""
    size = image.shape[dim]
    padded = F.pad(image, (1, 1, 0, 0) if dim == -1 else (0, 0, 1, 1), mode="replicate")
    signs = 0.5 - torch.arange(size, device=image.device) % 2
    return (padded.narrow(dim, 2, size) - padded.narrow(dim, 0, size)) * (signs if dim == -1 else signs.unsqueeze(1))


def _axis(position: Tensor, size: int) -> tuple[Tensor, Tensor, Tensor]:
    """Of positions along one axis, px: grid_sample's place of the smooth step, its plain place, both (N, h, w), and the weight
    of the slopes (N, 1, h, w)."""
    whole = position.detach().floor()
    t = position - whole
    weight = t * (1 - t) * (1 - 2 * whole.remainder(2))
    return _grid(whole + t * t * (3 - 2 * t), size), _grid(position, size), weight.unsqueeze(1)


def _grid(position: Tensor, size: int) -> Tensor:
    """Pixels 0 .. size - 1 as grid_sample wants them, -1 .. 1."""
    return position * (2 / max(size - 1, 1)) - 1


def _bilinear(image: Tensor, grid_x: Tensor, grid_y: Tensor) -> Tensor:
    return F.grid_sample(image, torch.stack((grid_x, grid_y), -1), mode="bilinear", padding_mode="border", align_corners=True)
