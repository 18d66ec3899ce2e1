"""Disparities beyond those that the networks know: how far they reach is found, and the networks are set to it."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch
from scenes import plane, smooth_texture

import lfcore.compact_synthesizer
import lfcore.network_synthesizer
from assets import sample_path, weights_path
from lfcore.compact_inference import CompactInference
from lfcore.formats import open_light_field
from lfcore.lightfield import CORNERS, FloatArray, LightField
from lfcore.planesweep import Levels
from lfcore.span import Span, continued_by_others, disparity_reach, made_larger, made_smaller, span_of
from lfcore.synthesizer import Synthesizer, corner_tensor, make_synthesizer
from lfcore.tuned_stack import Tuning
from lfcore.weights import load_weights

SIZE = 240, 320
DATA = Path(__file__).parents[2] / "shared" / "data"
SCENES = sorted(path for part in ("train", "val") for path in (DATA / part).glob("*") if path.is_dir())


def _waves() -> list[tuple[float, float, float, FloatArray]]:
    draw = np.random.default_rng(3)
    return [(*draw.uniform(-0.12, 0.12, 2), draw.uniform(0, 7), draw.uniform(0, 1, 3).astype(np.float32)) for _ in range(40)]


def clouds(x: FloatArray, y: FloatArray) -> FloatArray:
    """A picture without end (..., 3), 0 to 1, that resembles itself nowhere else, and that half its size still holds."""
    found = np.full((*x.shape, 3), 0.5, np.float32)
    for across, down, phase, colour in _waves():
        found += 0.05 * np.sin(2 * np.pi * (across * x + down * y) + phase)[..., None] * colour
    return found.clip(0, 1)


def halves(left: float, right: float, grid: tuple[int, int] = (2, 2)) -> LightField:
    """Two planes side by side as the middle viewpoint sees them, the one on the right in front."""
    rows, columns = grid
    y, x = np.mgrid[: SIZE[0], : SIZE[1]].astype(np.float32)
    views = np.empty((rows, columns, *SIZE, 3), np.float32)
    for r in range(rows):
        for c in range(columns):
            u, v = c / (columns - 1) - 0.5, r / (rows - 1) - 0.5
            behind, front = (clouds(x - d * u, y - d * v) for d in (left, right))
            inside = x - right * u > SIZE[1] / 2
            views[r, c] = np.where(inside[..., None], 1 - front, behind)
    return LightField(views, "halves", "", "")


@pytest.mark.parametrize("disparity", [-56.0, -30.0, 0.0, 9.0, 47.0])
def test_the_reach_of_a_plane_is_its_disparity(disparity: float) -> None:
    reach = disparity_reach(corner_tensor(plane(disparity, (2, 2), SIZE, clouds)))
    assert reach is not None
    assert abs(reach.low - disparity) <= reach.step and abs(reach.high - disparity) <= reach.step
    assert reach.low <= reach.mean <= reach.high


def darkened(corners: torch.Tensor, gains: tuple[float, ...]) -> torch.Tensor:
    """The corner views by these factors, and each to half of that towards its own corner, as lenses do it."""
    y = torch.linspace(0, 1, corners.shape[2]).view(-1, 1)
    x = torch.linspace(0, 1, corners.shape[3])
    outwards = [(1 - abs(u - x)) * (1 - abs(v - y)) for u, v in CORNERS]
    return corners * torch.stack([gain * (1 - part / 2) for gain, part in zip(gains, outwards, strict=True)]).unsqueeze(1)


UNEVEN = (0.8, 1, 1, 1), (1, 1, 0.6, 1), (0.9, 0.7, 0.8, 0.6)


@pytest.mark.parametrize("gains", UNEVEN)
def test_views_of_uneven_brightness_have_the_same_reach(gains: tuple[float, ...]) -> None:
    for scene in (plane(47.0, (2, 2), SIZE, clouds), halves(-18.0, 20.0)):
        corners = corner_tensor(scene)
        even, uneven = disparity_reach(corners), disparity_reach(darkened(corners, gains))
        assert even is not None and uneven is not None
        assert abs(even.low - uneven.low) <= even.step and abs(even.high - uneven.high) <= even.step


def test_noise_a_flat_picture_and_a_small_one_tell_nothing() -> None:
    noise = torch.rand(4, 3, *SIZE, generator=torch.Generator().manual_seed(1))
    assert disparity_reach(noise) is None
    assert disparity_reach(torch.full((4, 3, *SIZE), 0.4)) is None
    assert disparity_reach(torch.rand(4, 3, 9, 200)) is None


def test_a_strip_does_not_go_farther_than_it_is_high() -> None:
    """Else its views would not meet where they continue one another."""
    strip = corner_tensor(plane(70.0, (2, 2), (64, 480), clouds))
    span = span_of(strip, Levels())
    assert abs(span.shift) < 64
    assert bool(continued_by_others(strip, 90, span.shift).isfinite().all())


def test_where_nothing_is_told_nothing_is_changed() -> None:
    noise = torch.rand(4, 3, *SIZE, generator=torch.Generator().manual_seed(1))
    for told_nothing in (noise, torch.zeros(4, 3, 2, 2)):
        assert span_of(told_nothing, Levels()) == Span()


@pytest.mark.parametrize(
    ("left", "right", "scale", "least", "most"),
    [
        (-18.0, 20.0, 1, 0, 0),
        (-20.0, -44.0, 1, -41, -23),
        (30.0, 50.0, 1, 29, 51),
        (-36.0, 40.0, 2, -2, 6),
        (-60.0, 10.0, 2, -40, -14),
    ],
)
def test_the_span_brings_all_disparities_within_the_levels(
    left: float, right: float, scale: int, least: float, most: float
) -> None:
    span = span_of(corner_tensor(halves(left, right)), Levels())
    assert span.scale == scale and least <= span.shift <= most
    for disparity in (left, right):
        assert abs(disparity - span.shift) / span.scale <= 21.5


@pytest.mark.skipif(not SCENES, reason="the shared test data is not beside the repository")
@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.name)
def test_real_light_fields_within_the_levels_are_left_alone(path: Path) -> None:
    corners = corner_tensor(open_light_field(path))
    assert span_of(corners, Levels()) == Span()
    for gains in UNEVEN:
        assert span_of(darkened(corners, gains), Levels()) == Span()


def test_the_sample_is_left_alone() -> None:
    assert span_of(corner_tensor(open_light_field(sample_path())), Levels()) == Span()


@pytest.mark.parametrize("move", [14, -14])
def test_where_all_is_at_the_shift_the_others_know_what_lies_beyond_an_edge(move: int) -> None:
    by = 20
    y, x = np.mgrid[-by : 48 + by, -by : 60 + by].astype(np.float32)
    larger = [smooth_texture(x - move * u, y - move * v) for u, v in CORNERS]
    truth = torch.from_numpy(np.stack(larger)).permute(0, 3, 1, 2)  # (4, 3, 48 + 2 by, 60 + 2 by)
    inside = truth[:, :, by:-by, by:-by]
    found = continued_by_others(inside, by, float(move))
    assert found.shape == truth.shape
    rows, columns = (slice(by - max(at, 0), by + size - min(at, 0)) for at, size in ((0, 48), (0, 60)))
    torch.testing.assert_close(found[:, :, rows, columns], inside)
    for n, (u, v) in enumerate(CORNERS):
        # Of view 0 the others see beyond its left and upper edge where they lie at smaller x and y: where `move` is positive.
        left, above = ((move > 0) == (at == 0) for at in (u, v))
        seen = (
            slice(by - 14, by + 48) if above else slice(by, by + 48 + 14),
            slice(by - 14, by + 60) if left else slice(by, by + 60 + 14),
        )
        torch.testing.assert_close(found[n][:, *seen], truth[n][:, *seen], atol=1e-4, rtol=0)
    aligned = continued_by_others(inside, by, float(move), 16)
    assert [size % 16 for size in (aligned.shape[2] - 2 * by, aligned.shape[3] - 2 * by)] == [0, 0]
    torch.testing.assert_close(aligned[:, :, : truth.shape[2], : truth.shape[3]], found)


def test_what_is_made_larger_lies_where_what_is_made_smaller_was() -> None:
    y, x = np.mgrid[:48, :60].astype(np.float32)
    slope = torch.from_numpy(0.3 * x - 0.2 * y)[None, None]
    again = made_larger(made_smaller(slope, 3), 3)
    torch.testing.assert_close(again[:, :, 3:-3, 3:-3], slope[:, :, 3:-3, 3:-3], atol=1e-4, rtol=0)


def small_pair() -> Synthesizer:
    weights = load_weights(weights_path("realtime"))
    return lfcore.compact_synthesizer.CompactSynthesizer(weights.model, weights.digest, Tuning(torch.float32))  # type: ignore[arg-type]


def papers_pair() -> Synthesizer:
    weights = load_weights(weights_path("full"))
    return lfcore.network_synthesizer.NetworkSynthesizer(weights.model, weights.digest, Tuning(torch.float32))  # type: ignore[arg-type]


@pytest.mark.parametrize("make", [small_pair, papers_pair])
def test_a_shift_shows_the_networks_what_they_would_see_of_smaller_disparities(
    make: Callable[[], Synthesizer], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A light field whose views are cropped at places that move by whole pixels: all disparities grow by 32 px, and the middle
    view stays. Set to it, networks have the same picture, and disparities 32 px larger."""
    shift, crop = 32, 16
    whole = halves(-4.0, 6.0, (2, 2))
    places = [[(shift * (1 - r), shift * (1 - c)) for c in (0, 1)] for r in (0, 1)]
    moved = [
        [whole.views[r, c, y : y + SIZE[0] - shift, x : x + SIZE[1] - shift] for c, (y, x) in enumerate(row)]
        for r, row in enumerate(places)
    ]
    model = make()
    model.set_light_field(whole)
    expected = model.synthesize(0.5, 0.5)
    for module in (lfcore.compact_synthesizer, lfcore.network_synthesizer):
        monkeypatch.setattr(module, "span_of", lambda *_: Span(1, float(shift)))
    model.set_light_field(LightField(np.array(moved), "moved", "", ""))
    found = model.synthesize(0.5, 0.5)
    assert found.disparity is not None and expected.disparity is not None
    edge = 100  # beyond what the networks see across the edges
    inner = slice(edge, -edge)
    own = slice(crop, -crop)
    if make is papers_pair:
        inner = slice(40, -40)
    image, disparity = expected.image[own, own], expected.disparity[own, own]
    np.testing.assert_allclose(found.image[inner, inner], image[inner, inner], atol=2e-3)
    np.testing.assert_allclose(found.disparity[inner, inner], disparity[inner, inner] + shift, atol=0.05)


