"""What the shipped weights promise: on the sample, and on a real capture where the test data stand beside the repository."""

import dataclasses
import functools
from pathlib import Path

import numpy as np
import pytest
import torch
from whole_reference import whole_reference

from assets import sample_path, weights_path
from lfcore.formats import open_light_field
from lfcore.kernels import can_convolve
from lfcore.lightfield import FloatArray, LightField
from lfcore.metrics import k16, k16_view, psnr
from lfcore.network_synthesizer import NetworkSynthesizer
from lfcore.networks import BORDER, FullModel
from lfcore.planesweep import Levels
from lfcore.synthesizer import MODEL_NAMES, Synthesizer, make_synthesizer
from lfcore.tuned_stack import Tuning
from lfcore.weights import Weights, load_weights

BUTTERCUP = Path(__file__).parents[2] / "shared" / "data" / "val" / "Buttercup"
SHIPPED = ("full", "realtime", "single")
# What is looked at on one of them is looked at by one process, which computes once what several tests look at.
of_buttercup = (
    pytest.mark.skipif(not BUTTERCUP.is_dir(), reason="the shared test data is not beside the repository"),
    pytest.mark.xdist_group("Buttercup"),
)
SCENES = [
    pytest.param(sample_path(), marks=pytest.mark.xdist_group("sample")),
    pytest.param(BUTTERCUP, marks=of_buttercup),
]


@pytest.fixture
def weights() -> Weights:
    return load_weights(weights_path("full"))


def score(synthesizer: Synthesizer, field: LightField) -> float:
    place = k16_view(field)
    synthesizer.set_light_field(field)
    return k16(synthesizer.synthesize(*field.position(*place)).image, field.view(*place)).psnr


@functools.cache
def as_used(name: str, path: Path) -> FloatArray:
    """What a model as it is used makes of the view that K16 scores."""
    field, synthesizer = open_light_field(path), make_synthesizer(name)
    synthesizer.set_light_field(field)
    return synthesizer.synthesize(*field.position(*k16_view(field))).image


def score_as_used(name: str, path: Path) -> float:
    field = open_light_field(path)
    return k16(as_used(name, path), field.view(*k16_view(field))).psnr


@functools.cache
def exactly(path: Path, row: int, column: int) -> FloatArray:
    """What the paper's pair makes of a captured view in float32, by torch's convolutions."""
    field = open_light_field(path)
    synthesizer = NetworkSynthesizer(load_weights(weights_path("full")).model, "float32", Tuning())
    synthesizer.set_light_field(field)
    return synthesizer.synthesize(*field.position(row, column)).image


def exact_score(path: Path) -> float:
    field = open_light_field(path)
    return k16(exactly(path, *k16_view(field)), field.view(*k16_view(field))).psnr


@pytest.mark.parametrize("name", SHIPPED)
def test_they_tell_how_they_were_trained(name: str) -> None:
    weights = load_weights(weights_path(name))
    assert weights.model.config.name == name
    assert weights.training["steps"] > 0 and weights.training["config"]["patches"]["batch"] > 0
    assert len(weights.training["scenes"]) >= 10
    # No place on anybody's disk, and no scene of the validation among those trained on.
    assert "/" not in str(weights.training["scenes"])
    assert not set(weights.training["k16_psnr"]) & set(weights.training["scenes"])


@pytest.mark.parametrize("path", SCENES)
def test_bfloat16_costs_no_more_than_a_twentieth_of_a_decibel_and_both_beat_the_mean(weights: Weights, path: Path) -> None:
    whole = open_light_field(path)
    # Processors that imitate products of bfloat16 take more than a minute for a whole picture.
    field = whole if can_convolve(torch.bfloat16) else Cropped.of(whole).own
    exact = score(NetworkSynthesizer(weights.model, "float32", Tuning()), field)
    short = score(NetworkSynthesizer(weights.model, "bfloat16", Tuning(torch.bfloat16)), field)
    assert abs(exact - short) <= 0.05
    assert min(exact, short) > score(make_synthesizer("mean"), field) + 3


@pytest.mark.usefixtures("compiled_kernels")
@pytest.mark.parametrize("path", SCENES)
def test_fourier_transforms_in_bfloat16_cost_no_more_than_that_either(weights: Weights, path: Path) -> None:
    field = open_light_field(path)
    short = score(NetworkSynthesizer(weights.model, "by Fourier", Tuning.by_fourier(torch.bfloat16)), field)
    assert abs(exact_score(path) - short) <= 0.05


@pytest.mark.parametrize("path", SCENES)
@pytest.mark.parametrize("at", [(0, 0), (0, 1), (1, 1), (2, 1)])
def test_few_means_cost_less_than_a_fiftieth_of_a_decibel(weights: Weights, path: Path, at: tuple[int, int]) -> None:
    """At a captured corner, in the middle, and at edges of the grid. Along the edges of the picture all inputs count at every
    level too, since their edges are repeated, else no mixture would follow the means; it may cost a twentieth there."""
    field = open_light_field(path)
    middle = k16_view(field)
    row, column = ((0, middle[k], size - 1)[at[k]] for k, size in enumerate((field.rows, field.columns)))
    truth = field.view(row, column)
    frame = np.ones((field.height, field.width), bool)
    frame[24:-24, 24:-24] = False
    few = dataclasses.replace(Tuning(), means=Tuning.by_fourier(torch.float32).means)
    assert few.means < Tuning().means == Levels().count
    synthesizer = NetworkSynthesizer(weights.model, "means", few)
    synthesizer.set_light_field(field)
    pictures = exactly(path, row, column), synthesizer.synthesize(*field.position(row, column)).image
    scores = [k16(seen, truth).psnr for seen in pictures]
    along_edges = [psnr(seen[frame], truth[frame]) for seen in pictures]
    assert scores[1] == pytest.approx(scores[0], abs=0.02)
    assert along_edges[1] == pytest.approx(along_edges[0], abs=0.05)


