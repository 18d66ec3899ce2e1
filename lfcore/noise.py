"""Noise of a picture on its flat regions: how much less a synthesis has than the captured view at the same place.

The estimator is that of Immerkaer (1996): a 3 x 3 kernel that no constant and no ramp passes, here with the median of its
answer in place of the mean, so that a few edges do not count. It sees the noise between neighbouring pixels. Noise of a
decoded capture is correlated over a few pixels, since demosaicking and resampling average it, and any warp by parts of a pixel
averages a little more; therefore the same is measured on means of 2 x 2 and 4 x 4 px too. For white noise all three scales give
the same ratio of two pictures; where they differ, the coarser ones tell more of the noise that an eye sees.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lfcore.lightfield import FloatArray

SCALES = (1, 2, 4)  # px averaged along each axis before the kernel

_KERNEL_GAIN = 6.0  # root of the sum of squares of the kernel's weights: (1 -2 1) times (1 -2 1)
_MEDIAN_TO_SIGMA = 0.674489750196082  # median of |x| for a normal x of deviation 1
_SMOOTHING = 2.5  # px, sigma
_STEEPEST = 0.004  # change a pixel, 1 = white: one step of 8 bits
_DARKEST, _BRIGHTEST = 2 / 255, 250 / 255
_REACH = 3  # px that a flat pixel keeps from anything that is not
_BORDER = 8  # px at the picture's edge, where the smoothing knows only one side
_LEAST = 400  # pixels, fewer say too little

BoolArray = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class SceneNoise:
    """Noise on the flat regions of one captured view, standard deviations in steps of 8 bits, one for each of SCALES.

    Deviations are those of the averaged pixels. nan where a scale had too few of them.
    """

    name: str
    flat_share: float  # of the view's pixels
    captured: tuple[float, ...]
    synthesized: Mapping[str, tuple[float, ...]]  # by model

    def ratio(self, model: str) -> tuple[float, ...]:
        """Noise of a model's synthesis over that of the captured view, by scale; nan where there is none to compare with."""
        pairs = zip(self.synthesized[model], self.captured, strict=True)
        return tuple(found / there if there > 0 else math.nan for found, there in pairs)


def flat_regions(view: FloatArray) -> BoolArray:
    """Where a captured view (H, W, 3), 1 = white, is flat enough for its noise to be seen: bool (H, W).

    There, and up to 3 px around, the smoothed view changes by less than about one step of 8 bits a pixel in every channel,
    and no channel is near black or white, where clipping would hide noise.
    """
    smooth = np.stack([_gaussian(view[..., channel]) for channel in range(3)], -1)
    down, across = np.gradient(smooth, axis=(0, 1))
    flat = np.hypot(down, across).max(-1) < _STEEPEST
    flat &= (smooth > _DARKEST).all(-1) & (smooth < _BRIGHTEST).all(-1)
    flat[:_BORDER] = flat[-_BORDER:] = False
    flat[:, :_BORDER] = flat[:, -_BORDER:] = False
    return _eroded(flat, _REACH)


def noise_sigma(image: FloatArray, flat: BoolArray) -> tuple[float, ...]:
    """Standard deviation of the noise of a picture (H, W, 3), 1 = white, where `flat` (H, W) holds: one for each of SCALES.

    In steps of 8 bits; root of the mean square over the channels. nan where a scale has fewer than 400 / scale^2 places.
    """
    return tuple(_sigma_at(image, flat, scale) for scale in SCALES)


def enough(flat: BoolArray) -> bool:
    """Whether there are flat pixels enough to measure noise on."""
    return int(flat.sum()) >= _LEAST


