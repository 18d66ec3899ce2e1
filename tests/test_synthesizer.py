import dataclasses
import math

import numpy as np
import pytest
import torch
from scenes import plane
from whole_reference import whole_reference

from lfcore.errors import Cancelled, InputError, WeightsError
from lfcore.network_synthesizer import NetworkSynthesizer
from lfcore.networks import BORDER, FullModel, ModelConfig, initialise
from lfcore.planesweep import Levels
from lfcore.synthesizer import MeanSynthesizer, corner_offsets, corner_tensor, make_synthesizer, reference_synthesis
from lfcore.tuned_stack import Tuning
from lfcore.warp import backward_warp

SIZE = (70, 83)


def small_model() -> FullModel:
    """The paper's networks on a short sweep, with random weights scaled so that the disparity is a few pixels."""
    model = FullModel(ModelConfig(levels=Levels(12, -9, 9)))
    initialise(model, seed=3)
    with torch.no_grad():
        model.disparity.last.weight *= 20
    return model


def float32(model: FullModel, tile: tuple[int, int]) -> NetworkSynthesizer:
    return NetworkSynthesizer(model, "test", tuning(torch.float32, tile))


def tuning(dtype: torch.dtype, tile: tuple[int, int]) -> Tuning:
    return Tuning(dtype, tile[1], 1, tile[0] * tile[1])


@pytest.mark.parametrize("q", [(0.3, 0.6), (-0.25, 1.25)])
def test_every_pixel_equals_the_reference_of_continued_inputs(q: tuple[float, float]) -> None:
    model, field = small_model(), plane(3.0, size=SIZE)
    reference = whole_reference(model, field, *q)
    synthesizer = float32(model, (1000, 1000))
    synthesizer.set_light_field(field)
    found = synthesizer.synthesize(*q)
    assert found.image.shape == (*SIZE, 3) and found.disparity is not None and found.warped is not None
    assert float(reference.disparity.std()) > 0.05  # the map is not flat, so the warp is tested
    np.testing.assert_allclose(found.disparity, reference.disparity, atol=1e-4)
    np.testing.assert_allclose(found.image, reference.image, atol=1e-4)
    warped = backward_warp(corner_tensor(field), torch.tensor(reference.disparity)[None, None], corner_offsets(*q))
    np.testing.assert_allclose(found.warped, warped.permute(0, 2, 3, 1), atol=1e-4)


def test_far_from_the_edges_that_is_the_reference_of_the_inputs_themselves() -> None:
    model, field = small_model(), plane(3.0, size=SIZE)
    image, disparity, warped = reference_synthesis(model, corner_tensor(field), 0.3, 0.6)
    synthesizer = float32(model, (1000, 1000))
    synthesizer.set_light_field(field)
    found = synthesizer.synthesize(0.3, 0.6)
    assert found.disparity is not None and found.warped is not None
    far = 9 * 0.7 + 2  # px that samples of the sweep lie beside their pixels at most, with their taps
    inner = math.ceil(far)
    beside = slice(BORDER + inner, -BORDER - inner)
    np.testing.assert_allclose(found.disparity[beside, beside], disparity[inner:-inner, inner:-inner], atol=1e-4)
    own = warped[..., inner:-inner, inner:-inner].permute(0, 2, 3, 1)
    np.testing.assert_allclose(found.warped[:, beside, beside], own, atol=1e-4)
    beside = slice(2 * BORDER + inner, -2 * BORDER - inner)
    own = image[:, inner:-inner, inner:-inner].permute(1, 2, 0).clamp(0, 1)
    np.testing.assert_allclose(found.image[beside, beside], own, atol=1e-4)


def test_no_dark_fringe_where_the_warp_leaves_the_picture() -> None:
    """On a plane whose disparity is known to the network, a colour network that averages must not darken towards the edge."""
    model, field = small_model(), plane(8.0, size=SIZE)
    with torch.no_grad():
        model.disparity.last.weight.zero_()
        model.disparity.last.bias.fill_(8.0)
        model.colour.last.weight[:, 12:] = 0  # leave the averaging path alone
    synthesizer = float32(model, (64, 64))
    synthesizer.set_light_field(field)
    found, truth = synthesizer.synthesize(0.5, 0.5), field.view(1, 1)
    assert found.warped is not None and (found.warped[:, 0] == 0).any()  # the inputs themselves do leave the picture
    edge = np.ones(SIZE, bool)
    edge[6:-6, 6:-6] = False
    assert np.abs(found.image - truth)[edge].mean() < 0.12
    assert found.image[edge].mean() == pytest.approx(truth[edge].mean(), abs=0.03)


