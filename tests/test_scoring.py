"""Scores and their maps: the same pixels, the same protocol."""

from __future__ import annotations

import numpy as np
import pytest
from moving_scene import truth

from app import scoring
from lfcore.lightfield import FloatArray
from lfcore.metrics import k16, psnr, to_uint8


def noisy(picture: FloatArray) -> FloatArray:
    noise = np.random.default_rng(0).normal(0, 0.02, picture.shape)
    return (picture + noise * np.linspace(0, 1, picture.shape[1])[:, None]).astype(np.float32)  # worse to the right


def test_a_map_of_ssim_has_the_score_as_its_mean_and_nothing_where_the_protocol_does_not_look() -> None:
    clean = truth(0.5, 0.5)
    shown = noisy(clean)
    score = scoring.score(shown, clean)
    assert (score.psnr, score.ssim) == (k16(shown, clean).psnr, k16(shown, clean).ssim)
    assert "K16" in score.protocol
    values = scoring.similarity(shown, clean)
    assert values.shape == clean.shape[:2]
    assert np.isnan(values[:22]).all() and np.isnan(values[:, -22:]).all()
    inside = values[22:-22, 22:-22]
    assert float(inside.mean(dtype=np.float64)) == pytest.approx(score.ssim, abs=1e-6)
    assert inside[:, :20].mean() > inside[:, -20:].mean()


def test_psnr_of_blocks_comes_to_that_of_the_whole() -> None:
    clean = truth(0.5, 0.5)
    shown = noisy(clean)
    values = scoring.blocks(shown, clean)[22:-22, 22:-22].astype(np.float64)
    mean_square = (255**2 / 10 ** (values / 10)).mean()  # each pixel has its block's
    assert 10 * np.log10(255**2 / mean_square) == pytest.approx(scoring.score(shown, clean).psnr, abs=1e-4)


def test_small_pictures_are_scored_whole_and_say_so() -> None:
    clean = truth(0.5, 0.5, (40, 50))
    shown = noisy(clean)
    score = scoring.score(shown, clean)
    assert score.psnr == psnr(to_uint8(shown), to_uint8(clean))
    assert "whole" in score.protocol
    assert not np.isnan(scoring.similarity(shown, clean)).any()
    assert not np.isnan(scoring.blocks(shown, clean)).any()
