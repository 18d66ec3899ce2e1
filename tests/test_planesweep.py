from functools import cache

import numpy as np
import numpy.typing as npt
import pytest
import torch
from scenes import plane
from slow import features as slow_features

from lfcore.lightfield import CORNERS
from lfcore.planesweep import Levels, Window, deviation_sweep, luminance, matching_disparity, plane_sweep
from lfcore.synthesizer import corner_offsets, corner_tensor

pytestmark = pytest.mark.usefixtures("several_threads", "either_route")


def random_luma(seed: int = 0, size: tuple[int, int] = (14, 17), batch: int = 1) -> torch.Tensor:
    return torch.from_numpy(np.random.default_rng(seed).random((4, batch, *size)).astype(np.float32))


def slow_sweep(luma: np.ndarray, offsets: torch.Tensor, levels: Levels, window: Window) -> np.ndarray:
    """(4, H, W) -> (2 L, h, w), by definition."""
    shifts, disparities = offsets.numpy().astype(np.float64), np.linspace(levels.low, levels.high, levels.count)
    found = [slow_features(luma.astype(np.float64), shifts, 0, 0, disparity) for disparity in disparities]
    whole = np.concatenate([np.stack(part) for part in zip(*found, strict=True)])
    return whole[:, window.top : window.bottom, window.left : window.right]


@pytest.mark.parametrize(("u", "v"), [(0.5, 0.5), (0.0, 1.0), (0.3, 0.85), (-0.25, 1.25)])
def test_features_equal_a_slow_computation_by_definition(u: float, v: float) -> None:
    luma, levels, window = random_luma(), Levels(7, -21, 21), Window(0, 14, 0, 17)
    found = plane_sweep(luma, corner_offsets(u, v), levels, window)[0]
    np.testing.assert_allclose(found, slow_sweep(luma[:, 0].numpy(), corner_offsets(u, v), levels, window), atol=2e-6)


@pytest.mark.parametrize("dtype", [torch.float32, torch.bfloat16])
@pytest.mark.parametrize("count", [2, 7, 16])
def test_deviations_alone_are_those_of_the_whole_sweep(count: int, dtype: torch.dtype) -> None:
    luma, levels, window = random_luma(5, (23, 37), batch=2), Levels(count, -21, 21), Window(1, 22, 3, 36)
    offsets = corner_offsets(0.8, 0.3)
    expected = plane_sweep(luma, offsets, levels, window)[:, count:].to(dtype)
    around = torch.full((2, count + 1, 21, 33), 7.0, dtype=dtype).to(memory_format=torch.channels_last)
    found = deviation_sweep(luma, offsets, levels, window, around[:, :count])
    torch.testing.assert_close(found, expected, atol=4e-3 if dtype is torch.bfloat16 else 1e-6, rtol=0)
    assert torch.equal(around[:, count], torch.full((2, 21, 33), 7.0, dtype=dtype))
    torch.testing.assert_close(deviation_sweep(luma, offsets, levels, window).to(dtype), found)


def test_no_sample_inside_the_picture_gives_zero_and_one_gives_no_deviation() -> None:
    luma = random_luma(size=(10, 10))
    found = plane_sweep(luma, corner_offsets(0.5, 0.5), Levels(2, -21, 21), Window(0, 10, 0, 10))[0]
    assert torch.equal(found, torch.zeros(4, 10, 10))  # shifts by 10.5 px leave a picture of 10
    found = plane_sweep(luma, corner_offsets(0, 0), Levels(2, -21, 21), Window(0, 10, 0, 10))[0]
    torch.testing.assert_close(found[0], luma[0, 0])  # only the input at the viewpoint itself counts
    assert torch.equal(found[2:], torch.zeros(2, 10, 10))


def test_a_window_is_a_part_of_the_whole() -> None:
    luma = random_luma(1, (40, 50))
    offsets = corner_offsets(0.4, 0.1)
    whole = plane_sweep(luma, offsets, Levels(), Window(0, 40, 0, 50))
    part = plane_sweep(luma, offsets, Levels(), Window(11, 31, 0, 22))
    torch.testing.assert_close(part, whole[:, :, 11:31, 0:22], atol=1e-6, rtol=0)


