"""Refocusing: a plane is sharp at its own disparity and blurred at others; the shift is that of the backward warp."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch

from lfcore.refocus import aperture_weights, refocus, shifted
from lfcore.warp import backward_warp
from tests.scenes import plane, smooth_texture

INSIDE = (slice(8, -8), slice(8, -8))


@pytest.mark.parametrize("disparity", [-5.3, 0.0, 4.0])
@pytest.mark.parametrize("viewpoint", [(0.5, 0.5), (0.2, 0.9)])
def test_a_plane_in_focus_is_the_plane_seen_from_the_viewpoint(disparity: float, viewpoint: tuple[float, float]) -> None:
    scene = plane(disparity, (5, 5))
    views = [(scene.position(r, c), scene.view(r, c), 1.0) for r in range(5) for c in range(5)]
    found = refocus(views, viewpoint, disparity)
    y, x = np.mgrid[: scene.height, : scene.width].astype(np.float32)
    truth = smooth_texture(x - disparity * viewpoint[0], y - disparity * viewpoint[1])
    assert found.dtype == np.float32
    assert np.abs(found - truth)[INSIDE].max() < 0.004


def test_out_of_focus_a_point_becomes_the_shape_of_the_aperture() -> None:
    # A dot at disparity 0, focused at -8: view (u, v) shows it at (u - 0.5) * 8 px from the middle, so 5 x 5 views make a
    # pattern of 5 x 5 dots, 2 px apart.
    dot = np.zeros((33, 33, 3), np.float32)
    dot[16, 16] = 1
    views = [((u, v), dot, 1.0) for v in np.linspace(0, 1, 5) for u in np.linspace(0, 1, 5)]
    found = refocus(views, (0.5, 0.5), -8.0)
    expected = np.zeros((33, 33), np.float32)
    expected[12:21:2, 12:21:2] = 1 / 25
    assert np.abs(found - expected[..., None]).max() < 1e-6
    assert np.array_equal(refocus(views, (0.5, 0.5), 0.0)[..., 0] > 0.5, dot[..., 0] > 0.5)


def test_weights_count() -> None:
    dark, bright = np.zeros((4, 4, 3), np.float32), np.ones((4, 4, 3), np.float32)
    assert refocus([((0, 0), dark, 3.0), ((1, 1), bright, 1.0)], (0, 0), 0.0) == pytest.approx(0.25)
    with pytest.raises(ValueError, match="weight"):
        refocus([((0, 0), dark, 0.0)], (0, 0), 0.0)


@pytest.mark.parametrize(("dx", "dy"), [(0.0, 0.0), (3.0, -2.0), (0.37, 0.0), (-1.61, 2.83)])
def test_the_shift_is_that_of_the_backward_warp(dx: float, dy: float) -> None:
    picture = np.random.default_rng(0).random((24, 30, 3), dtype=np.float32)
    image = torch.from_numpy(picture).permute(2, 0, 1)[None]
    warped = backward_warp(image, torch.ones(1, 1, 24, 30), torch.tensor([[dx, dy]]))[0].permute(1, 2, 0).numpy()
    assert np.abs(shifted(picture, dx, dy) - warped)[5:-5, 5:-5].max() < 1e-5


def test_what_is_shifted_in_repeats_the_edge() -> None:
    picture = np.arange(5, dtype=np.float32)[None, :, None].repeat(3, 2).repeat(2, 0)
    assert shifted(picture, 2, 0)[0, :, 0].tolist() == [2, 3, 4, 4, 4]
    assert shifted(picture, 100.5, -100.5)[0, :, 0] == pytest.approx([4] * 5)


def test_the_aperture_is_round_soft_and_never_empty() -> None:
    positions = np.array([(u, v) for v in np.linspace(0, 1, 9) for u in np.linspace(0, 1, 9)])
    distance = np.hypot(*(positions - 0.5).T)
    weights = aperture_weights(positions, (0.5, 0.5), 0.5, 1 / 8)
    assert (weights[distance <= 0.25] == 1).all()
    assert (weights[distance >= 0.25 + 1 / 8] == 0).all()
    rim = (distance > 0.26) & (distance < 0.37)
    assert ((weights[rim] > 0) & (weights[rim] < 1)).all()
    pinhole = aperture_weights(positions, (0.5, 0.5), 0.0, 1 / 8)
    assert pinhole.sum() == 1 and pinhole[np.argmin(distance)] == 1
    assert aperture_weights(positions, (-0.25, -0.25), 0.0, 1 / 8).tolist() == [1.0, *[0.0] * 80]
    # Weights change by no more than the movement over the spacing.
    moved = aperture_weights(positions, (0.51, 0.5), 0.5, 1 / 8)
    assert np.abs(moved - weights).max() <= 0.01 * 8 + 1e-9
    assert math.isclose(weights.max(), 1)