@pytest.mark.parametrize("path", SCENES)
def test_the_small_pair_is_above_all_others_and_the_papers_pair_is_second(path: Path) -> None:
    scores = {name: score_as_used(name, path) for name in MODEL_NAMES}
    assert sorted(scores, key=lambda name: -scores[name])[:2] == ["realtime", "full"]
    assert scores["full"] > max(scores["single"], scores["mean"]) + 1.5


@pytest.mark.parametrize("path", SCENES[1:])
@pytest.mark.parametrize("name", SHIPPED)
def test_the_score_in_the_file_is_the_score_one_gets(path: Path, name: str) -> None:
    weights = load_weights(weights_path(name))
    assert score_as_used(name, path) == pytest.approx(weights.training["k16_psnr"]["Buttercup"], abs=0.05)


@pytest.mark.parametrize("path", SCENES[1:])
@pytest.mark.parametrize("name", ["full", "realtime", "planesweep"])
def test_it_helps_to_know_that_the_corner_views_of_an_eslf_are_pale(path: Path, name: str) -> None:
    """On a capture that nothing was fitted to."""
    field = open_light_field(path)
    assert field.aperture == 1
    assert score_as_used(name, path) > score(make_synthesizer(name), dataclasses.replace(field, aperture=0.0)) + 0.2


@pytest.mark.parametrize("path", SCENES)
@pytest.mark.parametrize("multiple", [1, 32])
def test_tiles_in_bfloat16_keep_the_score_of_the_reference_and_leave_no_seams(
    weights: Weights, path: Path, multiple: int
) -> None:
    model = weights.model
    assert isinstance(model, FullModel)
    whole = open_light_field(path)
    top, left = whole.height // 3, whole.width // 3
    # The paper's networks and no more: the reference knows nothing of the camera.
    field = dataclasses.replace(whole, views=whole.views[:, :, top : top + 120, left : left + 150], aperture=0.0)
    row, column = k16_view(field)
    u, v = field.position(row, column)
    inside = slice(2 * BORDER, -2 * BORDER)
    reference = whole_reference(model, field, u, v).image[inside, inside]
    tuning = Tuning(torch.bfloat16, 64, multiple, 64 * 40)
    synthesizer = NetworkSynthesizer(model, "tiles", tuning)
    synthesizer.set_light_field(field)
    found, truth = synthesizer.synthesize(u, v).image[inside, inside], field.view(row, column)[inside, inside]
    assert abs(psnr(found, truth) - psnr(reference, truth)) <= 0.05
    difference = np.abs(found - reference).mean(2)
    # Of the colour network's tiles, and of the disparity network's, which begin BORDER before the picture.
    starts = {tile.window.left for tile in tuning.tiles(120, 150)}
    starts |= {tile.window.left - BORDER for tile in tuning.tiles(120 + 2 * BORDER, 150 + 2 * BORDER)}
    seams = {left - 2 * BORDER for left in starts} & set(range(1, difference.shape[1]))
    assert seams
    beside = sorted({column + side for column in seams for side in (-1, 0)})
    assert difference[:, beside].mean() < 1.5 * difference.mean()


@dataclasses.dataclass(frozen=True)
class Cropped:
    """The middle quarter of the views as a light field of its own, and its outermost px, which the whole views continue."""

    whole: LightField
    window: tuple[slice, slice]
    rim: np.ndarray  # (h, w) bool

    @staticmethod
    def of(field: LightField) -> "Cropped":
        size = (field.height, field.width)
        window = tuple(slice(length // 4, length // 4 + length // 2) for length in size)
        rim = np.ones((size[0] // 2, size[1] // 2), bool)
        rim[2 * BORDER : -2 * BORDER, 2 * BORDER : -2 * BORDER] = False
        return Cropped(field, (window[0], window[1]), rim)

    @property
    def own(self) -> LightField:
        return dataclasses.replace(self.whole, views=self.whole.views[:, :, *self.window])


@pytest.mark.parametrize("path", SCENES)
@pytest.mark.parametrize("name", SHIPPED)
def test_the_rim_of_a_picture_is_nearly_as_good_as_the_same_place_inside_of_a_larger_one(path: Path, name: str) -> None:
    cropped, synthesizer = Cropped.of(open_light_field(path)), make_synthesizer(name)
    row, column = k16_view(cropped.whole)
    at = cropped.whole.position(row, column)
    inside = as_used(name, path)[cropped.window][cropped.rim]
    synthesizer.set_light_field(cropped.own)
    alone = synthesizer.synthesize(*at).image[cropped.rim]
    truth = cropped.own.view(row, column)[cropped.rim]
    assert psnr(alone, truth) > psnr(inside, truth) - 1.5  # some of what is seen there only the larger inputs hold


@pytest.mark.parametrize("path", SCENES)
@pytest.mark.parametrize("name", SHIPPED)
def test_the_rim_of_a_picture_does_not_flicker(path: Path, name: str) -> None:
    """A small step of the viewpoint changes it no more than the same place inside of a larger picture."""
    cropped, synthesizer = Cropped.of(open_light_field(path)), make_synthesizer(name)

    def change(field: LightField, window: tuple[slice, slice]) -> float:
        synthesizer.set_light_field(field)
        one, other = (synthesizer.synthesize(u, 0.47).image[window][cropped.rim] for u in (0.4, 0.41))
        return float(np.sqrt(np.square(one - other).mean()))

    assert change(cropped.own, (slice(None), slice(None))) < 1.25 * change(cropped.whole, cropped.window)
