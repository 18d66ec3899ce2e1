"""PSNR and SSIM against slow direct computations, and the K16 protocol against its written rule."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest

from lfcore.errors import InputError
from lfcore.lightfield import LightField
from lfcore.metrics import (
    PSNR_BLOCK,
    absolute_error,
    block_psnr,
    check_size,
    k16,
    k16_view,
    psnr,
    similarity_map,
    squared_error,
    ssim,
    to_uint8,
)


def pictures(seed: int, shape: tuple[int, ...]) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.uint8]]:
    """A smooth random picture and a noisy, slightly darker copy of it."""
    random = np.random.default_rng(seed)
    rows, columns = np.mgrid[: shape[0], : shape[1]]
    smooth = 128 + 80 * np.sin(rows / 3)[..., None] * np.cos(columns / 4)[..., None] * np.ones(shape[2:])
    noisy = 0.9 * smooth + random.normal(0, 12, smooth.shape)
    return smooth.astype(np.uint8), np.clip(noisy, 0, 255).astype(np.uint8)


def ssim_by_loops(a: npt.NDArray[np.uint8], b: npt.NDArray[np.uint8]) -> float:
    """The volume SSIM written out: every voxel, every one of the 11^3 neighbours, indices clamped at the edges."""
    height, width, channels = a.shape
    offsets = [(i, j, k) for i in range(-5, 6) for j in range(-5, 6) for k in range(-5, 6)]
    weights = np.array([math.exp(-(i * i + j * j + k * k) / (2 * 1.5**2)) for i, j, k in offsets])
    weights /= weights.sum()
    c1, c2 = (0.01 * 255) ** 2, (0.03 * 255) ** 2
    values = []
    for y in range(height):
        for x in range(width):
            for c in range(channels):
                where = [
                    (min(max(y + i, 0), height - 1), min(max(x + j, 0), width - 1), min(max(c + k, 0), channels - 1))
                    for i, j, k in offsets
                ]
                p = np.array([float(a[w]) for w in where])
                q = np.array([float(b[w]) for w in where])
                mp, mq = weights @ p, weights @ q
                vp, vq = weights @ (p - mp) ** 2, weights @ (q - mq) ** 2
                cov = weights @ ((p - mp) * (q - mq))
                values.append((2 * mp * mq + c1) * (2 * cov + c2) / ((mp**2 + mq**2 + c1) * (vp + vq + c2)))
    return sum(values) / len(values)


def test_psnr_of_a_known_difference() -> None:
    a = np.full((5, 7, 3), 100, np.uint8)
    b = a.copy()
    b[..., 0] = 103  # one channel of three off by 3: mean square 3
    assert psnr(a, b) == pytest.approx(10 * math.log10(255**2 / 3))
    assert psnr(b, a) == psnr(a, b)
    assert psnr(a, a) == math.inf


def test_psnr_takes_the_peak_from_the_type() -> None:
    a = np.zeros((4, 4, 3), np.float32)
    assert psnr(a, a + np.float32(0.1)) == pytest.approx(20, abs=1e-5)
    assert psnr(np.zeros((4, 4), np.uint16), np.full((4, 4), 6553, np.uint16)) == pytest.approx(20, abs=1e-2)


def test_unlike_pictures_are_refused() -> None:
    a = np.zeros((4, 4, 3), np.uint8)
    with pytest.raises(ValueError, match="alike"):
        psnr(a, a[:3])
    with pytest.raises(ValueError, match="alike"):
        ssim(a, a.astype(np.float32))


def test_ssim_equals_the_direct_sum_over_a_volume() -> None:
    a, b = pictures(1, (9, 14, 3))
    assert ssim(a, b) == pytest.approx(ssim_by_loops(a, b), abs=1e-9)


def test_ssim_reaches_across_the_channels() -> None:
    a, b = pictures(2, (16, 16, 3))
    each = np.mean([ssim(a[..., [c, c, c]], b[..., [c, c, c]]) for c in range(3)])
    assert abs(ssim(a, b) - each) > 1e-3


def test_ssim_is_one_for_equal_pictures_and_falls_with_noise() -> None:
    a, b = pictures(3, (24, 24, 3))
    half = ((a.astype(int) + b) // 2).astype(np.uint8)
    assert ssim(a, a) == pytest.approx(1)
    assert ssim(a, b) == pytest.approx(ssim(b, a))
    assert ssim(a, b) < ssim(a, half) < 1


def test_to_uint8_rounds_and_clips() -> None:
    values = np.array([-0.5, 0, 0.5 / 255, 0.49 / 255, 1.5 / 255, 254.4 / 255, 1, 3], np.float32)
    assert to_uint8(values).tolist() == [0, 0, 1, 0, 2, 254, 255, 255]
    stored = np.arange(256, dtype=np.uint8)
    assert (to_uint8(stored.astype(np.float32) / np.float32(255)) == stored).all()


def test_k16_ignores_the_border_and_what_8_bits_cannot_hold() -> None:
    random = np.random.default_rng(4)
    truth = random.integers(0, 250, (60, 70, 3)).astype(np.float32) / 255
    same = truth + np.float32(0.3 / 255)
    same[:22] = same[-22:] = 0
    same[:, :22] = same[:, -22:] = 0
    assert k16(same, truth).psnr == math.inf
    off = truth.copy()
    off[22, 22, 0] += 5 / 255  # the first pixel that counts; 16 x 26 x 3 values remain
    assert k16(off, truth).psnr == pytest.approx(10 * math.log10(255**2 * 16 * 26 * 3 / 25))


def test_k16_refuses_views_that_the_crop_would_use_up() -> None:
    small = np.zeros((44, 100, 3), np.float32)
    with pytest.raises(InputError, match="22 px"):
        k16(small, small)


@pytest.mark.parametrize(("grid", "view"), [((8, 8), (4, 4)), ((7, 7), (3, 3)), ((3, 3), (1, 1)), ((3, 5), (1, 2))])
def test_k16_scores_the_view_of_the_protocol(grid: tuple[int, int], view: tuple[int, int]) -> None:
    light_field = LightField(np.zeros((*grid, 4, 4, 3), np.uint8), "test", "", "test")
    assert k16_view(light_field) == view


def test_corner_views_alone_cannot_be_scored() -> None:
    with pytest.raises(InputError, match="four corner views"):
        k16_view(LightField(np.zeros((2, 2, 4, 4, 3), np.uint8), "flower", "", "test"))


def test_error_maps() -> None:
    a = np.zeros((2, 3, 3), np.float32)
    b = a.copy()
    b[1, 2] = (0.3, 0, -0.6)
    assert absolute_error(a, b)[1, 2] == pytest.approx(0.3)
    assert squared_error(a, b)[1, 2] == pytest.approx((0.09 + 0.36) / 3)
    assert absolute_error(a, b).sum() == pytest.approx(0.3)
    assert psnr(a, b) == pytest.approx(10 * math.log10(1 / float(squared_error(a, b).mean())))


def test_the_map_of_ssim_has_the_score_as_its_mean_and_is_low_where_the_pictures_differ() -> None:
    a, _ = pictures(3, (150, 90, 3))  # more rows than one block of the filter
    b = a.copy()
    b[100:120, 30:50] = a[100:120, 30:50][::-1]
    found = similarity_map(a, b)
    assert found.shape == (150, 90)
    assert float(found.mean(dtype=np.float64)) == pytest.approx(ssim(a, b), abs=1e-6)
    assert found[110, 40] < 0.9
    np.testing.assert_allclose(found[:90], 1, atol=1e-6)  # farther off than the window reaches


def test_ssim_of_a_picture_larger_than_a_block_of_the_filter_is_that_of_loops() -> None:
    """Loops over all of it would take minutes: a single pixel beside the border of two blocks tells."""
    a, b = pictures(4, (80, 20, 3))
    found = similarity_map(a, b)
    cut = slice(64 - 12, 64 + 12)  # around row 64, where the second block begins; the window reaches 5 px
    np.testing.assert_allclose(found[64 - 6 : 64 + 6], similarity_map(a[cut], b[cut])[6:18], atol=1e-6)


def test_psnr_of_blocks_is_psnr_of_each() -> None:
    a, b = pictures(5, (40, 37, 3))
    b[:PSNR_BLOCK, :PSNR_BLOCK] = a[:PSNR_BLOCK, :PSNR_BLOCK]
    found = block_psnr(a, b)
    assert found.shape == (3, 3)  # 16, 16, 8 rows; 16, 16, 5 columns
    assert found[0, 0] == math.inf
    for row, column in ((0, 1), (1, 0), (2, 1), (2, 2)):
        block = (slice(16 * row, 16 * row + 16), slice(16 * column, 16 * column + 16))
        assert found[row, column] == pytest.approx(psnr(a[block], b[block]), abs=1e-4)


@pytest.mark.parametrize("grid", [(2, 3), (3, 2), (2, 5)])
def test_a_view_on_an_edge_is_none_to_score(grid: tuple[int, int]) -> None:
    views = np.zeros((*grid, 60, 60, 3), np.uint8)
    with pytest.raises(InputError, match=f"flat: found {grid[0]} x {grid[1]} views; .*at least 3 x 3"):
        k16_view(LightField(views, "flat", "", ""))


@pytest.mark.parametrize(("protocol", "least"), [("K16", 45), ("7x7-Y", 55), ("8x8-BGR", 51)])
def test_views_too_small_for_a_protocol_are_named(protocol: str, least: int) -> None:
    check_size(LightField(np.zeros((3, 3, least, least, 3), np.uint8), "flat", "", ""), protocol)
    with pytest.raises(InputError, match=f"^flat: the views are {least} x {least - 1} px.*at least {least} x {least} px"):
        check_size(LightField(np.zeros((3, 3, least - 1, least, 3), np.uint8), "flat", "", ""), protocol)
