"""Convolutions and products by the matrix unit against the same by their definition, in float64."""

import os

import pytest
import torch
import torch.nn.functional as F
from processor import processor_flags, tiles_are_granted
from torch import Tensor, nn

from lfcore import amx, kernels
from lfcore.amx import AmxConvolution, can_compute
from lfcore.fourier import FourierConvolution
from lfcore.kernels import AMX_MOST_PIECES, amx_packed, amx_products, amx_room, has_amx
from lfcore.layers import DirectConvolution, Way, make_layer
from lfcore.networks import PaperStack
from lfcore.tuned_stack import TunedStack, Tuning

pytestmark = pytest.mark.usefixtures("several_threads")


@pytest.fixture
def matrix_unit(compiled_kernels: None) -> None:
    """Skips a test where this processor has none; fails where the system names one, and it was not found."""
    if not has_amx():
        if os.environ.get("CI") and not os.environ.get("ONEDNN_MAX_CPU_ISA") and tiles_are_granted():
            assert not {"amx_tile", "amx_bf16", "avx512_bf16"} <= processor_flags()
        pytest.skip("this processor has no matrix unit for bfloat16 (AMX)")


def picture(channels: int, height: int, width: int) -> Tensor:
    return torch.randn(1, channels, height, width).bfloat16().contiguous(memory_format=torch.channels_last)


def rounded(values: Tensor) -> Tensor:
    return values.bfloat16().double()


def assert_nearly(found: Tensor, expected: Tensor) -> None:
    """Sums in float32 of exact products, rounded once at the end: to a part in 256, half of which is rounding's error."""
    most = expected.abs().double() / 256 + 1e-3 * float(expected.std())
    assert bool(((found.double() - expected).abs() <= most).all())


@pytest.mark.usefixtures("matrix_unit")
@pytest.mark.parametrize(
    ("kernel", "stride", "padding", "dilation"),
    [
        (3, 1, 1, 1),
        (3, 1, 0, 1),
        (3, 2, 1, 1),
        (3, 1, 8, 8),
        (3, 1, 3, 1),
        (3, 2, 2, 3),
        (1, 1, 0, 1),
        (5, 1, 0, 1),
        (7, 3, 2, 1),
    ],
)
@pytest.mark.parametrize(
    ("channels", "size"),
    [
        ((16, 32), (17, 20)),
        ((19, 37), (23, 41)),  # channels and widths that fill no block
        ((3, 100), (33, 50)),
        ((48, 12), (40, 16)),
        ((96, 48), (60, 150)),  # more than one band of rows for each thread
    ],
)
def test_it_is_the_convolution(
    channels: tuple[int, int], size: tuple[int, int], kernel: int, stride: int, padding: int, dilation: int
) -> None:
    torch.manual_seed(3)
    x, bias = picture(channels[0], *size), torch.randn(channels[1])
    weight = torch.randn(channels[1], channels[0], kernel, kernel)
    expected = F.conv2d(x.double(), rounded(weight), bias.double(), stride, padding, dilation)
    found = AmxConvolution(weight, bias, stride, padding, dilation)(x)
    assert found.dtype == torch.bfloat16 and found.is_contiguous(memory_format=torch.channels_last)
    assert found.shape == expected.shape
    assert_nearly(found, expected)


@pytest.mark.usefixtures("matrix_unit")
@pytest.mark.parametrize("of_positive", [False, True])
@pytest.mark.parametrize("added", [False, True])
@pytest.mark.parametrize("positive", [False, True])
@pytest.mark.parametrize("biased", [False, True])
@pytest.mark.parametrize("outputs", [7, 16, 34, 60])  # one group of columns, or two at a time and what is left
def test_what_comes_before_and_after_is_what_a_layer_promises(
    outputs: int, of_positive: bool, added: bool, positive: bool, biased: bool
) -> None:
    torch.manual_seed(5)
    x, weight = picture(21, 21, 30), torch.randn(outputs, 21, 3, 3)
    bias = torch.randn(outputs) if biased else None
    plus = 10 * picture(outputs, 21, 30) if added else None
    given = [part.clone() for part in (x, plus) if part is not None]
    expected = F.conv2d(
        (x.relu() if of_positive else x).double(), rounded(weight), None if bias is None else bias.double(), padding=1
    )
    expected = expected if plus is None else expected + plus
    expected = expected.relu() if positive else expected
    found = AmxConvolution(weight, bias, padding=1)(x, of_positive=of_positive, plus=plus, positive=positive)
    assert_nearly(found, expected)
    assert not positive or float(found.min()) == 0
    for part, before in zip([part for part in (x, plus) if part is not None], given, strict=True):
        assert torch.equal(part, before)  # what was handed over is as it was


@pytest.mark.usefixtures("matrix_unit")
def test_zeros_beyond_the_picture_do_not_depend_on_what_lies_in_memory() -> None:
    """A picture of ones by a kernel of ones: as many as there are samples around a pixel, at the borders fewer."""
    x = torch.ones(1, 24, 11, 13, dtype=torch.bfloat16).contiguous(memory_format=torch.channels_last)
    layer = AmxConvolution(torch.ones(24, 24, 3, 3) / 32, None, padding=1)
    expected = F.conv2d(torch.ones(1, 1, 11, 13), torch.full((1, 1, 3, 3), 24 / 32), padding=1).expand(1, 24, 11, 13)
    for _ in range(5):
        trash = [torch.full((1 << size,), float("nan")) for size in range(8, 18)]  # freed, and taken again by the layer
        del trash
        assert torch.equal(layer(x).float(), expected)