def test_a_batch_is_its_members() -> None:
    luma = random_luma(2, (30, 30), batch=3)
    offsets = corner_offsets(0.7, 0.2)
    window = Window(3, 27, 4, 30)
    together = plane_sweep(luma, offsets, Levels(), window)
    for k in range(3):
        torch.testing.assert_close(together[k : k + 1], plane_sweep(luma[:, k : k + 1], offsets, Levels(), window))


@cache  # it takes seconds, and is the same for every type and way
def placed_sweep(count: int, columns: int) -> npt.NDArray[np.floating]:
    """What the next test expects."""
    luma, levels, window = random_luma(3, (23, 37), batch=2), Levels(count, -9, 9), Window(2, 21, 1, 1 + columns)
    return np.stack([slow_sweep(luma[:, k].numpy(), corner_offsets(0.2, 0.6), levels, window) for k in range(2)])


@pytest.mark.parametrize("dtype", [torch.float32, torch.bfloat16])
@pytest.mark.parametrize(("count", "columns"), [(2, 35), (5, 3), (5, 35), (8, 16), (20, 9)])
def test_the_result_goes_into_the_place_it_is_given_and_nowhere_else(count: int, columns: int, dtype: torch.dtype) -> None:
    """With fewer channels and pixels than are written together, as many, and numbers of them between."""
    luma, levels, window = random_luma(3, (23, 37), batch=2), Levels(count, -9, 9), Window(2, 21, 1, 1 + columns)
    offsets = corner_offsets(0.2, 0.6)
    expected = torch.from_numpy(placed_sweep(count, columns)).float()  # (2, 2 count, 19, columns)
    around = torch.full((2, 2 * count + 3, 25, 40), 7.0, dtype=dtype).to(memory_format=torch.channels_last)
    place = around[:, : 2 * count, 4:23, 2 : 2 + columns]
    assert plane_sweep(luma, offsets, levels, window, place) is place
    coarseness = 4e-3 if dtype is torch.bfloat16 else 1e-6
    torch.testing.assert_close(place.float(), expected.to(dtype).float(), atol=coarseness, rtol=0)
    place.fill_(7.0)
    assert torch.equal(around, torch.full_like(around, 7.0))


def test_the_number_of_threads_changes_nothing() -> None:
    luma, levels, window = random_luma(4, (31, 33)), Levels(6, -14, 14), Window(0, 31, 0, 33)
    before = torch.get_num_threads()
    found = []
    try:
        for threads in (1, 2, 5):
            torch.set_num_threads(threads)
            found.append(plane_sweep(luma, corner_offsets(0.9, 0.4), levels, window))
    finally:
        torch.set_num_threads(before)
    for other in found[1:]:
        torch.testing.assert_close(other, found[0], atol=1e-6, rtol=0)


def test_deviation_vanishes_at_the_disparity_of_a_plane() -> None:
    levels = Levels(43, -21, 21)  # whole pixels
    field = plane(5.0, size=(80, 90))
    luma = luminance(corner_tensor(field)).unsqueeze(1)
    found = plane_sweep(luma, corner_offsets(0.5, 0.5), levels, Window(20, 60, 20, 70))[0]
    mean_deviation = found[43:].mean((1, 2))
    assert int(mean_deviation.argmin()) == 21 + 5
    assert float(mean_deviation.min()) < 2e-3 < 0.02 < float(mean_deviation.median())


def test_the_best_match_of_a_plane_is_its_disparity() -> None:
    field = plane(-6.0, size=(100, 100))
    luma = luminance(corner_tensor(field)).unsqueeze(1)
    target = luminance(torch.from_numpy(field.view(1, 1)).permute(2, 0, 1))[None, 25:75, 25:75]
    levels = Levels()
    disparity, confidence = matching_disparity(luma, corner_offsets(0.5, 0.5), levels, Window(25, 75, 25, 75), target)
    spacing = 42 / 99
    assert float((disparity + 6).abs().max()) <= spacing
    assert float(confidence.min()) > 0.5


def test_luminance_weighs_the_channels() -> None:
    colours = torch.eye(3).view(3, 3, 1, 1)
    assert luminance(colours).flatten().tolist() == pytest.approx([0.2989, 0.5870, 0.1140])
    assert len(CORNERS) == 4
