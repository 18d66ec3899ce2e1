"""Comparing by fed mouse and key events, without any GL."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Any

import pytest
from moving_scene import light_field
from test_panels import GRID, OPEN, Screen

from app.comparison import CAPTURED_VIEW, INSTANT, Arrangement, Difference
from app.foresight import captured_viewpoints
from app.keyboard import _KEYS
from app.panes import arrange, handle
from app.readout import Compared, ScoreText
from app.sidebar.score_map import Summary, is_novel, scored_words, summary
from app.state import Grid, Look, Tab
from lfcore.protocols import novel_views

SIZE = (541, 376)
THERE = replace(OPEN, captured_here=9, models=("full", "realtime", "mean"), compared=Compared(there=True))


@pytest.fixture
def screen(imgui_context: Any) -> Screen:
    made = Screen(imgui_context)
    made.readout = THERE
    made.frame(2)
    return made


def hold(screen: Screen, name: str, down: bool) -> None:
    screen.io.add_key_event(_KEYS[name][0], down)
    screen.frame(2)


def chord(screen: Screen, modifier: str, name: str) -> None:
    imgui = screen.imgui
    modifiers = {"Shift": (imgui.Key.mod_shift, imgui.Key.left_shift)}[modifier]
    for down in (True, False):
        for key in (*modifiers, _KEYS[name][0]):
            screen.io.add_key_event(key, down)
        screen.frame(2)


def test_the_partner_is_seen_as_long_as_the_key_is_held(screen: Screen) -> None:
    hold(screen, "R", True)
    assert screen.state.flipped
    screen.frame(5)
    assert screen.state.flipped
    hold(screen, "R", False)
    assert not screen.state.flipped


def test_wipe_and_side_by_side_take_turns(screen: Screen) -> None:
    for key, arrangement in (("W", Arrangement.WIPE), ("D", Arrangement.SIDE_BY_SIDE), ("D", Arrangement.ALONE)):
        screen.press(key)
        assert screen.state.comparison.arrangement is arrangement


def test_the_handle_is_dragged_with_the_mouse_and_leaves_the_viewpoint_alone(screen: Screen) -> None:
    screen.press("W")
    area = screen.layout.picture
    x = handle(screen.state.comparison, area)
    screen.move(x, 300)
    screen.frame(3)
    screen.drag((x, 300), (-150, 40))
    assert handle(screen.state.comparison, area) == pytest.approx(x - 150, abs=1)
    assert (screen.state.u, screen.state.v) == (0.5, 0.5)
    x = handle(screen.state.comparison, area)
    screen.drag((x, 300), (-3 * area.width, 0))
    assert screen.state.comparison.wipe == 0
    screen.drag((area.x + 1, 300), (90, 0))  # it can be taken at the edge, too
    assert screen.state.comparison.wipe > 0.05


def test_where_there_is_no_partner_there_is_no_handle(screen: Screen) -> None:
    screen.readout = replace(THERE, captured_here=None, compared=Compared())
    screen.press("W")
    x = handle(screen.state.comparison, screen.layout.picture)
    screen.drag((x, 200), (-90, 0))
    assert screen.state.comparison.wipe == 0.5
    assert screen.state.u > 0.5  # the picture is dragged there, as anywhere


@pytest.mark.parametrize("key", ["W", "D", "3"])
def test_where_there_is_no_captured_view_the_way_to_one_is_offered(screen: Screen, key: str) -> None:
    """And to another partner: in the part of the window that has nothing to show."""
    screen.readout = replace(THERE, captured_here=None, compared=Compared())
    screen.press(key)
    screen.frame(3)
    area = arrange(screen.state, screen.layout.picture)[-1].clip
    middle = area.x + area.width / 2
    done = set()
    for y in range(int(area.height / 2), int(area.height / 2) + 60, 4):
        for x in (middle - 120, middle + 20):
            screen.state.move_to(0.5, 0.5)
            screen.state.comparison = replace(screen.state.comparison, partner=CAPTURED_VIEW)
            screen.click(x, y)
            if GRID.at(screen.state.u, screen.state.v) is not None:
                done.add("nearest")
            if screen.state.comparison.partner == INSTANT:
                done.add("partner")
    assert done == {"nearest", "partner"}


def test_beside_the_handle_the_picture_is_dragged_as_ever(screen: Screen) -> None:
    screen.press("W")
    for x in (200, 800):
        before = screen.state.u
        screen.drag((x, 300), (30, 0))
        assert screen.state.u < before
    assert screen.state.comparison.wipe == 0.5


def test_keys_move_the_handle_only_where_there_is_one(screen: Screen) -> None:
    chord(screen, "Shift", "Right")
    assert screen.state.comparison.wipe == 0.5
    screen.press("W")
    chord(screen, "Shift", "Right")
    assert screen.state.comparison.wipe > 0.5
    chord(screen, "Shift", "Left")
    chord(screen, "Shift", "Left")
    assert screen.state.comparison.wipe < 0.5
    assert (screen.state.u, screen.state.v) == (0.5, 0.5)


@pytest.mark.parametrize("pane", [0, 1])
def test_the_wheel_zooms_both_pictures_about_the_point_under_the_mouse(screen: Screen, pane: int) -> None:
    screen.press("D")
    panes = arrange(screen.state, screen.layout.picture)
    middle = panes[pane].clip
    mouse = (round(middle.x + 0.4 * middle.width), round(middle.y + 0.45 * middle.height))
    screen.move(*mouse)
    before = panes[pane].placement(screen.state.zoom, SIZE)
    fixed = before.to_picture(mouse)
    screen.io.add_mouse_wheel_event(0, 3)
    screen.frame(3)
    after = panes[pane].placement(screen.state.zoom, SIZE)
    assert after.scale > 1.5 * before.scale
    assert after.to_picture(mouse) == pytest.approx(fixed, abs=0.6)
    other = panes[1 - pane]
    same = (mouse[0] - panes[pane].frame.x + other.frame.x, mouse[1])
    assert other.placement(screen.state.zoom, SIZE).to_picture(same) == pytest.approx(fixed, abs=0.6)
    assert screen.state.cursor == pytest.approx(fixed, abs=0.6)


@pytest.mark.parametrize("x", [200, 700])
def test_a_right_drag_moves_both_pictures(screen: Screen, x: float) -> None:
    screen.press("D")
    before = [pane.placement(screen.state.zoom, SIZE).origin for pane in arrange(screen.state, screen.layout.picture)]
    screen.drag((x, 400), (20, 10), 1)
    after = [pane.placement(screen.state.zoom, SIZE).origin for pane in arrange(screen.state, screen.layout.picture)]
    for old, new in zip(before, after, strict=True):
        assert (new[0] - old[0], new[1] - old[1]) == pytest.approx((20, 10), abs=1)


def test_zoom_keys_magnify_what_a_half_shows(screen: Screen) -> None:
    screen.press("D")
    left, _ = arrange(screen.state, screen.layout.picture)
    before = left.placement(screen.state.zoom, SIZE).scale
    screen.press("+")
    assert left.placement(screen.state.zoom, SIZE).scale == pytest.approx(1.25 * before)


def test_partners_go_round_and_leave_out_the_model_itself(screen: Screen) -> None:
    seen = []
    for _ in range(4):
        screen.press("Q")
        seen.append(screen.state.comparison.partner)
    assert seen == [INSTANT, "realtime", "mean", CAPTURED_VIEW]
    chord(screen, "Shift", "Q")
    assert screen.state.comparison.partner == "mean"


def test_the_key_of_differences_first_shows_one_and_then_goes_through_the_kinds(screen: Screen) -> None:
    screen.press("E")
    assert screen.state.look is Look.ERROR
    assert screen.state.comparison.difference is Difference.ABSOLUTE
    seen = []
    for _ in Difference:
        screen.press("E")
        seen.append(screen.state.comparison.difference)
    assert set(seen) == set(Difference)
    assert seen[-1] is Difference.ABSOLUTE


def test_the_key_of_scores_opens_the_tab(screen: Screen) -> None:
    screen.state.panel = False
    screen.press("H")
    assert screen.state.score_all and screen.state.tab is Tab.COMPARE and screen.state.panel
    screen.press("H")
    assert not screen.state.score_all


def test_a_click_in_the_map_of_scores_goes_to_the_view(screen: Screen) -> None:
    views = tuple(ScoreText(30 + index / 10, 0.9, "K16") for index in range(64))
    screen.readout = replace(THERE, compared=Compared(there=True, views=views))
    screen.state.tab = Tab.COMPARE
    screen.frame(3)

    def gone_to_a_view() -> bool:
        state = screen.state
        found = state.hand is None and (state.u, state.v) != (0.5, 0.5)  # the pad would leave a hand
        if not found:
            state.move_to(0.5, 0.5)
        return found

    x, y = screen.find_in_panel(gone_to_a_view, "left")
    here = GRID.at(screen.state.u, screen.state.v)
    assert here is not None and here < 8  # the first row met from above
    screen.click(x, y + 60)  # within the map, farther down
    below = GRID.at(screen.state.u, screen.state.v)
    assert below is not None and below % 8 == here % 8 and below > here + 8


def test_the_summary_leaves_out_inputs_and_dark_views() -> None:
    grid = Grid(3, 3, *SIZE, frozenset({(0, 1)}))
    scores: list[ScoreText | None] = [ScoreText(99.0, 1.0, "K16")] * 9
    assert summary(grid, ()) == Summary(4, 0)
    for index, psnr in ((3, 30.0), (4, 34.0), (5, 35.0)):
        scores[index] = ScoreText(psnr, 0.9, "K16")
    scores[7] = None
    assert summary(grid, tuple(scores)) == Summary(4, 3, 33.0, 30.0, 35.0)


def test_the_tab_counts_scores_as_the_status_line_does() -> None:
    """Of all captured views but the dark ones, inputs among them."""
    grid = Grid(3, 3, *SIZE, frozenset({(0, 1)}))
    scores = [ScoreText(99.0, 1.0, "K16") if index in (0, 3, 4) else None for index in range(9)]
    readout = replace(OPEN, model="full", compared=Compared(views=tuple(scores)))
    assert scored_words(readout, grid) == f"3 of {len(captured_viewpoints(grid))}"
    never = replace(readout, compared=Compared(never_scored=frozenset({"full"})))
    assert scored_words(never, grid) == "none"


@pytest.mark.parametrize(("side", "offered"), [(8, True), (2, False)])
def test_all_views_can_be_scored_where_some_are_no_inputs(screen: Screen, side: int, offered: bool) -> None:
    screen.readout = replace(THERE, grid=Grid(side, side, *SIZE), captured_here=None)
    screen.state.tab = Tab.COMPARE
    screen.frame(3)
    if offered:
        screen.find_in_panel(lambda: screen.state.score_all)
    else:
        with pytest.raises(AssertionError):
            screen.find_in_panel(lambda: screen.state.score_all)


@pytest.mark.parametrize(("rows", "columns"), [(7, 7), (8, 8), (3, 5), (2, 2)])
def test_the_summary_is_of_the_views_that_the_protocols_score(rows: int, columns: int) -> None:
    """So that on 7 x 7 and 8 x 8 views its mean is the protocol's."""
    expected = {row * columns + column for row, column in novel_views(light_field(rows, columns, (4, 4)))}
    assert {index for index in range(rows * columns) if is_novel(Grid(rows, columns, 4, 4), index)} == expected


