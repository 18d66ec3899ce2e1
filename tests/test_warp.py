import numpy as np
import pytest
import torch
from scenes import plane
from slow import keys_kernel, sample

from lfcore.warp import backward_warp, cubic_taps, quick_sample, quick_warp, source_offset

pytestmark = pytest.mark.usefixtures("several_threads", "either_route")


def test_taps_are_the_kernel_of_keys() -> None:
    fractions = torch.linspace(0, 0.999, 37, dtype=torch.float64)
    expected = [[keys_kernel(t - k) for k in (-1, 0, 1, 2)] for t in fractions.tolist()]
    np.testing.assert_allclose(cubic_taps(fractions).numpy(), expected, atol=1e-12)
    np.testing.assert_allclose(cubic_taps(fractions).sum(-1).numpy(), 1, atol=1e-12)


def test_the_warp_equals_a_slow_sampling_by_definition() -> None:
    rng = np.random.default_rng(3)
    image = rng.random((2, 3, 11, 13)).astype(np.float32)
    disparity = rng.uniform(-6, 6, (2, 1, 11, 13)).astype(np.float32)
    offset = np.array([[0.7, -0.4], [-0.3, 1.0]], np.float32)
    warped = backward_warp(*(torch.from_numpy(a) for a in (image, disparity, offset))).numpy()
    outside = 0
    for n, c, y, x in np.ndindex(warped.shape):
        d = float(disparity[n, 0, y, x])
        # Positions in float32, as the warp has them: at the very edge of the picture rounding decides on which side one is.
        px, py = np.float32(x) + offset[n, 0] * np.float32(d), np.float32(y) + offset[n, 1] * np.float32(d)
        expected = sample(image[n, c].astype(np.float64), float(px), float(py))
        outside += expected is None
        assert warped[n, c, y, x] == pytest.approx(0.0 if expected is None else expected, abs=2e-6)
    assert outside > 50


def test_a_window_of_the_warp_is_a_part_of_the_whole() -> None:
    rng = np.random.default_rng(4)
    image = torch.from_numpy(rng.random((1, 3, 20, 24)).astype(np.float32))
    disparity = torch.from_numpy(rng.uniform(-5, 5, (1, 1, 20, 24)).astype(np.float32))
    offset = torch.tensor([[0.6, -0.9]])
    whole = backward_warp(image, disparity, offset)
    part = backward_warp(image, disparity[:, :, 5:17, 6:20], offset, (5, 6))
    assert torch.equal(part, whole[:, :, 5:17, 6:20])


def test_the_gradient_of_the_disparity_is_that_of_finite_differences() -> None:
    rng = np.random.default_rng(5)
    image = torch.from_numpy(rng.random((1, 3, 16, 16)).astype(np.float32))
    disparity = torch.from_numpy(rng.uniform(-3, 3, (1, 1, 16, 16)).astype(np.float32))
    weights = torch.from_numpy(rng.normal(size=(1, 3, 16, 16)).astype(np.float32))
    offset = torch.tensor([[0.8, -0.5]])
    leaf = disparity.clone().requires_grad_()
    (backward_warp(image, leaf, offset) * weights).sum().backward()
    assert leaf.grad is not None
    # Every pixel has a warp of its own, so one shifted copy gives all finite differences at once.
    step = 1e-2
    plus = (backward_warp(image, disparity + step, offset) * weights).sum(1)
    minus = (backward_warp(image, disparity - step, offset) * weights).sum(1)
    expected = (plus - minus) / (2 * step)
    fraction_x = (torch.arange(16) + 0.8 * disparity[0, 0]) % 1
    fraction_y = (torch.arange(16)[:, None] - 0.5 * disparity[0, 0]) % 1
    smooth = ((fraction_x - 0.5).abs() < 0.48) & ((fraction_y - 0.5).abs() < 0.48)  # no knot of the cubic within the step
    inside = (plus != 0) & (minus != 0)
    chosen = (smooth & inside[0]).numpy()
    assert chosen.sum() > 80
    np.testing.assert_allclose(leaf.grad[0, 0].numpy()[chosen], expected[0].numpy()[chosen], atol=5e-3)


