"""The estimator of noise against noise that is known, white and correlated; flat regions where they are and only there."""

from __future__ import annotations

import math

import numpy as np
import pytest

from lfcore.lightfield import FloatArray
from lfcore.noise import SceneNoise, as_json, enough, flat_regions, noise_sigma, noise_table

SIGMA = 3 / 255


def flat_picture(size: int = 240) -> FloatArray:
    """A gentle ramp, from 0.3 to 0.6, that no 3 x 3 kernel of second differences sees."""
    ramp = np.linspace(0.3, 0.6, size, dtype=np.float32)
    return np.repeat(np.tile(ramp, (size, 1))[..., None], 3, axis=2)


def noisy(picture: FloatArray, seed: int, sigma: float = SIGMA) -> FloatArray:
    noise = np.random.default_rng(seed).normal(0, sigma, picture.shape)
    return (picture + noise).astype(np.float32)


def test_white_noise_is_recovered_and_falls_with_the_scale() -> None:
    picture = noisy(flat_picture(), 1)
    flat = flat_regions(picture)
    assert flat.mean() > 0.5
    for scale, sigma in zip((1, 2, 4), noise_sigma(picture, flat), strict=True):
        assert sigma == pytest.approx(255 * SIGMA / scale, rel=0.03)


def test_the_average_of_four_has_half_of_the_noise() -> None:
    clean = flat_picture()
    captured = noisy(clean, 2)
    average = np.mean([noisy(clean, seed) for seed in (3, 4, 5, 6)], axis=0, dtype=np.float32)
    flat = flat_regions(captured)
    noise = SceneNoise("scene", float(flat.mean()), noise_sigma(captured, flat), {"mean": noise_sigma(average, flat)})
    assert noise.ratio("mean") == pytest.approx((0.5, 0.5, 0.5), rel=0.06)


def test_rounding_to_8_bits_adds_its_own_noise_and_no_more() -> None:
    picture = noisy(flat_picture(), 7, 1.5 / 255)
    stored = (np.round(picture * 255) / 255).astype(np.float32)
    (sigma, _, _) = noise_sigma(stored, flat_regions(stored))
    assert sigma == pytest.approx(math.sqrt(1.5**2 + 1 / 12), rel=0.04)


def test_correlated_noise_shows_at_the_coarser_scales() -> None:
    """Noise averaged over 3 x 3 px: little of it between neighbouring pixels, more on means of 4 x 4."""
    clean = flat_picture()
    white = np.random.default_rng(8).normal(0, SIGMA, (242, 242, 3))
    smooth = sum(white[y : y + 240, x : x + 240] for y in range(3) for x in range(3)) / 9
    picture = (clean + smooth).astype(np.float32)
    flat = flat_regions(picture)
    for scale, sigma in zip((1, 2, 4), noise_sigma(picture, flat), strict=True):
        # Box of 3, means over `scale` and second differences at that distance are one filter on white noise, along each axis.
        differences = np.zeros(2 * scale + 1)
        differences[[0, scale, 2 * scale]] = 1, -2, 1
        filtered = np.convolve(np.convolve(np.ones(3) / 3, np.ones(scale) / scale), differences)
        assert sigma == pytest.approx(255 * SIGMA * (filtered @ filtered) / 6, rel=0.05)
    fine, _, coarse = noise_sigma(picture, flat)
    assert coarse > 0.9 * fine  # of white noise it would be a quarter


def test_flat_regions_leave_out_texture_clipping_and_the_border() -> None:
    picture = flat_picture()
    picture[40:80, 40:80, 1] += 0.2  # an edge in one channel
    picture[150:200, 150:200] = 1.0  # clipped
    picture[150:200, 40:90] = 0.0
    flat = flat_regions(noisy(picture, 9, 0.001))
    assert enough(flat)
    assert not flat[36:84, 38:42].any()
    assert not flat[155:195, 155:195].any()
    assert not flat[155:195, 45:85].any()
    assert not flat[:11].any()
    assert flat[100:140, 100:140].all()


def test_a_picture_without_flat_regions_has_none() -> None:
    texture = np.random.default_rng(10).random((60, 60, 3)).astype(np.float32)
    assert not enough(flat_regions(texture))
    assert all(math.isnan(sigma) for sigma in noise_sigma(texture, flat_regions(texture)))


def test_table_and_json_say_what_was_measured() -> None:
    scene = SceneNoise("hill", 0.25, (2.0, 1.0, math.nan), {"full": (1.0, 0.25, math.nan)})
    lines = noise_table([scene]).splitlines()
    assert lines[2].split() == ["hill", "25%", "captured", "2.000", "1.000", "-"]
    assert lines[3].split()[:5] == ["full", "1.000", "(0.50)", "0.250", "(0.25)"]
    assert as_json(scene, "full") == {
        "flat_share": 0.25,
        "scales_px": [1, 2, 4],
        "captured": [2.0, 1.0, None],
        "synthesized": [1.0, 0.25, None],
        "ratio": [0.5, 0.25, None],
    }
