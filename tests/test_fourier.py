"""Convolutions by Fourier transforms against the same by their definition, in float64."""

import pytest
import torch
import torch.nn.functional as F
from torch import Tensor, nn

from lfcore.errors import Cancelled
from lfcore.fourier import LEAST_CHANNELS, SIZE, FourierConvolution

pytestmark = pytest.mark.usefixtures("several_threads", "compiled_kernels")


def case(channels: tuple[int, int], kernel: int, size: tuple[int, int], mean: float = 0.0) -> tuple[nn.Conv2d, Tensor, Tensor]:
    """A layer, an input and what should come out, float64."""
    torch.manual_seed(4)
    layer = nn.Conv2d(*channels, kernel).requires_grad_(False)
    x = (torch.randn(1, channels[0], *size) + mean).to(memory_format=torch.channels_last)
    assert layer.bias is not None
    return layer, x, F.conv2d(x.double(), layer.weight.double(), layer.bias.double()).relu()


@pytest.mark.parametrize("kernel", [1, 3, 5, 7, 15])
@pytest.mark.parametrize(
    ("channels", "size"),
    [
        ((16, 16), (16, 16)),  # one tile, or little more
        ((17, 35), (15, 40)),  # less than a tile high; channels that fill no register
        ((48, 31), (53, 37)),
        ((16, 20), (150, 170)),  # many blocks of tiles
    ],
)
def test_it_is_the_convolution(channels: tuple[int, int], kernel: int, size: tuple[int, int]) -> None:
    layer, x, expected = case(channels, kernel, size)
    found = FourierConvolution(layer, torch.float32)(x)
    assert found.dtype == torch.float32 and found.is_contiguous(memory_format=torch.channels_last)
    torch.testing.assert_close(found.double(), expected, atol=5e-6, rtol=0)
    assert float(expected.mean()) > 0.01 and float((expected == 0).double().mean()) > 0.2  # there is something to rectify


def test_a_single_sample_comes_out_as_the_kernel_mirrored_wherever_it_lies() -> None:
    layer = nn.Conv2d(16, 16, 5).requires_grad_(False)
    assert layer.bias is not None
    layer.bias.zero_()
    layer.weight.abs_()
    convolution = FourierConvolution(layer, torch.float32)
    for row in range(8, 8 + SIZE):
        column = 40 - row
        x = torch.zeros(1, 16, 40, 48).to(memory_format=torch.channels_last)
        x[0, 3, row, column] = 1
        found = convolution(x)
        torch.testing.assert_close(found[0, :, row - 4 : row + 1, column - 4 : column + 1], layer.weight[:, 3].flip(1, 2))
        found[0, :, row - 4 : row + 1, column - 4 : column + 1] = 0
        assert float(found.abs().max()) < 1e-6


def test_in_bfloat16_it_is_about_as_exact_as_torchs() -> None:
    layer, x, _ = case((40, 50), 7, (60, 70))
    x = x.bfloat16().to(memory_format=torch.channels_last)
    assert layer.bias is not None
    expected = F.conv2d(x.double(), layer.weight.double(), layer.bias.double()).relu()
    direct = F.conv2d(x, layer.weight.bfloat16(), layer.bias.bfloat16()).relu()
    found = FourierConvolution(layer, torch.bfloat16)(x)
    assert found.dtype == torch.bfloat16 and found.is_contiguous(memory_format=torch.channels_last)

    def error(result: Tensor) -> float:
        return float((result.double() - expected).pow(2).mean().sqrt())

    assert 0 < error(found) < 2 * error(direct) < 0.02 * float(expected.std())


def test_the_level_of_a_tile_is_kept_in_bfloat16() -> None:
    """Rounded like the rest, a tile would be wrong as a whole, by up to a 256th, which layers to come cannot average out."""
    layer, x, _ = case((40, 50), 7, (66, 76), mean=4.0)
    layer.weight.abs_()
    x = x.bfloat16().to(memory_format=torch.channels_last)
    assert layer.bias is not None
    expected = F.conv2d(x.double(), layer.weight.double(), layer.bias.double())
    found = FourierConvolution(layer, torch.bfloat16)(x)
    levels, true_levels = (F.avg_pool2d(result.double(), SIZE - 7 + 1) for result in (found, expected))
    assert float(((levels - true_levels) / true_levels).abs().max()) < 1e-3


def test_the_same_on_any_number_of_threads() -> None:
    layer, x, _ = case((16, 24), 5, (90, 100))
    convolution, threads = FourierConvolution(layer, torch.float32), torch.get_num_threads()
    try:
        torch.set_num_threads(1)
        one = convolution(x)
        torch.set_num_threads(3)
        torch.testing.assert_close(convolution(x), one, atol=1e-6, rtol=0)
    finally:
        torch.set_num_threads(threads)


def test_it_can_be_broken_off_within_a_picture() -> None:
    layer, x, _ = case((16, 16), 7, (260, 260))  # 26 x 26 tiles, of which fewer than a hundred are in work at once
    convolution = FourierConvolution(layer, torch.float32)
    asked = 0

    def check(most: int = 3) -> None:
        nonlocal asked
        asked += 1
        if asked > most:
            raise Cancelled

    with pytest.raises(Cancelled):
        convolution(x, check)
    assert asked == 4
    asked = 0
    convolution(x, lambda: check(1000))
    assert asked >= 26 * 26 / 100


def test_layers_that_it_cannot_compute_are_refused() -> None:
    with pytest.raises(AssertionError):
        FourierConvolution(nn.Conv2d(16, 16, SIZE + 1), torch.float32)
    with pytest.raises(AssertionError):
        FourierConvolution(nn.Conv2d(LEAST_CHANNELS - 1, 16, 3), torch.float32)
    with pytest.raises(AssertionError):
        FourierConvolution(nn.Conv2d(16, 16, 3, padding=1), torch.float32)
