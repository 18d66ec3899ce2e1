"""What surfaces are covered with: crops of photographs from a folder, and procedural patterns where there is none."""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt
import OpenImageIO as oiio
import torch
from torch import Tensor
from torch.nn import functional

from lfcore.errors import InputError
from lfcore.formats.images import EXTENSIONS, check_memory, read_header
from lfcore.training.scenes.noise import colour, fractal, ramp

ByteArray = npt.NDArray[np.uint8]

LONGEST_SIDE = 1600  # px at which photographs are kept
_SMALLEST_SIDE = 128  # px; smaller pictures are icons, not photographs
_CACHE_BYTES = 384 * 2**20

_VALUES = np.arange(256) / 255
_LINEAR = torch.from_numpy(np.where(_VALUES <= 0.04045, _VALUES / 12.92, ((_VALUES + 0.055) / 1.055) ** 2.4).astype(np.float32))


@dataclass(frozen=True)
class Textures:
    """Photographs in a folder and below it, by name; none where `folder` is None.

    Photographs are decoded when first asked for, kept at LONGEST_SIDE px at most, and the least used are let go above 384 MiB.
    Raises InputError where the folder is missing or holds no picture.
    """

    folder: Path | None = None
    files: tuple[Path, ...] = field(init=False)
    _cache: OrderedDict[Path, ByteArray] = field(init=False, repr=False, compare=False, default_factory=OrderedDict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "files", () if self.folder is None else _pictures(self.folder))

    def photograph(self, index: int) -> ByteArray:
        """Photograph number `index`, sRGB as stored, uint8 (H, W, 3). Raises InputError where it cannot be read."""
        path = self.files[index]
        picture = self._cache.pop(path, None)
        if picture is None:
            picture = _decode(path)
            while self._cache and sum(kept.nbytes for kept in self._cache.values()) + picture.nbytes > _CACHE_BYTES:
                self._cache.popitem(last=False)
        self._cache[path] = picture
        return picture

    def crop(self, index: int, shape: tuple[int, int], rng: np.random.Generator) -> Tensor:
        """A part of a photograph, turned, mirrored and resized to (H, W, 3), in linear light, 0 to 1."""
        picture = self.photograph(index)
        if rng.random() < 0.5:
            picture = picture.transpose(1, 0, 2)
        picture = picture[:: rng.choice((-1, 1)), :: rng.choice((-1, 1))]
        height, width = picture.shape[:2]
        most = min(height / shape[0], width / shape[1])
        # From magnified a little to the whole photograph: the finer detail of larger parts is drawn more often.
        scale = most * rng.uniform(min(0.75 / most, 1), 1) if most > 0.75 else most
        rows, columns = int(shape[0] * scale), int(shape[1] * scale)
        top, left = int(rng.integers(height - rows + 1)), int(rng.integers(width - columns + 1))
        part = np.ascontiguousarray(picture[top : top + rows, left : left + columns])
        planes = torch.from_numpy(part).permute(2, 0, 1)[None].float()
        resized = functional.interpolate(planes, size=shape, mode="bilinear", align_corners=False, antialias=True)
        return _LINEAR[resized[0].permute(1, 2, 0).round_().clamp_(0, 255).long()]


def _pictures(folder: Path) -> tuple[Path, ...]:
    if not folder.is_dir():
        raise InputError(f"{folder} is no folder; give a folder of photographs, or leave it out for procedural textures.")
    found = [path for path in folder.rglob("*") if path.suffix.lower() in EXTENSIONS and path.is_file() and path.name[0] != "."]
    files = tuple(sorted(found, key=lambda path: path.relative_to(folder).as_posix()))
    if not files:
        raise InputError(f"{folder} holds no pictures ({', '.join(EXTENSIONS)}); give a folder of photographs.")
    return files


def _decode(path: Path) -> ByteArray:
    header = read_header(path)
    check_memory(path, header)
    if min(header.width, header.height) < _SMALLEST_SIDE:
        raise InputError(f"{path} is {header.size} px; photographs need {_SMALLEST_SIDE} px each way: take it away.")
    whole = oiio.ImageBuf(str(path))
    factor = min(1.0, LONGEST_SIDE / max(header.width, header.height))
    size = max(round(header.width * factor), 1), max(round(header.height * factor), 1)
    spec = whole.spec()
    small = oiio.ImageBufAlgo.resize(whole, roi=oiio.ROI(0, size[0], 0, size[1], 0, 1, 0, spec.nchannels), filtername="box")
    pixels = small.get_pixels(oiio.UINT8)
    if pixels is None or whole.has_error or small.has_error:
        reason = (whole.geterror() or small.geterror() or "no reason given").strip().splitlines()[0]
        raise InputError(f"{path} cannot be read ({reason}); take it out of the folder of textures.")
    first, channels = header.first_channel, header.channels
    pixels = pixels.reshape(size[1], size[0], -1)[..., first : first + channels]
    return np.ascontiguousarray(np.broadcast_to(pixels, (size[1], size[0], 3)))