@pytest.mark.parametrize("tile", [(35, 41), (20, 83), (64, 64)])
def test_tiles_leave_no_seams(tile: tuple[int, int]) -> None:
    model, field = small_model(), plane(3.0, size=SIZE)
    whole, tiled = float32(model, (1000, 1000)), float32(model, tile)
    whole.set_light_field(field)
    tiled.set_light_field(field)
    a, b = whole.synthesize(0.8, 0.1), tiled.synthesize(0.8, 0.1)
    np.testing.assert_allclose(a.image, b.image, atol=1e-4)
    np.testing.assert_allclose(a.disparity, b.disparity, atol=1e-4)


@pytest.mark.parametrize("multiple", [16, 32])
def test_filled_channels_change_nothing(multiple: int) -> None:
    model, field = small_model(), plane(3.0, size=SIZE)
    exact, filled = (NetworkSynthesizer(model, "test", Tuning(torch.float32, 48, m, 48 * 48)) for m in (1, multiple))
    exact.set_light_field(field)
    filled.set_light_field(field)
    a, b = exact.synthesize(0.2, 0.7), filled.synthesize(0.2, 0.7)
    np.testing.assert_allclose(a.image, b.image, atol=1e-5)
    np.testing.assert_allclose(a.disparity, b.disparity, atol=1e-4)


def test_bfloat16_stays_close_to_float32() -> None:
    model, field = small_model(), plane(3.0, size=SIZE)
    exact = float32(model, (64, 64))
    short = NetworkSynthesizer(model, "test", tuning(torch.bfloat16, (64, 64)))
    exact.set_light_field(field)
    short.set_light_field(field)
    a, b = exact.synthesize(0.5, 0.5), short.synthesize(0.5, 0.5)
    assert a.disparity is not None and b.disparity is not None
    assert np.abs(a.disparity - b.disparity).mean() < 0.05 * (a.disparity.std() + np.abs(a.disparity).mean())
    assert np.abs(a.image - b.image).mean() < 0.01


@pytest.mark.parametrize("q", [(0.0, 0.0), (1.0, 1.0), (-0.25, 1.25), (0.123, 0.987)])
def test_any_viewpoint_gives_a_whole_finite_picture(q: tuple[float, float]) -> None:
    synthesizer = float32(small_model(), (64, 64))
    synthesizer.set_light_field(plane(2.0, size=(40, 48)))
    found = synthesizer.synthesize(*q)
    assert np.isfinite(found.image).all() and found.image.min() >= 0 and found.image.max() <= 1
    assert {"features", "disparity", "warp", "colour", "total"} <= set(found.timings)
    assert sum(v for k, v in found.timings.items() if k != "total") <= found.timings["total"] + 1e-6


@pytest.mark.parametrize("q", [(float("nan"), 0.5), (0.5, float("inf")), (1.3, 0.5)])
def test_impossible_viewpoints_are_refused(q: tuple[float, float]) -> None:
    for synthesizer in (float32(small_model(), (64, 64)), MeanSynthesizer()):
        synthesizer.set_light_field(plane(2.0))
        with pytest.raises(InputError, match="viewpoint"):
            synthesizer.synthesize(*q)


def test_work_nobody_wants_is_given_up_at_the_next_stage() -> None:
    synthesizer = float32(small_model(), (20, 20))
    synthesizer.set_light_field(plane(2.0, size=(60, 60)))
    asked = 0

    def cancelled() -> bool:
        nonlocal asked
        asked += 1
        return asked > 2

    with pytest.raises(Cancelled):
        synthesizer.synthesize(0.5, 0.5, cancelled)
    assert asked == 3


def test_the_mean_is_the_mean_of_the_corners() -> None:
    field = plane(2.0)
    synthesizer = MeanSynthesizer()
    synthesizer.set_light_field(field)
    expected = sum(field.view(r, c) for r in (0, 2) for c in (0, 2)) / 4
    np.testing.assert_allclose(synthesizer.synthesize(0.2, 0.9).image, expected, atol=1e-6)


def test_models_are_found_by_name_or_file(tmp_path) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(InputError, match="Unknown model"):
        make_synthesizer("resnet")
    with pytest.raises(WeightsError, match="No weights found"):
        make_synthesizer(tmp_path / "none.safetensors")
    assert make_synthesizer("mean").name == "mean"


def test_results_are_values() -> None:
    synthesizer = MeanSynthesizer()
    synthesizer.set_light_field(plane(2.0))
    with pytest.raises(dataclasses.FrozenInstanceError):
        synthesizer.synthesize(0.5, 0.5).u = 0.1  # type: ignore[misc]
