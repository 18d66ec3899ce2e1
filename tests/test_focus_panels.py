"""Refocusing, slices and stereo by fed mouse and key events, without any GL; and the controller that finds the disparity."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from moving_scene import DISPARITY, TruthSynthesizer, light_field
from test_panels import OPEN, Screen

from app.controller import Controller
from app.engine import Engine
from app.focusing import BASELINES, FOCUS_STEP, Choice, FocusFacts, place_in_slice
from app.geometry import place
from app.keyboard import _KEYS
from app.state import Look, Tab
from lfcore.key_frames import Stop
from lfcore.sweep_plan import KeyFramePath, SweepPlan


@pytest.fixture
def screen(imgui_context: Any) -> Screen:
    made = Screen(imgui_context)
    made.readout = replace(OPEN, has_disparity=True, focus=FocusFacts((-8.0, 9.0), "60 of 64 captured views", -2.0))
    return made


def chord(screen: Screen, name: str) -> None:
    """Shift and a key."""
    imgui = screen.imgui
    for down in (True, False):
        for key in (imgui.Key.mod_shift, imgui.Key.left_shift, _KEYS[name][0]):
            screen.io.add_key_event(key, down)
        screen.frame(2)


def shift(screen: Screen, down: bool) -> None:
    screen.io.add_key_event(screen.imgui.Key.mod_shift, down)
    screen.io.add_key_event(screen.imgui.Key.left_shift, down)
    screen.frame()


def under(screen: Screen, x: float, y: float) -> tuple[float, float]:
    return place(screen.state.zoom, (541, 376), screen.layout.picture).to_picture((x, y))


def test_keys_of_refocusing(screen: Screen) -> None:
    state = screen.state
    screen.press("O")
    assert state.look is Look.REFOCUS
    screen.press("]")
    screen.press("]")
    assert state.focusing.focus == pytest.approx(2 * FOCUS_STEP)
    screen.press("[")
    assert state.focusing.focus == pytest.approx(FOCUS_STEP)
    before = state.focusing.aperture
    screen.press("Y")
    assert state.focusing.aperture < before
    chord(screen, "Y")
    assert state.focusing.aperture == pytest.approx(before)
    chord(screen, "O")
    assert state.look is Look.SYNTHESIS
    screen.press("[")  # says that it wants another focus, and so wants to see it
    assert state.look is Look.REFOCUS
    screen.press("O")
    assert state.look is Look.SYNTHESIS


def test_the_views_that_are_summed_up_are_chosen_by_a_key(screen: Screen) -> None:
    seen = []
    for _ in Choice:
        chord(screen, "V")
        seen.append(screen.state.focusing.views)
    assert seen == [Choice.CAPTURED, Choice.SYNTHESIZED, Choice.AUTOMATIC]


def test_a_click_focuses_while_refocusing_and_a_drag_does_not(screen: Screen) -> None:
    state = screen.state
    screen.click(300, 300)
    assert state.pick is None
    screen.press("O")
    screen.click(310, 290)
    assert state.pick == pytest.approx(under(screen, 310, 290))
    state.pick = None
    screen.drag((300, 300), (60, 0))
    assert state.pick is None
    assert state.u != 0.5


def test_shift_and_press_focuses_wherever_the_mouse_goes(screen: Screen) -> None:
    state = screen.state
    screen.move(400, 350)
    shift(screen, True)
    screen.io.add_mouse_button_event(0, True)
    screen.frame()
    assert state.pick == pytest.approx(under(screen, 400, 350))
    screen.move(500, 250)
    assert state.pick == pytest.approx(under(screen, 500, 250))
    screen.io.add_mouse_button_event(0, False)
    screen.frame()
    shift(screen, False)
    assert (state.u, state.v) == (0.5, 0.5)  # the viewpoint stays


def test_stereo_goes_round_and_brackets_move_its_convergence(screen: Screen) -> None:
    state = screen.state
    seen = []
    for _ in range(4):
        screen.press("J")
        seen.append(state.look)
    assert seen == [Look.ANAGLYPH, Look.STEREO_PARALLEL, Look.STEREO_CROSSED, Look.SYNTHESIS]
    screen.press("J")
    screen.press("]")
    assert state.look is Look.ANAGLYPH
    assert state.focusing.convergence == FOCUS_STEP
    assert state.focusing.focus == 0.0
    baselines = []
    for _ in BASELINES:
        chord(screen, "J")
        baselines.append(state.focusing.baseline)
    assert sorted(baselines) == list(BASELINES)


def test_the_cursor_in_a_pair_is_that_of_one_picture(screen: Screen) -> None:
    screen.state.look = Look.STEREO_PARALLEL
    screen.frame(2)
    area = screen.layout.picture
    right = place(screen.state.zoom, (2 * 541, 376), area).to_window((541 + 100.5, 50.5))
    screen.move(*right)
    assert screen.state.cursor == pytest.approx((100.5, 50.5), abs=1.2)  # the mouse stands on whole pixels


def test_slices_follow_the_cursor_until_they_are_pinned(screen: Screen) -> None:
    state = screen.state
    whole = screen.layout.picture
    screen.press("U")
    assert screen.layout.strips is not None
    assert screen.layout.picture.height < whole.height
    screen.move(300, 300)
    assert state.sliced == pytest.approx(under(screen, 300, 300))
    chord(screen, "U")
    screen.move(400, 200)
    assert state.sliced == pytest.approx(under(screen, 300, 300))
    chord(screen, "U")
    screen.frame()
    assert state.sliced == pytest.approx(under(screen, 400, 200))
    screen.move(1100, 700)  # beside the picture
    assert state.sliced == pytest.approx(under(screen, 400, 200))
    screen.press("U")
    assert screen.layout.strips is None


def test_slices_that_are_hidden_stay_so_when_they_are_let_go(screen: Screen) -> None:
    chord(screen, "U")
    assert screen.state.focusing.slices and screen.state.focusing.pin is not None  # to pin them shows them
    screen.press("U")
    chord(screen, "U")
    assert (screen.state.focusing.slices, screen.state.focusing.pin) == (False, None)


def test_a_drag_in_a_slice_moves_the_viewpoint_along_it(screen: Screen) -> None:
    state = screen.state
    screen.press("U")
    strips = screen.layout.strips
    assert strips is not None
    below, beside = strips.below, strips.beside
    y = below.y + 0.75 * below.height
    screen.click(below.x + 200, y)
    assert (state.u, state.v) == pytest.approx((place_in_slice(0.75), 0.5))
    screen.drag((beside.x + 0.5 * beside.width, 200), (-0.3 * beside.width, 30))
    assert (state.u, state.v) == pytest.approx((place_in_slice(0.75), place_in_slice(0.2)), abs=0.02)


def find(screen: Screen, changed: Callable[[], bool], x: float) -> None:
    """Click down the tab at so many window units from the panel's left edge until it holds."""
    panel = screen.layout.panel
    assert panel is not None
    for y in range(int(panel.y) + 310, int(panel.y + panel.height), 6):
        screen.click(panel.x + x, y)
        if changed():
            return
    raise AssertionError("nothing in the tab does that")


