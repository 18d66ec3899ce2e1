"""Painting only what has changed gives what painting everything gives, whatever has changed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pytest
from test_panel_painting import RECTANGLE, corners_of, corners_of_rectangle

from app.painting import Box, Texture, marked
from app.panel_painting import Piece
from app.repainting import CELL, Repainting, paint
from lfcore.synthesis import ByteArray

SIZE = (200, 140)  # width, height: no multiples of a cell
WHOLE = Box(0, 0, *SIZE)
WHITE = Texture(np.full((2, 2, 4), 255, np.uint8), white=True)


@pytest.fixture(autouse=True)
def compiled(compiled_painting: None) -> None:
    """All of these need it."""


@dataclass(frozen=True)
class Grey:
    """A rectangle of one value."""

    box: Box
    mark: int

    def paint(self, sheet: ByteArray, box: Box) -> None:
        sheet[box.top : box.bottom, box.left : box.right] = self.mark


GROUND = Grey(WHOLE, 40)


def empty() -> ByteArray:
    return np.zeros((SIZE[1], SIZE[0], 4), np.uint8)


def rectangle(left: float, top: float, right: float, bottom: float, colour: Sequence[int] = (255, 0, 0, 255)) -> Piece:
    corners = corners_of(corners_of_rectangle(left, top, right, bottom), tuple(colour))
    return Piece(WHOLE, 1, WHITE, corners, RECTANGLE)


def made_up(random: np.random.Generator) -> Piece:
    """Triangles here and there, in parts of the window."""
    count = int(random.integers(3, 12))
    near = random.uniform((0, 0), SIZE)
    places = near + random.normal(0, random.choice((3, 20, 200)), (count, 2))
    corners = corners_of(places, random.integers(0, 256, (count, 4)))
    left, top = random.integers(-20, 100, 2).tolist()
    box = WHOLE if random.random() < 0.5 else Box(left, top, left + 90, top + 60)
    return Piece(box, int(random.integers(2)), WHITE, corners, random.integers(0, count, 3 * count).astype(np.uint32))


def pixels_of(boxes: Sequence[Box]) -> int:
    """How many pixels they hold; none may lie in two of them."""
    counts = np.zeros(SIZE[::-1], np.int64)
    for box in boxes:
        assert box.within(WHOLE) == box
        counts[box.top : box.bottom, box.left : box.right] += 1
    assert counts.max(initial=0) <= 1
    return int(counts.sum())


def test_whatever_changes_the_window_is_as_if_all_of_it_had_been_painted() -> None:
    random = np.random.default_rng(8)
    repainting, sheet = Repainting(), empty()
    layers: list[Grey] = [GROUND]
    pieces = [made_up(random) for _ in range(6)]
    painted = 0
    for _ in range(300):
        at = int(random.integers(len(pieces)))
        match int(random.integers(6)):
            case 0:
                pieces[at] = made_up(random)
            case 1:
                pieces.insert(at, made_up(random))
            case 2 if len(pieces) > 2:
                del pieces[at]
            case 3:
                pieces.reverse()
            case 4:
                corners = np.array(pieces[at].corners)  # one colour, or a place
                corners[0, random.integers(20)] ^= 1 << random.integers(5)
                pieces[at] = replace(pieces[at], corners=corners)
            case _:
                left, top = random.integers(-30, 150, 2).tolist()
                layers = [GROUND, Grey(Box(left, top, left + 40, top + 50), int(random.integers(256)))]
        boxes = repainting.outdated(SIZE, layers, pieces)
        painted += pixels_of(boxes)
        paint(sheet, boxes, layers, pieces)
        expected = empty()
        paint(expected, [WHOLE], layers, pieces)
        np.testing.assert_array_equal(sheet, expected)
    assert painted < 0.8 * 300 * SIZE[0] * SIZE[1]  # or all of it was painted each time


def test_nothing_is_painted_where_nothing_has_changed() -> None:
    repainting = Repainting()
    layers, pieces = [GROUND], [rectangle(10, 10, 60, 50), rectangle(100, 20, 104, 25)]
    assert pixels_of(repainting.outdated(SIZE, layers, pieces)) == SIZE[0] * SIZE[1]
    again = [replace(piece, corners=np.array(piece.corners)) for piece in pieces]  # in other memory
    assert repainting.outdated(SIZE, layers, again) == []


def test_what_is_small_takes_a_cell_with_it_where_it_was_and_where_it_is() -> None:
    repainting = Repainting()
    repainting.outdated(SIZE, [GROUND], [rectangle(70, 40, 80, 50)])
    moved = repainting.outdated(SIZE, [GROUND], [rectangle(140, 105, 150, 115)])
    assert set(moved) == {Box(64, 32, 96, 64), Box(128, 96, 160, 128)}
    assert repainting.outdated(SIZE, [GROUND], []) == [Box(128, 96, 160, 128)]
    assert CELL == 32


@pytest.mark.parametrize(
    "changed",
    [
        rectangle(70, 40, 80, 50, (255, 0, 0, 254)),
        rectangle(70, 40, 80.01, 50),
        replace(rectangle(70, 40, 80, 50), number=2),
        replace(rectangle(70, 40, 80, 50), box=Box(0, 0, 75, 140)),
    ],
)
def test_a_colour_a_place_a_texture_and_a_bound_each_count(changed: Piece) -> None:
    repainting = Repainting()
    repainting.outdated(SIZE, [GROUND], [rectangle(70, 40, 80, 50)])
    assert repainting.outdated(SIZE, [GROUND], [changed]) == [Box(64, 32, 96, 64)]


def test_so_does_what_lies_over_what() -> None:
    repainting = Repainting()
    pieces = [rectangle(70, 40, 80, 50), rectangle(75, 45, 85, 55, (0, 255, 0, 255))]
    repainting.outdated(SIZE, [GROUND], pieces)
    assert repainting.outdated(SIZE, [GROUND], pieces[::-1]) == [Box(64, 32, 96, 64)]


def test_all_is_painted_in_another_size_and_after_forgetting() -> None:
    repainting = Repainting()
    repainting.outdated(SIZE, [GROUND], [])
    assert repainting.outdated((SIZE[0] - 1, SIZE[1]), [GROUND], []) == [Box(0, 0, SIZE[0] - 1, SIZE[1])]
    repainting.outdated(SIZE, [GROUND], [])
    repainting.forget()
    assert repainting.outdated(SIZE, [GROUND], []) == [WHOLE]


def test_marks_of_what_is_not_there_are_refused() -> None:
    corners = corners_of(corners_of_rectangle(0, 0, 9, 9))
    with pytest.raises(ValueError, match="not there"):
        marked(np.zeros((5, 7), np.uint64), CELL, WHOLE, 0, corners, np.array([0, 1, 4], np.uint32))
    with pytest.raises(ValueError, match="cells without pixels"):
        marked(np.zeros((5, 7), np.uint64), 0, WHOLE, 0, corners, RECTANGLE)
