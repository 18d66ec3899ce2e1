"""The viewpoint that moves by itself, and the ways to the first and the last captured view."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
from moving_scene import TruthSynthesizer, light_field

from app.controller import Controller
from app.engine import Engine
from app.state import ViewState
from app.sway import PERIOD, RADIUS, Sway
from tests.test_panels import GRID, Screen


def swaying(u: float = 0.4, v: float = 0.6) -> tuple[Sway, ViewState]:
    state = ViewState(u=u, v=v, swaying=True)
    sway = Sway()
    sway.move(state, 100.0)
    return sway, state


def test_it_begins_where_it_is_and_goes_round_once_a_period() -> None:
    sway, state = swaying()
    assert (state.u, state.v) == (0.4, 0.6)
    path = []
    for step in range(1, 400):
        sway.move(state, 100.0 + step * 0.03)
        path.append((state.u, state.v))
    distances = [math.dist(point, (0.4, 0.6)) for point in path]
    assert distances == sorted(distances[:50]) + distances[50:]  # it opens
    np.testing.assert_allclose(distances[60:], RADIUS, rtol=1e-9)
    speeds = [math.dist(a, b) / 0.03 for a, b in itertools.pairwise(path)]
    np.testing.assert_allclose(speeds[60:], 2 * math.pi * RADIUS / PERIOD, rtol=1e-3)
    assert max(speeds) < 0.2  # of the baseline a second: slow everywhere


def test_it_does_not_matter_how_many_frames_there_are() -> None:
    fine, coarse = swaying(), swaying()
    for step in range(1, 301):
        fine[0].move(fine[1], 100.0 + step / 100)
        fine[0].move(fine[1], 100.0 + step / 100)  # a frame asks twice
    coarse[0].move(coarse[1], 103.0)
    assert (fine[1].u, fine[1].v) == pytest.approx((coarse[1].u, coarse[1].v))


def test_whatever_else_moves_the_viewpoint_stops_it() -> None:
    def drag(state: ViewState) -> None:
        state.drag_by(0.0, 0.0)

    def step(state: ViewState) -> None:
        state.move_to(0.1, 0.1)

    for move in (drag, step):
        sway, state = swaying()
        sway.move(state, 101.0)
        move(state)
        there = state.u, state.v
        sway.move(state, 102.0)
        assert not state.swaying
        assert (state.u, state.v) == there
        sway.move(state, 103.0)
        assert (state.u, state.v) == there


def test_it_stays_within_what_is_allowed() -> None:
    sway, state = swaying(1.25, -0.25)
    for step in range(300):
        sway.move(state, 100.0 + step * 0.05)
        assert state.u <= 1.25 and state.v >= -0.25
    assert state.swaying


def test_the_loop_draws_on_while_it_sways() -> None:
    engine = Engine(lambda: TruthSynthesizer(0.0), 2**24)
    controller = Controller(engine, lambda path, progress, cancelled: light_field(3, 3), lambda: None, "truth")
    try:
        controller.show_light_field(light_field(3, 3))
        controller.state.swaying = True
        controller.tick(10.0)
        assert controller.next_frame_in == 0.0
        controller.tick(11.0)
        assert controller.viewpoint != (0.5, 0.5)
        controller.state.move_to(0.5, 0.5)
        controller.tick(11.1)
        controller.tick(20.0)
        assert controller.next_frame_in != 0.0
    finally:
        controller.stop()


def test_keys_sway_and_go_to_both_ends(imgui_context: Any) -> None:
    screen = Screen(imgui_context)
    screen.press("End")
    assert (screen.state.u, screen.state.v) == (1.0, 1.0)
    screen.press("Shift+Home")
    assert (screen.state.u, screen.state.v) == (0.0, 0.0)
    screen.press("Home")
    assert (screen.state.u, screen.state.v) == (0.5, 0.5)
    screen.press("B")
    assert screen.state.swaying
    screen.press("B")
    assert not screen.state.swaying
    assert GRID.nearest(1.0, 1.0) == 63


def test_buttons_do_the_same(imgui_context: Any) -> None:
    screen = Screen(imgui_context)
    panel = screen.layout.panel
    assert panel is not None
    seen = set()
    for y in range(int(panel.y) + 110, int(panel.y) + 280, 8):
        for x in range(int(panel.x) + 155, int(panel.x + panel.width) - 10, 12):
            screen.click(x, y)
            seen.add((screen.state.u, screen.state.v))
        if screen.state.swaying:
            break
    assert {(0.0, 0.0), (1.0, 1.0)} <= seen
    assert screen.state.swaying