def test_the_tab_changes_everything_by_mouse(screen: Screen) -> None:
    state = screen.state
    state.tab = Tab.FOCUS
    screen.frame(2)
    box, sliders = 26, 160
    find(screen, lambda: state.look is Look.REFOCUS, box)
    before = state.focusing
    for name in ("focus", "aperture", "baseline", "convergence"):
        find(screen, lambda name=name: getattr(state.focusing, name) != getattr(before, name), sliders)  # type: ignore[misc]
        screen.press("Esc")  # a list that was opened on the way
    assert -8.0 <= state.focusing.focus <= 9.0
    find(screen, lambda: state.focusing.slices, box)
    find(screen, lambda: state.focusing.pin is not None, box)


def test_the_tab_leaves_alone_what_nobody_moves(screen: Screen) -> None:
    state = screen.state
    state.tab = Tab.FOCUS
    # No number of these is one of single precision, in which sliders compute, and the focus lies beyond its slider.
    state.focusing = chosen = replace(state.focusing, focus=31.7, aperture=0.8, baseline=0.3, convergence=-1.1)
    screen.frame(3)
    assert state.look is Look.SYNTHESIS
    assert state.focusing == chosen


@pytest.mark.parametrize("size", [(200, 150), (640, 400), (5000, 3000)])
def test_slices_and_stereo_draw_in_every_size(imgui_context: Any, size: tuple[int, int]) -> None:
    screen = Screen(imgui_context)
    screen.readout = replace(OPEN, has_disparity=True, focus=FocusFacts(under=3.0))
    screen.size = size
    screen.state.focusing = replace(screen.state.focusing, slices=True, pin=(540.0, 375.0))
    looks, drawn = (Look.SYNTHESIS, Look.REFOCUS, Look.ANAGLYPH, Look.STEREO_PARALLEL, Look.STEREO_CROSSED), set()
    for look in looks:
        for tab in Tab:
            screen.state.look, screen.state.tab = look, tab
            screen.frame(3)
            assert screen.layout.picture.width > 0 and screen.layout.picture.height > 0
            drawn.add(screen.drawn())
    assert len(drawn) == len(looks) * (1 if screen.layout.panel is None else len(Tab))


