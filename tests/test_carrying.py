"""The disparity map carried to other viewpoints, against a search by definition."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from app.canvas.carrying import carrying
from app.canvas.passes import Passes
from app.canvas.synthesized import Synthesized
from app.canvas.textures import Textures
from app.state import CARRIED
from lfcore.lightfield import FloatArray

SIZE = 40, 50
MADE_AT = 0.5, 0.5


@pytest.fixture
def textures(gl: Any) -> Iterator[Textures]:
    resting_place = gl.framebuffer([gl.texture((1, 1), 4)])
    made = Textures(gl, np.zeros((4, *SIZE, 3), np.uint8), "f4")
    made.made_at = MADE_AT
    yield made
    resting_place.use()  # what is drawn into is not to be released
    made.release()
    assert gl.error == "GL_NO_ERROR"


def square(near: float, far: float) -> FloatArray:
    """A near square before a far ground."""
    disparity = np.full(SIZE, far, np.float32)
    disparity[12:27, 15:36] = near
    return disparity


def searched(disparity: FloatArray, shift: tuple[float, float], values: tuple[float, float]) -> FloatArray:
    """At each pixel the smallest of these disparities that lies in the map where it leads to; NaN where there is none."""
    height, width = disparity.shape
    rows, columns = np.mgrid[:height, :width]
    found = np.full(disparity.shape, np.nan, np.float32)
    for value in sorted(values, reverse=True):
        y = np.clip(np.floor(rows + shift[1] * value + 0.5).astype(int), 0, height - 1)
        x = np.clip(np.floor(columns + shift[0] * value + 0.5).astype(int), 0, width - 1)
        found[disparity[y, x] == value] = value
    return found


@pytest.mark.parametrize(("near", "far"), [(-6.0, 4.0), (10.0, 11.0), (-11.0, -10.0)])  # the last two nearly move as a whole
@pytest.mark.parametrize(("pixels", "steps"), [(0.45, 0), (0.95, 1), (3.3, 3)])
def test_it_is_found_by_as_few_steps_as_things_move_far(
    gl: Any, textures: Textures, near: float, far: float, pixels: float, steps: int
) -> None:
    disparity = square(near, far)
    textures.disparity_map.write(disparity)
    textures.disparity_range = near, far
    distance = pixels / max(abs(near), abs(far))
    for direction in (0.3, 2.0, 4.1):
        viewpoint = MADE_AT[0] + distance * math.cos(direction), MADE_AT[1] + distance * math.sin(direction)
        assert carrying(textures, viewpoint)["steps"] == steps
        carried = Synthesized(Passes(gl), textures, CARRIED).carry_disparity(viewpoint)
        found = np.frombuffer(carried.read(), np.float32).reshape(SIZE)
        expected = searched(disparity, (MADE_AT[0] - viewpoint[0], MADE_AT[1] - viewpoint[1]), (near, far))
        known = ~np.isnan(expected)
        assert known.mean() > 0.9 and {near, far} == set(expected[known])
        np.testing.assert_array_equal(found[known], expected[known])


def test_along_lines_of_viewpoints_as_many_steps_as_there_are(textures: Textures) -> None:
    textures.disparity_range = -1.0, 1.0
    assert carrying(textures, MADE_AT)["steps"] == 0
    assert carrying(textures, MADE_AT, farthest=math.inf)["steps"] == 3
