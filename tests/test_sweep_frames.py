"""Frames of a sweep: each layer shows what it says, at the stops of the plan; labels and sizes; refocusing."""

from __future__ import annotations

import numpy as np
import pytest

from lfcore import colormaps
from lfcore.display_tone import brightened
from lfcore.errors import InputError
from lfcore.key_frames import Stop
from lfcore.lightfield import LightField
from lfcore.metrics import to_uint8
from lfcore.sweep import horizontal
from lfcore.sweep_frames import SweepFrames, remembering
from lfcore.sweep_plan import KeyFramePath, Layer, ShapePath, SweepPlan
from lfcore.synthesizer import MeanSynthesizer, Synthesis
from tests.moving_scene import DISPARITY, SIZE, TruthSynthesizer, light_field, truth

LINE = KeyFramePath((Stop(0.1, 0.4), Stop(0.9, 0.4)))
HEIGHT, WIDTH = SIZE


def frames_of(plan: SweepPlan, views: int = 3) -> tuple[SweepFrames, TruthSynthesizer]:
    synthesizer = TruthSynthesizer()
    scene = light_field(views, views)
    return SweepFrames(plan, scene, remembering(scene, synthesizer)), synthesizer


def test_image_frames_are_the_syntheses_made_one_by_one() -> None:
    frames, synthesizer = frames_of(SweepPlan(LINE, 5))
    assert len(frames) == 5
    assert synthesizer.asked == []
    for index, u in enumerate(np.linspace(0.1, 0.9, 5)):
        picture = frames.picture(index)
        assert picture.dtype == np.uint8
        assert np.abs(picture.astype(int) - to_uint8(truth(u, 0.4))).max() <= 1  # the cache rounds to float16
        assert len(synthesizer.asked) == index + 1


def test_revisits_come_from_the_cache() -> None:
    frames, synthesizer = frames_of(SweepPlan(ShapePath("horizontal", 0.5), 8))
    for index in range(8):
        frames.picture(index)
    assert synthesizer.asked == horizontal(8)[:5]


def test_disparity_frames_have_one_range_and_true_numbers() -> None:
    frames, _ = frames_of(SweepPlan(LINE, 3, layer=Layer.DISPARITY))
    assert frames.numbers(1).shape == (HEIGHT, WIDTH, 1)
    assert (frames.numbers(1) == DISPARITY).all()

    class Sloped(TruthSynthesizer):
        def synthesize(self, u: float, v: float, cancelled: object = None) -> Synthesis:
            disparity = np.tile(np.linspace(0, 100, WIDTH, dtype=np.float32) + 50 * (u - 0.5), (HEIGHT, 1))
            return Synthesis(u, v, self.name, truth(u, v), disparity, None, {"total": 0.0})

    scene = light_field()
    sloped = SweepFrames(frames.plan, scene, Sloped().synthesize)
    # The range is that of the middle view, 1 to 99; at u = 0.1 the values are 20 less.
    table = colormaps.disparity_colours()
    expected = colormaps.apply(table, np.linspace(-20, 80, WIDTH, dtype=np.float32)[None], 1, 99)[0]
    assert np.abs(sloped.picture(0)[5].astype(int) - expected).max() <= 6


def test_error_frames_are_taken_where_the_truth_is_known() -> None:
    scene = light_field(5, 5)
    mean = MeanSynthesizer()
    plan = SweepPlan(KeyFramePath((Stop(0.1, 0.3), Stop(0.4, 0.3))), 2, layer=Layer.ERROR, gain=4)
    frames = SweepFrames(plan, scene, remembering(scene, mean))
    assert [(stop.u, stop.v) for stop in frames.stops] == [(0, 0.25), (0.5, 0.25)]
    expected = np.abs(mean.synthesize(0, 0).image - scene.view(1, 2)).mean(2)
    assert frames.numbers(1)[..., 0] == pytest.approx(expected, abs=1e-3)
    assert np.array_equal(frames.picture(1), colormaps.apply(colormaps.error_colours(), frames.numbers(1)[..., 0], 0, 0.25))


def test_an_error_needs_more_than_the_corners() -> None:
    with pytest.raises(InputError, match="only the four corner views"):
        frames_of(SweepPlan(LINE, layer=Layer.ERROR), views=2)


def test_side_by_side_stand_the_layers_of_one_stop() -> None:
    image = frames_of(SweepPlan(LINE, 3))[0].picture(2)
    beside, _ = frames_of(SweepPlan(LINE, 3, layer=Layer.BESIDE_CAPTURED))
    assert np.array_equal(beside.picture(2), np.concatenate([image, light_field().views[1, 2]], 1))
    colours = frames_of(SweepPlan(LINE, 3, layer=Layer.DISPARITY))[0].picture(2)
    beside, _ = frames_of(SweepPlan(LINE, 3, layer=Layer.BESIDE_DISPARITY))
    assert np.array_equal(beside.picture(2), np.concatenate([image, colours], 1))
    with pytest.raises(InputError, match="one layer"):
        beside.numbers(0)


