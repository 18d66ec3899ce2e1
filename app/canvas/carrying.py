"""How the newest disparity map is carried to other viewpoints (shaders/carry.glsl)."""

from __future__ import annotations

import math

from app.canvas.passes import Uniform
from app.canvas.textures import Textures
from app.geometry import Point

# How often a disparity is looked up again where it led to, while nothing moves by more px than that. Within half a pixel it
# leads to the pixel itself; up to one, more would show another picture for hardly a pixel (docs/speed.md).
_STEPS = ((0.5, 0), (1.0, 1))
_MOST_STEPS = 3


def carrying(textures: Textures, viewpoint: Point, farthest: float | None = None) -> dict[str, Uniform]:
    """The uniforms of carry.glsl, and the viewpoint. farthest: how far from the map's own viewpoint it is carried, of the
    baseline, if not to `viewpoint`. There must be a map."""
    made_at = textures.made_at
    assert made_at is not None
    steps = steps_to(textures, viewpoint, farthest)
    return {"made_at": made_at, "nearest_disparity": textures.disparity_range[0], "steps": steps, "viewpoint": viewpoint}


def steps_to(textures: Textures, viewpoint: Point, farthest: float | None = None) -> int:
    """How often disparities are looked up again; arguments as above."""
    assert textures.made_at is not None
    distance = math.dist(textures.made_at, viewpoint) if farthest is None else farthest
    reach = distance * max(map(abs, textures.disparity_range))
    return next((steps for most, steps in _STEPS if reach <= most), _MOST_STEPS)
