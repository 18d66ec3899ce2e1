from dataclasses import replace

import numpy as np
import pytest
import torch
from scenes import plane

from lfcore.fine import OFF_PLANE, SURFACES, FineColour, FineConfig, FineModel, Surfaces, initialise_fine
from lfcore.fine_synthesizer import FineSynthesizer
from lfcore.lightfield import LightField
from lfcore.networks import INPUTS
from lfcore.planesweep import Levels
from lfcore.tone import root_tone
from lfcore.training.architectures import Batch, architecture
from lfcore.training.patches import PatchConfig, TrainingScene, sample_group

CONFIG = FineConfig(levels=Levels(12, -9, 9))
MIDDLE = torch.tensor([[0.5, 0.5]])


@pytest.fixture
def model() -> FineModel:
    model = FineModel(CONFIG)
    initialise_fine(model, 3)
    return model.eval()


def surfaces_of(network: Surfaces, disparity: torch.Tensor) -> torch.Tensor:
    height, width = disparity.shape[-2:]
    warped = torch.rand(1, 3 * INPUTS, height, width, generator=torch.Generator().manual_seed(1))
    off_plane = torch.zeros(1, len(OFF_PLANE), height, width)
    seen = torch.zeros(1, CONFIG.fine_width, height // 2, width // 2)
    with torch.no_grad():
        found, _ = network(warped, off_plane, disparity, seen, MIDDLE)
    assert isinstance(found, torch.Tensor)
    return found


def choosing(model: FineModel, first: int, second: int) -> Surfaces:
    """The network with a choice that is made already: which candidate each surface takes, whatever the pictures."""
    bias = model.surfaces.choice.bias
    assert bias is not None
    with torch.no_grad():
        model.surfaces.choice.weight.zero_()
        starts = bias.zero_().view(SURFACES, -1, 4)
        starts[0, first], starts[1, second] = 50.0, 50.0
    return model.surfaces


@pytest.mark.parametrize(("candidate", "reach"), [(1, 2), (2, 6)])
def test_the_second_surface_is_the_neighbour_across_an_edge_of_depth(model: FineModel, candidate: int, reach: int) -> None:
    """A step from -4 to 6 px: within reach of it both sides name the other one, beyond it there is but one surface."""
    disparity = torch.full((1, 1, 32, 48), -4.0)
    disparity[..., 24:] = 6.0
    first, second = surfaces_of(choosing(model, 0, candidate), disparity)[0]
    torch.testing.assert_close(first, disparity[0, 0])
    across = slice(24 - reach, 24 + reach)
    torch.testing.assert_close(second[:, across], 2.0 - first[:, across])
    torch.testing.assert_close(second[:, : 24 - reach], first[:, : 24 - reach])
    torch.testing.assert_close(second[:, 24 + reach :], first[:, 24 + reach :])


def test_of_two_neighbours_the_farther_one_is_named(model: FineModel) -> None:
    disparity = torch.zeros(1, 1, 16, 16)
    disparity[..., :8, :], disparity[..., 12:, :] = 1.0, -5.0  # a narrow strip of 0 between 1 and -5
    second = surfaces_of(choosing(model, 0, 1), disparity)[0, 1]
    assert (second[10:12] == -5).all() and (second[8:10] == 1).all()


def test_disparities_stay_within_the_levels(model: FineModel) -> None:
    network = choosing(model, 0, 0)
    assert network.choice.bias is not None
    with torch.no_grad():
        network.choice.bias.view(SURFACES, -1, 4)[:, -1] = torch.tensor([[100.0], [-100.0]])  # what is added to the choice
    found = surfaces_of(network, torch.zeros(1, 1, 16, 16))
    assert (found[:, 0] == 9).all() and (found[:, 1] == -9).all()


def test_the_picture_is_a_mixture_of_both_surfaces_inputs() -> None:
    """With weights that are decided beforehand the picture is one of the eight warped inputs."""
    colour = FineColour(CONFIG)
    with torch.no_grad():
        for layer in (colour.weights, colour.residual, colour.straight):
            layer.weight.zero_()
        assert colour.weights.bias is not None and colour.residual.bias is not None
        colour.residual.bias.zero_()
        stored = torch.rand(1, SURFACES * INPUTS, 3, 8, 12, generator=torch.Generator().manual_seed(2))
        for wanted in range(SURFACES * INPUTS):
            colour.weights.bias.zero_().view(SURFACES * INPUTS, 4)[wanted] = 100.0
            seen = torch.zeros(1, CONFIG.surface_width, 4, 6)
            found, weights = colour(root_tone(stored).flatten(1, 2), torch.zeros(1, SURFACES, 8, 12), seen, MIDDLE)
            torch.testing.assert_close(found, stored[:, wanted], atol=1e-5, rtol=1e-4)
            assert (weights[:, wanted] > 0.999).all()


def test_training_and_synthesis_see_the_same(model: FineModel) -> None:
    """A patch with its margin, given to the synthesizer as a light field, comes out as in a step of training."""
    field = plane(4.0, (3, 3), (140, 140))
    patches = PatchConfig(64, 2, 2, edge_share=0, tone_share=0)
    drawn = sample_group([TrainingScene(field, 4.0, 4.0)], patches, CONFIG.levels, np.random.default_rng(4))
    group = replace(drawn, shift=0.0)
    batch = Batch.of([group], torch.device("cpu"))
    with torch.no_grad():
        prediction = architecture("fine").predict(model, batch, lambda: torch.autocast("cpu", enabled=False))
    synthesizer = FineSynthesizer(model, "test", torch.float32)
    for patch in range(2):
        views = group.inputs[:, patch].reshape(2, 2, *group.inputs.shape[2:])  # (u, v, 3, H, W)
        synthesizer.set_light_field(LightField(views.transpose(1, 0, 3, 4, 2).copy(), "patch", "", ""))
        found = synthesizer.synthesize(group.u, group.v)
        # Convolutions fill up with zeros at the edge of a patch: what lies far from it is the same.
        rim, window = 28, group.window
        inside = slice(window.top + rim, window.bottom - rim), slice(window.left + rim, window.right - rim)
        rim -= prediction.border
        image = prediction.image[patch, :, rim:-rim, rim:-rim].clamp(0, 1).permute(1, 2, 0).numpy()
        assert image.shape == (8, 8, 3)
        np.testing.assert_allclose(found.image[inside], image, atol=0.02)
