"""Protocols 7x7-Y and 8x8-BGR: which views of which grid, and their numbers against computations written out."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest

from lfcore.errors import InputError
from lfcore.lightfield import LightField
from lfcore.metrics import channel_score, luma_score, studio_luma
from lfcore.protocols import EIGHT_BGR, K16, PROTOCOLS, SEVEN_Y, novel_views

Array = npt.NDArray[np.float64]


def pair(seed: int = 1, size: tuple[int, int] = (62, 58)) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
    """A synthesis of any value and a captured view of 8 bits."""
    random = np.random.default_rng(seed)
    rows, columns = np.mgrid[: size[0], : size[1]]
    smooth = (0.5 + 0.3 * np.sin(rows / 3) * np.cos(columns / 4))[..., None] * np.array([1, 0.8, 0.6])
    truth = np.round(np.clip(smooth + random.normal(0, 0.02, smooth.shape), 0, 1) * 255).astype(np.float32) / np.float32(255)
    synthesis = (smooth + random.normal(0, 0.05, smooth.shape)).astype(np.float32)  # reaches beyond 0 and 1
    return synthesis, truth


def ssim_written_out(a: Array, b: Array, weights: Array, unbiased: float) -> float:
    """One channel, every window that lies within the picture, by the definition."""
    side = weights.shape[0]
    c1, c2 = (0.01 * 255) ** 2, (0.03 * 255) ** 2
    values = []
    for y in range(a.shape[0] - side + 1):
        for x in range(a.shape[1] - side + 1):
            p, q = a[y : y + side, x : x + side], b[y : y + side, x : x + side]
            mp, mq = (weights * p).sum(), (weights * q).sum()
            vp, vq = unbiased * (weights * (p - mp) ** 2).sum(), unbiased * (weights * (q - mq) ** 2).sum()
            covariance = unbiased * (weights * (p - mp) * (q - mq)).sum()
            values.append((2 * mp * mq + c1) * (2 * covariance + c2) / ((mp**2 + mq**2 + c1) * (vp + vq + c2)))
    return sum(values) / len(values)


def test_luma_score_equals_the_computation_written_out() -> None:
    synthesis, truth = pair()
    inside = (slice(22, -22), slice(22, -22))
    y = [
        np.array([[16 + 65.481 * r + 128.553 * g + 24.966 * b for r, g, b in row] for row in picture.astype(np.float64)])
        for picture in (np.clip(synthesis, 0, 1), truth)
    ]
    found, captured = y[0][inside], np.round(y[1])[inside]
    decibels = 10 * math.log10(255**2 / ((found - captured) ** 2).mean())
    assert luma_score(synthesis, truth).psnr == pytest.approx(decibels, abs=1e-6)
    offsets = np.arange(-5, 6)
    gaussian = np.exp(-(offsets[:, None] ** 2 + offsets**2) / (2 * 1.5**2))
    expected = ssim_written_out(found, captured, gaussian / gaussian.sum(), 1.0)
    assert luma_score(synthesis, truth).ssim == pytest.approx(expected, abs=1e-6)


def test_studio_luma_runs_from_16_to_235() -> None:
    black_white = np.array([[[0, 0, 0], [1, 1, 1]]], np.float32)
    assert studio_luma(black_white).ravel().tolist() == pytest.approx([16, 235])


def test_channel_score_equals_the_computation_written_out() -> None:
    synthesis, truth = pair(2)
    inside = (slice(22, -22), slice(22, -22))
    found = np.floor(np.clip(synthesis, 0, 1).astype(np.float64) * 255 + 0.5)[inside]
    captured = np.round(truth.astype(np.float64) * 255)[inside]
    decibels = [10 * math.log10(255**2 / ((found[..., c] - captured[..., c]) ** 2).mean()) for c in range(3)]
    score = channel_score(synthesis, truth)
    assert score.psnr == pytest.approx(sum(decibels) / 3, abs=1e-4)
    flat = np.full((7, 7), 1 / 49)
    expected = [ssim_written_out(found[..., c], captured[..., c], flat, 49 / 48) for c in range(3)]
    assert score.ssim == pytest.approx(sum(expected) / 3, abs=1e-6)


def test_equal_pictures_score_at_the_top() -> None:
    _, truth = pair(3)
    assert channel_score(truth, truth).psnr == math.inf
    assert channel_score(truth, truth).ssim == pytest.approx(1)
    # The captured view's Y is rounded to whole steps, that of the synthesis is not: at most half a step, 1/12 on average.
    assert 10 * math.log10(255**2 / 0.25) < luma_score(truth, truth).psnr < 70


@pytest.mark.parametrize(("score", "least"), [(luma_score, 55), (channel_score, 51)])
def test_small_views_are_refused(score: object, least: int) -> None:
    small = np.zeros((least - 1, 90, 3), np.float32)
    assert callable(score)
    with pytest.raises(InputError, match=f"at least {least}"):
        score(small, small)
    enough = np.zeros((least, 90, 3), np.float32)
    assert score(enough, enough).ssim == pytest.approx(1)


def numbered(rows: int, columns: int) -> LightField:
    """Views of one pixel whose value says the row and the column."""
    values = np.zeros((rows, columns, 1, 1, 3), np.uint8)
    values[..., 0] = np.arange(rows)[:, None, None, None]
    values[..., 1] = np.arange(columns)[:, None, None]
    return LightField(values, "numbered", "", "test", dark=frozenset({(0, 0), (rows - 1, columns - 1)}))


@pytest.mark.parametrize(
    ("size", "first"), [((7, 7), (0, 0)), ((8, 8), (0, 0)), ((9, 9), (1, 1)), ((14, 14), (3, 3)), ((8, 9), (0, 1))]
)
def test_seven_y_takes_the_grid_of_the_published_tests(size: tuple[int, int], first: tuple[int, int]) -> None:
    grid = SEVEN_Y.grid(numbered(*size))
    assert (grid.rows, grid.columns) == (7, 7)
    assert tuple(grid.views[0, 0, 0, 0, :2]) == first
    assert tuple(grid.views[6, 6, 0, 0, :2]) == (first[0] + 6, first[1] + 6)
    assert ((0, 0) in grid.dark) == (first == (0, 0))
    assert ((6, 6) in grid.dark) == (size == (7, 7))
    assert len(SEVEN_Y.views(grid)) == 45


def test_eight_bgr_scores_the_sixty_novel_views() -> None:
    grid = EIGHT_BGR.grid(numbered(14, 14))
    assert tuple(grid.views[0, 0, 0, 0, :2]) == (3, 3)
    views = EIGHT_BGR.views(grid)
    assert len(set(views)) == 60
    assert not {(0, 0), (0, 7), (7, 0), (7, 7)} & set(views)


def test_grids_too_small_for_a_protocol_are_refused() -> None:
    with pytest.raises(InputError, match="found 7 x 7 views, but the protocol 8x8-BGR is about 8 x 8"):
        EIGHT_BGR.grid(numbered(7, 7))
    with pytest.raises(InputError, match="7x7-Y"):
        SEVEN_Y.grid(numbered(7, 3))


def test_k16_keeps_the_grid_and_scores_one_view() -> None:
    field = numbered(8, 8)
    assert K16.grid(field) is field
    assert K16.views(field) == [(4, 4)] == [K16.shown_view(field)]
    assert len(novel_views(numbered(3, 5))) == 11


def test_protocols_are_found_by_their_names() -> None:
    assert [protocol.name for protocol in PROTOCOLS.values()] == ["K16", "7x7-Y", "8x8-BGR"]
    assert all(name == protocol.name.lower() for name, protocol in PROTOCOLS.items())
