"""Convolutions by Winograd's transforms against the same by their definition, in float64."""

import pytest
import torch
import torch.nn.functional as F
from torch import Tensor

from lfcore.layers import DirectConvolution, Layer, fastest_layer
from lfcore.winograd import LEAST_CHANNELS, WinogradConvolution


def picture(channels: int, height: int, width: int) -> Tensor:
    return torch.randn(1, channels, height, width).to(memory_format=torch.channels_last)


@pytest.mark.usefixtures("compiled_kernels")
@pytest.mark.parametrize(("padding", "dilation"), [(0, 1), (1, 1), (2, 2), (4, 4), (8, 8), (3, 1), (0, 3)])
@pytest.mark.parametrize(
    ("channels", "size"),
    [
        ((16, 16), (17, 20)),
        ((19, 37), (23, 41)),  # channels that fill no register, sizes that fill no tile
        ((16, 33), (100, 130)),  # many blocks of tiles
    ],
)
def test_it_is_the_convolution(channels: tuple[int, int], size: tuple[int, int], padding: int, dilation: int) -> None:
    torch.manual_seed(3)
    x, weight, bias = picture(channels[0], *size), torch.randn(channels[1], channels[0], 3, 3), torch.randn(channels[1])
    expected = F.conv2d(x.double(), weight.double(), bias.double(), 1, padding, dilation)
    found = WinogradConvolution(weight, bias, padding, dilation)(x)
    assert found.dtype == torch.float32 and found.is_contiguous(memory_format=torch.channels_last)
    torch.testing.assert_close(found.double(), expected, atol=4e-5 * float(expected.std()), rtol=0)


@pytest.mark.usefixtures("compiled_kernels")
@pytest.mark.parametrize("of_positive", [False, True])
@pytest.mark.parametrize("added", [False, True])
@pytest.mark.parametrize("positive", [False, True])
@pytest.mark.parametrize("biased", [False, True])
def test_what_comes_before_and_after_is_what_a_layer_promises(
    of_positive: bool, added: bool, positive: bool, biased: bool
) -> None:
    torch.manual_seed(5)
    x, weight, bias = picture(16, 21, 30), torch.randn(18, 16, 3, 3), torch.randn(18) if biased else None
    plus = 10 * picture(18, 21, 30) if added else None
    given = [part.clone() for part in (x, plus) if part is not None]
    expected = F.conv2d(x.relu() if of_positive else x, weight, bias, padding=1)
    expected = expected if plus is None else expected + plus
    expected = expected.relu() if positive else expected
    layers: list[Layer] = [WinogradConvolution(weight, bias, 1), DirectConvolution(weight, bias, 1, 1)]
    for layer in layers:
        found = layer(x, of_positive=of_positive, plus=plus, positive=positive)
        torch.testing.assert_close(found, expected, atol=1e-3, rtol=0)
    for part, before in zip([part for part in (x, plus) if part is not None], given, strict=True):
        assert torch.equal(part, before)  # what was handed over is as it was


@pytest.mark.usefixtures("compiled_kernels")
def test_it_is_chosen_where_it_is_faster_and_exact_enough() -> None:
    def chosen(outputs: int, inputs: int, kernel: int = 3, dtype: torch.dtype = torch.float32, stride: int = 1) -> type:
        return type(fastest_layer(torch.randn(outputs, inputs, kernel, kernel), None, dtype, stride, 1, 1))

    assert chosen(48, 48) is chosen(32, 16) is WinogradConvolution
    assert chosen(12, 48) is chosen(48, LEAST_CHANNELS - 1) is DirectConvolution
    assert chosen(48, 48, kernel=1) is chosen(48, 48, stride=2) is chosen(48, 48, dtype=torch.bfloat16) is DirectConvolution


@pytest.mark.usefixtures("either_route")
@pytest.mark.parametrize(("stride", "dilation"), [(1, 1), (1, 2), (2, 1)])
def test_the_fastest_layer_computes_the_same_with_and_without_compiled_kernels(stride: int, dilation: int) -> None:
    torch.manual_seed(6)
    x, weight, bias = picture(20, 22, 26), torch.randn(40, 20, 3, 3), torch.randn(40)
    found = fastest_layer(weight, bias, torch.float32, stride, dilation, dilation)(x)
    torch.testing.assert_close(found, F.conv2d(x, weight, bias, stride, dilation, dilation), atol=1e-3, rtol=0)


def test_layers_that_it_cannot_compute_are_refused() -> None:
    with pytest.raises(AssertionError):
        WinogradConvolution(torch.randn(16, 16, 5, 5), None)
    with pytest.raises(AssertionError):
        WinogradConvolution(torch.randn(LEAST_CHANNELS - 1, 16, 3, 3), None)
