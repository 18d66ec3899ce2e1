"""The order of views told from pictures: generated planes of known disparity, and real light fields as they are and turned."""

from __future__ import annotations

import dataclasses
import functools
import itertools
from pathlib import Path

import numpy as np
import pytest

from lfcore.disparity_sign import Order, baselines_differ, check_disparity
from lfcore.formats import open_light_field
from lfcore.formats.checks import put_in_order, with_warnings
from lfcore.lightfield import LightField

DATA = Path(__file__).parents[2] / "shared" / "data"
SCENES = [path for group in ("val", "corners") for path in sorted(DATA.glob(f"{group}/*"))] + sorted(DATA.glob("train/*"))[::5]

# Views as they lie in the array, changed in a way whose name the check must find.
CHANGES = {
    "as is": (lambda views: views, Order.AGREES),
    "rows reversed": (lambda views: views[::-1], Order.REVERSED),
    "columns reversed": (lambda views: views[:, ::-1], Order.REVERSED),
    "exchanged": (lambda views: views.swapaxes(0, 1), Order.EXCHANGED),
    "turned": (lambda views: views.swapaxes(0, 1)[::-1], Order.TURNED),
    "turned the other way": (lambda views: views.swapaxes(0, 1)[:, ::-1], Order.TURNED),
}


def wrap(views: np.ndarray) -> LightField:
    return LightField(views=views, name="made", source="made", kind="made")


def textured(generator: np.random.Generator) -> np.ndarray:
    """Smooth random texture that may be sampled anywhere: a sum of waves, as (frequency y, frequency x, phase) rows."""
    count = 30
    return np.stack(
        [generator.uniform(-0.9, 0.9, count), generator.uniform(-0.9, 0.9, count), generator.uniform(0, 2 * np.pi, count)]
    )


def plane(waves: np.ndarray, y: np.ndarray, x: np.ndarray) -> np.ndarray:
    return np.sin(waves[0] * y[..., None] + waves[1] * x[..., None] + waves[2]).mean(axis=-1) * 2 + 0.5


@functools.cache
def two_planes(near: float, far: float, rows: int = 3, columns: int = 3, size: tuple[int, int] = (150, 200)) -> np.ndarray:
    """A square before a background, each at its own disparity (px corner to corner): views[v, u] shows s - (u, v) D."""
    generator = np.random.default_rng(5)
    height, width = size
    y, x = np.mgrid[:height, :width].astype(np.float64)
    front, back = textured(generator), textured(generator)
    views = np.empty((rows, columns, height, width, 3), np.uint8)
    for row, column in itertools.product(range(rows), range(columns)):
        v, u = row / (rows - 1), column / (columns - 1)
        picture = plane(back, y - v * far, x - u * far)
        in_front = (np.abs(y - v * near - height / 2) < height / 4) & (np.abs(x - u * near - width / 2) < width / 4)
        picture[in_front] = plane(front, y - v * near, x - u * near)[in_front]
        noise = generator.normal(0, 2, (height, width, 3))
        views[row, column] = np.clip(picture[..., None] * np.array([255, 200, 150]) + noise, 0, 255)
    return views


@pytest.mark.parametrize("change", CHANGES)
def test_known_planes_are_judged_and_measured(change: str) -> None:
    rearrange, expected = CHANGES[change]
    check = check_disparity(wrap(rearrange(two_planes(near=6.0, far=-3.0))))
    assert check.order is expected
    assert check.is_wrong == (expected is not Order.AGREES)
    if expected is Order.AGREES:
        # Blocks across the edge of the square blur the percentiles a little.
        assert check.low == pytest.approx(-3.0, abs=0.5)
        assert check.high == pytest.approx(6.0, abs=0.5)
    else:
        # The sign is not told in a changed order, the extent is.
        assert check.high - check.low == pytest.approx(9.0, abs=1.0)


def test_all_disparities_of_one_sign_are_judged_too() -> None:
    views = two_planes(near=-4.0, far=-4.0)
    assert check_disparity(wrap(views)).order is Order.AGREES
    assert check_disparity(wrap(views[:, ::-1])).order is Order.REVERSED


@pytest.mark.parametrize("change", CHANGES)
def test_planes_as_far_apart_as_those_of_a_gantry_are_judged_and_measured(change: str) -> None:
    rearrange, expected = CHANGES[change]
    check = check_disparity(wrap(rearrange(two_planes(near=-60.0, far=-80.0, size=(300, 400)))))
    assert check.order is expected
    if expected is Order.AGREES:
        # The farther look averages over 3 px here.
        assert check.low == pytest.approx(-80.0, abs=3.0)
        assert check.high == pytest.approx(-60.0, abs=3.0)
    else:
        assert check.high - check.low == pytest.approx(20.0, abs=3.0)


