"""A camera like the Illum: its views miss their place, differ in brightness and colour, blur outwards, are noisy and clip."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from lfcore.illum import mixing
from lfcore.lightfield import FloatArray

Range = tuple[float, float]

_LEVELS = 65536


@dataclass(frozen=True)
class CameraConfig:
    """Ranges from which the camera of a scene is drawn, each evenly unless said otherwise. Light is linear, 1 = white."""

    # px, deviation of each view's place; what is drawn is made smaller by a share that is drawn too, so that most are small
    misplacement: Range = (0.0, 0.2)
    wandering: Range = (0.0, 0.012)  # deviation of each view's (u, v), in baselines
    gain_deviation: Range = (0.0, 0.015)  # of the views' brightness, relative
    tint_deviation: Range = (0.0, 0.008)  # of the views' red, green and blue, relative
    # How far the corner views lose colour, see lfcore.illum, where that of an ESLF has been taken off: as toolboxes decode.
    paleness: Range = (0.0, 0.4)
    # How much darker the corner views are. Around 0, as in decoded captures: with 0 to 0.12 the networks learnt to brighten
    # every picture by 4%, which cost half a decibel.
    vignette: Range = (-0.015, 0.025)
    shading: Range = (0.0, 0.03)  # how much the outer views brighten to one side of the picture and darken to the other
    softness: Range = (0.42, 0.75)  # px, deviation of the blur that all views share
    outer_blur: Range = (0.0, 0.5)  # px, deviation of the blur that corner views have besides
    shot_noise: Range = (2e-5, 6e-4)  # variance per light, drawn evenly in the logarithm
    read_noise: Range = (5e-4, 4e-3)  # deviation, drawn evenly in the logarithm
    dark_share: float = 0.45  # scenes stored as linear light, as an ESLF is; the others are gamma-encoded
    dark_mean: Range = (0.07, 0.25)  # mean light of those
    bright_mean: Range = (0.08, 0.38)  # mean light of the gamma-encoded ones, before encoding


FAULTLESS = CameraConfig(
    misplacement=(0, 0),
    wandering=(0, 0),
    gain_deviation=(0, 0),
    tint_deviation=(0, 0),
    paleness=(0, 0),
    vignette=(0, 0),
    shading=(0, 0),
    outer_blur=(0, 0),
    shot_noise=(0, 0),
    read_noise=(0, 0),
)


@dataclass(frozen=True)
class Camera:
    """One camera with one exposure, drawn for a scene."""

    positions: Tensor  # (N, 2) offsets (u, v) of the views from the middle viewpoint, in baselines
    shifts: Tensor  # (N, 2) px
    gains: FloatArray  # (N, 3)
    mixing: FloatArray  # (N, 3, 3), stored colours by true ones
    shading: FloatArray  # (N, 2), relative change of light per half picture in x and y
    blurs: FloatArray  # (N,), px
    softness: float  # px
    shot_noise: float
    read_noise: float
    mean: float  # light that the middle view is exposed to
    dark: bool


def draw_camera(views: int, config: CameraConfig, rng: np.random.Generator) -> Camera:
    """A camera with views x views viewpoints, row by row."""
    v, u = np.divmod(np.arange(views * views), views)
    places = np.stack([u, v], 1) / (views - 1) - 0.5  # (N, 2)
    outward = 2 * (places**2).sum(1)  # 0 in the middle, 1 at the corners
    count = len(places)
    wandering = rng.uniform(*config.wandering) * np.clip(rng.standard_normal((count, 2)), -2, 2)
    misplacement = rng.uniform(*config.misplacement) * rng.random() * np.clip(rng.standard_normal((count, 2)), -2, 2)
    gains = 1 + rng.uniform(*config.gain_deviation) * rng.standard_normal((count, 1))
    gains = gains * (1 + rng.uniform(*config.tint_deviation) * rng.standard_normal((count, 3)))
    gains = gains * (1 - rng.uniform(*config.vignette) * outward[:, None])
    dark = bool(rng.random() < config.dark_share)
    paleness = rng.uniform(*config.paleness) * outward
    return Camera(
        positions=torch.from_numpy((places + wandering).astype(np.float32)),
        shifts=torch.from_numpy(misplacement.astype(np.float32)),
        gains=gains.astype(np.float32),
        mixing=mixing(paleness),
        shading=(rng.uniform(*config.shading) * 2 * places * np.sqrt(outward)[:, None]).astype(np.float32),
        blurs=(rng.uniform(*config.outer_blur) * outward).astype(np.float32),
        softness=float(rng.uniform(*config.softness)),
        shot_noise=_log_uniform(config.shot_noise, rng),
        read_noise=_log_uniform(config.read_noise, rng),
        mean=_log_uniform(config.dark_mean if dark else config.bright_mean, rng),
        dark=dark,
    )


def _log_uniform(span: Range, rng: np.random.Generator) -> float:
    position = rng.random()
    return float(span[0] * (span[1] / span[0]) ** position) if span[0] > 0 else 0.0


def expose(light: Tensor, camera: Camera, rng: np.random.Generator) -> npt.NDArray[np.uint8]:
    """Views (N, H, W, 3) in linear light, of any scale, to what the camera stores of them, uint8."""
    middle = light[len(light) // 2].numpy()
    # The exposure goes by the picture without its highlights, as a meter does.
    exposure = camera.mean / max(float(np.minimum(middle, 4 * np.median(middle)).mean()), 1e-6)
    table = tone_table(camera.dark)
    stored = np.empty(tuple(light.shape), np.uint8)
    for k in range(len(light)):
        mixed = _soften(light[k], float(camera.blurs[k])).numpy() @ camera.mixing[k].T
        view = mixed * (camera.gains[k] * np.float32(exposure))
        view *= _shading(view.shape, camera.shading[k])
        view = add_noise(view, camera.shot_noise, camera.read_noise, rng)
        np.clip(view, 0, 1, out=view)
        stored[k] = np.take(table, (view * np.float32(_LEVELS - 1) + np.float32(0.5)).astype(np.uint16))
    return stored


def add_noise(light: FloatArray, shot: float, read: float, rng: np.random.Generator) -> FloatArray:
    """Light with noise of variance shot * light + read^2."""
    if shot <= 0 and read <= 0:
        return light
    noise = rng.standard_normal(light.shape, dtype=np.float32)
    noise *= np.sqrt(np.maximum(light, 0) * np.float32(shot) + np.float32(read * read))
    noise += light
    return noise


def tone_table(dark: bool) -> npt.NDArray[np.uint8]:
    """Stored values for 65536 levels of linear light: in proportion where `dark`, else sRGB-encoded."""
    linear = np.arange(_LEVELS) / (_LEVELS - 1)
    encoded: Callable[[], np.ndarray] = lambda: np.where(  # noqa: E731
        linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055
    )
    return np.rint(255 * (linear if dark else encoded())).astype(np.uint8)


def _shading(shape: tuple[int, ...], slopes: FloatArray) -> FloatArray:
    y = np.linspace(-1, 1, shape[0], dtype=np.float32)[:, None, None]
    x = np.linspace(-1, 1, shape[1], dtype=np.float32)[:, None]
    shaded: FloatArray = 1 + slopes[0] * x + slopes[1] * y
    return shaded


def _soften(picture: Tensor, sigma: float) -> Tensor:
    """Blur (H, W, 3) by a small Gaussian, edges repeated."""
    if sigma < 0.1:
        return picture.contiguous()
    reach = int(np.ceil(3 * sigma))
    taps = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2)
    taps /= taps.sum()
    for axis in (0, 1):
        size = picture.shape[axis]
        index = torch.arange(-reach, size + reach).clamp(0, size - 1)
        padded = picture.index_select(axis, index)
        picture = sum((padded.narrow(axis, k, size) * float(tap) for k, tap in enumerate(taps)), torch.zeros(()))
    return picture
