"""Many small pictures in a few textures."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import moderngl
import numpy as np
import pytest

from app.canvas import atlas as module
from app.canvas.atlas import PLACE, Atlas
from app.desk import Placed
from lfcore.formats.glance import LONGEST_SIDE


def picture(seed: int, height: int = 7, width: int = 5) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, (height, width, 3), dtype=np.uint8)


def read(gl: Any, placed: Placed) -> np.ndarray:
    """The pixels at that place, straight from the texture."""
    side = PLACE * module._ACROSS
    held = gl.external_texture(placed.texture, (side, side), 4, 0, "f1")
    whole = np.frombuffer(held.read(alignment=1), np.uint8).reshape(side, side, 4)[..., :3]
    x, y = round(placed.first[0] * side - 0.5), round(placed.first[1] * side - 0.5)
    assert (round(placed.last[0] * side + 0.5) - x, round(placed.last[1] * side + 0.5) - y) == (placed.width, placed.height)
    return whole[y : y + placed.height, x : x + placed.width]


@pytest.fixture
def atlas(gl: Any, monkeypatch: pytest.MonkeyPatch) -> Iterator[Atlas]:
    monkeypatch.setattr(module, "_ACROSS", 2)
    monkeypatch.setattr(module, "_SHEETS", 2)
    made = Atlas(gl)
    yield made
    made.release()
    assert gl.error == "GL_NO_ERROR"


def test_pictures_lie_where_it_is_said_and_those_shown_longest_ago_make_room(gl: moderngl.Context, atlas: Atlas) -> None:
    sizes = [(7, 5), (1, 1), (LONGEST_SIDE, 3), (3, LONGEST_SIDE), (9, 9), (2, 3), (4, 4), (5, 5)]
    pictures = [picture(seed, *size) for seed, size in enumerate(sizes)]
    places = [atlas.place(seed, each) for seed, each in enumerate(pictures)]
    for place, each in zip(places, pictures, strict=True):
        assert place is not None
        assert (read(gl, place) == each).all()
    assert atlas.place(0, pictures[0]) == places[0]
    new = picture(9)
    ninth = atlas.place(8, new)  # in the place of 1
    assert ninth is not None
    assert places[1] is not None
    assert (ninth.texture, ninth.first) == (places[1].texture, places[1].first)
    assert (read(gl, ninth) == new).all()
    assert places[0] is not None
    assert (read(gl, places[0]) == pictures[0]).all()


def test_every_glance_has_room() -> None:
    assert PLACE >= LONGEST_SIDE


def test_only_so_many_are_taken_in_a_frame(atlas: Atlas) -> None:
    atlas.begin()
    taken = [atlas.place(seed, picture(seed)) is not None for seed in range(module._UPLOADS + 3)]
    assert taken == [True] * module._UPLOADS + [False] * 3
    atlas.begin()
    assert atlas.place(100, picture(100)) is not None
