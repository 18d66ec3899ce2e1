"""Captures by the model of the camera in files, and the views that they should become."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
import torch

from lfcore.camera_files import write_calibration, write_capture
from lfcore.camera_model import CameraModel, expose, white_image
from lfcore.decode.grid import LensGrid
from lfcore.decode.resample import HALF_ROW, PictureGrid, picture_grid
from lfcore.plane_scene import PlaneScene

Views = npt.NDArray[np.float32]


def write_model_capture(
    folder: Path,
    camera: CameraModel,
    scene: PlaneScene,
    samples: int = 6,
    white: bool = True,
    name: str = "capture.LFR",
    orientation: int = 1,
) -> Path:
    """A capture of the scene, and in the same folder an archive with its white image unless `white` is False."""
    if white:
        write_calibration(folder / "caldata-model.tar", [(camera, white_image(camera, seed=7, samples=samples))])
    path = folder / name
    write_capture(path, camera, expose(camera, scene, samples=samples), orientation)
    return path


def true_views(
    camera: CameraModel, scene: PlaneScene, views: int, every_row: bool = False, places: list[tuple[int, int]] | None = None
) -> dict[tuple[int, int], Views]:
    """What ideal cameras in the places (row, column) of the views see, linear (H, W, 3): each pixel the mean of its area."""
    picture = true_picture(camera, every_row)
    grid = picture.grid
    x, y = np.moveaxis(picture.positions, -1, 0)
    x, y = (x - (camera.width - 1) / 2) / grid.pitch, (y - (camera.height - 1) / 2) / grid.pitch
    cos, sin = np.cos(grid.rotation), np.sin(grid.rotation)
    steps = (np.arange(views) - (views - 1) / 2) / 14
    inside = picture.step * ((np.arange(4) + 0.5) / 4 - 0.5)
    seen = {}
    for row, column in places or [(row, column) for row in range(views) for column in range(views)]:
        u, v = steps[column] * cos - steps[row] * sin, steps[column] * sin + steps[row] * cos
        total = torch.zeros(*x.shape, 3)
        for a in inside:
            for b in inside:
                px = torch.from_numpy(x + a * cos - b * sin).float()
                py = torch.from_numpy(y + a * sin + b * cos).float()
                total += scene.radiance(px, py, torch.full_like(px, u), torch.full_like(px, v))
        seen[row, column] = (total / len(inside) ** 2).numpy()
    return seen


def true_picture(camera: CameraModel, every_row: bool = False) -> PictureGrid:
    """Where the pixels of the views lie, on the true grid of microlenses."""
    return picture_grid(camera.grid, (camera.height, camera.width), HALF_ROW if every_row else 1.0)


def srgb(light: npt.NDArray[np.floating]) -> npt.NDArray[np.float64]:
    """The sRGB curve, straight from its definition."""
    light = np.clip(light, 0, 1).astype(np.float64)
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)


def decoded_psnr(view: npt.NDArray[np.generic], truth: Views, border: int = 4) -> float:
    """PSNR in dB of an 8-bit sRGB view against linear truth, `border` pixels on each side left out."""
    difference = (view / 255 - srgb(truth))[border:-border, border:-border]
    return float(-10 * np.log10((difference**2).mean()))


def grid_errors(found: LensGrid, camera: CameraModel) -> npt.NDArray[np.float64]:
    """Distances in px of microlenses all over the sensor from where they truly are."""
    true = camera.grid
    y, x = np.meshgrid(np.linspace(20, camera.height - 20, 30), np.linspace(20, camera.width - 20, 30), indexing="ij")
    centres = true.centres(*true.nearest(x, y))
    nearest = found.centres(*found.nearest(centres[..., 0], centres[..., 1]))
    return np.asarray(np.hypot(*np.moveaxis(nearest - centres, -1, 0)))


def small(camera: CameraModel, width: int, height: int, **changes: object) -> CameraModel:
    """The camera with a smaller sensor, and other changes."""
    return replace(camera, width=width, height=height, **changes)  # type: ignore[arg-type]
