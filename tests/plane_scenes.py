"""Scenes of lfcore.plane_scene that the decoding of a camera's pictures is tested on."""

from __future__ import annotations

import math

import torch

from lfcore.plane_scene import TEXELS, Plane, PlaneScene


def natural_texture(size: tuple[int, int], seed: int, contrast: float = 0.5) -> torch.Tensor:
    """Clouds of all sizes with discs and bars of plain colour over them, (3, H, W) linear light; `size` in pitches (x, y).

    Detail is limited to what a lens in front of the microlenses would pass: a blur of 0.35 pitches (standard deviation).
    """
    draw = torch.Generator().manual_seed(seed)
    width, height = (math.ceil(side * TEXELS) for side in size)
    fy, fx = torch.fft.fftfreq(height)[:, None], torch.fft.rfftfreq(width)[None]
    radius = torch.hypot(fx, fy).clamp(min=1 / max(width, height))
    layers = []
    for spread in (1.0, 0.25, 0.25):  # brightness, and two differences of colour
        noise = torch.complex(*torch.randn(2, height, width // 2 + 1, generator=draw))
        cloud = torch.fft.irfft2(noise * radius**-1.4, s=(height, width))
        layers.append(spread * cloud / cloud.std())
    light, red, blue = layers
    texture = torch.stack([light + red, light - 0.3 * red - 0.3 * blue, light + blue])
    y, x = torch.meshgrid(torch.arange(height), torch.arange(width), indexing="ij")
    for _ in range(max(width * height // 40_000, 4)):
        cx, cy, reach, angle = (torch.rand(4, generator=draw) * torch.tensor([width, height, 60.0, math.pi])).tolist()
        shift = torch.randn(3, 1, generator=draw)
        along = (x - cx) * math.cos(angle) + (y - cy) * math.sin(angle)
        across = (y - cy) * math.cos(angle) - (x - cx) * math.sin(angle)
        inside = torch.hypot(along, across) < reach if angle < 1 else (along.abs() < 3 * reach) & (across.abs() < 0.15 * reach)
        texture[:, inside] = 0.5 * texture[:, inside] + shift
    blur = torch.exp(-0.5 * (2 * math.pi * 0.35 * TEXELS) ** 2 * radius**2)
    smooth = torch.fft.irfft2(torch.fft.rfft2(texture) * blur, s=(height, width))
    smooth = smooth / smooth.std()
    return (0.22 * torch.exp2(1.6 * contrast * smooth)).clamp(0.004, 0.92)


def patches_texture(size: tuple[int, int], columns: int, rows: int, seed: int) -> torch.Tensor:
    """A chart of `columns` x `rows` patches of plain colour, (3, H, W) linear light; `size` in pitches (x, y)."""
    draw = torch.Generator().manual_seed(seed)
    width, height = (math.ceil(side * TEXELS) for side in size)
    hues = 0.05 + 0.6 * torch.rand(3, rows, columns, generator=draw)
    hues = 0.65 * hues + 0.35 * hues.mean(0, keepdim=True)  # what paints and prints reach, and the sensor can tell apart
    return torch.nn.functional.interpolate(hues[None], (height, width), mode="nearest")[0]


def slanted_scene(size: tuple[float, float], seed: int, depth: float = 1.0) -> PlaneScene:
    """A background and three slanted discs in front of it, for a picture of `size` pitches (x, y).

    Disparities reach from 4 to -6 pitches over the whole aperture times `depth`: 2 to -3 px over the middle 8 x 8 views.
    """
    width, height = size
    texture_size = (math.ceil(width * 1.2), math.ceil(height * 1.2))
    textures = [natural_texture(texture_size, 10 * seed + n) for n in range(4)]
    radius = 0.24 * min(size)
    return PlaneScene(
        (
            Plane(textures[0], 3.0 * depth, (2.0 * depth / width, 0.0)),
            Plane(textures[1], 0.5 * depth, (0.0, 1.5 * depth / height), (-0.24 * width, -0.15 * height), radius),
            Plane(textures[2], -2.0 * depth, (1.5 * depth / width, 0.0), (0.22 * width, -0.12 * height), 0.9 * radius),
            Plane(textures[3], -5.0 * depth, (0.0, -2.0 * depth / height), (0.02 * width, 0.27 * height), 0.8 * radius),
        )
    )


def patches_scene(size: tuple[float, float], columns: int = 6, rows: int = 4, seed: int = 1) -> PlaneScene:
    """A chart of plain colours in the plane of focus."""
    width, height = size
    texture = patches_texture((math.ceil(width), math.ceil(height)), columns, rows, seed)
    return PlaneScene((Plane(texture, 0.0),))
