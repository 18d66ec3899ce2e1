"""The pace of frames: the monitor's where they are cheap, slower where they would take the cores from the networks."""

from __future__ import annotations

import time

import pytest

from app.pacing import DRAWING_SHARE, LONGEST_INTERVAL, Pace

SHORTEST = 0.014
ENOUGH_FRAMES = 40  # for the mean to be that of these frames


def paced(monkeypatch: pytest.MonkeyPatch, cost: float, cores: int) -> Pace:
    """After many frames that took so many seconds of processor time each."""
    spent = 0.0
    monkeypatch.setattr(time, "process_time", lambda: spent)
    pace = Pace(SHORTEST, cores)
    for _ in range(ENOUGH_FRAMES):
        with pace.frame():
            spent += cost
    return pace


def test_cheap_frames_come_at_the_monitors_pace(monkeypatch: pytest.MonkeyPatch) -> None:
    assert Pace(SHORTEST, 2).sharing == SHORTEST
    assert paced(monkeypatch, 0.003, 2).sharing == SHORTEST
    assert paced(monkeypatch, 0.018, 16).sharing == SHORTEST


@pytest.mark.parametrize(("cost", "cores"), [(0.015, 2), (0.02, 2), (0.02, 3)])
def test_dear_ones_take_their_share_of_the_cores_and_no_more(monkeypatch: pytest.MonkeyPatch, cost: float, cores: int) -> None:
    assert cost / (paced(monkeypatch, cost, cores).sharing * cores) == pytest.approx(DRAWING_SHARE, rel=1e-3)


def test_the_picture_moves_however_dear_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    assert paced(monkeypatch, 0.5, 1).sharing == LONGEST_INTERVAL


def test_only_what_is_taken_from_the_networks_makes_frames_fewer(monkeypatch: pytest.MonkeyPatch) -> None:
    pace = paced(monkeypatch, 0.02, 2)
    assert pace.interval(takes_from_networks=False) == SHORTEST < pace.interval(takes_from_networks=True) == pace.sharing
