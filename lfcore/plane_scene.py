"""A textured scene of slanted planes whose picture from any viewpoint is known exactly: the truth for the model of the camera.

Positions (x, y) and disparities are in pitches of the microlenses, x to the right, y downwards, from the picture's centre.
The aperture (u, v) is in shares of the diameter of a microlens's picture: -0.5 to 0.5 from edge to edge. A plane seen at (x, y)
from the middle of the aperture is seen at (x, y) + d(x, y) (u, v) from (u, v), d being its disparity; near planes have the
smaller d.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import torch

TEXELS = 4  # per pitch of the microlenses: finer than any detail in the textures


@dataclass(frozen=True)
class Plane:
    """A plane: its texture (3, H, W) in linear light, disparity at the centre, slope, and the disc or whole that it fills.

    `disparity` d(x, y) = disparity + slope[0] x + slope[1] y. `radius` None is the background; else the plane is a disc around
    `centre` whose edge is soft over `softness` pitches.
    """

    texture: torch.Tensor
    disparity: float
    slope: tuple[float, float] = (0.0, 0.0)
    centre: tuple[float, float] = (0.0, 0.0)
    radius: float | None = None
    softness: float = 0.5

    def seen(self, x: torch.Tensor, y: torch.Tensor, u: torch.Tensor, v: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Where the ray through (x, y, u, v) meets the plane, as the position at which the middle of the aperture sees it."""
        slope_x, slope_y = self.slope
        d = (self.disparity + slope_x * x + slope_y * y) / (1 + slope_x * u + slope_y * v)
        return x - d * u, y - d * v

    def colour(self, x: torch.Tensor, y: torch.Tensor) -> torch.Tensor:
        """The texture at these places, bilinear: (...,) -> (..., 3)."""
        height, width = self.texture.shape[1:]
        grid = torch.stack([2 * TEXELS / width * x, 2 * TEXELS / height * y], dim=-1)
        sampled = torch.nn.functional.grid_sample(
            self.texture[None], grid.reshape(1, 1, -1, 2), padding_mode="reflection", align_corners=False
        )  # (1, 3, 1, N)
        return sampled[0, :, 0].T.reshape(*x.shape, 3)

    def cover(self, x: torch.Tensor, y: torch.Tensor) -> torch.Tensor:
        """How much of what is behind the plane hides: 0 to 1."""
        assert self.radius is not None
        outside = torch.hypot(x - self.centre[0], y - self.centre[1]) - self.radius
        return torch.clamp(0.5 - outside / self.softness, 0, 1)


@dataclass(frozen=True)
class PlaneScene:
    """Planes from the farthest (the background) to the nearest."""

    planes: tuple[Plane, ...] = field(default_factory=tuple)

    def radiance(self, x: torch.Tensor, y: torch.Tensor, u: torch.Tensor, v: torch.Tensor) -> torch.Tensor:
        """Linear sRGB light of the rays through (x, y, u, v), all of one shape: (...,) -> (..., 3), 1 = white."""
        background, *others = self.planes
        light = background.colour(*background.seen(x, y, u, v))
        for plane in others:
            place = plane.seen(x, y, u, v)
            cover = plane.cover(*place)[..., None]
            hit = cover[..., 0] > 0
            light[hit] += cover[hit] * (plane.colour(place[0][hit], place[1][hit]) - light[hit])
        return light


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
