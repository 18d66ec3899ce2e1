"""Smooth interpolation of layers: cubic B-splines through the samples, at any sub-pixel place.

A cubic B-spline through the samples (Unser 1999) keeps fine detail far better between the pixels than Keys' cubic does, so that
views differ by their place and not by their sharpness. The spline's 16 taps are read as four bilinear samples (Sigg and
Hadwiger 2005), which torch does fast on one thread.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor
from torch.nn import functional


def spline_coefficients(picture: Tensor, sigma: float) -> Tensor:
    """Blur (H, W, C) by a Gaussian of `sigma` px and turn it into spline coefficients (1, C, H, W), channels last.

    One pass through the Fourier domain does both; the picture is taken as periodic, so keep a margin of a few sigma.
    """
    height, width, _ = picture.shape
    transfer = _transfer(height, sigma)[:, None] * _transfer(width, sigma)[None, : width // 2 + 1]  # (H, W/2 + 1)
    planes = picture.permute(2, 0, 1)
    filtered = torch.fft.irfft2(torch.fft.rfft2(planes) * transfer, s=(height, width))  # (C, H, W)
    return filtered.unsqueeze(0).contiguous(memory_format=torch.channels_last)


def _transfer(size: int, sigma: float) -> Tensor:
    frequency = torch.fft.fftfreq(size)  # cycles per px
    gaussian = torch.exp(-2 * (math.pi * sigma * frequency) ** 2)
    spline = (2 + torch.cos(2 * math.pi * frequency)) / 3  # the B-spline's own taps 1/6, 4/6, 1/6
    return gaussian / spline


def blur(picture: Tensor, sigma: float) -> Tensor:
    """Blur (H, W, C) or (H, W) by a Gaussian of `sigma` px; the picture is taken as periodic."""
    if sigma <= 0:
        return picture
    planes = picture if picture.dim() == 2 else picture.permute(2, 0, 1)
    height, width = planes.shape[-2:]
    rows = torch.exp(-2 * (math.pi * sigma * torch.fft.fftfreq(height)) ** 2)
    columns = torch.exp(-2 * (math.pi * sigma * torch.fft.rfftfreq(width)) ** 2)
    blurred = torch.fft.irfft2(torch.fft.rfft2(planes) * rows[:, None] * columns, s=(height, width))
    return blurred if picture.dim() == 2 else blurred.permute(1, 2, 0)


def sample_spline(coefficients: Tensor, x: Tensor, y: Tensor) -> Tensor:
    """Values (h, w, C) of the spline (1, C, H, W) at pixel places x, y (h, w); beyond the edge the edge repeats."""
    _, _, height, width = coefficients.shape
    x_near, x_far, x_weight = _pairs(x, width)
    y_near, y_far, y_weight = _pairs(y, height)
    upper = _blend(coefficients, x_near, x_far, x_weight, y_near)
    lower = _blend(coefficients, x_near, x_far, x_weight, y_far)
    return torch.lerp(upper, lower, y_weight.unsqueeze(-1))


def _pairs(place: Tensor, size: int) -> tuple[Tensor, Tensor, Tensor]:
    """Two places between taps, in grid_sample's units, whose bilinear samples make up the four taps, and the second's weight."""
    whole = place.floor()
    t = place - whole
    rest = 1 - t
    w0, w3 = rest * rest * rest / 6, t * t * t / 6
    w1 = 2 / 3 - t * t * (1 - t / 2)
    near = w0 + w1
    scale = 2 / (size - 1)
    first = (whole + (w1 / near - 1)) * scale - 1
    second = (whole + (w3 / (1 - near) + 1)) * scale - 1
    return first, second, 1 - near


def _blend(coefficients: Tensor, x_near: Tensor, x_far: Tensor, weight: Tensor, y: Tensor) -> Tensor:
    return torch.lerp(_bilinear(coefficients, x_near, y), _bilinear(coefficients, x_far, y), weight.unsqueeze(-1))


def _bilinear(planes: Tensor, x: Tensor, y: Tensor) -> Tensor:
    grid = torch.stack((x, y), -1).unsqueeze(0)
    sampled = functional.grid_sample(planes, grid, mode="bilinear", padding_mode="border", align_corners=True)
    return sampled[0].permute(1, 2, 0)  # (h, w, C)
