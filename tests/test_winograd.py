"""Convolutions by Winograd's transforms against the same by their definition, in float64."""

import os
import subprocess
import sys
from collections.abc import Callable

import pytest
import torch
import torch.nn.functional as F
from processor import processor_flags
from torch import Tensor

from lfcore import kernels
from lfcore.kernels import can_convolve
from lfcore.layers import DirectConvolution, Layer, Way, make_layer
from lfcore.winograd import WinogradConvolution

pytestmark = pytest.mark.usefixtures("several_threads")


def picture(channels: int, height: int, width: int) -> Tensor:
    return torch.randn(1, channels, height, width).to(memory_format=torch.channels_last)


TYPES = [torch.float32, torch.bfloat16]


@pytest.fixture
def kernels_for(compiled_kernels: None) -> Callable[[torch.dtype], None]:
    """Skips a test of a type in which this processor cannot compute; fails where the system names what that takes."""

    def need(dtype: torch.dtype) -> None:
        if not can_convolve(dtype):
            if os.environ.get("CI"):
                assert not {"avx512_bf16", "avx512bw", "avx512vl", "avx512dq"} <= processor_flags()
            pytest.skip("this processor has no products of pairs of bfloat16")

    return need


@pytest.mark.parametrize("dtype", TYPES)
@pytest.mark.parametrize(("padding", "dilation"), [(0, 1), (1, 1), (2, 2), (4, 4), (8, 8), (3, 1), (0, 3)])
@pytest.mark.parametrize(
    ("channels", "size"),
    [
        ((16, 32), (17, 20)),
        ((19, 37), (23, 41)),  # channels that fill no register, sizes that fill no tile
        ((33, 35), (100, 130)),  # many blocks of tiles
        ((64, 80), (17, 20)),
    ],
)
def test_it_is_the_convolution(
    channels: tuple[int, int],
    size: tuple[int, int],
    padding: int,
    dilation: int,
    dtype: torch.dtype,
    kernels_for: Callable[[torch.dtype], None],
) -> None:
    kernels_for(dtype)
    torch.manual_seed(3)
    x, weight = picture(channels[0], *size).to(dtype), torch.randn(channels[1], channels[0], 3, 3)
    bias = torch.randn(channels[1])
    expected = F.conv2d(x.double(), weight.double(), bias.double(), 1, padding, dilation)
    found = WinogradConvolution(weight, bias, padding, dilation, dtype)(x)
    assert found.dtype == dtype and found.is_contiguous(memory_format=torch.channels_last)
    wrong = (found.double() - expected) / expected.std()
    # In bfloat16 36 numbers with a relative error of 1/256 at most, of inputs and of weights, make up a result.
    mean, most = (1e-6, 2e-5) if dtype == torch.float32 else (0.015, 0.12)
    assert float(wrong.square().mean().sqrt()) < mean and float(wrong.abs().max()) < most


def test_in_bfloat16_any_count_of_channels_will_do(kernels_for: Callable[[torch.dtype], None]) -> None:
    kernels_for(torch.bfloat16)
    torch.manual_seed(4)
    for inputs, outputs in ((1, 1), (3, 5), (32, 12), (31, 16), (34, 100)):
        x, weight = picture(inputs, 9, 14).bfloat16(), torch.randn(outputs, inputs, 3, 3)
        expected = F.conv2d(x.float(), weight, padding=1)
        wrong = WinogradConvolution(weight, None, 1, dtype=torch.bfloat16)(x) - expected
        assert float(wrong.abs().max()) < 0.12 * float(expected.std())


@pytest.mark.parametrize("dtype", TYPES)
@pytest.mark.parametrize("of_positive", [False, True])
@pytest.mark.parametrize("added", [False, True])
@pytest.mark.parametrize("positive", [False, True])
@pytest.mark.parametrize("biased", [False, True])
@pytest.mark.parametrize("inputs", [16, 48])
def test_what_comes_before_and_after_is_what_a_layer_promises(
    inputs: int,
    of_positive: bool,
    added: bool,
    positive: bool,
    biased: bool,
    dtype: torch.dtype,
    kernels_for: Callable[[torch.dtype], None],
) -> None:
    kernels_for(dtype)
    torch.manual_seed(5)
    x, weight = picture(inputs, 21, 30).to(dtype), torch.randn(34, inputs, 3, 3)
    bias = torch.randn(34) if biased else None
    plus = 10 * picture(34, 21, 30).to(dtype) if added else None
    given = [part.clone() for part in (x, plus) if part is not None]
    expected = F.conv2d((x.relu() if of_positive else x).float(), weight, bias, padding=1)
    expected = expected if plus is None else expected + plus
    expected = expected.relu() if positive else expected
    direct = DirectConvolution(weight.to(dtype), None if bias is None else bias.to(dtype), 1, 1)
    layers: list[Layer] = [WinogradConvolution(weight, bias, 1, dtype=dtype), direct]
    for layer in layers:
        found = layer(x, of_positive=of_positive, plus=plus, positive=positive)
        most = 1e-3 if dtype == torch.float32 else 0.15 * float(expected.std())
        torch.testing.assert_close(found.float(), expected, atol=most, rtol=0)
        assert not positive or float(found.min()) == 0
    for part, before in zip([part for part in (x, plus) if part is not None], given, strict=True):
        assert torch.equal(part, before)  # what was handed over is as it was