def flat(shape: tuple[int, int], rng: np.random.Generator) -> Tensor:
    """One colour with the faintest unevenness: a painted wall, the sky, plastic."""
    tone = 1 + 0.04 * fractal(shape, 1.5, 300, rng)
    return tone.clamp_min(0.3).unsqueeze(-1) * colour(rng)


def clouds(shape: tuple[int, int], rng: np.random.Generator) -> Tensor:
    """Fractal mixture of two colours with fine grain: stone, earth, plaster."""
    return ramp(fractal(shape, rng.uniform(0.7, 1.6), rng.uniform(20, 200), rng), colour(rng), colour(rng))


def fibres(shape: tuple[int, int], rng: np.random.Generator) -> Tensor:
    """Noise drawn out in one direction: wood, brushed metal, fur, straw."""
    turned = rng.random() < 0.5
    drawn = fractal(shape[::-1] if turned else shape, rng.uniform(0.5, 1.2), 60, rng, stretch=rng.uniform(4, 14))
    return ramp(drawn.T if turned else drawn, colour(rng), colour(rng))


def periodic(shape: tuple[int, int], rng: np.random.Generator) -> Tensor:
    """A pattern that repeats, in any direction: stripes, checks, bricks, dots, cloth. The hardest thing to match."""
    along, across = turned_coordinates(shape, rng)
    period = float(np.exp(rng.uniform(math.log(5), math.log(40))))
    pattern = (_stripes, _checks, _bricks, _dots, _cloth)[int(rng.integers(5))]
    mixture = pattern(along / period, across / period * rng.uniform(0.7, 1.4), rng)
    grain = 0.25 * fractal(shape, 1.0, 80, rng) * rng.uniform(0, 1)
    return ramp(3 * (mixture - 0.5) + grain, colour(rng), colour(rng))


def turned_coordinates(shape: tuple[int, int], rng: np.random.Generator) -> tuple[Tensor, Tensor]:
    """Coordinates in px (H, W) along and across a random direction, upright half of the time."""
    angle = float(rng.choice((0.0, np.pi / 2))) + rng.normal(0, 0.04) if rng.random() < 0.5 else rng.uniform(0, np.pi)
    y = torch.arange(shape[0], dtype=torch.float32)[:, None] + rng.uniform(0, 100)
    x = torch.arange(shape[1], dtype=torch.float32)[None] + rng.uniform(0, 100)
    return x * math.cos(angle) + y * math.sin(angle), y * math.cos(angle) - x * math.sin(angle)


def _edge(wave: Tensor, sharpness: float) -> Tensor:
    return (0.5 + wave * sharpness).clamp(0, 1)


def _stripes(a: Tensor, b: Tensor, rng: np.random.Generator) -> Tensor:
    return _edge(torch.sin(2 * np.pi * a) + rng.uniform(-0.6, 0.6), rng.uniform(0.5, 3))


def _checks(a: Tensor, b: Tensor, rng: np.random.Generator) -> Tensor:
    return _edge(torch.sin(2 * np.pi * a) * torch.sin(2 * np.pi * b), rng.uniform(1, 4))


def _bricks(a: Tensor, b: Tensor, rng: np.random.Generator) -> Tensor:
    shifted = a / 2 + 0.5 * torch.remainder(b.floor(), 2)
    joint = rng.uniform(0.06, 0.15)
    gap = torch.minimum((shifted - shifted.round()).abs() * 2, (b - b.round()).abs())
    tones = torch.frac(torch.sin(torch.floor(shifted + 0.5) * 12.9898 + torch.floor(b) * 78.233) * 43758.5).abs()
    return ((gap - joint) * 12).clamp(0, 1) * (0.6 + 0.4 * tones)


def _dots(a: Tensor, b: Tensor, rng: np.random.Generator) -> Tensor:
    radius = torch.sqrt((a - a.round()).square() + (b - b.round()).square())
    return ((rng.uniform(0.2, 0.42) - radius) * 12 + 0.5).clamp(0, 1)


def _cloth(a: Tensor, b: Tensor, rng: np.random.Generator) -> Tensor:
    over = torch.remainder(a.floor() + b.floor(), 2)
    return torch.where(over > 0, torch.sin(np.pi * torch.frac(a).abs()), 0.7 * torch.sin(np.pi * torch.frac(b).abs()))


PROCEDURAL: tuple[Callable[[tuple[int, int], np.random.Generator], Tensor], ...] = (flat, clouds, clouds, fibres, periodic)


def procedural(shape: tuple[int, int], rng: np.random.Generator) -> Tensor:
    """Any of the procedural textures, (H, W, 3), linear."""
    return PROCEDURAL[int(rng.integers(len(PROCEDURAL)))](shape, rng)