@pytest.mark.usefixtures("matrix_unit")
def test_torchs_own_use_of_the_unit_is_not_disturbed() -> None:
    """Both set the unit up for themselves; torch's library keeps in mind what it has set."""
    torch.manual_seed(7)
    left, right = torch.randn(70, 96).bfloat16(), torch.randn(96, 130).bfloat16()
    x, weight = picture(32, 20, 40), torch.randn(48, 32, 3, 3)
    expected = left @ right, F.conv2d(x, weight.bfloat16(), padding=1)
    layer = AmxConvolution(weight, None, padding=1)
    by_unit = layer(x)
    for _ in range(20):
        assert torch.equal(left @ right, expected[0])
        assert torch.equal(layer(x), by_unit)
        assert torch.equal(F.conv2d(x, weight.bfloat16(), padding=1), expected[1])


@pytest.mark.usefixtures("matrix_unit")
@pytest.mark.parametrize("shape", [(3, 16, 32, 32), (5, 37, 200, 100), (2, 1, 7, 5), (4, 95, 33, 17), (1, 65, 400, 200)])
def test_products_are_those_of_the_matrices(shape: tuple[int, int, int, int]) -> None:
    torch.manual_seed(8)
    count, rows, values, columns = shape
    room = amx_room(count, rows, values).fill_(float("nan"))  # what is not set must not matter
    left, right = torch.randn(count, rows, values), torch.randn(count, values, columns)
    room[: left.numel()] = left.flatten()
    out = torch.full((count, rows, columns), 3.0, dtype=torch.bfloat16)
    amx_products(room, values, amx_packed(right), out)
    assert_nearly(out, rounded(left) @ rounded(right))


@pytest.mark.usefixtures("matrix_unit")
@pytest.mark.parametrize("size", [(16, 16), (53, 37), (150, 170)])
def test_fourier_convolutions_are_the_same_by_the_unit_and_by_torch(
    size: tuple[int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    torch.manual_seed(9)
    layer, x = nn.Conv2d(40, 50, 7).requires_grad_(False), picture(40, *size)
    by_unit = FourierConvolution(layer, torch.bfloat16)(x)
    monkeypatch.setattr("lfcore.fourier.has_amx", lambda: False)
    by_torch = FourierConvolution(layer, torch.bfloat16)(x)
    assert float(by_torch.float().std()) > 0.05
    # Sums in another order come out rounded to a neighbouring value now and then.
    assert float((by_unit.float() - by_torch.float()).abs().mean()) < 1e-3 * float(by_torch.float().std())


@pytest.mark.usefixtures("matrix_unit")
@pytest.mark.parametrize("channels", [24, 40])  # of few, large kernels are computed directly
@pytest.mark.parametrize("tuning", [Tuning.by_fourier(torch.bfloat16, Way.AMX), Tuning(torch.bfloat16, way=Way.AMX)])
def test_the_papers_stack_by_the_unit_is_the_stack(tuning: Tuning, channels: int) -> None:
    torch.manual_seed(10)
    stack, features = PaperStack(channels, 3), torch.randn(1, channels, 62, 73)
    tuned = TunedStack(stack, tuning)
    x = tuned.empty_input(62, 73)
    x[:, :channels] = features
    with torch.inference_mode():
        expected, found = stack(features), tuned(x)
    # Four layers, each rounded to a part in 256.
    assert float((found - expected).square().mean().sqrt()) < 0.03 * float(expected.std())


@pytest.mark.usefixtures("matrix_unit")
def test_it_is_used_where_it_is_asked_for_and_possible(monkeypatch: pytest.MonkeyPatch) -> None:
    weight = torch.randn(12, 10, 3, 3)
    assert type(make_layer(weight, None, torch.bfloat16, Way.AMX, 2, 1, 1)) is AmxConvolution
    assert type(make_layer(weight, None, torch.bfloat16, Way.TORCH)) is DirectConvolution
    assert type(make_layer(weight, None, torch.float32, Way.AMX)) is DirectConvolution
    assert not can_compute(torch.empty(8, 10, 3, 1), torch.bfloat16)
    many = torch.empty(8, 32 * AMX_MOST_PIECES // 3, 3, 3)
    assert can_compute(many[:, : many.shape[1] // 3 - 32], torch.bfloat16) and not can_compute(many, torch.bfloat16)
    with pytest.raises(AssertionError):
        AmxConvolution(many, None)
    monkeypatch.setenv("ONEDNN_MAX_CPU_ISA", "AVX512_CORE_BF16")  # by which torch, too, is told to leave it alone
    assert not has_amx() and type(make_layer(weight, None, torch.bfloat16, Way.AMX)) is DirectConvolution
    monkeypatch.setenv("ONEDNN_MAX_CPU_ISA", "avx512_core_amx")
    assert has_amx()


def test_without_compiled_kernels_there_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kernels, "_KERNELS", None)
    assert not has_amx()
    assert type(make_layer(torch.randn(48, 48, 3, 3), None, torch.bfloat16, Way.AMX)) is DirectConvolution
    assert not amx.can_compute(torch.randn(48, 48, 3, 3), torch.bfloat16)
