"""A textured scene of slanted planes whose picture from any viewpoint is known exactly: the truth for the model of the camera.

Positions (x, y) and disparities are in pitches of the microlenses, x to the right, y downwards, from the picture's centre.
The aperture (u, v) is in shares of the diameter of a microlens's picture: -0.5 to 0.5 from edge to edge. A plane seen at (x, y)
from the middle of the aperture is seen at (x, y) + d(x, y) (u, v) from (u, v), d being its disparity; near planes have the
smaller d.
"""

from __future__ import annotations

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
