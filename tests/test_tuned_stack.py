import dataclasses

import numpy as np
import pytest
import torch

from lfcore.layers import Way
from lfcore.networks import BORDER, PaperStack
from lfcore.planesweep import Window
from lfcore.tuned_stack import TunedStack, Tuning

pytestmark = pytest.mark.usefixtures("several_threads")


@pytest.mark.parametrize(
    ("size", "tile"), [((100, 130), (40, 50)), ((376, 541), (200, 288)), ((33, 161), (16, 32)), ((9, 7), (16, 16))]
)
def test_tiles_cover_the_picture_once_and_are_no_larger_than_asked(size: tuple[int, int], tile: tuple[int, int]) -> None:
    seen = np.zeros(size, int)
    for part in Tuning(tile_width=tile[1], tile_pixels=tile[0] * tile[1]).tiles(*size):
        window = part.window
        seen[window.top : window.bottom, window.left : window.right] += 1
        assert 0 < window.shape[0] <= tile[0] and 0 < window.shape[1] <= tile[1]
        rows, columns = window.shape
        bottom, right = window.top + rows + 2 * BORDER, window.left + columns + 2 * BORDER
        assert part.source == Window(window.top, bottom, window.left, right)
    assert (seen == 1).all()


@pytest.mark.parametrize("multiple", [1, 16, 32])
def test_tiles_of_a_filled_stack_are_parts_of_the_stack_on_the_whole_input(multiple: int) -> None:
    torch.manual_seed(1)
    stack, features = PaperStack(5, 2), torch.randn(1, 5, 50 + 2 * BORDER, 61 + 2 * BORDER)
    expected = stack(features)
    tuning = Tuning(torch.float32, 32, multiple, 32 * 20)
    tuned = TunedStack(stack, tuning)
    with torch.inference_mode():
        for tile in tuning.tiles(50, 61):
            x = tuned.tile_input(features, tile)
            assert x.is_contiguous(memory_format=torch.channels_last) and x.shape[1] % multiple == 0
            window = tile.window
            part = expected[:, :, window.top : window.bottom, window.left : window.right]
            torch.testing.assert_close(tuned(x), part, atol=1e-5, rtol=1e-5)


@pytest.mark.usefixtures("compiled_kernels")
@pytest.mark.parametrize("way", Way)
@pytest.mark.parametrize("channels", [5, 24])
def test_the_same_by_transforms(channels: int, way: Way) -> None:
    torch.manual_seed(2)
    stack, features = PaperStack(channels, 3), torch.randn(1, channels, 50 + 2 * BORDER, 61 + 2 * BORDER)
    expected = stack(features)
    tuning = dataclasses.replace(Tuning.by_fourier(torch.float32, way), tile_width=32, tile_pixels=32 * 20)
    tuned = TunedStack(stack, tuning)
    with torch.inference_mode():
        for tile in tuning.tiles(50, 61):
            part = expected[:, :, tile.window.top : tile.window.bottom, tile.window.left : tile.window.right]
            torch.testing.assert_close(tuned(tuned.tile_input(features, tile)), part, atol=1e-5, rtol=1e-5)
