"""The compact networks laid out for speed, compiled and by torch, against lfcore.compact as it is trained."""

import copy

import pytest
import torch

from lfcore import compact_inference, kernels
from lfcore import winograd as winograds
from lfcore.compact import CompactConfig, CompactModel, initialise_compact
from lfcore.compact_inference import CompactInference
from lfcore.compact_parts import MIDDLE, Places, full_size
from lfcore.compact_synthesizer import REACH
from lfcore.expected_disparities import Limits
from lfcore.layers import Way
from lfcore.planesweep import Levels, Window, deviation_sweep
from lfcore.synthesizer import corner_offsets
from lfcore.tuned_stack import Tuning
from lfcore.warp import quick_warp

pytestmark = pytest.mark.usefixtures("several_threads", "either_route")

SIZE = (28, 36)  # 14 x 18 pixels of half the resolution: neither a multiple of the four that a kernel takes at once


def phases(picture: torch.Tensor) -> torch.Tensor:
    """(..., 2 h, 2 w) -> (..., 4, h, w)."""
    return torch.stack([picture[..., dy::2, dx::2] for dy in (0, 1) for dx in (0, 1)], -3)


@pytest.fixture(scope="module")
def model() -> CompactModel:
    """Random weights, none of them small, so that every path counts."""
    model = CompactModel(CompactConfig(levels=Levels(12, -9, 9)))
    initialise_compact(model, 5)
    generator = torch.Generator().manual_seed(6)
    with torch.no_grad():
        for parameter in model.parameters():
            if parameter.dim():
                parameter.add_(torch.randn(parameter.shape, generator=generator) * 0.05)
    return model.eval()


def test_phases_are_put_together_at_their_places() -> None:
    picture = torch.rand(2, 3, *SIZE)
    assert torch.equal(full_size(phases(picture)), picture)


@pytest.mark.parametrize("way", Way)
@pytest.mark.parametrize("products", ["floats", "halves", "amx"])  # the most that the processor may use for scores
@pytest.mark.parametrize("dtype", [torch.float32, torch.bfloat16])
def test_the_disparity_is_that_of_the_model(
    model: CompactModel, dtype: torch.dtype, products: str, way: Way, monkeypatch: pytest.MonkeyPatch
) -> None:
    if products != "amx":
        monkeypatch.setattr(kernels, "has_amx", lambda: False)
    if products == "floats":
        use_floats_alone(monkeypatch)
    torch.manual_seed(1)
    luma, offsets, window = torch.rand(4, 1, 40, 44), corner_offsets(0.3, 0.6), Window(13, 27, 13, 31)
    levels = Levels(12, -4.5, 4.5)
    with torch.inference_mode():
        deviations = deviation_sweep(luma, offsets, levels, window)
        expected = model.disparity(deviations)
        found = CompactInference(model, Tuning(dtype, way=way)).disparity(deviations.to(dtype))
    assert float(expected.std()) > 0.1
    if dtype == torch.float32:
        torch.testing.assert_close(full_size(found)[None, None], expected, atol=2e-4, rtol=1e-4)
    else:  # hidden values are rounded to a part in 256
        assert float((full_size(found)[None, None] - expected).abs().mean()) < 0.05 * float(expected.std())


