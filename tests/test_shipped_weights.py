"""What the shipped weights promise: on the sample, and on a real capture where the test data stand beside the repository."""

from pathlib import Path

import pytest
import torch

from assets import sample_path, weights_path
from lfcore.formats import open_light_field
from lfcore.lightfield import LightField
from lfcore.metrics import k16, k16_view
from lfcore.network_synthesizer import NetworkSynthesizer
from lfcore.synthesizer import MeanSynthesizer, Synthesizer
from lfcore.tuned_stack import Tuning
from lfcore.weights import Weights, load_weights

BUTTERCUP = Path(__file__).parents[2] / "shared" / "data" / "val" / "Buttercup"
SCENES = [
    sample_path(),
    pytest.param(
        BUTTERCUP, marks=pytest.mark.skipif(not BUTTERCUP.is_dir(), reason="the shared test data is not beside the repository")
    ),
]


@pytest.fixture
def weights() -> Weights:
    return load_weights(weights_path("full"))


def score(synthesizer: Synthesizer, field: LightField) -> float:
    place = k16_view(field)
    synthesizer.set_light_field(field)
    return k16(synthesizer.synthesize(*field.position(*place)).image, field.view(*place)).psnr


def test_they_tell_how_they_were_trained(weights: Weights) -> None:
    assert weights.model.config.name == "full"
    assert weights.training["steps"] > 1000
    assert len(weights.training["scenes"]) >= 10
    # No place on anybody's disk, and no scene of the validation among those trained on.
    assert "/" not in str(weights.training["scenes"])
    assert not set(weights.training["k16_psnr"]) & set(weights.training["scenes"])


@pytest.mark.parametrize("path", SCENES)
def test_bfloat16_costs_no_more_than_a_twentieth_of_a_decibel_and_both_beat_the_mean(path: Path) -> None:
    field = open_light_field(path)
    weights = load_weights(weights_path("full"))
    exact = score(NetworkSynthesizer(weights.model, "float32", Tuning()), field)
    short = score(NetworkSynthesizer(weights.model, "bfloat16", Tuning(torch.bfloat16)), field)
    assert abs(exact - short) <= 0.05
    assert min(exact, short) > score(MeanSynthesizer(), field) + 3


@pytest.mark.skipif(not BUTTERCUP.is_dir(), reason="the shared test data is not beside the repository")
def test_the_score_in_the_file_is_the_score_one_gets(weights: Weights) -> None:
    found = score(NetworkSynthesizer(weights.model, weights.digest, Tuning()), open_light_field(BUTTERCUP))
    assert found == pytest.approx(weights.training["k16_psnr"]["Buttercup"], abs=0.05)
