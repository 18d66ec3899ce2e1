"""The compact networks laid out for speed against lfcore.compact as it is trained."""

import pytest
import torch

from lfcore.compact import CompactConfig, CompactModel, initialise_compact
from lfcore.compact_inference import CompactInference, full_size, sweep_input
from lfcore.compact_synthesizer import REACH, _warped_phases
from lfcore.planesweep import Levels, Window, plane_sweep
from lfcore.synthesizer import corner_offsets
from lfcore.warp import quick_warp

SIZE = (28, 36)


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


def test_the_disparity_is_that_of_the_model(model: CompactModel) -> None:
    torch.manual_seed(1)
    luma, offsets, window = torch.rand(4, 1, 40, 44), corner_offsets(0.3, 0.6), Window(13, 27, 13, 31)
    levels = Levels(12, -4.5, 4.5)
    with torch.inference_mode():
        expected = model.disparity(plane_sweep(luma, offsets, levels, window))
        features = plane_sweep(sweep_input(luma), offsets, levels, window)
        found = CompactInference(model, torch.float32).disparity(features)
    assert float(expected.std()) > 0.1
    torch.testing.assert_close(full_size(found)[None, None], expected, atol=2e-4, rtol=1e-4)


def test_the_picture_is_that_of_the_model(model: CompactModel) -> None:
    torch.manual_seed(2)
    toned, disparity = torch.rand(4, 3, *SIZE), 3 * torch.randn(1, 1, *SIZE)
    positions = torch.tensor([[0.2, 0.9]])
    with torch.inference_mode():
        expected = model.colour(toned.reshape(1, 12, *SIZE), disparity, positions)[0]
        found = CompactInference(model, torch.float32).colour(phases(toned - 0.5), phases(disparity[0, 0]), positions)
    assert float(expected.std()) > 0.05
    torch.testing.assert_close(full_size(found), expected, atol=1e-4, rtol=1e-4)


def test_the_phases_of_the_warp_are_those_of_the_quick_warp() -> None:
    torch.manual_seed(3)
    padded = torch.rand(4, 3, SIZE[0] + 2 * REACH, SIZE[1] + 2 * REACH)
    disparity, offsets = 4 * torch.randn(1, 1, *SIZE), corner_offsets(0.8, 0.1)
    expected = quick_warp(padded, disparity, offsets, (REACH, REACH))
    torch.testing.assert_close(full_size(_warped_phases(padded, phases(disparity[0, 0]), offsets)), expected, atol=2e-5, rtol=0)
