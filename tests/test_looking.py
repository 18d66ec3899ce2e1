"""Tone, colours, range and level: their limits, their keys and their controls, by fed events."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from app.looking import LEAST_RANGE, LEVEL_STEP, LEVELS, RANGE_LIMITS, Looking, level_limits
from app.snapshot import put_back, take
from app.state import GAIN_LIMITS, Look, ViewState
from app.tone import STOPS_LIMITS, STOPS_STEP, Curve, Tone
from lfcore.colormaps import ColourMap
from tests.test_panels import OPEN, Screen

KEYS = {"9": Look.LEAN, "0": Look.DISAGREEMENT, "Shift+9": Look.SWEEP_MEAN, "Shift+0": Look.SWEEP_DEVIATION}


@pytest.fixture
def screen(imgui_context: Any) -> Screen:
    made = Screen(imgui_context)
    made.readout = replace(OPEN, disparity_range=(-3.0, 5.0), has_disparity=True)
    return made


def test_keys_show_what_is_inside_the_synthesis(screen: Screen) -> None:
    for name, look in KEYS.items():
        screen.press(name)
        assert screen.state.look is look


def test_the_level_of_the_sweep_goes_by_keys_and_leads_to_the_sweep(screen: Screen) -> None:
    screen.press("PgUp")
    assert screen.state.look is Look.SWEEP_MEAN
    screen.press("Shift+0")
    screen.press("PgUp")
    screen.press("PgUp")
    screen.press("PgDn")
    assert screen.state.look is Look.SWEEP_DEVIATION
    assert screen.state.looking.level == pytest.approx(1.5 * LEVEL_STEP)  # the first one was half a step from 0


@pytest.mark.parametrize("start", [0.0, -7.31, 20.9, 33.3])
def test_the_keys_go_from_one_level_of_the_network_to_the_next(start: float) -> None:
    """And beyond its last one in the same steps."""
    limits = (-30.0, 40.0)
    up, down = (Looking(level=start).at_next_level(step, limits) for step in (1, -1))
    assert start < up.level < start + LEVEL_STEP
    assert start - LEVEL_STEP < down.level < start
    for level in (up.level, down.level, up.at_next_level(1, limits).level):
        place = (level - LEVELS[0]) / LEVEL_STEP
        assert place == pytest.approx(round(place), abs=1e-6)
    assert up.at_next_level(-1, limits).level == pytest.approx(down.level)
    assert up.at_next_level(1, limits).level - up.level == pytest.approx(LEVEL_STEP)


def test_tone_and_exposure_go_by_keys(screen: Screen) -> None:
    screen.press("X")
    screen.press("X")
    screen.press("Shift+X")
    screen.press("G")
    assert screen.state.looking.tone == Tone(Curve.SRGB, STOPS_STEP)
    screen.press("T")
    assert screen.state.looking.tone == Tone(Curve.AUTHORS, STOPS_STEP)
    screen.press("T")
    assert screen.state.looking.tone == Tone(stops=STOPS_STEP)


def test_the_colour_map_goes_round_by_its_key(screen: Screen) -> None:
    seen = []
    for _ in ColourMap:
        screen.press("L")
        seen.append(screen.state.looking.colour_map)
    assert set(seen) == set(ColourMap)
    assert seen[-1] is ColourMap.VIRIDIS


def test_the_range_by_hand_begins_as_it_is_and_is_narrowed_about_its_middle(screen: Screen) -> None:
    screen.press("Shift+L")
    assert screen.state.looking.hand_range == (-3.0, 5.0)
    assert screen.state.look is Look.DISPARITY
    screen.press(".")
    assert screen.state.looking.hand_range == pytest.approx((-1.0, 3.0))
    screen.press(",")
    assert screen.state.looking.hand_range == pytest.approx((-3.0, 5.0))
    screen.press("Shift+L")
    assert screen.state.looking.hand_range is None


@pytest.mark.parametrize("look", KEYS.values())
def test_a_click_in_the_panel_shows_it(screen: Screen, look: Look) -> None:
    clicks = "left" if look in (Look.LEAN, Look.SWEEP_MEAN) else "right"
    screen.find_in_panel(lambda: screen.state.look is look, clicks)


def test_sliders_of_tone_level_and_gain_are_there_for_the_looks_that_have_them(screen: Screen) -> None:
    state = screen.state
    screen.find_in_panel(lambda: state.looking.tone.stops != 0, "left")
    for look in (Look.SWEEP_MEAN, Look.SWEEP_DEVIATION):
        state.look, state.looking = look, Looking()
        screen.frame(2)
        screen.find_in_panel(lambda shown=look: state.looking.level != 0 or state.look is not shown, "left")
        state.look = look
    state.look, gain = Look.DISAGREEMENT, state.gain
    screen.frame(2)
    panel = screen.layout.panel
    assert panel is not None
    for y in range(int(panel.y + 640), int(panel.y + panel.height), 6):
        screen.click(panel.x + 0.3 * panel.width, y)
        assert state.look is Look.DISAGREEMENT
        if state.gain != gain:
            return
    raise AssertionError("there is no gain")


def test_gain_belongs_to_deviations_as_to_the_error() -> None:
    state = ViewState(look=Look.SWEEP_DEVIATION, gain=8.0)
    state.change_contrast(2.0)
    assert state.gain == 16.0
    state.look = Look.DISAGREEMENT
    for _ in range(9):
        state.change_contrast(2.0)
    assert state.gain == GAIN_LIMITS[1]
    state.look = Look.SYNTHESIS
    state.change_contrast(0.5)
    assert state.gain == GAIN_LIMITS[1]


def test_the_window_says_that_a_picture_is_not_shown_as_stored(screen: Screen) -> None:
    def drawn() -> int:
        screen.frame(3)
        return int(screen.imgui.get_draw_data().total_vtx_count)

    for look, said in ((Look.SYNTHESIS, True), (Look.SWEEP_MEAN, True), (Look.DISPARITY, False), (Look.SWEEP_DEVIATION, False)):
        screen.state.look, screen.state.looking = look, Looking()
        before = drawn()
        screen.state.looking = Looking(Tone(stops=0.5))
        assert (drawn() - before > 30) is said  # "+0.5 stops"; the slider's value has a digit more


def test_ranges_and_levels_stay_within_limits() -> None:
    assert Looking().with_range(5.0, -3.0).hand_range == (-3.0, 5.0)
    low, high = Looking().with_range(2.0, 2.0).hand_range or (0.0, 0.0)
    assert high - low == pytest.approx(LEAST_RANGE)
    wild = Looking(Tone(stops=1e9), hand_range=(-1e9, 1e9), level=-1e9).bounded()
    assert wild == Looking(Tone(stops=STOPS_LIMITS[1]), hand_range=RANGE_LIMITS, level=RANGE_LIMITS[0])
    looking = Looking()
    for _ in range(200):
        looking = looking.at_next_level(1, LEVELS)
    assert looking.level == LEVELS[1]


def test_levels_reach_as_far_as_the_disparities_that_are_shown(screen: Screen) -> None:
    assert level_limits(None) == level_limits((-2.0, 3.0)) == LEVELS
    assert level_limits((-60.0, -50.0)) == (-60.0, LEVELS[1])
    screen.readout = replace(screen.readout, disparity_range=(-22.0, 40.0))
    for _ in range(round(41 / LEVEL_STEP)):
        screen.press("PgUp")
    assert screen.state.looking.level == 40.0


def test_all_of_it_is_kept_and_undone() -> None:
    looking = Looking(Tone(Curve.GAMMA, 1.5, 1.8), ColourMap.TURBO, (-2.0, 7.0), -3.5)
    other = ViewState()
    put_back(other, take(ViewState(looking=looking)))
    assert other.looking == looking