def test_positive_disparity_means_content_moves_to_larger_x_and_y() -> None:
    field = plane(4.0)
    novel = torch.tensor([0.5, 0.5])
    for row, column in ((0, 0), (2, 2), (0, 2)):
        image = torch.from_numpy(field.view(row, column)).permute(2, 0, 1)[None]
        offset = source_offset(torch.tensor(field.position(row, column)), novel)[None]
        height, width = image.shape[2:]
        warped = backward_warp(image, torch.full((1, 1, height, width), 4.0), offset)[0].permute(1, 2, 0).numpy()
        inside = (slice(4, -4), slice(4, -4))
        np.testing.assert_allclose(warped[inside], field.view(1, 1)[inside], atol=2e-3)
        wrong = backward_warp(image, torch.full((1, 1, height, width), -4.0), offset)[0].permute(1, 2, 0).numpy()
        assert np.abs(wrong[inside] - field.view(1, 1)[inside]).mean() > 0.05


def test_warping_there_and_back_returns_the_picture() -> None:
    field = plane(0.0)
    image = torch.from_numpy(field.view(0, 0)).permute(2, 0, 1)[None]
    disparity = torch.full((1, 1, *image.shape[2:]), 3.3)
    there = backward_warp(image, disparity, torch.tensor([[1.0, 1.0]]))
    back = backward_warp(there, disparity, torch.tensor([[-1.0, -1.0]]))
    inside = (..., slice(8, -8), slice(8, -8))
    np.testing.assert_allclose(back[inside].numpy(), image[inside].numpy(), atol=3e-3)


def test_the_quick_warp_moves_as_the_papers_warp_does() -> None:
    """Another kernel, the same places: on a smooth picture both agree, also where the map covers a part of the picture."""
    y, x = torch.meshgrid(torch.arange(40.0), torch.arange(50.0), indexing="ij")
    image = (0.5 + 0.2 * torch.sin(x / 4) * torch.cos(y / 5)).expand(2, 3, 40, 50)
    disparity = 4 * torch.rand(1, 1, 20, 30, generator=torch.Generator().manual_seed(1)) - 2
    offset = torch.tensor([[-0.4, 0.3], [0.6, -0.7]])
    found = quick_warp(image, disparity, offset, (10, 10))
    expected = backward_warp(image, disparity.expand(2, -1, -1, -1), offset, (10, 10))
    torch.testing.assert_close(found, expected, atol=6e-3, rtol=0)


def test_quick_samples_equal_a_slow_sampling_whose_edges_are_repeated() -> None:
    rng = np.random.default_rng(6)
    image = rng.random((2, 3, 7, 9)).astype(np.float32)
    x = rng.uniform(-6, 15, (2, 5, 40)).astype(np.float32)
    y = rng.uniform(-6, 13, (2, 5, 40)).astype(np.float32)
    x[0, 0, :4], y[0, 0, :4] = (0, 8, 3, -1), (0, 6, 2, 7)  # whole pixels, the last one outside
    found = quick_sample(*(torch.from_numpy(a) for a in (image, x, y))).numpy()
    for n, row, column in np.ndindex(x.shape):
        px, py = float(x[n, row, column]), float(y[n, row, column])
        left, top = int(np.floor(px)) - 1, int(np.floor(py)) - 1
        across = [keys_kernel(px - (left + k), -0.75) for k in range(4)]
        down = [keys_kernel(py - (top + k), -0.75) for k in range(4)]
        rows, columns = np.clip(np.arange(top, top + 4), 0, 6), np.clip(np.arange(left, left + 4), 0, 8)
        expected = np.einsum("cyx,y,x->c", image[n][:, rows][:, :, columns].astype(np.float64), down, across)
        np.testing.assert_allclose(found[n, :, row, column], expected, atol=2e-5)


def test_a_place_that_is_not_a_number_or_far_away_is_outside() -> None:
    image = torch.rand(1, 3, 8, 8, generator=torch.Generator().manual_seed(2))
    disparity = torch.full((1, 1, 8, 8), 1e30)
    disparity[..., :2], disparity[..., 2:4] = float("nan"), -float("inf")
    warped = backward_warp(image, disparity, torch.tensor([[1.0, -1.0]]))
    assert torch.equal(warped, torch.zeros_like(warped))