@pytest.fixture
def controller() -> Any:
    made = Controller(Engine(TruthSynthesizer, 2**26), lambda *_: light_field(), lambda: None, "truth")
    yield made
    made.stop()


def test_a_pick_waits_for_the_disparity_and_becomes_the_focus(controller: Controller) -> None:
    controller.show_light_field(light_field())
    controller.state.pick = (30.0, 20.0)
    deadline = time.monotonic() + 60
    while controller.state.pick is not None:
        controller.tick(time.monotonic())
        assert time.monotonic() < deadline
        time.sleep(0.01)
    assert controller.state.look is Look.REFOCUS
    assert controller.state.focusing.focus == pytest.approx(DISPARITY)
    low, high = controller.readout(None).focus.limits
    assert low < DISPARITY < high
    assert not controller.captured_summed  # 3 x 3 captured views are too few


def test_another_light_field_is_not_sliced_where_the_last_one_was(controller: Controller) -> None:
    controller.show_light_field(light_field())
    state = controller.state
    state.focusing, state.sliced = replace(state.focusing, slices=True, pin=(100.0, 90.0)), (100.0, 90.0)
    controller.show_light_field(light_field(size=(40, 50)))
    assert state.focusing.slices
    assert (state.focusing.pin, state.sliced) == (None, None)


def test_a_path_with_a_focus_drives_the_focus(controller: Controller) -> None:
    controller.show_light_field(light_field())
    choices = controller.state.export
    choices.take(SweepPlan(KeyFramePath((Stop(0.2, 0.5, -3.0), Stop(0.8, 0.5, 5.0))), frames=9, fps=10.0, aperture=0.7))
    choices.play()
    seen = []
    for frame in range(9):
        controller.tick(100.0 + frame * 0.1001)
        seen.append((controller.state.u, controller.state.focusing.focus))
    assert controller.state.look is Look.REFOCUS
    assert controller.state.focusing.aperture == 0.7
    expected = [(0.2 + 0.6 * k / 8, -3.0 + 8.0 * k / 8) for k in range(9)]
    assert np.array(seen) == pytest.approx(np.array(expected), abs=0.02)


def test_what_the_eyes_see_is_synthesized_while_the_hand_rests(controller: Controller) -> None:
    controller.show_light_field(light_field())
    state = controller.state
    state.foresight = False
    state.look = Look.STEREO_PARALLEL
    deadline = time.monotonic() + 60
    while len(controller.eyes.answers) < 2:
        controller.tick(time.monotonic())
        assert time.monotonic() < deadline
        time.sleep(0.01)
    eyes = state.focusing.eyes((state.u, state.v))
    assert [(a.synthesis.u, a.synthesis.v) for a in controller.eyes.answers.values()] == [pytest.approx(eye) for eye in eyes]
    kept = dict(controller.eyes.answers)
    controller.tick(time.monotonic())
    assert all(controller.eyes.answers[eye] is answer for eye, answer in kept.items())
    # Beyond what can be synthesized nothing is asked for.
    state.focusing = replace(state.focusing, baseline=1.0)
    state.move_to(-0.2, 0.5)
    controller.tick(time.monotonic())
    assert controller.eyes.missing(state, ()) == pytest.approx((0.3, 0.5))
    state.look = Look.SYNTHESIS
    controller.tick(time.monotonic())
    assert controller.eyes.answers == {}
