"""Where pictures that are compared lie."""

from __future__ import annotations

from dataclasses import replace

import pytest

from app.comparison import Arrangement, Comparison
from app.geometry import Rect, Zoom
from app.panes import arrange, handle, under
from app.state import Look, ViewState

AREA = Rect(10, 20, 801, 600)
PICTURE = (541, 376)


def state(**comparison: object) -> ViewState:
    return ViewState(comparison=replace(Comparison(), **comparison))  # type: ignore[arg-type]


@pytest.mark.parametrize("zoom", [Zoom(), Zoom(1.0), Zoom(3.7, (0.2, 0.9))])
def test_pictures_side_by_side_show_the_same_part_equally_large(zoom: Zoom) -> None:
    left, right = arrange(state(arrangement=Arrangement.SIDE_BY_SIDE), AREA)
    assert (left.partner, right.partner) == (False, True)
    assert left.clip.x == AREA.x and right.clip.x + right.clip.width == AREA.x + AREA.width
    assert left.clip.x + left.clip.width < right.clip.x
    one, other = left.placement(zoom, PICTURE), right.placement(zoom, PICTURE)
    assert one.scale == other.scale
    inside = (30.0, 40.0)
    seen = [each.to_picture((pane.clip.x + inside[0], pane.clip.y + inside[1])) for pane, each in ((left, one), (right, other))]
    assert seen[0] == pytest.approx(seen[1], abs=1.01 / one.scale)  # origins are whole pixels


def test_a_wipe_divides_one_picture_at_its_handle() -> None:
    wiped = state(arrangement=Arrangement.WIPE, wipe=0.25)
    left, right = arrange(wiped, AREA)
    assert left.frame == right.frame == AREA
    assert left.clip.width + right.clip.width == AREA.width
    assert left.clip.x + left.clip.width == right.clip.x == handle(wiped.comparison, AREA) == 210
    assert not under((left, right), (209, 100)).partner
    assert under((left, right), (211, 100)).partner
    for share, widths in ((0.0, (0, 801)), (1.0, (801, 0))):
        panes = arrange(state(arrangement=Arrangement.WIPE, wipe=share), AREA)
        assert tuple(pane.clip.width for pane in panes) == widths


def test_flipped_there_is_only_the_partner() -> None:
    for arrangement in Arrangement:
        made = state(arrangement=arrangement)
        made.flipped = True
        (pane,) = arrange(made, AREA)
        assert pane.partner and pane.frame == pane.clip == AREA


def test_a_sheet_of_four_pictures_stands_alone() -> None:
    made = state(arrangement=Arrangement.SIDE_BY_SIDE)
    made.look = Look.WARPED_ALL
    (pane,) = arrange(made, AREA)
    assert not pane.partner and pane.clip == AREA
