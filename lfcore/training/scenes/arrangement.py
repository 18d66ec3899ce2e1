"""What a scene is made of: things at their depths, covered with textures, lit, casting shadows, near ones before far ones."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from lfcore.training.scenes import shapes, surfaces
from lfcore.training.scenes.noise import fractal
from lfcore.training.scenes.render import Glint, Layer
from lfcore.training.scenes.sampling import blur
from lfcore.training.scenes.shapes import Shape
from lfcore.training.scenes.surfaces import Canvas
from lfcore.training.scenes.textures import Textures, procedural

Range = tuple[float, float]

_STEEPEST = 0.6  # px of disparity per px


@dataclass(frozen=True)
class ContentConfig:
    """Ranges and shares from which the content of a scene is drawn. Disparities are px over the full baseline."""

    layers: tuple[int, int] = (4, 14)
    largest_disparity: float = 21.0
    lytro_share: float = 0.5  # scenes within -6..6, as the camera's own are
    wide_share: float = 0.12  # scenes that may reach the largest disparity; the others lie within -12..12
    photograph_share: float = 0.75  # textures that are photographs, where there are any
    photographs: tuple[int, int] = (1, 5)  # of so many a scene's surfaces are covered
    slanted_share: float = 0.65  # scenes whose things share a slant, like the ground they stand on
    shadow_share: float = 0.6
    translucent_share: float = 0.08  # layers that let through what is behind
    glint_share: float = 0.15  # bodies with a moving highlight
    defocus_share: float = 0.35  # scenes whose lens is focused so shallowly that it shows
    largest_defocus: float = 4.0  # px, deviation of the blur at the end of the range


@dataclass(frozen=True)
class _Material:
    """The photographs that this scene is made of, and the mixture with procedural textures."""

    textures: Textures
    photographs: tuple[int, ...]
    share: float

    def draw(self, shape: tuple[int, int], rng: np.random.Generator) -> Tensor:
        """A texture (H, W, 3), linear."""
        if not self.photographs or rng.random() >= self.share:
            return procedural(shape, rng)
        index = self.photographs[int(rng.integers(len(self.photographs)))]
        picture = self.textures.crop(index, shape, rng)
        if rng.random() < 0.3:
            picture = picture[..., torch.from_numpy(rng.permutation(3))]
        grey = picture.mean(-1, keepdim=True)
        gains = torch.from_numpy(np.exp(rng.normal(0, 0.15, 3)).astype(np.float32))
        return torch.lerp(grey, picture, float(rng.uniform(0.3, 1))) * gains + 0.003


def arrange(
    canvas: Canvas, textures: Textures, config: ContentConfig, softness: float, rng: np.random.Generator
) -> list[Layer]:
    """Draw a scene's layers, from back to front; `softness` px is the camera's own blur."""
    low, high = draw_range(config, rng)
    count = int(rng.integers(config.layers[0], config.layers[1] + 1))
    material = _draw_material(textures, config, rng)
    drawn = [_draw_shape(k / (count - 1), canvas, rng) for k in range(count)]
    grids = _draw_surfaces(canvas, drawn, config, high - low, rng)
    grids = _stretch(canvas, drawn, grids, low, high)
    pictures = [material.draw(canvas.full, rng) * shape.shade.unsqueeze(-1) for shape in drawn]
    pictures = _light(pictures, rng)
    if rng.random() < config.shadow_share:
        pictures = _cast_shadows(canvas, pictures, drawn, grids, rng)
    blurs = _draw_blurs(canvas, drawn, grids, config, softness, rng)
    layers = []
    for k, (shape, grid, picture, sigma) in enumerate(zip(drawn, grids, pictures, blurs, strict=True)):
        alpha = shape.alpha
        if k > 0 and rng.random() < config.translucent_share:
            alpha = alpha * _translucency(canvas, rng)
        rgba = torch.cat((picture * alpha.unsqueeze(-1), alpha.unsqueeze(-1)), -1)
        glint = None
        if shape.solid and rng.random() < config.glint_share:
            glint = _draw_glint(canvas, shape, grid, picture, config, rng)
        layers.append(Layer(rgba, grid, sigma, glint))
    return layers


def draw_range(config: ContentConfig, rng: np.random.Generator) -> tuple[float, float]:
    """Smallest and largest disparity of a scene, px over the full baseline."""
    kind = rng.random()
    if kind < config.lytro_share:
        limit, smallest = 6.0, 2.0
    elif kind < 1 - config.wide_share:
        limit, smallest = 12.0, 4.0
    else:
        limit, smallest = config.largest_disparity, 10.0
    limit = min(limit, config.largest_disparity)
    width = rng.uniform(min(smallest, limit), 1.4 * limit)
    low = rng.uniform(-limit, limit - width)
    return low, low + width


def _draw_material(textures: Textures, config: ContentConfig, rng: np.random.Generator) -> _Material:
    count = min(int(rng.integers(config.photographs[0], config.photographs[1] + 1)), len(textures.files))
    chosen = rng.choice(len(textures.files), count, replace=False) if count else np.empty(0, np.int64)
    # Some scenes are all photograph, some all pattern; most are mixed.
    share = float(np.clip(config.photograph_share + rng.normal(0, 0.25), 0, 1))
    return _Material(textures, tuple(int(index) for index in chosen), share)


def _draw_shape(depth: float, canvas: Canvas, rng: np.random.Generator) -> Shape:
    """A thing at relative depth 0 (back) to 1 (front): bodies behind, thin things before them."""
    if depth == 0:
        return Shape(torch.ones(canvas.full), torch.ones(canvas.full), solid=False)
    if depth < 0.4 and rng.random() < 0.2:
        return shapes.ground(canvas.full, rng)
    kinds = shapes.THIN if rng.random() < 0.25 + 0.4 * depth else shapes.BODIES
    return kinds[int(rng.integers(len(kinds)))](canvas.full, rng)


def _draw_surfaces(
    canvas: Canvas, drawn: list[Shape], config: ContentConfig, span: float, rng: np.random.Generator
) -> list[Tensor]:
    """Disparities in units of the scene's range, `span` px, each thing before all that it covers."""
    count = len(drawn)
    slant = torch.zeros(canvas.coarse)
    if rng.random() < config.slanted_share:
        size, angle = rng.uniform(0.05, 0.5), np.pi / 2 + rng.normal(0, 0.5)
        slant = surfaces.plane(canvas, -size * math.cos(angle), -size * math.sin(angle))
    gaps = rng.exponential(1, count - 1) + 0.1
    offsets = -np.concatenate(([0], np.cumsum(gaps) / gaps.sum()))
    front = torch.full(canvas.coarse, math.inf)
    grids = []
    for shape, offset in zip(drawn, offsets, strict=True):
        form = _own_form(canvas, shape, 1.5 / count, rng)
        # No surface may fold over in any view: at 1 px per px it would be seen edge on.
        form = form * min(1.0, _STEEPEST / max(surfaces.steepness(form) * span, 1e-6))
        grid = slant + float(offset) + form
        present = _widen(canvas.shrink(shape.alpha) > 0.02)
        # What would stand out behind its background is brought forward as a whole, so that its form stays.
        excess = (grid - front)[present]
        if len(excess):
            grid = grid - float(excess.max().clamp_min(0))
        front = torch.where(present, torch.minimum(front, grid), front)
        grids.append(grid)
    return grids


