"""Mattes: the outlines of things, one pixel soft, with how light falls on them. All are drawn on a layer of (H, W) px."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from lfcore.lightfield import FloatArray
from lfcore.training.scenes.noise import fractal
from lfcore.training.scenes.sampling import blur


@dataclass(frozen=True)
class Shape:
    """An outline on a layer: how much it covers of each pixel, and by how much its shading brightens the texture there."""

    alpha: Tensor  # (H, W), 0 to 1
    shade: Tensor  # (H, W), about 0.3 to 1.5
    solid: bool = False  # whether the outline bounds one body, which may bulge


@dataclass(frozen=True)
class Stroke:
    """A straight piece of a line: ends (x, y) and half widths there in px, and brightness."""

    start: tuple[float, float]
    end: tuple[float, float]
    start_width: float
    end_width: float
    tone: float = 1.0


Draw = Callable[[tuple[int, int], np.random.Generator], Shape]


def blob(shape: tuple[int, int], rng: np.random.Generator) -> Shape:
    """A rounded body somewhere in the picture."""
    x, y, size = _place(shape, rng, 0.12, 0.45)
    angle = torch.atan2(y, x)
    radius = torch.full_like(x, size)
    for k in range(1, 6):
        radius += size * 0.35 / k * rng.normal() * torch.cos(k * angle + rng.uniform(0, 2 * np.pi))
    alpha = (radius - torch.sqrt(x.square() + y.square() * rng.uniform(0.6, 1.7)) + 0.5).clamp(0, 1)
    return Shape(alpha, _body_shade(alpha, size, rng), solid=True)


def polygon(shape: tuple[int, int], rng: np.random.Generator) -> Shape:
    """A flat piece with straight edges: box, card, sign, stone."""
    x, y, size = _place(shape, rng, 0.12, 0.45)
    edges = int(rng.choice((3, 4, 4, 4, 5, 6)))
    turn = rng.uniform(0, 2 * np.pi) if rng.random() < 0.6 else np.pi / edges + rng.normal(0, 0.05)
    inside = torch.full_like(x, math.inf)
    for k in range(edges):
        direction = turn + 2 * np.pi * (k + rng.uniform(-0.12, 0.12)) / edges
        inside = torch.minimum(inside, size * rng.uniform(0.5, 1) - x * math.cos(direction) - y * math.sin(direction))
    alpha = (inside + 0.5).clamp(0, 1)
    return Shape(alpha, _gradient_shade(shape, rng), solid=rng.random() < 0.3)


def torn(shape: tuple[int, int], rng: np.random.Generator) -> Shape:
    """Thresholded noise: clumps with ragged outlines and holes, as bushes and moss have."""
    field = fractal(shape, rng.uniform(1.2, 2.2), rng.uniform(40, 200), rng)
    grade = fractal(shape, 2.5, 400, rng)
    level = rng.uniform(0.0, 1.2)
    alpha = ((field + 0.8 * grade - level) * rng.uniform(4, 12) + 0.5).clamp(0, 1)
    return Shape(alpha, (1 + 0.18 * field).clamp(0.4, 1.5))


def window(shape: tuple[int, int], rng: np.random.Generator) -> Shape:
    """Everything but a hole that one looks through."""
    draw = blob if rng.random() < 0.5 else polygon
    hole = draw(shape, rng)
    return Shape(1 - hole.alpha, _gradient_shade(shape, rng))


def ground(shape: tuple[int, int], rng: np.random.Generator) -> Shape:
    """All below a rough horizon, or beside it where it is turned: table, earth, wall."""
    height, width = shape
    profile = fractal((1, width), 1.5, width, rng)[0] * rng.uniform(0, 0.03) * height
    horizon = rng.uniform(0.25, 0.75) * height
    y = torch.arange(height, dtype=torch.float32)[:, None]
    alpha = (y - horizon - profile * (rng.random() < 0.6) + 0.5).clamp(0, 1)
    return Shape(alpha.expand(height, width), _gradient_shade(shape, rng))


def leaves(shape: tuple[int, int], rng: np.random.Generator) -> Shape:
    """One large leaf to thirty small ones, with veins, and with holes eaten into some."""
    count = int(np.exp(rng.uniform(0, math.log(30))))
    longest = max(shape) * float(np.clip(rng.uniform(0.35, 0.9) / count**0.45, 0.06, 0.9))
    alpha, shade = np.zeros(shape, np.float32), np.ones(shape, np.float32)
    middle = rng.uniform(0.15, 0.85, 2) * (shape[1], shape[0])
    spread = max(shape) * rng.uniform(0.15, 0.5)
    direction, veins, slim = rng.uniform(0, 2 * np.pi), rng.uniform(0, 0.35), rng.uniform(0.12, 0.4)
    for _ in range(count):
        base = middle + rng.normal(0, spread, 2) * (count > 1)
        turn = direction + rng.normal(0, 0.9)
        _draw_leaf(alpha, shade, base, turn, longest * rng.uniform(0.6, 1.2), slim, veins, rng)
    return Shape(torch.from_numpy(alpha), torch.from_numpy(shade))


def _draw_leaf(
    alpha: FloatArray,
    shade: FloatArray,
    base: np.ndarray,
    turn: float,
    length: float,
    slim: float,
    veins: float,
    rng: np.random.Generator,
) -> None:
    """Draw one leaf over what is there."""
    height, width = alpha.shape
    left, right = (int(np.clip(base[0] + side * length * 1.1, 0, width)) for side in (-1, 1))
    top, bottom = (int(np.clip(base[1] + side * length * 1.1, 0, height)) for side in (-1, 1))
    if right - left < 2 or bottom - top < 2:
        return
    y, x = np.mgrid[top:bottom, left:right].astype(np.float32)
    x, y = x - np.float32(base[0]), y - np.float32(base[1])
    t = (x * math.cos(turn) + y * math.sin(turn)) / length  # 0 at the stem, 1 at the tip
    across = y * math.cos(turn) - x * math.sin(turn) + length * rng.uniform(-0.3, 0.3) * (t * (1 - t))
    inside = np.clip(t, 0, 1)
    half = slim * length * np.maximum(np.sin(np.pi * inside ** rng.uniform(0.6, 1.1)), 0) ** rng.uniform(0.7, 1.3)
    if rng.random() < 0.4:
        half *= 1 - rng.uniform(0.05, 0.2) * np.abs(((t * rng.integers(5, 16)) % 1) * 2 - 1)
    cover = np.clip(np.minimum(half - np.abs(across), length * np.minimum(t, 1 - t)) + 0.5, 0, 1)
    for _ in range(int(rng.poisson(1.5)) if rng.random() < 0.4 else 0):
        place, radius = rng.uniform(0.2, 0.8), length * rng.uniform(0.02, 0.1)
        offset = rng.normal(0, 0.5) * slim * length
        cover *= np.clip(np.hypot((t - place) * length, across - offset) - radius + 0.5, 0, 1)
    rib = np.clip(1.6 - np.abs(across), 0, 1)
    phase = (t * length - np.abs(across) * rng.uniform(0.5, 1.2)) / (length / rng.uniform(6, 14))
    side = np.clip(1.3 - np.abs(phase - np.round(phase)) * length / 10, 0, 1)
    fold = 1 + 0.15 * np.sign(across) * rng.uniform(-1, 1)
    tone = rng.uniform(0.6, 1.25) * fold * (1 + veins * np.maximum(rib, 0.6 * side)) * (0.85 + 0.3 * inside)
    _put_over(alpha, shade, (slice(top, bottom), slice(left, right)), cover, tone)


def _put_over(alpha: FloatArray, shade: FloatArray, area: tuple[slice, slice], cover: FloatArray, tone: FloatArray) -> None:
    shade[area] += cover * (tone - shade[area])
    alpha[area] = np.maximum(alpha[area], cover)


def branches(shape: tuple[int, int], rng: np.random.Generator) -> Shape:
    """A twig with its side twigs, coming in from an edge of the picture."""
    height, width = shape
    strokes: list[Stroke] = []
    for _ in range(int(rng.integers(1, 4))):
        side = rng.random()
        start = rng.uniform(0, width), float(height)  # from below, or from the left or right
        if side >= 0.5:
            start = (0.0 if side < 0.75 else float(width)), rng.uniform(0, height)
        aim = math.atan2(height * rng.uniform(0.1, 0.7) - start[1], width * rng.uniform(0.2, 0.8) - start[0])
        thick = float(np.exp(rng.uniform(math.log(1.2), math.log(12))))
        _grow(strokes, start, aim, thick, max(shape) * rng.uniform(0.5, 1.1), 4, rng)
    return draw_strokes(shape, strokes, rng)


def _grow(
    strokes: list[Stroke],
    start: tuple[float, float],
    aim: float,
    thick: float,
    length: float,
    depth: int,
    rng: np.random.Generator,
) -> None:
    pieces = int(rng.integers(4, 9))
    bend = rng.normal(0, 0.06)
    for k in range(pieces):
        aim += bend + rng.normal(0, 0.12)
        end = start[0] + length / pieces * math.cos(aim), start[1] + length / pieces * math.sin(aim)
        thinner = thick * (0.93 if k < pieces - 1 else 0.7)
        strokes.append(Stroke(start, end, thick, thinner))
        start, thick = end, max(thinner, 0.35)
        if depth > 1 and len(strokes) < 150 and rng.random() < 0.55:
            fork = aim + rng.choice((-1, 1)) * rng.uniform(0.35, 1.1)
            _grow(strokes, start, fork, thick * rng.uniform(0.4, 0.7), length * rng.uniform(0.25, 0.55), depth - 1, rng)


def blades(shape: tuple[int, int], rng: np.random.Generator) -> Shape:
    """Grass: bent, tapering blades that rise from below the picture."""
    height, width = shape
    strokes: list[Stroke] = []
    lean, thick = rng.normal(0, 0.35), rng.uniform(0.7, 4)
    for _ in range(int(np.exp(rng.uniform(math.log(4), math.log(45))))):
        x, y = rng.uniform(-0.1, 1.1) * width, float(height)
        length, aim, bend = height * rng.uniform(0.35, 1.1), -np.pi / 2 + lean + rng.normal(0, 0.3), rng.normal(0, 0.12)
        widest, tone, pieces = thick * rng.uniform(0.5, 1.3), rng.uniform(0.55, 1.3), 8
        for k in range(pieces):
            end = x + length / pieces * math.cos(aim), y + length / pieces * math.sin(aim)
            first, last = (widest * (1 - ((k + j) / pieces) ** 2) + 0.25 for j in (0, 1))
            strokes.append(Stroke((x, y), end, first, last, tone))
            (x, y), aim = end, aim + bend
    return draw_strokes(shape, strokes, rng)


def wires(shape: tuple[int, int], rng: np.random.Generator) -> Shape:
    """Thin lines across the picture, straight or sagging: wires, threads, stalks, spokes."""
    height, width = shape
    strokes: list[Stroke] = []
    common, thick = rng.uniform(0, np.pi), rng.uniform(0.35, 2.2)
    for _ in range(int(rng.integers(1, 12))):
        angle = common + rng.normal(0, 0.25)
        middle = rng.uniform(0, 1, 2) * (width, height)
        reach, sag = max(shape) * rng.uniform(0.3, 0.9), max(shape) * rng.normal(0, 0.06)
        places = np.linspace(-1, 1, 13)
        xs = middle[0] + reach * places * math.cos(angle)
        ys = middle[1] + reach * places * math.sin(angle) + sag * (1 - places**2)
        own, tone = thick * rng.uniform(0.7, 1.3), rng.uniform(0.6, 1.3)
        strokes += [
            Stroke((float(xs[k]), float(ys[k])), (float(xs[k + 1]), float(ys[k + 1])), own, own, tone) for k in range(12)
        ]
    return draw_strokes(shape, strokes, rng)


def draw_strokes(shape: tuple[int, int], strokes: Sequence[Stroke], rng: np.random.Generator) -> Shape:
    """Round rods along the strokes, lit from one side; later ones lie over earlier ones."""
    height, width = shape
    alpha, shade = np.zeros(shape, np.float32), np.ones(shape, np.float32)
    light, depth = rng.uniform(0, 2 * np.pi), rng.uniform(0.2, 0.6)
    for stroke in strokes:
        (x0, y0), (x1, y1) = stroke.start, stroke.end
        reach = max(stroke.start_width, stroke.end_width) + 1.5
        left, right = max(int(min(x0, x1) - reach), 0), min(int(max(x0, x1) + reach) + 1, width)
        top, bottom = max(int(min(y0, y1) - reach), 0), min(int(max(y0, y1) + reach) + 1, height)
        if right - left < 1 or bottom - top < 1:
            continue
        dx, dy = x1 - x0, y1 - y0
        squared = max(dx * dx + dy * dy, 1e-6)
        y, x = np.ogrid[top:bottom, left:right]
        y, x = y.astype(np.float32) - np.float32(y0), x.astype(np.float32) - np.float32(x0)
        t = np.clip((x * dx + y * dy) / squared, 0, 1)
        distance = np.hypot(x - t * dx, y - t * dy)
        half = stroke.start_width + t * (stroke.end_width - stroke.start_width)
        # A rod thinner than a pixel covers only a part of it.
        cover = np.clip(half - distance + 0.5, 0, 1) * np.minimum(2 * half, 1)
        across = np.clip((y * dx - x * dy) / (math.sqrt(squared) * np.maximum(half, 0.5)), -1, 1)
        facing = math.sin(light - math.atan2(dy, dx))
        tone = stroke.tone * (1 + depth * facing * across - 0.5 * depth * across**2)
        _put_over(alpha, shade, (slice(top, bottom), slice(left, right)), cover.astype(np.float32), tone.astype(np.float32))
    return Shape(torch.from_numpy(alpha), torch.from_numpy(shade).clamp_min(0.15))


def railing(shape: tuple[int, int], rng: np.random.Generator) -> Shape:
    """Bars, a lattice or a net, in any direction and often over a part of the picture only: fences, grilles, mesh."""
    height, width = shape
    angle = rng.normal(0, 0.15) if rng.random() < 0.6 else rng.uniform(0, np.pi)
    y = torch.arange(height, dtype=torch.float32)[:, None] - height / 2
    x = torch.arange(width, dtype=torch.float32)[None] - width / 2
    a = x * math.cos(angle) + y * math.sin(angle)
    b = y * math.cos(angle) - x * math.sin(angle)
    period = float(np.exp(rng.uniform(math.log(9), math.log(70))))
    half = max(period * rng.uniform(0.05, 0.3) / 2, 0.5)
    kind = rng.random()
    if kind < 0.4:  # upright bars with one or two rails
        rails = (b - rng.uniform(-0.4, 0.4, 2)[0] * height).abs()
        distance, across = _periodic_distance(a, period)
        distance = torch.minimum(distance, rails)
    elif kind < 0.7:  # lattice
        first, across = _periodic_distance(a, period)
        distance = torch.minimum(first, _periodic_distance(b, period * rng.uniform(0.6, 1.6))[0])
    else:  # net of diamonds
        slope = rng.uniform(0.5, 1.2)
        first, across = _periodic_distance(a + slope * b, period)
        distance = torch.minimum(first, _periodic_distance(a - slope * b, period)[0]) / math.hypot(1, slope)
    alpha = (half - distance + 0.5).clamp(0, 1) * min(2 * half, 1)
    if rng.random() < 0.4:
        edge = rng.uniform(-0.3, 0.3) * height
        alpha = alpha * ((b if rng.random() < 0.7 else a) - edge + 0.5).clamp(0, 1)
    rounded = (1 - 0.5 * rng.uniform(0, 1) * (across / max(half, 0.5)).clamp(-1, 1)).clamp_min(0.2)
    return Shape(alpha, rounded)


def _periodic_distance(place: Tensor, period: float) -> tuple[Tensor, Tensor]:
    signed = place - (place / period).round() * period
    return signed.abs(), signed


def _place(shape: tuple[int, int], rng: np.random.Generator, smallest: float, largest: float) -> tuple[Tensor, Tensor, float]:
    """Coordinates in px about a random middle, and a size in px."""
    height, width = shape
    y = torch.arange(height, dtype=torch.float32)[:, None] - rng.uniform(0.1, 0.9) * height
    x = torch.arange(width, dtype=torch.float32)[None] - rng.uniform(0.1, 0.9) * width
    angle = rng.uniform(0, np.pi)
    size = max(shape) * rng.uniform(smallest, largest)
    return x * math.cos(angle) + y * math.sin(angle), y * math.cos(angle) - x * math.sin(angle), size


def _gradient_shade(shape: tuple[int, int], rng: np.random.Generator) -> Tensor:
    """Light that falls off evenly over a flat thing."""
    y = torch.linspace(-1, 1, shape[0])[:, None]
    x = torch.linspace(-1, 1, shape[1])[None]
    slope = rng.normal(0, 0.2, 2)
    return (1 + float(slope[0]) * x + float(slope[1]) * y).clamp(0.4, 1.5)


def _body_shade(alpha: Tensor, size: float, rng: np.random.Generator) -> Tensor:
    """A body's light and dark side: its outline, blurred, taken for its height."""
    height = blur(alpha, size * 0.3)
    slope_y, slope_x = (torch.from_numpy(slope) for slope in np.gradient(height.numpy()))
    angle = rng.uniform(0, 2 * np.pi)
    lit = (slope_x * math.cos(angle) + slope_y * math.sin(angle)) * size * rng.uniform(0.3, 1.2)
    return (0.65 + 0.4 * height - lit).clamp(0.15, 1.7)


BODIES: tuple[Draw, ...] = (blob, blob, polygon, polygon, torn, leaves, leaves, window)
THIN: tuple[Draw, ...] = (branches, branches, blades, blades, wires, railing, leaves)
