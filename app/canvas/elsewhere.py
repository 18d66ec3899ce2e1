"""What is seen from other viewpoints than the one on screen, from what is at hand."""

from __future__ import annotations

import math

import moderngl

from app.canvas.carrying import carrying
from app.canvas.passes import AnyTexture, Passes, Uniform
from app.canvas.textures import Textures
from app.geometry import Point
from app.state import CARRIED
from app.tone import Tone


def draw_elsewhere(
    passes: Passes,
    textures: Textures,
    target: moderngl.Framebuffer,
    tile: tuple[int, int],
    at: Point,
    tone: Tone,
    shift: Point = (0.0, 0.0),
) -> None:
    """Draw what is seen from `at` into the target, its first pixel at `tile`, moved by `shift` px to smaller x and y.

    It is the newest synthesis, carried by its disparity, where that is near, else the corner views, warped by the same
    disparity. There must be one.
    """
    made_at = textures.made_at
    assert made_at is not None
    near = made_at == textures.newest_at and math.dist(at, made_at) <= CARRIED.far
    sampled: dict[str, AnyTexture] = {"disparity_map": textures.disparity_map}
    uniforms: dict[str, Uniform] = {**carrying(textures, at), "tile": tile, "shift": shift}
    if near:
        sampled["syntheses"] = textures.syntheses
        uniforms["newest"] = textures.newest
    else:
        sampled["corner_views"] = textures.corner_views
    target.viewport = (*tile, *textures.size)
    target.use()
    passes.toned("elsewhere.frag", tone, seen="seen_carried.glsl" if near else "seen_warped.glsl").render(sampled, uniforms)
