"""Paths through key frames: they pass through all of them, smoothly, at even speed, and without leaving the corner views."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from lfcore.errors import InputError
from lfcore.key_frames import Stop, spline, through

KEYS = (Stop(0.1, 0.2), Stop(0.8, 0.1), Stop(0.9, 0.7), Stop(0.3, 0.9))


def steps(stops: list[Stop]) -> list[float]:
    return [math.dist((a.u, a.v), (b.u, b.v)) for a, b in itertools.pairwise(stops)]


def distance_to(path: list[Stop], key: Stop) -> float:
    return min(math.dist((stop.u, stop.v), (key.u, key.v)) for stop in path)


@pytest.mark.parametrize("closed", [False, True])
def test_the_path_passes_through_every_key_frame_at_even_speed(closed: bool) -> None:
    path = through(KEYS, 1000, closed)
    assert len(path) == 1000
    lengths = steps(path)
    assert max(lengths) / min(lengths) < 1.01
    assert all(distance_to(path, key) <= max(lengths) for key in KEYS)
    assert (path[0].u, path[0].v) == pytest.approx((0.1, 0.2))
    last = KEYS[0] if closed else KEYS[-1]
    gap = math.dist((path[-1].u, path[-1].v), (last.u, last.v))
    assert gap == pytest.approx(lengths[0] if closed else 0, rel=0.01, abs=1e-9)  # the beginning is not repeated


def test_the_path_has_no_corner() -> None:
    path = through(KEYS, 2000, closed=True)
    points = np.array([(stop.u, stop.v) for stop in [*path, *path[:2]]])
    directions = np.diff(points, axis=0)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    turns = np.degrees(np.arccos(np.clip((directions[1:] * directions[:-1]).sum(1), -1, 1)))
    assert turns.max() < 4  # the key frames' own polygon turns by 60 to 120 degrees at once
    assert turns.sum() == pytest.approx(360, abs=2)  # once round, without a loop


def test_two_key_frames_make_a_line() -> None:
    path = through((Stop(0, 1), Stop(1, 0.5)), 5, closed=False)
    assert [stop.u for stop in path] == pytest.approx([0, 0.25, 0.5, 0.75, 1])
    assert [stop.v for stop in path] == pytest.approx([1, 0.875, 0.75, 0.625, 0.5])
    back = through((Stop(0, 0), Stop(1, 0)), 8, closed=True)
    assert [stop.u for stop in back] == pytest.approx([0, 0.25, 0.5, 0.75, 1, 0.75, 0.5, 0.25], abs=1e-3)


def test_one_key_frame_or_the_same_one_again_stands_still() -> None:
    here = Stop(0.3, 0.4, 2.0)
    assert through((here,), 3, closed=True) == [here] * 3
    assert through((here, here, here), 3, closed=False) == [here] * 3
    assert [stop.u for stop in through((Stop(0, 0), Stop(0, 0), Stop(1, 0)), 3, closed=False)] == pytest.approx([0, 0.5, 1])


def test_a_bend_does_not_leave_the_corner_views() -> None:
    corners = (Stop(0, 0), Stop(1, 0), Stop(1, 1), Stop(0, 1))
    bare = spline(np.array([(key.u, key.v) for key in corners]), closed=True)
    assert bare.min() < -0.01  # the spline alone would
    path = through(corners, 100, closed=True)
    assert all(0 <= stop.u <= 1 and 0 <= stop.v <= 1 for stop in path)
    beyond = through((Stop(-0.2, 0), Stop(1, 0), Stop(-0.2, 1)), 50, closed=False)
    assert min(stop.u for stop in beyond) == pytest.approx(-0.2)


def test_focus_runs_along_with_the_viewpoint_and_alone() -> None:
    path = through((Stop(0, 0.5, -4), Stop(1, 0.5, 6)), 11, closed=False)
    assert [stop.focus for stop in path] == pytest.approx(list(range(-4, 7)))
    # The viewpoint rests while the whole range of focus goes by: as long as one baseline.
    still = through((Stop(0, 0.5, -4), Stop(0, 0.5, 6), Stop(1, 0.5, 6)), 2001, closed=False)
    resting = sum(stop.u < 0.05 for stop in still) / 2001
    assert resting == pytest.approx(0.5, abs=0.06)
    assert still[-1] == Stop(pytest.approx(1), pytest.approx(0.5), pytest.approx(6))


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ((), "no key frame"),
        ((Stop(0, 0, 1.0), Stop(1, 1)), "Key frame 2 has no focus"),
        ((Stop(0, 1.3),), "must lie from"),
        ((Stop(math.nan, 0.5),), "must be a number"),
        ((Stop(0, 0, math.nan),), "must lie from"),
        ((Stop(0, 0, 1e9),), "must lie from"),
    ],
)
def test_impossible_key_frames_are_refused(keys: tuple[Stop, ...], words: str) -> None:
    with pytest.raises(InputError, match=words):
        through(keys, 10, closed=False)