def test_labels_surround_the_pictures_and_tell_the_viewpoint() -> None:
    bare = frames_of(SweepPlan(LINE, 3))[0]
    labelled, _ = frames_of(SweepPlan(LINE, 3, labels=True))
    first, last = labelled.picture(0), labelled.picture(2)
    assert first.shape == last.shape
    assert first.shape[0] > HEIGHT and first.shape[1] > WIDTH
    assert np.array_equal(first[32 : 32 + HEIGHT, 8 : 8 + WIDTH], bare.picture(0))
    assert not np.array_equal(first[:32], last[:32])  # another u
    legend = frames_of(SweepPlan(LINE, 3, layer=Layer.DISPARITY, labels=True))[0].picture(0)
    assert legend.shape[0] > first.shape[0]


@pytest.mark.parametrize(("scale", "size"), [(0.5, (48, 64)), (1.5, (144, 192)), (0.33, (32, 42))])
def test_frames_are_scaled_smoothly(scale: float, size: tuple[int, int]) -> None:
    picture = frames_of(SweepPlan(LINE, 3, scale=scale))[0].picture(1)
    assert picture.shape == (*size, 3)
    # The scene is a formula of position, so that its scaled picture is known.
    y, x = ((np.arange(count) + 0.5) / count * full - 0.5 for count, full in zip(size, SIZE, strict=True))
    x, y = x[None] - DISPARITY * 0.5, y[:, None] - DISPARITY * 0.4
    red = 255 * (0.5 + 0.3 * np.sin(x / 9) * np.cos(y / 11))
    assert np.abs(picture[3:-3, 3:-3, 0] - red[3:-3, 3:-3]).max() <= 3


def test_frames_too_large_for_any_file_are_refused() -> None:
    scene = light_field(3, 3, (8, 8000))
    with pytest.raises(InputError, match="smaller"):
        SweepFrames(SweepPlan(LINE, scale=4), scene, TruthSynthesizer().synthesize)


@pytest.mark.parametrize("views", [3, 5])
def test_refocused_at_its_disparity_the_scene_stays_sharp(views: int) -> None:
    focused = KeyFramePath((Stop(0.5, 0.5, DISPARITY), Stop(0.5, 0.5, DISPARITY + 40)))
    frames, synthesizer = frames_of(SweepPlan(focused, 2, aperture=0.9), views)
    inside = (slice(14, -14), slice(14, -14))
    assert np.abs(frames.numbers(0) - truth(0.5, 0.5))[inside].max() < 0.01
    assert np.abs(frames.numbers(1) - truth(0.5, 0.5))[inside].max() > 0.1
    # 3 x 3 captured views would leave ghosts: the views in between are synthesized.
    assert (len(synthesizer.asked) > 30) == (views == 3)


def test_dark_views_are_not_summed_up() -> None:
    scene = light_field(5, 5)
    views = scene.views.copy()
    views[0, 0] = views[4, 4] = 0
    dark = LightField(views, "x", "x", "x", dark=frozenset(((0, 0), (4, 4))))
    plan = SweepPlan(KeyFramePath((Stop(0.5, 0.5, DISPARITY),)), 1, aperture=1.5)
    inside = (slice(14, -14), slice(14, -14))
    found = SweepFrames(plan, dark, TruthSynthesizer().synthesize).numbers(0)
    assert np.abs(found - truth(0.5, 0.5))[inside].max() < 0.01


def test_views_far_apart_are_not_summed_up() -> None:
    class Deep(TruthSynthesizer):
        def synthesize(self, u: float, v: float, cancelled: object = None) -> Synthesis:
            self.asked.append((u, v))
            disparity = np.tile(np.linspace(-10, 10, WIDTH, dtype=np.float32), (HEIGHT, 1))  # 5 px from view to view
            return Synthesis(u, v, self.name, truth(u, v), disparity, None, {"total": 0.0})

    plan = SweepPlan(KeyFramePath((Stop(0.5, 0.5, 1.0),)), 1, aperture=0.5)
    scene = light_field(5, 5)
    deep = Deep()
    SweepFrames(plan, scene, deep.synthesize).picture(0)
    assert len(deep.asked) > 10
    # Without a disparity the captured views serve.
    asked: list[tuple[float, float]] = []
    mean = MeanSynthesizer()
    mean.set_light_field(scene)
    SweepFrames(plan, scene, lambda u, v: (asked.append((u, v)), mean.synthesize(u, v))[1]).picture(0)
    assert asked == [(0.5, 0.5)]


def test_a_model_without_disparity_says_so() -> None:
    scene = light_field()
    frames = SweepFrames(SweepPlan(LINE, layer=Layer.DISPARITY), scene, remembering(scene, MeanSynthesizer()))
    with pytest.raises(InputError, match="mean has no disparity"):
        frames.picture(0)


def test_brightening_is_the_display_tone() -> None:
    # rgb2hsv by hand: value to the power of 2/3, saturation times 1.5, hue kept.
    found = brightened(np.array([[[0.125, 0.125, 0.125], [0.64, 0.512, 0.343], [0, 0, 1], [0, 0, 0]]], np.float32))[0]
    assert found[0] == pytest.approx([0.25] * 3)
    value = np.array([0.64, 0.512, 0.343]) ** (2 / 3)
    assert found[1] == pytest.approx(value[0] - (value[0] - value) * 1.5, abs=1e-5)
    assert found[2].tolist() == [0, 0, 1]  # fully saturated already
    assert found[3].tolist() == [0, 0, 0]
    bright = frames_of(SweepPlan(LINE, 3, brighten=True))[0].picture(0)
    assert np.abs(bright.astype(int) - to_uint8(brightened(truth(0.1, 0.4)))).max() <= 1
