"""Undo and redo, and the snapshots that they go by."""

from __future__ import annotations

import random

import pytest

from app.geometry import ZOOM_LIMITS, Zoom
from app.history import LIMIT, RUN_SECONDS, History
from app.looking import Looking
from app.snapshot import LOOKED_AT, Snapshot, put_back, take
from app.state import GAIN_LIMITS, Look, ViewState
from app.tone import Curve, Tone
from lfcore.lightfield import EXTRAPOLATION_LIMIT

LOOKING = Looking(Tone(Curve.GAMMA, stops=-1.5, gamma=1.8))


class Hand:
    """A state with a history and a clock, as the program has them."""

    def __init__(self) -> None:
        self.state = ViewState()
        self.history = History()
        self.history.start(take(self.state))
        self.now = 10.0

    def frame(self, holding: bool = False, seconds: float = 0.02) -> None:
        self.now += seconds
        self.history.observe(take(self.state), self.now, holding)

    def drag(self, *path: float) -> None:
        for u in path:
            self.state.drag_to(u, 0.5)
            self.frame(holding=True)
        self.frame()

    def undo(self) -> bool:
        return self._put(self.history.undo())

    def redo(self) -> bool:
        return self._put(self.history.redo())

    def _put(self, snapshot: Snapshot | None) -> bool:
        if snapshot is not None:
            put_back(self.state, snapshot)
        self.frame()
        return snapshot is not None


@pytest.fixture
def hand() -> Hand:
    return Hand()


def test_a_drag_is_one_change_even_right_after_another(hand: Hand) -> None:
    hand.drag(0.4, 0.3, 0.2)
    hand.drag(0.25, 0.7)
    assert hand.undo()
    assert hand.state.u == 0.2
    assert hand.undo()
    assert hand.state.u == 0.5
    assert not hand.undo()
    assert hand.redo()
    assert hand.redo()
    assert hand.state.u == 0.7
    assert not hand.redo()


def test_the_pull_of_a_captured_view_belongs_to_the_drag(hand: Hand) -> None:
    hand.drag(0.4, 0.335)
    hand.frame(seconds=0.1)
    hand.state.u = 1 / 3
    hand.frame()
    assert hand.undo()
    assert hand.state.u == 0.5


def test_a_run_of_presses_is_one_change_and_a_pause_ends_it(hand: Hand) -> None:
    for pause in (0.1, 0.1, RUN_SECONDS + 0.1, 0.1):
        hand.now += pause
        hand.state.move_to(hand.state.u + 0.02, 0.5)
        hand.frame()
    assert hand.undo()
    assert hand.state.u == pytest.approx(0.54)
    assert hand.undo()
    assert hand.state.u == 0.5


def test_different_things_are_changes_of_their_own(hand: Hand) -> None:
    hand.state.look = Look.DISPARITY
    hand.frame()
    hand.state.zoom = Zoom(2.0, (0.25, 0.75))
    hand.frame()
    assert hand.undo()
    assert hand.state.zoom == Zoom()
    assert hand.state.look is Look.DISPARITY
    assert hand.undo()
    assert hand.state.look is Look.SYNTHESIS


def test_there_and_back_again_is_no_change(hand: Hand) -> None:
    for _ in range(2):
        hand.state.captured = not hand.state.captured
        hand.frame()
    assert not hand.undo()
    hand.drag(0.4, 0.5)
    assert not hand.undo()


def test_a_new_change_ends_the_future(hand: Hand) -> None:
    hand.drag(0.2)
    hand.undo()
    hand.drag(0.9)
    assert not hand.redo()
    hand.history.start(take(hand.state))
    assert not hand.undo()


def test_undo_and_redo_walk_the_same_way_back_and_forth(hand: Hand) -> None:
    """Against a plain list of every state that was come to rest at."""
    dice, stops = random.Random(2), [take(hand.state)]
    for _ in range(LIMIT + 50):
        hand.state.zoom = Zoom(dice.uniform(1, 4), (dice.random(), dice.random()))
        hand.frame(holding=True)
        hand.frame()
        stops.append(take(hand.state))
    for stop in stops[-2 : -LIMIT - 2 : -1]:
        assert hand.undo()
        assert take(hand.state) == stop
    assert not hand.undo()
    for stop in stops[-LIMIT:]:
        assert hand.redo()
        assert take(hand.state) == stop


def test_snapshots_put_everything_back() -> None:
    state = ViewState(u=0.1, v=-0.2, look=Look.ERROR, captured=True, looking=LOOKING, zoom=Zoom(3.0), gain=16.0, tail=2.0)
    other = ViewState()
    put_back(other, take(state))
    assert take(other) == take(state)
    assert all(getattr(other, name) == getattr(state, name) for name in LOOKED_AT)


def test_what_a_file_says_is_held_within_limits() -> None:
    state = ViewState()
    put_back(state, {"u": 99, "v": "up", "look": "NONE", "zoom": {"scale": 1e-9, "centre": [7, -1]}, "gain": 1e9, "other": 1})
    assert (state.u, state.v) == (1 + EXTRAPOLATION_LIMIT, 0.5)
    assert state.look is Look.SYNTHESIS
    assert state.zoom == Zoom(ZOOM_LIMITS[0], (1.0, 0.0))
    assert state.gain == GAIN_LIMITS[1]