def _own_form(canvas: Canvas, shape: Shape, scale: float, rng: np.random.Generator) -> Tensor:
    """Flat, slanted, folded, rounded or bulging, in units of the scene's range."""
    kind = rng.random()
    size = scale * rng.uniform(0.2, 1.2)
    if shape.solid and kind < 0.5:
        height = blur(shape.alpha, max(canvas.full) * rng.uniform(0.03, 0.1))
        return -size * canvas.shrink(height)
    if kind < 0.25:
        return torch.zeros(canvas.coarse)
    if kind < 0.65:
        return surfaces.plane(canvas, *(size * rng.normal(0, 1, 2)))
    if kind < 0.85:
        return size * surfaces.waves(canvas, rng)
    return size * surfaces.ridge(canvas, rng)


def _widen(mask: Tensor) -> Tensor:
    """A mask on the coarse grid, wider by two points."""
    return functional.max_pool2d(mask[None, None].float(), 5, 1, 2)[0, 0] > 0


def _stretch(canvas: Canvas, drawn: list[Shape], grids: list[Tensor], low: float, high: float) -> list[Tensor]:
    """Scale and move all surfaces alike, so that what can be seen of them spans `low` to `high`."""
    visible = [grid[canvas.shrink(shape.alpha) > 0.02] for shape, grid in zip(drawn, grids, strict=True)]
    values = torch.cat(visible)
    least, most = float(values.min()), float(values.max())
    scale = (high - low) / max(most - least, 1e-6)
    return [((grid - least) * scale + low).clamp(low, high) for grid in grids]


