"""Fractal noise and smooth colours: the raw material of procedural textures and torn shapes."""

from __future__ import annotations

import math

import numpy as np
import torch
from torch import Tensor


def fractal(shape: tuple[int, int], slope: float, longest: float, rng: np.random.Generator, stretch: float = 1.0) -> Tensor:
    """Noise (H, W) of mean 0 and deviation 1 whose amplitude falls with frequency to the power -slope.

    Waves longer than `longest` px are held back. `stretch` above 1 draws it out along x, as fibres or blades are.
    """
    height, width = shape
    white = torch.from_numpy(rng.standard_normal(shape, dtype=np.float32))
    fy = torch.fft.fftfreq(height)[:, None]
    fx = torch.fft.rfftfreq(width)[None] * stretch
    radius = torch.sqrt(fx.square() + fy.square() + 1 / longest**2)
    shaped = torch.fft.irfft2(torch.fft.rfft2(white) * radius.pow(-slope), s=shape)
    shaped = shaped - float(shaped.numpy().mean())
    return shaped / max(float(shaped.numpy().std()), 1e-6)


def colour(rng: np.random.Generator, brightness: float | None = None) -> Tensor:
    """A linear colour (3,): any hue, mostly of moderate saturation, as the surfaces of things have."""
    hue, saturation = rng.uniform(0, 2 * np.pi), rng.beta(1.2, 3.0)
    value = brightness if brightness is not None else float(np.exp(rng.normal(-1.6, 0.6)))
    waves = [1 + saturation * math.cos(hue - 2 * np.pi * k / 3) for k in range(3)]
    return torch.tensor(waves, dtype=torch.float32) * value


def ramp(values: Tensor, dark: Tensor, light: Tensor) -> Tensor:
    """Colours (H, W, 3) between two colours for values of about -2 to 2."""
    weight = torch.sigmoid(values * 1.2).unsqueeze(-1)
    return torch.lerp(dark.expand(*values.shape, 3), light.expand(*values.shape, 3), weight)
