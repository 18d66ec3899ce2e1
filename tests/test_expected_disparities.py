"""Which disparities a light field is expected to have, and what the small pair makes of patterns that fit at several."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from scenes import plane, smooth_texture

from lfcore.expected_disparities import ENOUGH, MARGIN, STEEPNESS, Limits, expected
from lfcore.lightfield import CORNERS, FloatArray, LightField
from lfcore.synthesizer import make_synthesizer

VALUES = torch.linspace(-21, 21, 43)  # a level for each px


def told(*groups: tuple[float, int, str]) -> tuple[torch.Tensor, torch.Tensor]:
    """Probabilities and costs of pixels: a disparity, how many, and whether they are "sure", "unsure", or sure of one of two
    that fit alike ("twofold")."""
    probabilities, costs = [], []
    for disparity, count, kind in groups:
        distance = (VALUES - disparity).abs()
        spread = torch.exp(-0.5 * (distance / (3.0 if kind == "unsure" else 0.4)).square())
        cost = (0.05 * distance).clamp(max=0.3)
        if kind == "twofold":
            cost = torch.minimum(cost, 0.01 + (0.05 * (VALUES - disparity - 9).abs()).clamp(max=0.3))
        probabilities.append((spread / spread.sum()).expand(count, -1))
        costs.append(cost.expand(count, -1))
    return torch.cat(probabilities), torch.cat(costs)


def found(*groups: tuple[float, int, str]) -> Limits | None:
    return expected(*told(*groups), VALUES)


def test_limits_are_those_of_the_pixels_that_are_sure() -> None:
    limits = found((-4.0, 300, "sure"), (3.0, 500, "sure"), (1.0, 200, "sure"))
    assert limits is not None
    assert (limits.low, limits.high) == pytest.approx((-4 - MARGIN, 3 + MARGIN), abs=0.05)


def test_pixels_that_are_not_sure_or_fit_at_two_disparities_tell_nothing() -> None:
    expected_limits = found((-4.0, 300, "sure"), (3.0, 500, "sure"))
    assert found((-4.0, 300, "sure"), (3.0, 500, "sure"), (-12.0, 400, "unsure"), (9.0, 400, "twofold")) == expected_limits


def test_the_outermost_few_tell_nothing() -> None:
    few = found((2.0, 9996, "sure"), (15.0, 2, "sure"), (-15.0, 2, "sure"))
    assert few is not None and (few.low, few.high) == pytest.approx((2 - MARGIN, 2 + MARGIN), abs=0.05)
    more = found((2.0, 9994, "sure"), (15.0, 4, "sure"), (-15.0, 2, "sure"))
    assert more is not None and (more.low, more.high) == pytest.approx((2 - MARGIN, 15 + MARGIN), abs=0.05)


def test_where_hardly_a_pixel_tells_there_are_no_limits() -> None:
    enough = int(ENOUGH * 1000)
    assert found((2.0, enough - 1, "sure"), (0.0, 1001 - enough, "unsure")) is None
    assert found((2.0, enough, "sure"), (0.0, 1000 - enough, "unsure")) is not None


def test_levels_are_less_likely_the_farther_they_lie_out() -> None:
    values = torch.linspace(-4, 4, 5)  # 2 px apart
    np.testing.assert_allclose(Limits(-2.0, 1.0).penalties(values), [STEEPNESS, 0, 0, 0.5 * STEEPNESS, 1.5 * STEEPNESS])


def woven(period: float, stripes: bool) -> FloatArray:
    """A texture with a large patch that repeats itself, in x and y or in y alone."""

    def texture(x: FloatArray, y: FloatArray) -> FloatArray:
        turns = 2 * np.pi / period
        pattern = 0.5 + 0.3 * np.sin(turns * y) * (np.ones_like(x) if stripes else np.sin(turns * x))
        inside = (x > 40) & (x < 130) & (y > 30) & (y < 100)
        drawn: FloatArray = np.where(inside[..., None], pattern[..., None], smooth_texture(x, y)).astype(np.float32)
        return drawn

    return texture


PATCH = slice(40, 96), slice(50, 125)


@pytest.mark.parametrize("stripes", [False, True])
@pytest.mark.parametrize("period", [6.0, 8.0, 10.0])
def test_a_repetitive_pattern_lies_where_the_rest_of_the_scene_does(period: float, stripes: bool) -> None:
    """Without limits most of each of these patches is taken a period or more too far or too near."""
    synthesizer = make_synthesizer("realtime")
    synthesizer.set_light_field(plane(3.0, (2, 2), (160, 208), woven(period, stripes)))
    synthesis = synthesizer.synthesize(0.5, 0.5)
    assert synthesis.disparity is not None
    assert float(np.quantile(np.abs(synthesis.disparity[PATCH] - 3), 0.99)) < 2
    truth = plane(3.0, (3, 3), (160, 208), woven(period, stripes)).view(1, 1)
    assert float(np.abs(synthesis.image - truth)[PATCH].mean()) < 0.02


def test_a_small_thing_far_in_front_of_all_others_stays_where_it_is() -> None:
    """A square of 18 px, a six-hundredth of the picture, 15 px in front of a plane."""
    y, x = np.mgrid[:376, :541].astype(np.float32)
    views = np.empty((2, 2, 376, 541, 3), np.float32)
    for u, v in CORNERS:
        behind = smooth_texture(x - 3 * u, y - 3 * v)
        moved_x, moved_y = x + 12 * (u - 0.5), y + 12 * (v - 0.5)
        board = (moved_x.astype(int) // 3 + moved_y.astype(int) // 3) % 2
        thing = 0.7 * smooth_texture(2 * moved_x, 2 * moved_y) + 0.3 * board[..., None]
        inside = (np.abs(moved_x - 270) < 9) & (np.abs(moved_y - 188) < 9)
        views[int(v), int(u)] = np.where(inside[..., None], thing, behind)
    synthesizer = make_synthesizer("realtime")
    synthesizer.set_light_field(LightField(views, "thing", "", ""))
    disparity = synthesizer.synthesize(0.5, 0.5).disparity
    assert disparity is not None
    assert float(np.median(disparity[183:194, 265:276])) == pytest.approx(-12, abs=0.5)
    assert float(np.median(disparity)) == pytest.approx(3, abs=0.5)


def test_limits_are_those_of_the_light_field_that_is_set() -> None:
    far, near = plane(11.0, (2, 2), (96, 128)), plane(-11.0, (2, 2), (96, 128))
    used, fresh = make_synthesizer("realtime"), make_synthesizer("realtime")
    used.set_light_field(far)
    used.set_light_field(near)
    fresh.set_light_field(near)
    found, expected_found = used.synthesize(0.4, 0.6), fresh.synthesize(0.4, 0.6)
    np.testing.assert_array_equal(found.image, expected_found.image)
    np.testing.assert_array_equal(found.disparity, expected_found.disparity)
    assert found.disparity is not None
    assert float(np.median(found.disparity)) == pytest.approx(-11, abs=0.5)