def _light(pictures: list[Tensor], rng: np.random.Generator) -> list[Tensor]:
    """Bring the textures to one light: each of a brightness of its own about the scene's, all of one tint."""
    tint = torch.from_numpy(np.exp(rng.normal(0, 0.12, 3)).astype(np.float32))
    spread = rng.uniform(0.2, 0.8)
    lit = []
    for picture in pictures:
        brightness = float(picture.numpy()[::4, ::4].mean())
        wanted = 0.2 * math.exp(float(np.clip(rng.normal(0, spread), -1.8, 1.6)))
        # Half way to the wanted brightness: photographs keep some of their own.
        lit.append(picture * tint * (wanted / max(brightness, 0.01)) ** 0.8)
    return lit


def _cast_shadows(
    canvas: Canvas, pictures: list[Tensor], drawn: list[Shape], grids: list[Tensor], rng: np.random.Generator
) -> list[Tensor]:
    """Each thing darkens what is behind it: the nearer, the darker and the sharper."""
    angle, depth = rng.uniform(0, 2 * np.pi), rng.uniform(0.25, 0.7)
    shadows = [torch.ones(canvas.coarse) for _ in pictures]
    means = [float(grid.numpy().mean()) for grid in grids]
    span = max(means[0] - means[-1], 1e-3)
    for k in range(1, len(drawn)):
        cover = canvas.shrink(drawn[k].alpha)
        for j in range(max(k - 3, 0), k):
            gap = max(means[j] - means[k], 0) / span
            reach = 2 + 14 * gap
            shift = round(reach * math.sin(angle)), round(reach * math.cos(angle))
            shadow = blur(torch.roll(cover, shift, (0, 1)), 0.6 + 6 * gap)
            shadows[j] = shadows[j] * (1 - depth * max(1 - gap, 0.2) * shadow.clamp(0, 1))
    return [picture * canvas.enlarge(shadow).unsqueeze(-1) for picture, shadow in zip(pictures, shadows, strict=True)]


def _draw_blurs(
    canvas: Canvas,
    drawn: list[Shape],
    grids: list[Tensor],
    config: ContentConfig,
    softness: float,
    rng: np.random.Generator,
) -> list[float]:
    means = []
    for shape, grid in zip(drawn, grids, strict=True):
        present = grid[canvas.shrink(shape.alpha) > 0.3]
        means.append(float((present if len(present) else grid).numpy().mean()))
    if rng.random() >= config.defocus_share:
        return [softness] * len(means)
    focus = rng.uniform(min(means), max(means))
    farthest = max(max(abs(mean - focus) for mean in means), 1e-3)
    strength = config.largest_defocus * rng.random() ** 2
    return [math.hypot(softness, strength * abs(mean - focus) / farthest) for mean in means]


def _translucency(canvas: Canvas, rng: np.random.Generator) -> Tensor:
    """Coverage of 0.3 to 0.8, even or cloudy."""
    level = rng.uniform(0.35, 0.75)
    if rng.random() < 0.5:
        return torch.full(canvas.full, level)
    return (level + 0.1 * fractal(canvas.full, 1.8, 200, rng)).clamp(0.3, 0.8)


def _draw_glint(
    canvas: Canvas, shape: Shape, grid: Tensor, picture: Tensor, config: ContentConfig, rng: np.random.Generator
) -> Glint | None:
    """Bright spots on a body, as of a lamp that is mirrored in it: they lie before or behind its surface."""
    places = (shape.alpha.numpy() > 0.9).nonzero()
    if not len(places[0]):
        return None
    y = torch.arange(canvas.full[0], dtype=torch.float32)[:, None]
    x = torch.arange(canvas.full[1], dtype=torch.float32)[None]
    spots = torch.zeros(canvas.full)
    for _ in range(int(rng.integers(1, 5))):
        middle = int(rng.integers(len(places[0])))
        angle, long, short = rng.uniform(0, np.pi), rng.uniform(2, 14), rng.uniform(1.2, 5)
        dx, dy = x - float(places[1][middle]), y - float(places[0][middle])
        along, across = dx * math.cos(angle) + dy * math.sin(angle), dy * math.cos(angle) - dx * math.sin(angle)
        spots += torch.exp(-(((along / long).square() + (across / short).square()) ** rng.uniform(0.8, 2.5)))
    strength = rng.uniform(0.3, 4) * max(float(picture.numpy()[::4, ::4].mean()), 0.05)
    limit = config.largest_disparity
    offset = rng.uniform(0.1, 0.4) * rng.choice((-1, 1)) * (1 + float(grid.max() - grid.min()) + rng.uniform(0, 8))
    light = (spots * strength).unsqueeze(-1).expand(*canvas.full, 3)
    return Glint(light, (grid + float(offset)).clamp(-limit, limit))
