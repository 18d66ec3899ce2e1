import math

import numpy as np
import pytest
import torch
from scenes import plane

from lfcore.compact import CompactModel, initialise_compact, log_nearness, spread_out
from lfcore.compact_synthesizer import CompactSynthesizer
from lfcore.errors import Cancelled, InputError
from lfcore.layers import Way
from lfcore.lightfield import CORNERS, LightField
from lfcore.metrics import psnr
from lfcore.synthesis import Synthesizer
from lfcore.tone import root_tone, stored_from_root
from lfcore.tuned_stack import Tuning

pytestmark = pytest.mark.usefixtures("several_threads")


def untrained(tuning: Tuning | None = None) -> Synthesizer:
    """The small pair with the weights from which training starts."""
    model = CompactModel()
    initialise_compact(model, 1)
    return CompactSynthesizer(model, "test", tuning)


def test_the_root_tone_has_its_inverse_and_evens_out_shot_noise() -> None:
    values = torch.linspace(0, 1.2, 100)
    torch.testing.assert_close(stored_from_root(root_tone(values)), values, atol=1e-6, rtol=1e-5)
    assert root_tone(torch.tensor(-1.0)) == root_tone(torch.tensor(0.0))
    generator = torch.Generator().manual_seed(1)
    spreads = []
    for light in (0.05, 0.2, 0.8):  # photons of a thousand to one full well
        seen = torch.poisson(torch.full((100_000,), light * 1000), generator=generator) / 1000
        spreads.append(float(root_tone(seen).std()))
    assert max(spreads) < 1.08 * min(spreads)


def test_one_coarse_pixel_is_spread_by_its_weights() -> None:
    coarse = torch.randn(2, 1, 5, 7)
    # All weight on the centre: nearest neighbour. On the pixel to the right (index 5): that pixel, the last repeated.
    for index, expected in ((4, coarse), (5, torch.cat((coarse[..., 1:], coarse[..., -1:]), -1))):
        logits = torch.full((2, 4, 9, 5, 7), -100.0)
        logits[:, :, index] = 0
        found = spread_out(coarse, logits.flatten(1, 2))
        torch.testing.assert_close(found, expected.repeat_interleave(2, -1).repeat_interleave(2, -2))


def test_nearness_is_in_the_order_of_the_corners() -> None:
    for index, corner in enumerate(CORNERS):
        near = log_nearness(torch.tensor([corner]))[0, :, 0, 0]
        assert int(near.argmax()) == index
    assert torch.allclose(log_nearness(torch.tensor([[0.5, 0.5]])), torch.tensor(math.log(0.27)), atol=1e-5)


@pytest.mark.parametrize("disparity", [-9.0, 0.0, 6.0])
def test_untrained_it_starts_from_the_minimum_of_the_sweep(disparity: float) -> None:
    """Its first guess for a textured plane at a known disparity is near that, and so the picture is near the truth."""
    field = plane(disparity, (3, 3), (72, 92))
    synthesizer = untrained(Tuning())
    synthesizer.set_light_field(field)
    found = synthesizer.synthesize(0.5, 0.5)
    assert found.disparity is not None and found.warped is not None
    inside = slice(16, -16)
    # The texture is weak, so that the first guess, a mean over levels, stays short of the plane.
    middle = float(np.median(found.disparity[inside, inside]))
    assert min(0.4 * disparity, disparity) - 0.5 < middle < max(0.4 * disparity, disparity) + 0.5
    truth = field.view(1, 1)[inside, inside]
    assert psnr(found.image[inside, inside], truth) > psnr(field.corners().mean(0)[inside, inside], truth) or disparity == 0


def test_pictures_of_any_size_come_out_whole_and_like_a_larger_ones_part() -> None:
    field = plane(2.0, (2, 2), (61, 83))
    synthesizer = untrained(Tuning())
    synthesizer.set_light_field(field)
    found = synthesizer.synthesize(0.3, 0.8)
    assert found.image.shape == (61, 83, 3) and found.image.dtype == np.float32
    assert found.disparity is not None and found.disparity.shape == (61, 83)
    assert found.warped is not None and found.warped.shape == (4, 61, 83, 3)
    assert found.image.min() >= 0 and found.image.max() <= 1
    assert set(found.timings) == {"features", "disparity", "warp", "colour", "total"}


@pytest.mark.parametrize("way", Way)
def test_bfloat16_changes_little(way: Way) -> None:
    field = plane(3.0, (2, 2), (64, 80))
    pictures = []
    for dtype in (torch.float32, torch.bfloat16):
        synthesizer = untrained(Tuning(dtype, way=way))
        synthesizer.set_light_field(field)
        pictures.append(synthesizer.synthesize(0.4, 0.6).image)
    assert psnr(pictures[0], pictures[1]) > 40


def test_the_synthesizer_asks_for_what_it_needs() -> None:
    synthesizer = untrained()
    with pytest.raises(InputError, match="set_light_field"):
        synthesizer.synthesize(0.5, 0.5)
    synthesizer.set_light_field(LightField(np.zeros((2, 2, 32, 40, 3), np.uint8), "", "", ""))
    with pytest.raises(InputError, match="viewpoint"):
        synthesizer.synthesize(2.0, 0.5)
    with pytest.raises(Cancelled):
        synthesizer.synthesize(0.5, 0.5, lambda: True)
    assert np.isfinite(synthesizer.synthesize(-0.25, 1.25).image).all()
