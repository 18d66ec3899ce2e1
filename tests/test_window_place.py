"""A window comes back where it was, if it can be seen there."""

from __future__ import annotations

import pytest

from app.geometry import Rect
from app.settings import WindowPlace
from app.window_place import fitted

LEFT, RIGHT = Rect(0, 30, 1920, 1050), Rect(1920, 0, 1280, 1024)


@pytest.mark.parametrize(
    "place", [WindowPlace(100, 100, 800, 600), WindowPlace(1500, 50, 900, 700), WindowPlace(-300, 0, 900, 600)]
)
def test_where_it_can_be_seen_it_goes_where_it_was(place: WindowPlace) -> None:
    assert fitted(place, [LEFT, RIGHT]) == (place.x, place.y, place.width, place.height)


@pytest.mark.parametrize(
    "place", [WindowPlace(2500, 100, 800, 600), WindowPlace(-9000, 0, 900, 600), WindowPlace(0, 0, 9000, 9000)]
)
def test_else_it_goes_into_the_middle_of_the_first_monitor(place: WindowPlace) -> None:
    x, y, width, height = fitted(place, [LEFT])
    assert (width, height) == (min(place.width, 1920), min(place.height, 1050))
    assert (x + width / 2, y + height / 2) == (960, 555)