@pytest.mark.parametrize("dtype", TYPES)
def test_zeros_beyond_the_picture_do_not_depend_on_what_lies_in_memory(
    dtype: torch.dtype, kernels_for: Callable[[torch.dtype], None]
) -> None:
    """A picture of ones by a kernel of ones: as many as there are samples around a pixel, at the borders fewer."""
    kernels_for(dtype)
    x = torch.ones(1, 32, 11, 13, dtype=dtype).contiguous(memory_format=torch.channels_last)
    found = WinogradConvolution(torch.ones(32, 32, 3, 3) / 32, None, 1, dtype=dtype)(x)
    expected = F.conv2d(torch.ones(1, 1, 11, 13), torch.ones(1, 1, 3, 3), padding=1).expand_as(found)
    torch.testing.assert_close(found.float(), expected, atol=0.1 if dtype == torch.bfloat16 else 1e-4, rtol=0)


@pytest.mark.parametrize("dtype", TYPES)
def test_it_is_used_where_it_is_asked_for_and_possible(dtype: torch.dtype, kernels_for: Callable[[torch.dtype], None]) -> None:
    kernels_for(dtype)

    def chosen(outputs: int, inputs: int, kernel: int = 3, way: Way = Way.WINOGRAD, stride: int = 1) -> type:
        return type(make_layer(torch.randn(outputs, inputs, kernel, kernel), None, dtype, way, stride, 1, 1))

    assert chosen(48, 48) is chosen(12, 16) is WinogradConvolution
    assert chosen(48, 48, kernel=1) is chosen(48, 48, stride=2) is chosen(48, 48, way=Way.TORCH) is DirectConvolution
    few = DirectConvolution if dtype == torch.float32 else WinogradConvolution
    assert chosen(7, 48) is chosen(48, 7) is few


def test_without_compiled_kernels_layers_are_direct(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kernels, "_KERNELS", None)
    for dtype in TYPES:
        assert type(make_layer(torch.randn(48, 48, 3, 3), None, dtype, Way.WINOGRAD)) is DirectConvolution


@pytest.mark.usefixtures("either_route")
@pytest.mark.parametrize(("stride", "dilation"), [(1, 1), (1, 2), (2, 1)])
def test_a_layer_computes_the_same_with_and_without_compiled_kernels(stride: int, dilation: int) -> None:
    torch.manual_seed(6)
    x, weight, bias = picture(20, 22, 26), torch.randn(40, 20, 3, 3), torch.randn(40)
    found = make_layer(weight, bias, torch.float32, Way.WINOGRAD, stride, dilation, dilation)(x)
    torch.testing.assert_close(found, F.conv2d(x, weight, bias, stride, dilation, dilation), atol=1e-3, rtol=0)


@pytest.mark.usefixtures("compiled_kernels")
@pytest.mark.parametrize("threads", [1, 2, 3, 9, 70])
def test_any_number_of_threads_computes_the_whole_picture(threads: int) -> None:
    """Fewer than the picture has blocks of tiles, more, and more than have blocks of their own."""
    torch.manual_seed(9)
    x, weight, bias = picture(16, 60, 70), torch.randn(16, 16, 3, 3), torch.randn(16)
    layer, expected = WinogradConvolution(weight, bias, 1), F.conv2d(x, weight, bias, padding=1)
    before = torch.get_num_threads()
    torch.set_num_threads(threads)
    try:
        for _ in range(5):
            torch.full_like(expected, float("nan"))  # what is left in memory, where a part is computed by nobody
            torch.testing.assert_close(layer(x), expected, atol=1e-3, rtol=0)
    finally:
        torch.set_num_threads(before)


@pytest.mark.usefixtures("compiled_kernels")
def test_fewer_threads_than_asked_for_take_the_others_parts_too() -> None:
    """As where the system grants a process no more."""
    script = """
import torch
from lfcore.winograd import WinogradConvolution
x, weight = torch.randn(1, 16, 60, 70).to(memory_format=torch.channels_last), torch.randn(16, 16, 3, 3)
torch.set_num_threads(5)
expected = torch.nn.functional.conv2d(x, weight, padding=1)
torch.full_like(expected, float("nan"))
torch.testing.assert_close(WinogradConvolution(weight, None, 1)(x), expected, atol=1e-3, rtol=0)
"""
    run = subprocess.run(
        [sys.executable, "-c", script], env={**os.environ, "OMP_THREAD_LIMIT": "2"}, capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stderr


def test_layers_that_it_cannot_compute_are_refused() -> None:
    for shape in ((32, 16, 5, 5), (32, 7, 3, 3), (7, 16, 3, 3)):
        with pytest.raises(AssertionError):
            WinogradConvolution(torch.randn(shape), None)