def noise_table(scenes: list[SceneNoise]) -> str:
    """Noise as text: a line per scene, the captured view first, then each model with its ratio to it; scales side by side."""
    models = list(scenes[0].synthesized) if scenes else []
    first = max(len("scene"), *(len(scene.name) for scene in scenes)) if scenes else 5
    second = max(len("captured"), *(len(model) for model in models)) if models else 8
    scales = "  ".join(f"{f'{scale} x {scale} px':>14}" for scale in SCALES)
    lines = [
        "noise on flat regions: deviation in steps of 8 bits (and over that of the captured view), pixels averaged by",
        f"{'scene':<{first}}  {'flat':>4}  {'picture':<{second}}  {scales}",
    ]
    for scene in scenes:
        values = "  ".join(_cell(sigma, "") for sigma in scene.captured)
        lines.append(f"{scene.name:<{first}}  {scene.flat_share:>4.0%}  {'captured':<{second}}  {values}".rstrip())
        for model in models:
            pairs = zip(scene.synthesized[model], scene.ratio(model), strict=True)
            values = "  ".join(_cell(sigma, f"({ratio:.2f})") for sigma, ratio in pairs)
            lines.append(f"{'':<{first}}  {'':>4}  {model:<{second}}  {values}".rstrip())
    return "\n".join(lines)


def _cell(sigma: float, ratio: str) -> str:
    """A deviation and its ratio, 14 characters wide; a dash where there were too few flat pixels."""
    return f"{'-':>6}{'':8}" if math.isnan(sigma) else f"{sigma:>6.3f} {ratio:<7}"


def as_json(scene: SceneNoise, model: str) -> dict[str, object]:
    """One model's noise on one scene in JSON's types; nan becomes null."""
    return {
        "flat_share": round(scene.flat_share, 4),
        "scales_px": list(SCALES),
        "captured": [_number(value) for value in scene.captured],
        "synthesized": [_number(value) for value in scene.synthesized[model]],
        "ratio": [_number(value) for value in scene.ratio(model)],
    }


def _sigma_at(image: FloatArray, flat: BoolArray, scale: int) -> float:
    values, valid = _averaged(image.astype(np.float64), scale), _averaged(flat.astype(np.float64), scale) == 1
    inside = _eroded(valid, 1)[1:-1, 1:-1]  # where the whole kernel is on flat ground
    if int(inside.sum()) < _LEAST / scale**2:
        return math.nan
    across = values[:, :-2] - 2 * values[:, 1:-1] + values[:, 2:]
    answer = (across[:-2] - 2 * across[1:-1] + across[2:]) / _KERNEL_GAIN  # (h - 2, w - 2, 3)
    sigmas = np.median(np.abs(answer[inside]), axis=0) / _MEDIAN_TO_SIGMA
    return float(255 * np.sqrt(np.mean(sigmas**2)))


def _averaged(values: npt.NDArray[np.float64], scale: int) -> npt.NDArray[np.float64]:
    """Means of scale x scale blocks along the first two axes; what is left over at the end is dropped."""
    height, width = values.shape[0] // scale, values.shape[1] // scale
    blocks = values[: height * scale, : width * scale].reshape(height, scale, width, scale, *values.shape[2:])
    means: npt.NDArray[np.float64] = blocks.mean((1, 3))
    return means


def _gaussian(channel: FloatArray) -> FloatArray:
    radius = math.ceil(3 * _SMOOTHING)
    offsets = np.arange(-radius, radius + 1)
    taps = np.exp(-(offsets**2) / (2 * _SMOOTHING**2))
    taps = (taps / taps.sum()).astype(np.float32)
    for axis in (0, 1):
        pad = [(radius, radius) if a == axis else (0, 0) for a in (0, 1)]
        padded = np.pad(channel, pad, mode="edge")
        windows = np.lib.stride_tricks.sliding_window_view(padded, len(taps), axis=axis)
        channel = windows @ taps
    return channel


def _eroded(mask: BoolArray, radius: int) -> BoolArray:
    """Where the mask holds in the whole square of 2 radius + 1 px around."""
    for axis in (0, 1):
        pad = [(radius, radius) if a == axis else (0, 0) for a in (0, 1)]
        windows = np.lib.stride_tricks.sliding_window_view(np.pad(mask, pad), 2 * radius + 1, axis=axis)
        mask = np.asarray(windows.all(-1))
    return mask


def _number(value: float) -> float | None:
    return round(value, 4) if math.isfinite(value) else None