def test_a_look_that_finds_disparities_up_to_its_end_is_followed_by_a_farther_one() -> None:
    check = check_disparity(wrap(two_planes(near=30.0, far=10.0)))  # the nearer one ends at 12.5 px
    assert check.order is Order.AGREES
    assert (check.low, check.high) == (pytest.approx(10.0, abs=1.0), pytest.approx(30.0, abs=1.0))


def test_disparity_is_measured_over_the_full_baseline_when_dark_corners_are_passed_over() -> None:
    views = two_planes(near=8.0, far=-4.0, rows=5, columns=5).copy()
    views[[0, 0, -1, -1], [0, -1, 0, -1]] //= 20
    corners = frozenset({(0, 0), (0, 4), (4, 0), (4, 4)})
    check = check_disparity(dataclasses.replace(wrap(views), dark=corners))
    assert check.order is Order.AGREES
    # Had the inner square's baseline been taken for the full one, -2 and 4 would have come out.
    assert (check.low, check.high) == (pytest.approx(-4.0, abs=1.5), pytest.approx(8.0, abs=1.5))


def test_views_without_movement_or_texture_or_kinship_cannot_be_told() -> None:
    generator = np.random.default_rng(2)
    one = two_planes(near=6.0, far=-3.0)[0, 0]
    still = np.broadcast_to(one, (3, 3, *one.shape)).copy()
    flat = np.full((2, 2, 100, 120, 3), 90, np.uint8)
    unrelated = generator.integers(0, 255, (2, 2, 100, 120, 3), dtype=np.uint8)
    tiny = generator.integers(0, 255, (2, 2, 6, 6, 3), dtype=np.uint8)
    for views in (still, flat, unrelated, tiny):
        check = check_disparity(wrap(views))
        assert check.order is Order.UNKNOWN
        assert not check.is_wrong
        assert np.isnan(check.median)


@pytest.mark.skipif(not SCENES, reason="the shared test data is not beside the repository")
@pytest.mark.parametrize("scene", SCENES, ids=lambda path: path.name)
def test_real_light_fields_are_judged_right_in_every_order(scene: Path) -> None:
    light_field = open_light_field(scene)
    assert light_field.warnings == ()
    for name, (rearrange, expected) in CHANGES.items():
        check = check_disparity(dataclasses.replace(light_field, views=rearrange(light_field.views)))
        assert check.order is expected, name


@pytest.mark.parametrize(("rows", "columns"), [(3, 5), (9, 3), (2, 4)])
@pytest.mark.parametrize("disparity", [-12.0, 6.0])
def test_of_other_grids_than_square_ones_the_baselines_count_as_equal(rows: int, columns: int, disparity: float) -> None:
    light_field = wrap(two_planes(near=disparity, far=disparity, rows=rows, columns=columns))
    check = check_disparity(light_field)
    assert check.order is Order.AGREES
    assert check.median == pytest.approx(disparity, abs=0.5)
    assert not baselines_differ(light_field, check)
    assert check_disparity(wrap(light_field.views[::-1])).order is Order.REVERSED


def test_a_grid_whose_views_lie_equally_far_apart_along_different_numbers_of_them_is_told() -> None:
    square = two_planes(near=12.0, far=-8.0, rows=5, columns=5)
    assert not baselines_differ(wrap(square), check_disparity(wrap(square)))
    light_field = wrap(square[1:4])
    assert check_disparity(light_field).order is Order.UNKNOWN
    assert baselines_differ(light_field, check_disparity(light_field))
    assert "two baselines differ" in with_warnings(light_field).warnings[0]


@pytest.mark.parametrize("size", [(3, 1000), (12, 4000), (1, 400), (4000, 10)])
def test_very_long_views_cannot_be_told(size: tuple[int, int]) -> None:
    views = np.random.default_rng(2).integers(0, 255, (2, 2, *size, 3), dtype=np.uint8)
    assert check_disparity(wrap(views)).order is Order.UNKNOWN


def test_views_put_in_order_are_warned_of_like_others() -> None:
    views = two_planes(near=6.0, far=-3.0)
    bright = wrap((views[::-1] / np.float32(128)).astype(np.float32))
    put_right = put_in_order(bright)
    np.testing.assert_array_equal(put_right.views, views / np.float32(128))
    (warning,) = put_right.warnings
    assert "lie above 1, up to" in warning
