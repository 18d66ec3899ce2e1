"""A model of the Lytro cameras: a known scene through the main lens, the microlenses and the mosaic of colours to raw pixels.

Each pixel gathers the rays of a patch of the aperture (the pixel's own area) and of a patch of the scene (the area of its
microlens). What the model leaves out: diffraction other than a fixed blur on the sensor, distortion by the main lens, and
microlenses that are not where the hexagonal grid has them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt
import torch

from lfcore.decode.grid import LensGrid, regular_grid
from lfcore.decode.unpack import Mosaic
from lfcore.plane_scene import PlaneScene

Radiance = Callable[[torch.Tensor, torch.Tensor, torch.Tensor, torch.Tensor], torch.Tensor]

# Of the Illum's own metadata: camera colour (white balanced) to linear sRGB; rows sum to 1.
_MATRIX = ((2.2271547, -1.0552933, -0.1718614), (-0.4269128, 1.7458618, -0.3189489), (-0.2049721, -0.7469925, 1.9519646))

_BAND = 64  # rows rendered at a time
_HALO = 2  # rows beyond, for the blur on the sensor


@dataclass(frozen=True)
class CameraModel:
    """One camera with its settings. Lengths in metres where the name ends in _pitch, else in px; angles in radians.

    `offset` is from the sensor's centre to the nearest microlens. `stretch` is what the distance to the exit pupil makes the
    pictures of the microlenses lie farther apart than the microlenses; the metadata does not hold it. `crosstalk` is the
    share of a pixel's light that goes to its four neighbours. `full_well` in electrons; 0 turns noise off.
    """

    width: int
    height: int
    generation: str  # "illum" or "f01": which kind of metadata is written
    lens_pitch: float
    pixel_pitch: float = 1.4e-6
    rotation: float = 0.0
    scale: tuple[float, float] = (1.0, 1.0)
    offset: tuple[float, float] = (0.0, 0.0)
    stretch: float = 1.0
    bits: int = 10
    black: int = 64
    white: int = 1023
    cfa: str = "GRBG"
    gains: tuple[float, float, float] = (1.3788593, 1.0, 1.148466)  # white balance: red, green, blue
    matrix: tuple[tuple[float, ...], ...] = _MATRIX
    exposure_bias: float = 0.2689967  # EV
    fill: float = 0.96  # diameter of a microlens's picture over the pitch
    falloff: float = 0.5  # loss of light at the edge of a microlens's picture
    corner_falloff: float = 0.3  # loss of light in the sensor's corners
    crosstalk: float = 0.2
    full_well: float = 5000.0
    read_noise: float = 3.0  # electrons
    hot_pixels: float = 2e-5  # share of all pixels
    zoom_step: int = -297
    focus_step: int = 309
    serial: str = "B5143900001"
    lamp: tuple[float, float, float] = field(default=(0.9, 1.0, 0.8))  # colour of the light of white images

    @property
    def grid(self) -> LensGrid:
        """Where the microlenses' pictures truly lie."""
        centre = (self.width - 1) / 2, (self.height - 1) / 2
        x, y = centre[0] + self.offset[0], centre[1] + self.offset[1]
        return regular_grid((x, y), self.stretch * self.lens_pitch / self.pixel_pitch, self.rotation, self.scale)

    @property
    def size_in_pitches(self) -> tuple[float, float]:
        """Width and height of the sensor in pitches of the microlenses."""
        return self.width / self.grid.pitch, self.height / self.grid.pitch

    def ray(self, px: torch.Tensor, py: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """(x, y) in the scene's pitches of places on the sensor in px."""
        pitch = self.grid.pitch
        return (px - (self.width - 1) / 2) / pitch, (py - (self.height - 1) / 2) / pitch


def illum(**changes: object) -> CameraModel:
    """A Lytro Illum."""
    camera = CameraModel(
        7728, 5368, "illum", 2.0e-5, rotation=-0.00054261, scale=(1.0, 1.00034297), offset=(6.016, -0.682), stretch=1.00038
    )
    return replace(camera, **changes)  # type: ignore[arg-type]


def f01(**changes: object) -> CameraModel:
    """A first-generation Lytro."""
    camera = CameraModel(
        3280, 3280, "f01", 1.4e-5, rotation=-0.00085881, scale=(1.0, 1.00037348), offset=(-5.841, 0.572), stretch=1.00011,
        bits=12, black=168, white=4095, cfa="BGGR", gains=(1.0, 1.0, 1.2578125), exposure_bias=-1.1139299,
        zoom_step=943, focus_step=672, serial="A303000001",
        matrix=((3.1115828, -1.9393929, -0.1721899), (-0.3629056, 1.6408803, -0.2779748), (0.078967, -1.1558043, 2.0768373)),
    )  # fmt: skip
    return replace(camera, **changes)  # type: ignore[arg-type]


def expose(camera: CameraModel, scene: PlaneScene, seed: int = 0, samples: int = 12) -> Mosaic:
    """The raw mosaic (H, W) that the camera takes of the scene. `samples` rays are followed to each pixel."""
    to_camera = torch.linalg.inv(torch.tensor(camera.matrix)) / torch.tensor(camera.gains)[:, None]
    # White of the scene comes out as white of the picture after decoding: exposure is what the decoder is told to undo.
    to_camera = to_camera * 2.0 ** -max(camera.exposure_bias, 0.0)
    light = _irradiance(camera, samples, lambda x, y, u, v: scene.radiance(x, y, u, v) @ to_camera.T)
    return _read_out(camera, light, seed)


def white_image(camera: CameraModel, seed: int = 0, level: float = 0.7, samples: int = 12) -> Mosaic:
    """The raw mosaic (H, W) of an evenly lit white wall, `level` of the sensor's white at the brightest place."""
    lamp = torch.tensor(camera.lamp) * level
    light = _irradiance(camera, samples, lambda x, y, u, v: lamp.expand(*x.shape, 3))
    return _read_out(replace(camera, hot_pixels=0.0), light, seed)


def _irradiance(camera: CameraModel, samples: int, radiance: Radiance) -> torch.Tensor:
    """Light on each pixel under its own colour filter, (H, W), 1 = white."""
    light = torch.empty(camera.height, camera.width)
    filters = torch.tensor([["RGB".index(camera.cfa[2 * y + x]) for x in range(2)] for y in range(2)])
    columns = torch.arange(camera.width)
    for begin in range(0, camera.height, _BAND):
        end = min(begin + _BAND, camera.height)
        top, bottom = max(begin - _HALO, 0), min(end + _HALO, camera.height)
        rows = torch.arange(top, bottom)
        y, x = (axis.contiguous() for axis in torch.meshgrid(rows.float(), columns.float(), indexing="ij"))
        band = torch.zeros(len(rows), camera.width, 3)
        for point in _rays(samples):
            band += _one_sample(camera, x, y, point, radiance) / samples
        band = _blur(band, camera.crosstalk)[begin - top : end - top]
        channel = filters[torch.arange(begin, end)[:, None] % 2, columns[None] % 2]
        light[begin:end] = torch.gather(band, 2, channel[..., None])[..., 0]
    return light


def _one_sample(
    camera: CameraModel, x: torch.Tensor, y: torch.Tensor, point: npt.NDArray[np.float64], radiance: Radiance
) -> torch.Tensor:
    """Light (rows, W, 3) by one ray to each pixel: `point` is its place in the pixel and in the microlens, -0.5 to 0.5."""
    grid = camera.grid
    px, py = x + float(point[0]), y + float(point[1])
    cx, cy = _nearest_centres(grid, px, py)
    u, v = (px - cx) / grid.pitch, (py - cy) / grid.pitch
    lens_x, lens_y = cx + float(point[2]) * grid.pitch, cy + float(point[3]) * grid.pitch
    light = radiance(*camera.ray(lens_x, lens_y), u, v)
    return light * (_transmission(camera, u, v) * _corner(camera, px, py))[..., None]


def _nearest_centres(grid: LensGrid, px: torch.Tensor, py: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """Centre of the nearest microlens, px; in double precision where it matters, float32 out."""
    inverse = np.linalg.inv(np.column_stack([grid.along, grid.down]))
    dx, dy = px.double() - grid.origin[0], py.double() - grid.origin[1]
    across, down = inverse[0, 0] * dx + inverse[0, 1] * dy, inverse[1, 0] * dx + inverse[1, 1] * dy
    found = []
    for row in (torch.floor(down), torch.floor(down) + 1):
        half = torch.remainder(row, 2) / 2
        column = torch.round(across - half) + half
        cx = grid.origin[0] + column * grid.along[0] + row * grid.down[0]
        cy = grid.origin[1] + column * grid.along[1] + row * grid.down[1]
        found.append((cx, cy, (cx - px) ** 2 + (cy - py) ** 2))
    first = found[0][2] <= found[1][2]
    return torch.where(first, found[0][0], found[1][0]).float(), torch.where(first, found[0][1], found[1][1]).float()


def _transmission(camera: CameraModel, u: torch.Tensor, v: torch.Tensor) -> torch.Tensor:
    """Light that passes the aperture at (u, v): falls towards the edge, and ends there over a twentieth of the diameter."""
    radius = 2 * torch.hypot(u, v) / camera.fill
    edge = torch.clamp((1 - radius) / 0.1 + 0.5, 0, 1)
    return (1 - camera.falloff * radius**2).clamp(min=0) * edge


def _corner(camera: CameraModel, px: torch.Tensor, py: torch.Tensor) -> torch.Tensor:
    x, y = px - (camera.width - 1) / 2, py - (camera.height - 1) / 2
    return 1 - camera.corner_falloff * (x**2 + y**2) / (camera.width**2 + camera.height**2) * 4


def _rays(samples: int) -> npt.NDArray[np.float64]:
    """Evenly spread places in a pixel (first two numbers, a square) and in a microlens (last two, a disc of its area)."""
    # The generalised golden ratio of four dimensions: powers of its inverse step evenly through the unit cube.
    golden = 1.1673039782614187
    points = np.mod(0.5 + np.arange(1, samples + 1)[:, None] * golden ** -np.arange(1.0, 5.0), 1)
    radius, angle = np.sqrt(points[:, 2]) * math.sqrt(math.sqrt(3) / 2 / math.pi), 2 * math.pi * points[:, 3]
    rays = np.column_stack([points[:, 0] - 0.5, points[:, 1] - 0.5, radius * np.cos(angle), radius * np.sin(angle)])
    return rays - rays.mean(axis=0)


def _blur(light: torch.Tensor, share: float) -> torch.Tensor:
    """Move `share` of each pixel's light to its four neighbours, (rows, W, 3)."""
    padded = torch.nn.functional.pad(light.permute(2, 0, 1)[None], (1, 1, 1, 1), mode="replicate")[0]
    around = padded[:, :-2, 1:-1] + padded[:, 2:, 1:-1] + padded[:, 1:-1, :-2] + padded[:, 1:-1, 2:]
    return ((1 - share) * padded[:, 1:-1, 1:-1] + share / 4 * around).permute(1, 2, 0)


def _read_out(camera: CameraModel, light: torch.Tensor, seed: int) -> Mosaic:
    """Light to numbers: shot noise, read noise, hot pixels, black level, whole steps."""
    draw = np.random.default_rng(seed)
    levels = np.empty(light.shape, np.uint16)
    span = camera.white - camera.black
    for begin in range(0, camera.height, _BAND):
        band = light[begin : begin + _BAND].numpy()
        if camera.full_well:
            electrons = draw.poisson(np.maximum(band, 0) * camera.full_well) + draw.normal(0, camera.read_noise, band.shape)
            band = electrons / camera.full_well
        values = np.rint(camera.black + span * band)
        values[draw.random(band.shape) < camera.hot_pixels] = camera.white
        levels[begin : begin + _BAND] = np.clip(values, 0, camera.white)
    return levels