SPANS = [(-6.0, 2.0), (40.0, 52.0), (-36.0, 38.0)]
# Where its levels hold the disparities as they are, test_classical.py asks more of the plane sweep.
LARGE = [(model, *span) for model in ("realtime", "full", "planesweep") for span in SPANS[model == "planesweep" :]]


@pytest.mark.parametrize(("model", "left", "right"), LARGE)
def test_views_are_synthesized_where_disparities_are_large(model: str, left: float, right: float) -> None:
    field = halves(left, right, (3, 3))
    synthesizer = make_synthesizer(model)
    synthesizer.set_light_field(field)
    found = synthesizer.synthesize(0.5, 0.5)
    assert found.disparity is not None
    for columns, disparity in ((slice(40, 110), left), (slice(200, 280), right)):
        inside = slice(40, 200), columns
        # Beyond what the levels hold as it is, a network's px counts for two.
        assert float(np.median(found.disparity[inside])) == pytest.approx(disparity, abs=2 if right - left > 42 else 1)
        errors = [float(np.abs(image - field.view(1, 1))[inside].mean()) for image in (found.image, field.corners().mean(0))]
        assert errors[0] < max(0.25 * errors[1], 0.01)  # the latter: what `full` blurs in any case


@pytest.mark.parametrize("make", [small_pair, papers_pair])
def test_a_scale_shows_the_networks_what_they_would_see_of_smaller_pictures(
    make: Callable[[], Synthesizer], monkeypatch: pytest.MonkeyPatch
) -> None:
    # What they find alone: the step after it looks at pictures that are not made smaller.
    monkeypatch.setattr(CompactInference, "aligned", lambda _self, _luma, disparity, *_: disparity)
    whole = halves(-16.0, 18.0)
    small = made_smaller(corner_tensor(whole), 2).permute(0, 2, 3, 1).numpy()
    model = make()
    model.set_light_field(LightField(np.stack([small[[0, 2]], small[[1, 3]]]), "small", "", ""))
    expected = model.synthesize(0.3, 0.6).disparity
    for module in (lfcore.compact_synthesizer, lfcore.network_synthesizer):
        monkeypatch.setattr(module, "span_of", lambda *_: Span(2, 0.0))
    model.set_light_field(whole)
    found = model.synthesize(0.3, 0.6).disparity
    assert expected is not None and found is not None and found.shape == SIZE
    y, x = (np.linspace(0, size / 2, 7, dtype=int)[1:-1] for size in SIZE)
    for row, column in itertools.product(y, x):  # between four px of the larger map lies one of the smaller
        around = found[2 * row : 2 * row + 2, 2 * column : 2 * column + 2]
        near = expected[row - 1 : row + 2, column - 1 : column + 2]
        weights = np.outer([1, 6, 1], [1, 6, 1]) / 64  # of linear steps between middles of px
        assert float(around.mean()) == pytest.approx(float(2 * (weights * near).sum()), abs=0.01)


def test_a_span_is_that_of_the_light_field_that_is_set() -> None:
    far, near = (plane(d, (2, 2), SIZE) for d in (44.0, 2.0))
    for model in ("realtime", "full"):
        used, fresh = make_synthesizer(model), make_synthesizer(model)
        used.set_light_field(far)
        used.synthesize(0.5, 0.5)
        used.set_light_field(near)
        fresh.set_light_field(near)
        np.testing.assert_array_equal(used.synthesize(0.3, 0.6).image, fresh.synthesize(0.3, 0.6).image)


def test_warped_inputs_and_weights_come_with_large_disparities() -> None:
    field = halves(30.0, 50.0)
    for model in ("realtime", "full"):
        synthesizer = make_synthesizer(model)
        synthesizer.set_light_field(field)
        warped = synthesizer.synthesize(0.5, 0.5).warped
        assert warped is not None
        inside: FloatArray = warped[:, 60:180, 60:120]
        assert float(np.abs(inside - inside.mean(0)).mean()) < 0.02
