import pytest
import torch
from scenes import plane

from lfcore.networks import BORDER, FullModel, ModelConfig, colour_features, initialise
from lfcore.planesweep import Levels, Window, luminance, plane_sweep
from lfcore.synthesizer import corner_offsets, corner_tensor
from lfcore.warp import backward_warp


def test_the_paper_s_pair_has_the_paper_s_parameters() -> None:
    model = FullModel()
    assert sum(p.numel() for p in model.disparity.parameters()) == 1_275_301
    assert sum(p.numel() for p in model.colour.parameters()) == 368_903


def test_each_network_loses_six_pixels_a_side() -> None:
    model = FullModel()
    assert model.disparity(torch.zeros(1, 200, 20, 24)).shape == (1, 1, 20 - 2 * BORDER, 24 - 2 * BORDER)
    assert model.colour(torch.zeros(2, 15, 20, 24)).shape == (2, 3, 20 - 2 * BORDER, 24 - 2 * BORDER)


def test_the_colour_network_starts_as_the_average_of_its_warped_inputs() -> None:
    model = FullModel()
    initialise(model, seed=7)
    generator = torch.Generator().manual_seed(0)
    warped = torch.rand(1, 12, 20, 20, generator=generator)
    with torch.no_grad():
        out = model.colour(colour_features(torch.zeros(1, 1, 20, 20), warped, torch.tensor([[0.5, 0.5]])))
    mean = warped.view(1, 4, 3, 20, 20).mean(1)[:, :, BORDER:-BORDER, BORDER:-BORDER]
    # The other channels' random weights add noise, but the average must dominate.
    assert float((out - mean).abs().mean()) < 0.1
    assert float(torch.corrcoef(torch.stack((out.flatten(), mean.flatten())))[0, 1]) > 0.8


def test_initialisation_depends_on_the_seed_alone() -> None:
    first, again, other = FullModel(), FullModel(), FullModel()
    for model, seed in ((first, 1), (again, 1), (other, 2)):
        initialise(model, seed)
    assert all(torch.equal(a, b) for a, b in zip(first.parameters(), again.parameters(), strict=True))
    assert not torch.equal(first.disparity.last.weight, other.disparity.last.weight)


def test_features_of_the_colour_network_stand_in_the_authors_order() -> None:
    warped = torch.arange(12.0).view(1, 12, 1, 1).expand(1, 12, 2, 3)
    h = colour_features(torch.full((1, 1, 2, 3), -4.0), warped, torch.tensor([[0.25, 1.0]]))  # u, v
    assert h.shape == (1, 15, 2, 3)
    assert h[0, :, 0, 0].tolist() == pytest.approx([-4, *range(12), 0.5, -0.25])  # ..., v - 0.5, u - 0.5


def test_the_last_layer_is_computed_in_float32_under_autocast() -> None:
    model = FullModel()
    with torch.no_grad():
        model.disparity.last.weight.zero_()
        model.disparity.last.bias.fill_(10.03)
        with torch.autocast("cpu", dtype=torch.bfloat16):
            out = model.disparity(torch.zeros(1, 200, 13, 13))
    assert out.dtype == torch.float32
    assert float(out) == pytest.approx(10.03)  # bfloat16 would make it 10.0


def test_the_error_s_gradient_through_warp_and_both_networks_is_that_of_finite_differences() -> None:
    """The chain rule of the paper's Section 3.3: dE/dw_d goes through the colour network, the warp and the disparity."""
    model = FullModel(ModelConfig(levels=Levels(5, -4, 4)))
    initialise(model, seed=2)
    field = plane(2.5, size=(34, 36))
    corners, target = corner_tensor(field), torch.from_numpy(field.view(1, 1)).permute(2, 0, 1)[None]
    offsets = corner_offsets(0.5, 0.5)
    features = plane_sweep(luminance(corners).unsqueeze(1), offsets, model.config.levels, Window(0, 34, 0, 36))

    def error(nudge: torch.Tensor) -> torch.Tensor:
        disparity = model.disparity(features) + nudge
        warped = backward_warp(corners, disparity.expand(4, -1, -1, -1), offsets, (BORDER, BORDER))
        h = colour_features(disparity, warped.reshape(1, 12, *warped.shape[2:]), torch.tensor([[0.5, 0.5]]))
        return (model.colour(h) - target[..., 12:-12, 12:-12]).square().sum()

    nudge = torch.zeros(1, 1, 22, 24, requires_grad=True)
    error(nudge).backward()
    assert nudge.grad is not None
    with torch.no_grad():
        for direction_seed in range(3):
            direction = torch.randn(nudge.shape, generator=torch.Generator().manual_seed(direction_seed)) * 0.1
            step = 1e-2
            expected = (error(step * direction) - error(-step * direction)) / (2 * step)
            assert float((nudge.grad * direction).sum()) == pytest.approx(float(expected), rel=0.03, abs=1e-3)
    # And from the disparity into the disparity network's weights.
    bias = model.disparity.last.bias
    assert bias is not None and bias.grad is not None
    assert float(bias.grad) == pytest.approx(float(nudge.grad.sum()), rel=1e-4)
