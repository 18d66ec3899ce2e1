"""Cubic interpolation and the backward warp by a disparity map (paper, Eq. 3 and the derivative of Section 3.3).

The kernel is Keys' cubic with a = -0.5, as in the authors' code. `torch.nn.functional.grid_sample` has a = -0.75 built in,
which is why the warp is written out here. The sign of disparity is defined by `source_offset`, here and nowhere else.
"""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor

CUBIC_A = -0.5


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


def cubic_tap_slopes(fraction: Tensor) -> Tensor:
    """Derivatives of `cubic_taps` with respect to the position: (...) -> (..., 4)."""
    t = fraction.unsqueeze(-1)
    a = CUBIC_A
    near = torch.cat((t, 1 - t), -1)
    far = torch.cat((1 + t, 2 - t), -1)
    inner = (3 * (a + 2) * near - 2 * (a + 3)) * near
    outer = (3 * a * far - 10 * a) * far + 8 * a
    # Distance grows with the position for the samples to the left, and shrinks for those to the right.
    return torch.stack((outer[..., 0], inner[..., 0], -inner[..., 1], -outer[..., 1]), -1)


def source_offset(input_position: Tensor, novel_position: Tensor) -> Tensor:
    """p_i - q: what one pixel of disparity moves the sampling position in input i by. All (..., 2), ordered (u, v) = (x, y)."""
    return input_position - novel_position


def backward_warp(
    image: Tensor, disparity: Tensor, offset: Tensor, origin: tuple[int, int] = (0, 0)
) -> Tensor:
    """Sample `image` at s + (p_i - q) D(s), differentiable in the disparity (paper, Eq. 3).

    image: (N, C, H, W) float32. disparity: (N, 1, h, w) float32, px over the full baseline. offset: (N, 2) = p_i - q.
    origin: (y, x) in `image` of the disparity map's first pixel, where the map covers only a part of the image. Returns
    (N, C, h, w) float32; what falls outside the picture is 0, as in the authors' code.
    """
    n, _, h, w = disparity.shape
    device = disparity.device
    rows = torch.arange(h, device=device, dtype=torch.float32).view(1, h, 1) + origin[0]
    columns = torch.arange(w, device=device, dtype=torch.float32).view(1, 1, w) + origin[1]
    d = disparity[:, 0]  # (N, h, w)
    x = columns + offset[:, 0].view(n, 1, 1) * d
    y = rows + offset[:, 1].view(n, 1, 1) * d
    sampled: Tensor = _CubicSample.apply(image, x, y)
    return sampled


def quick_warp(image: Tensor, disparity: Tensor, offset: Tensor, origin: tuple[int, int] = (0, 0)) -> Tensor:
    """The same warp by torch's own bicubic sampling: ten times as fast, with a sharper kernel (a = -0.75).

    For models trained with it, not for the paper's. Arguments as for `backward_warp`; the disparity of one map may serve all
    N images (1, 1, h, w). What falls outside the picture repeats its edge.
    """
    _, _, height, width = image.shape
    h, w = disparity.shape[-2:]
    n = offset.shape[0]
    d = disparity[:, 0]  # (N or 1, h, w)
    rows = torch.arange(h, device=d.device, dtype=torch.float32).view(1, h, 1) + origin[0]
    columns = torch.arange(w, device=d.device, dtype=torch.float32).view(1, 1, w) + origin[1]
    x = (columns + offset[:, 0].view(n, 1, 1) * d) * (2 / (width - 1)) - 1  # grid_sample's -1 .. 1
    y = (rows + offset[:, 1].view(n, 1, 1) * d) * (2 / (height - 1)) - 1
    return F.grid_sample(image, torch.stack((x, y), -1), mode="bicubic", padding_mode="border", align_corners=True)


class _CubicSample(torch.autograd.Function):
    """Bicubic samples of `image` at (x, y); the gradient goes to the positions, not to the image, which is never trained.

    Rows of four neighbouring pixels are laid side by side once, so that each sample needs four gathers, not sixteen.
    """

    @staticmethod
    def forward(ctx, image: Tensor, x: Tensor, y: Tensor) -> Tensor:  # type: ignore[no-untyped-def]
        n, c, height, width = image.shape
        _, h, w = x.shape
        inside = (x >= 0) & (x <= width - 1) & (y >= 0) & (y <= height - 1)  # (N, h, w); False for NaN
        x, y = x.where(inside, 0), y.where(inside, 0)
        column, row = x.floor(), y.floor()
        taps_x, taps_y = cubic_taps(x - column), cubic_taps(y - row)  # (N, h, w, 4)

        # (N, H, W, 4, C): at column j the pixels j - 1 .. j + 2. Taps beyond the image repeat its edge.
        near = torch.arange(-1, 3, device=image.device)
        neighbours = (torch.arange(width, device=image.device).unsqueeze(1) + near).clamp(0, width - 1)
        quads = image.permute(0, 2, 3, 1)[:, :, neighbours.flatten()].reshape(n * height * width, 4 * c)
        base = torch.arange(n, device=image.device).view(n, 1, 1) * (height * width) + column.long()
        needs_slopes = ctx.needs_input_grad[1] or ctx.needs_input_grad[2]
        slopes_y = cubic_tap_slopes(y - row) if needs_slopes else None
        blended = dy = None
        for k in range(4):
            line = base + (row.long() + (k - 1)).clamp(0, height - 1) * width
            quad = quads.index_select(0, line.flatten()).view(n, h, w, 4 * c)
            weighted = quad * taps_y[..., k : k + 1]
            blended = weighted if blended is None else blended.add_(weighted)
            if slopes_y is not None:
                weighted = quad * slopes_y[..., k : k + 1]
                dy = weighted if dy is None else dy.add_(weighted)
        assert blended is not None
        blended = blended.view(n, h, w, 4, c)
        mask = inside.unsqueeze(-1)
        out = (blended * taps_x.unsqueeze(-1)).sum(3) * mask  # (N, h, w, C)
        if dy is not None:
            slopes_x = cubic_tap_slopes(x - column)
            d_dx = (blended * slopes_x.unsqueeze(-1)).sum(3) * mask
            d_dy = (dy.view(n, h, w, 4, c) * taps_x.unsqueeze(-1)).sum(3) * mask
            ctx.save_for_backward(d_dx, d_dy)
        return out.permute(0, 3, 1, 2)

    @staticmethod
    def backward(ctx, grad: Tensor):  # type: ignore[no-untyped-def]
        d_dx, d_dy = ctx.saved_tensors  # (N, h, w, C)
        grad = grad.permute(0, 2, 3, 1)
        return None, (grad * d_dx).sum(-1), (grad * d_dy).sum(-1)
