"""Viewpoint paths: even speed, closure, and staying among the corner views."""

from __future__ import annotations

import itertools
import math

import pytest

from lfcore.errors import InputError
from lfcore.sweep import OPEN_PATHS, PATHS, circle, horizontal, lawnmower, spiral, vertical


@pytest.mark.parametrize("name", PATHS)
@pytest.mark.parametrize("frames", [1, 2, 7, 60])
def test_every_path_has_its_frames_inside_the_square(name: str, frames: int) -> None:
    points = PATHS[name](frames)
    assert len(points) == frames
    assert all(0 <= u <= 1 and 0 <= v <= 1 for u, v in points)


def test_circle_has_the_radius_and_closes_without_a_repeated_frame() -> None:
    points = circle(24, 0.4)
    assert all(math.hypot(u - 0.5, v - 0.5) == pytest.approx(0.4) for u, v in points)
    steps = [math.dist(a, b) for a, b in zip(points, points[1:] + points[:1], strict=True)]
    assert steps == pytest.approx([2 * 0.4 * math.sin(math.pi / 24)] * 24)


def test_horizontal_goes_there_and_back_at_even_speed() -> None:
    points = horizontal(8)
    assert [u for u, _ in points] == pytest.approx([0, 0.25, 0.5, 0.75, 1, 0.75, 0.5, 0.25])
    assert {v for _, v in points} == {0.5}
    assert vertical(8) == [(v, u) for u, v in points]


def test_lawnmower_visits_the_four_corners_row_by_row() -> None:
    points = lawnmower(1 + 9 * 14)  # its length is 8 rows of 1 and 7 steps down of 1/7, 9 in all
    assert points[0] == (0, 0)
    assert points[-1] == pytest.approx((0, 1))
    steps = [math.dist(a, b) for a, b in itertools.pairwise(points)]
    assert steps == pytest.approx([1 / 14] * (9 * 14))
    assert [v for _, v in points] == sorted(v for _, v in points)
    assert {round(7 * v) for u, v in points if u == pytest.approx(1)} == set(range(8))


def test_spiral_runs_at_even_speed_from_the_centre_to_the_rim_and_back() -> None:
    # With steps this short the chord is the arc to a few parts in a thousand, save at the two tight turns at the centre
    # and the sharp one at the rim.
    frames = 4000
    points = spiral(frames, 0.4)
    distances = [math.hypot(u - 0.5, v - 0.5) for u, v in points]
    assert distances[0] == pytest.approx(0)
    assert max(distances) == pytest.approx(0.4, abs=1e-3)
    assert distances.index(max(distances)) == pytest.approx(frames / 2, abs=1)
    steps = [math.dist(a, b) for a, b in zip(points, points[1:] + points[:1], strict=True)]
    # Length of r = c * angle over three turns (angle up to 6 pi), out and in, in closed form.
    end = 6 * math.pi
    length = 2 * (0.4 / end) * (end * math.sqrt(1 + end**2) + math.asinh(end)) / 2
    assert sorted(steps)[5:] == pytest.approx([length / frames] * (frames - 5), rel=5e-3)


@pytest.mark.parametrize("name", PATHS)
@pytest.mark.parametrize(("frames", "radius"), [(0, 0.3), (-1, 0.3), (10**9, 0.3), (8, 0), (8, 0.51), (8, math.nan)])
def test_impossible_paths_are_refused(name: str, frames: int, radius: float) -> None:
    with pytest.raises(InputError, match="must be"):
        PATHS[name](frames, radius)


@pytest.mark.parametrize("name", PATHS)
def test_closed_paths_lead_back_to_their_beginning_and_open_ones_do_not(name: str) -> None:
    points = PATHS[name](400)
    longest = max(math.dist(a, b) for a, b in itertools.pairwise(points))
    assert (math.dist(points[-1], points[0]) <= longest + 1e-9) == (name not in OPEN_PATHS)
