"""Scores and their maps: the same pixels, the same protocol."""

from __future__ import annotations

import math

import numpy as np
import pytest
from moving_scene import truth

from app.scoring import RULES, rule_for, score
from lfcore.lightfield import FloatArray
from lfcore.metrics import channel_score, k16, luma_score, psnr, ssim, to_uint8

SCORES = {"K16": k16, "7x7-Y": luma_score, "8x8-BGR": channel_score}


def noisy(picture: FloatArray) -> FloatArray:
    """Worse to the right, and some of it beyond white."""
    noise = np.random.default_rng(0).normal(0, 0.02, picture.shape)
    return (picture + 0.1 + noise * np.linspace(0, 1, picture.shape[1])[:, None]).astype(np.float32)


@pytest.mark.parametrize("name", RULES)
def test_a_score_is_that_of_its_protocol(name: str) -> None:
    clean = truth(0.5, 0.5)
    found, expected = score(name, noisy(clean), clean), SCORES[name](noisy(clean), clean)
    assert (found.psnr, found.ssim) == (expected.psnr, expected.ssim)
    assert name in found.protocol


@pytest.mark.parametrize("name", RULES)
def test_a_map_of_ssim_has_the_score_as_its_mean_and_nothing_where_the_protocol_does_not_look(name: str) -> None:
    clean = truth(0.5, 0.5)
    values = rule_for(name, *clean.shape[:2]).similarity(noisy(clean), clean)
    assert values.shape == clean.shape[:2]
    assert np.isnan(values[:22]).all() and np.isnan(values[:, -22:]).all()
    assert np.nanmean(values, dtype=np.float64) == pytest.approx(score(name, noisy(clean), clean).ssim, abs=1e-6)
    assert np.nanmean(values[:, :50]) > np.nanmean(values[:, -50:])


@pytest.mark.parametrize("name", ["K16", "7x7-Y"])
def test_psnr_of_blocks_comes_to_that_of_the_whole(name: str) -> None:
    clean = truth(0.5, 0.5)
    values = rule_for(name, *clean.shape[:2]).blocks(noisy(clean), clean)[22:-22, 22:-22].astype(np.float64)
    mean_square = (255**2 / 10 ** (values / 10)).mean()  # each pixel has its block's
    assert 10 * np.log10(255**2 / mean_square) == pytest.approx(score(name, noisy(clean), clean).psnr, abs=1e-4)


def test_psnr_of_blocks_of_channels_is_the_mean_of_each_channels_own() -> None:
    clean = truth(0.5, 0.5)
    shown = noisy(clean)
    values = RULES["8x8-BGR"].blocks(shown, clean)
    block = (slice(22 + 16, 22 + 32), slice(22, 22 + 16))
    a, b = to_uint8(shown)[block], to_uint8(clean)[block]
    expected = sum(psnr(a[..., channel], b[..., channel]) for channel in range(3)) / 3
    np.testing.assert_allclose(values[block], expected, rtol=1e-5)


@pytest.mark.parametrize("name", ["K16", "8x8-BGR"])  # 7x7-Y rounds Y of the captured view only
def test_equal_pictures_are_equal(name: str) -> None:
    clean = (to_uint8(truth(0.5, 0.5)) / 255).astype(np.float32)
    rule = rule_for(name, *clean.shape[:2])
    assert score(name, clean, clean).psnr == math.inf
    assert (rule.blocks(clean, clean)[22:-22, 22:-22] == np.inf).all()
    assert np.nanmin(rule.similarity(clean, clean)) == pytest.approx(1)


@pytest.mark.parametrize("name", RULES)
def test_small_pictures_are_scored_whole_and_say_so(name: str) -> None:
    clean = truth(0.5, 0.5, (40, 60))
    shown = noisy(clean)
    found = score(name, shown, clean)
    assert (found.psnr, found.ssim) == (psnr(to_uint8(shown), to_uint8(clean)), ssim(to_uint8(shown), to_uint8(clean)))
    assert "whole" in found.protocol
    rule = rule_for(name, 40, 60)
    assert float(rule.similarity(shown, clean).mean(dtype=np.float64)) == pytest.approx(found.ssim, abs=1e-6)
    assert not np.isnan(rule.blocks(shown, clean)).any()
    assert score(name, truth(0, 0, (55, 55)), truth(0, 0, (55, 55))).protocol.startswith(name)  # the least that can be cropped