@pytest.mark.parametrize("size", [(200, 150), (640, 400), (1280, 800), (5000, 3000)])
def test_every_way_of_comparing_draws_in_every_size(imgui_context: Any, size: tuple[int, int]) -> None:
    screen = Screen(imgui_context)
    screen.size = size
    table = (("full", ScoreText(36.1, 0.97, "K16")), ("realtime", None))
    views = (None, ScoreText(36.1, 0.97, "K16"), ScoreText(float("inf"), 1.0, "K16"))
    screen.state.tab = Tab.COMPARE
    for readout in (OPEN, THERE, replace(THERE, compared=Compared(True, table[0][1], True, table, views))):
        screen.readout = readout
        for difference, look in itertools.product(Difference, (Look.SYNTHESIS, Look.ERROR, Look.WARPED_ALL)):
            screen.state.look = look
            drawn = set()
            for arrangement in Arrangement:
                screen.state.comparison = replace(
                    screen.state.comparison, arrangement=arrangement, difference=difference, partner="realtime"
                )
                screen.move(size[0] / 3, size[1] / 3)
                screen.frame()
                drawn.add(screen.drawn())
            sheet = look is Look.WARPED_ALL  # it is shown alone
            assert len(drawn) == len(Arrangement) or (sheet and screen.layout.panel is None)


def test_a_key_that_is_held_while_another_window_takes_the_keys_is_let_go(screen: Screen) -> None:
    hold(screen, "R", True)
    assert screen.state.flipped
    screen.io.add_focus_event(False)
    screen.frame(2)
    assert not screen.state.flipped
    screen.io.add_focus_event(True)
    screen.frame(2)
    assert not screen.state.flipped
