"""The window in its states, drawn by a software rasteriser, against stored pictures: whether anything is misplaced or gone.

Tolerant of how a rasteriser rounds and smooths edges: what counts are means over blocks. After an intended change, draw the
pictures anew (tests/states.py) and look at them.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import OpenImageIO as oiio
import pytest

from tests.states import FOLDER, STATES, Picture, drawn, reduced

BLOCK = 2  # px of the stored pictures
LARGEST_STEP = 20.0  # of 255, by which the mean of a block may differ,
SHARE_OVER = 0.002  # but for this share of the blocks
STATUS = 8  # rows at the bottom: times, which differ from run to run


def stored(name: str) -> Picture:
    picture = oiio.ImageBuf(str(FOLDER / f"{name}.png")).get_pixels(oiio.UINT8)
    assert isinstance(picture, np.ndarray)
    return picture[..., :3]


def share_that_differs(a: Picture, b: Picture) -> float:
    """The share of blocks whose means differ by more than LARGEST_STEP."""
    assert a.shape == b.shape
    height, width = (a.shape[0] - STATUS) // BLOCK * BLOCK, a.shape[1] // BLOCK * BLOCK
    difference = a[:height, :width].astype(np.float32) - b[:height, :width]
    means = difference.reshape(height // BLOCK, BLOCK, width // BLOCK, BLOCK, 3).mean((1, 3))
    return float((np.abs(means).max(-1) > LARGEST_STEP).mean())


@pytest.mark.parametrize("name", STATES)
def test_the_window_looks_as_it_did(gl: Any, name: str) -> None:
    assert share_that_differs(reduced(drawn(STATES[name], gl)), stored(name)) <= SHARE_OVER


def test_the_states_differ_from_each_other() -> None:
    """So that a key which does nothing would be noticed."""
    base = stored("synthesis")
    for name, state in STATES.items():
        if name != "synthesis" and (state.size, state.scale) == (STATES["synthesis"].size, STATES["synthesis"].scale):
            assert share_that_differs(stored(name), base) > 10 * SHARE_OVER, name


def test_a_thing_out_of_place_is_noticed() -> None:
    base = stored("synthesis")
    moved = base.copy()
    width = base.shape[1]
    panel = slice(width - 70, width - 5), slice(50, 80)  # a part of the panel, a little lower
    rows, columns = panel[1], panel[0]
    moved[rows.start + 2 : rows.stop + 2, columns] = base[rows, columns]
    assert share_that_differs(moved, base) > SHARE_OVER