@pytest.mark.parametrize("dtype", [torch.float32, torch.bfloat16])
def test_levels_that_are_not_expected_have_lower_scores(
    model: CompactModel, dtype: torch.dtype, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What comes out is what the model finds whose scores are lowered, until other levels are expected."""
    limits = Limits(-3.0, 1.0)
    monkeypatch.setattr(compact_inference, "expected", lambda *_: limits)
    lowered = copy.deepcopy(model)
    torch.manual_seed(1)
    luma, offsets, window = torch.rand(4, 1, 40, 44), corner_offsets(0.3, 0.6), Window(13, 27, 13, 31)
    with torch.inference_mode():
        assert lowered.disparity.score.bias is not None
        lowered.disparity.score.bias -= limits.penalties(model.config.levels.values())
        deviations = deviation_sweep(luma, offsets, Levels(12, -4.5, 4.5), window)
        inference = CompactInference(model, Tuning(dtype))
        before = inference.disparity(deviations.to(dtype))
        inference.expect(deviations.to(dtype))
        found, known = full_size(inference.disparity(deviations.to(dtype)))[None, None], lowered.disparity(deviations)
        assert float(found.min()) > -5 and float(found.max()) < 3  # a level beyond is a few thousand times less likely
        assert float((found - known).abs().mean()) < (1e-4 if dtype == torch.float32 else 0.05 * float(known.std()))
        monkeypatch.setattr(compact_inference, "expected", lambda *_: None)
        inference.expect(deviations.to(dtype))
        assert torch.equal(inference.disparity(deviations.to(dtype)), before)


def use_floats_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """As on a processor without products of bfloat16."""
    for module in (kernels, winograds):
        monkeypatch.setattr(module, "can_convolve", lambda dtype: kernels.compiled() and dtype == torch.float32)


@pytest.mark.parametrize("cut", [(0, 0), (1, 3)])
@pytest.mark.parametrize(("dtype", "products"), [(torch.float32, "any"), (torch.bfloat16, "any"), (torch.bfloat16, "floats")])
def test_picture_weights_and_warped_inputs_are_those_of_the_model(
    model: CompactModel, dtype: torch.dtype, products: str, cut: tuple[int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """From the disparity on; also where the picture is smaller than its blocks of pixels."""
    if products == "floats":
        use_floats_alone(monkeypatch)
    torch.manual_seed(2)
    height, width = SIZE
    padded = torch.rand(4, 3, height + 2 * REACH, width + 2 * REACH)
    disparity, offsets = 3 * torch.randn(1, 1, *SIZE), corner_offsets(0.2, 0.9)
    size = height - cut[0], width - cut[1]
    with torch.inference_mode():
        # The network counts disparities in steps of 2 px, from 1 px on.
        warped = quick_warp(padded, (2 * disparity + 1).expand(4, -1, -1, -1), offsets, (REACH, REACH))
        expected = model.colour(warped.view(1, 12, *SIZE), disparity, torch.tensor([[0.2, 0.9]]))[0]
        networks = CompactInference(model, Tuning(dtype))
        places = Places(2 * offsets, offsets, REACH)
        gathered = networks.warp(networks.prepared(padded), phases(disparity[0, 0]), places, (0.2, 0.9))
        coloured = networks.colour(gathered, (0.2, 0.9), size)
        blended = full_size(coloured.shares()).unsqueeze(1).mul(warped - MIDDLE).sum(0)
    assert float(expected.std()) > 0.05
    inside = slice(size[0]), slice(size[1])
    image, expected = coloured.image.permute(2, 0, 1), expected[:, *inside].clamp(0, 1)
    if dtype == torch.float32:
        torch.testing.assert_close(image, expected, atol=1e-4, rtol=1e-4)
    else:  # hidden values are rounded to a part in 256
        assert float((image - expected).abs().mean()) < 0.01 * float(expected.std())
        torch.testing.assert_close(image, expected, atol=0.05, rtol=0)
    # In bfloat16 they may be half-precision floats, which below 1 are rounded to a part in 4096.
    torch.testing.assert_close(
        networks.warped_pictures(gathered), warped, atol=2e-5 if dtype == torch.float32 else 1e-3, rtol=0
    )
    torch.testing.assert_close(coloured.shares().sum(0), torch.ones(4, height // 2, width // 2))
    assert float((blended + MIDDLE - warped.mean(0)).abs().mean()) > 1e-3  # the weights differ, and belong to these inputs


@pytest.mark.parametrize("products", ["any", "floats"])
def test_what_the_colour_network_takes_is_the_same_in_bfloat16(
    model: CompactModel, products: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    if products == "floats":
        use_floats_alone(monkeypatch)
    torch.manual_seed(3)
    padded = torch.rand(4, 3, SIZE[0] + 2 * REACH, SIZE[1] + 2 * REACH)
    disparity, offsets = 4 * torch.randn(4, SIZE[0] // 2, SIZE[1] // 2), corner_offsets(0.8, 0.1)
    places = Places(offsets, torch.zeros(4, 2), REACH)
    found = {}
    with torch.inference_mode():
        for dtype in (torch.float32, torch.bfloat16):
            networks = CompactInference(model, Tuning(dtype))
            found[dtype] = networks.warp(networks.prepared(padded), disparity, places, (0.8, 0.1)).channels
    assert found[torch.bfloat16].is_contiguous(memory_format=torch.channels_last)
    if not kernels.compiled() or kernels.warp_type(torch.bfloat16) == torch.float32:
        assert torch.equal(found[torch.float32].bfloat16(), found[torch.bfloat16])
    else:  # inputs are half-precision floats, and what comes out is rounded to a part in 256
        torch.testing.assert_close(found[torch.bfloat16].float(), found[torch.float32], atol=4e-4, rtol=2**-8)


@pytest.mark.parametrize("dtype", [torch.float32, torch.bfloat16])
def test_disparities_that_are_far_away_take_the_edge(model: CompactModel, dtype: torch.dtype) -> None:
    torch.manual_seed(4)
    padded = torch.nn.functional.pad(torch.rand(4, 3, *SIZE), (REACH,) * 4, mode="replicate")
    disparity = torch.full((4, SIZE[0] // 2, SIZE[1] // 2), 1e30)
    disparity[:, :4] = -1e30
    disparity[:, 4] = float("nan")  # of which nothing is asked but that the program lives on
    with torch.inference_mode():
        networks = CompactInference(model, Tuning(dtype))
        places = Places(corner_offsets(1, 1), torch.zeros(4, 2), REACH)
        gathered = networks.warp(networks.prepared(padded), disparity, places, (1.0, 1.0))
        first = networks.warped_pictures(gathered)[0]
    exact = {} if dtype == torch.float32 else {"atol": 1e-3, "rtol": 0.0}
    # The first input's offsets are -1 and -1: far to the right and below in the first rows, left and above in the last.
    torch.testing.assert_close(first[:, :8], padded[0, :, -1:, -1:].expand(3, 8, SIZE[1]), **exact)
    torch.testing.assert_close(first[:, 10:], padded[0, :, :1, :1].expand(3, SIZE[0] - 10, SIZE[1]), **exact)
