"""The weights of the inputs in a picture: where they come from, that they are kept, asked for when looked at, and drawn."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch
from moving_scene import light_field
from remote_models import Weigher, make

from app.canvas import Canvas, Frame
from app.controller import Controller
from app.engine import Engine
from app.looking import CORNER_COLOURS, Looking
from app.painting import in_bytes
from app.samples import Part, Samples
from app.state import Look
from lfcore.cache import CacheKey, SynthesisCache
from lfcore.compact import CompactConfig, CompactModel, initialise_compact
from lfcore.compact_synthesizer import CompactSynthesizer
from lfcore.lightfield import FloatArray
from lfcore.planesweep import Levels
from lfcore.remote import RemoteSynthesizer, SynthesisProcess
from lfcore.synthesis import Synthesis, WeighingSynthesizer, weighs
from lfcore.synthesizer import MeanSynthesizer
from lfcore.tone import root_tone
from lfcore.tuned_stack import Tuning

SIZE = (21, 34)  # odd, so that the networks' phases do not fit
VIEWPOINT = (0.25, 0.5)


@pytest.fixture(scope="module")
def summing() -> WeighingSynthesizer:
    """Networks with random weights whose picture is the weighted sum alone: what they add to it is zero."""
    model = CompactModel(CompactConfig(levels=Levels(12, -9, 9)))
    initialise_compact(model, 5)
    generator = torch.Generator().manual_seed(6)
    with torch.no_grad():
        for parameter in model.parameters():
            if parameter.dim():
                parameter.add_(torch.randn(parameter.shape, generator=generator) * 0.05)
        for layer in (model.colour.straight, model.colour.residual):
            for parameter in layer.parameters():
                parameter.zero_()
    synthesizer = CompactSynthesizer(model.eval(), "key", Tuning())
    synthesizer.set_light_field(light_field(2, 2, SIZE))
    return synthesizer


def test_the_picture_is_the_sum_of_the_warped_inputs_by_these_weights(summing: WeighingSynthesizer) -> None:
    plain, weighed = summing.synthesize(*VIEWPOINT), summing.synthesize_weighed(*VIEWPOINT)
    np.testing.assert_array_equal(plain.image, weighed.image)
    weights = weighed.weights
    assert weights is not None and plain.warped is not None
    assert weights.shape == (4, *SIZE)
    assert np.ptp(weights.sum(0, dtype=int) - 255) <= 4  # four roundings
    assert float(weights.std()) > 5
    rooted = root_tone(torch.from_numpy(plain.warped)).numpy()
    expected = (weights[..., None] / 255 * rooted).sum(0)
    found = root_tone(torch.from_numpy(plain.image)).numpy()
    # Besides the roundings, warped inputs are held to 0 to 1 where they are shown.
    assert float(np.quantile(np.abs(found - expected), 0.98)) < 4 * 0.5 / 255


def test_who_can_tell_weights_says_so(summing: WeighingSynthesizer) -> None:
    assert isinstance(summing, WeighingSynthesizer)
    assert weighs(summing)
    assert not weighs(MeanSynthesizer())


def test_weights_come_from_another_process_as_they_are() -> None:
    here = Weigher("weigher")
    field = light_field(3, 3, SIZE)
    here.set_light_field(field)
    with SynthesisProcess(make) as process:
        there = RemoteSynthesizer(process, "weigher")
        there.set_light_field(field)
        expected = here.synthesize_weighed(*VIEWPOINT)
        found = there.synthesize_weighed(*VIEWPOINT)
        assert there.weighs and found.weights is not None and expected.weights is not None
        np.testing.assert_array_equal(found.weights, expected.weights)
        np.testing.assert_array_equal(found.image, expected.image)
        np.testing.assert_array_equal(found.disparity, expected.disparity)
        assert there.synthesize(*VIEWPOINT).weights is None
        plain = RemoteSynthesizer(process, "blender")
        plain.set_light_field(field)
        assert not plain.weighs
        assert plain.synthesize_weighed(*VIEWPOINT).weights is None


def test_the_cache_holds_weights_and_counts_them() -> None:
    chance = np.random.default_rng(3)
    image = chance.random((*SIZE, 3)).astype(np.float32)
    weights = chance.integers(0, 256, (4, *SIZE)).astype(np.uint8)
    synthesis = Synthesis(*VIEWPOINT, "m", image, image[..., 0], None, {}, weights)
    cache, bare = SynthesisCache(2**20), SynthesisCache(2**20)
    cache.put(CacheKey("c", "m", *VIEWPOINT), synthesis)
    bare.put(CacheKey("c", "m", *VIEWPOINT), replace(synthesis, weights=None))
    held = cache.get(CacheKey("c", "m", *VIEWPOINT))
    assert held is not None and held.weights is not None
    np.testing.assert_array_equal(held.weights, weights)
    assert cache.bytes_used - bare.bytes_used == weights.nbytes
    for number in range(200):
        cache.put(CacheKey("c", "m", number, 0.0), synthesis)
        assert cache.bytes_used <= cache.limit_bytes


class Counting(Weigher):
    """Counts what it is asked for."""

    def __init__(self) -> None:
        super().__init__("weigher")
        self.asked = [0, 0]  # without weights, and with

    def synthesize(self, u: float, v: float, cancelled: Callable[[], bool] = lambda: False) -> Synthesis:
        self.asked[0] += 1
        return super().synthesize(u, v, cancelled)

    def synthesize_weighed(self, u: float, v: float, cancelled: Callable[[], bool] = lambda: False) -> Synthesis:
        self.asked[1] += 1
        self.asked[0] -= 1  # which it does by the other
        return super().synthesize_weighed(u, v, cancelled)


def test_the_engine_asks_for_weights_once_and_only_when_told() -> None:
    model, field = Counting(), light_field(3, 3, SIZE)
    engine = Engine(lambda: model, 2**24)
    assert engine.answer(field, *VIEWPOINT, lambda: False).synthesis.weights is None
    for _ in range(2):
        assert engine.answer(field, *VIEWPOINT, lambda: False, weighed=True).synthesis.weights is not None
    assert engine.answer(field, *VIEWPOINT, lambda: False).synthesis.weights is not None  # they are at hand
    assert model.asked == [1, 1]


def test_weights_are_asked_for_when_they_are_looked_at() -> None:
    model, field = Counting(), light_field(3, 3, SIZE)
    controller = Controller(Engine(lambda: model, 2**24), lambda path, progress, cancelled: field, lambda: None, "weigher")
    controller.state.foresight = False
    try:
        controller.show_light_field(field)
        run_until(controller, lambda: controller.picture is not None and controller.picture.final)
        assert controller.readout(None).weighed is False
        assert model.asked[1] == 0
        controller.state.look = Look.LEAN
        run_until(controller, lambda: controller.readout(None).weighed)
        for _ in range(5):
            controller.tick(time.monotonic())
        assert model.asked[1] == 1
        samples = controller.readout(None).samples
        assert samples is not None and samples.weights is not None
    finally:
        controller.stop()


def run_until(controller: Controller, condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < deadline
        controller.tick(time.monotonic())
        time.sleep(0.01)


@pytest.fixture
def canvas(gl: Any) -> Iterator[Canvas]:
    made = Canvas(gl, "f4")
    made.set_light_field(np.random.default_rng(1).random((4, *SIZE, 3)).astype(np.float32))
    yield made
    made.clear()
    assert gl.error == "GL_NO_ERROR"


def give(canvas: Canvas, disparity: FloatArray, weights: Any) -> None:
    image = np.full((*SIZE, 3), 0.5, np.float32)
    canvas.set_synthesis(image, in_bytes(image), disparity, VIEWPOINT, weights)


def test_weights_are_drawn_as_the_mean_of_the_inputs_colours(canvas: Canvas) -> None:
    weights = np.random.default_rng(2).integers(0, 256, (4, *SIZE)).astype(np.uint8)
    disparity = np.full(SIZE, 4.0, np.float32)
    give(canvas, disparity, weights)
    shown = canvas.read(Frame(Look.LEAN, VIEWPOINT))
    total = weights.sum(0, dtype=float)
    expected = np.einsum("khw,kc->hwc", weights, np.array(CORNER_COLOURS)) / np.maximum(total, 1)[..., None]
    np.testing.assert_allclose(shown, expected, atol=1e-4)
    samples = Samples(light_field(2, 2, SIZE), VIEWPOINT, np.zeros((*SIZE, 3), np.float32), disparity, weights=weights)
    np.testing.assert_allclose(samples.shares(Part(3, 2, 9, 8)) @ np.array(CORNER_COLOURS), expected[2:8, 3:9], atol=1e-5)
    squared = canvas.read(Frame(Look.LEAN, VIEWPOINT, gain=2.0))
    squares = weights.astype(float) ** 2
    expected_squared = np.einsum("khw,kc->hwc", squares, np.array(CORNER_COLOURS)) / np.maximum(squares.sum(0), 1)[..., None]
    np.testing.assert_allclose(squared, expected_squared, atol=1e-4)
    patch = samples.patch(Look.LEAN, Part(3, 2, 9, 8), Looking(), 2.0, (0.0, 1.0))
    assert patch is not None
    np.testing.assert_allclose(patch.light, expected_squared[2:8, 3:9], atol=1e-5)
    # Half the baseline to the right, what moves by 4 px over the baseline lies 2 px further to the right.
    carried = canvas.read(Frame(Look.LEAN, (VIEWPOINT[0] + 0.5, VIEWPOINT[1])))
    np.testing.assert_allclose(carried[:, 4:], expected[:, 2:-2], atol=1e-4)


def test_without_weights_it_goes_by_likeness_again(canvas: Canvas) -> None:
    disparity = np.zeros(SIZE, np.float32)
    weights = np.zeros((4, *SIZE), np.uint8)
    weights[2] = 255
    give(canvas, disparity, weights)
    by_weights = canvas.read(Frame(Look.LEAN, VIEWPOINT))
    np.testing.assert_allclose(by_weights, np.broadcast_to(CORNER_COLOURS[2], by_weights.shape), atol=1e-5)
    give(canvas, disparity, None)
    assert np.abs(canvas.read(Frame(Look.LEAN, VIEWPOINT)) - by_weights).max() > 0.1
