"""Disparities moved to where the inputs agree best, on pictures of a known disparity."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from scenes import plane

from lfcore.alignment import MOST, alignment_step
from lfcore.compact import CompactModel, initialise_compact
from lfcore.compact_inference import CompactInference
from lfcore.compact_parts import Places, full_size, phases_of
from lfcore.compact_synthesizer import REACH, CompactSynthesizer
from lfcore.synthesizer import corner_offsets
from lfcore.tuned_stack import Tuning

pytestmark = pytest.mark.usefixtures("several_threads", "either_route")

SIZE = (44, 58)
VIEWPOINT = (0.3, 0.8)


def waves(x: torch.Tensor, y: torch.Tensor) -> torch.Tensor:
    """A picture that is known at every place, with slopes along both axes nearly everywhere."""
    return 0.5 + 0.2 * torch.sin(0.5 * x + 0.2 * y) + 0.2 * torch.cos(0.15 * x - 0.45 * y + 1)


def inputs(disparity: float, scale: float = 1.0) -> torch.Tensor:
    """The four inputs (4, H, W), continued, of a plane whose picture at VIEWPOINT is `waves`."""
    rows, columns = (torch.arange(size + 2 * REACH) - float(REACH) for size in SIZE)
    offsets = scale * corner_offsets(*VIEWPOINT)
    return torch.stack([waves(columns - dx * disparity, rows[:, None] - dy * disparity) for dx, dy in offsets.tolist()])


def aligned(luma: torch.Tensor, disparity: torch.Tensor, scale: float = 1.0, most: float = MOST) -> torch.Tensor:
    """As for a synthesis at VIEWPOINT: (H, W) to (H, W)."""
    networks = CompactInference(CompactModel(), Tuning())
    places = Places(scale * corner_offsets(*VIEWPOINT), torch.zeros(4, 2), REACH)
    with torch.inference_mode():
        return full_size(networks.aligned(luma, phases_of(disparity), places, most))


@pytest.mark.parametrize("scale", [1.0, 2.0])
@pytest.mark.parametrize("off", [-0.4, 0.0, 0.25])
def test_a_disparity_that_is_off_by_part_of_a_pixel_is_put_right(off: float, scale: float) -> None:
    found = aligned(inputs(5.0, scale), torch.full(SIZE, 5.0 + off), scale)
    inside = found[4:-4, 4:-4]  # where slopes on both sides are known
    assert float((inside - 5.0).abs().mean()) < 0.2 * abs(off) + 0.002
    assert float((inside - 5.0).abs().max()) < 0.45 * abs(off) + 0.01


def test_where_nothing_can_be_seen_nothing_is_changed() -> None:
    torch.manual_seed(1)
    disparity = 3 * torch.randn(SIZE)
    assert torch.equal(aligned(torch.full_like(inputs(0.0), 0.7), disparity), disparity)


def test_no_disparity_is_changed_by_more_than_is_allowed() -> None:
    start = torch.full(SIZE, 1.0)
    for most in (0.1, 0.5):
        change = aligned(inputs(5.0), start, most=most) - start
        assert float(change.abs().max()) == pytest.approx(most, abs=1e-6)


@pytest.mark.parametrize("value", [float("nan"), 1e30, -1e30])
def test_what_is_no_disparity_spoils_nothing_farther_away(value: float) -> None:
    disparity = torch.full(SIZE, 5.2)
    disparity[20, 30] = value
    found = aligned(inputs(5.0), disparity)
    for far in (found[4:16, 4:-4], found[4:-4, 4:26], found[4:-4, 35:-4]):
        torch.testing.assert_close(far, torch.full_like(far, 5.0), atol=0.1, rtol=0)


def test_it_is_the_step_that_is_trained_with() -> None:
    """Compiled or not, edges included; inputs are moved otherwise, too."""
    torch.manual_seed(2)
    luma = torch.nn.functional.avg_pool2d(torch.rand(4, SIZE[0] + 2 * REACH, SIZE[1] + 2 * REACH), 3, 1, 1)
    disparity, offsets, moves = 4 * torch.rand(SIZE) - 2, corner_offsets(0.9, 0.2), 0.3 * torch.randn(4, 2)
    networks = CompactInference(CompactModel(), Tuning())
    found = full_size(networks.aligned(luma, phases_of(disparity), Places(offsets, moves, REACH), MOST))
    rows, columns = (torch.arange(size) + float(REACH) for size in SIZE)
    y = rows[:, None] + moves[:, 1].view(4, 1, 1) + offsets[:, 1].view(4, 1, 1) * disparity
    x = columns + moves[:, 0].view(4, 1, 1) + offsets[:, 0].view(4, 1, 1) * disparity
    size = torch.tensor(luma.shape[1:]) - 1
    grid = torch.stack((2 * x / size[1] - 1, 2 * y / size[0] - 1), -1)
    warped = torch.nn.functional.grid_sample(luma.unsqueeze(1), grid, "bicubic", "border", align_corners=True)
    expected = disparity + alignment_step(warped, offsets, MOST)[0, 0]
    torch.testing.assert_close(found, expected, atol=2e-4, rtol=1e-4)
    assert float((expected - disparity).abs().mean()) > 0.05


def test_the_step_has_a_gradient() -> None:
    luma = inputs(5.0)[:, None, REACH:-REACH, REACH:-REACH].clone().requires_grad_()
    alignment_step(luma, corner_offsets(*VIEWPOINT), MOST).square().sum().backward()
    assert luma.grad is not None and float(luma.grad.abs().sum()) > 0 and bool(luma.grad.isfinite().all())


def test_a_synthesis_is_nearer_to_the_plane_than_the_networks_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Untrained, they start from the mean over levels that lie more than a pixel apart."""
    field = plane(3.0, (3, 3), (72, 92))
    model = CompactModel()
    initialise_compact(model, 1)
    with torch.no_grad():
        model.disparity.sharpness.fill_(3000.0)  # that level alone at which the inputs agree best
    errors = []
    for alone in (True, False):
        with monkeypatch.context() as patch:
            if alone:
                patch.setattr(CompactInference, "aligned", lambda _self, _luma, disparity, *_: disparity)
            synthesizer = CompactSynthesizer(model, "test", Tuning())
            synthesizer.set_light_field(field)
            found = synthesizer.synthesize(0.5, 0.5).disparity
        assert found is not None
        errors.append(float(np.abs(found[16:-16, 16:-16] - 3.0).mean()))
    assert errors[1] < 0.5 * errors[0]
