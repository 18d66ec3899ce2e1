"""The tab Export by fed mouse and key events, without any GL; and what the program does about it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from privileges import without_privileges

from app import dialogs
from app.asking import Asking
from app.controller import Controller
from app.dialogs import Answered, Purpose, Question
from app.engine import Engine, ModelChoice
from app.export_choices import KEY_FRAMES, Format, Product
from app.export_requests import CancelExport, ExportAction
from app.exporting import Phase, Status
from app.limits import within
from app.sidebar.export import progress_words
from app.state import Look, Tab
from app.tone import Curve
from app.widgets import typed
from lfcore.errors import InputError
from lfcore.key_frames import Stop
from lfcore.sweep_plan import ShapePath, SweepPlan, load_plan, save_plan
from tests.moving_scene import TruthSynthesizer, light_field
from tests.test_panels import Screen
from tests.virtual_screen import wait_until


@pytest.fixture
def screen(imgui_context: Any) -> Screen:
    made = Screen(imgui_context)
    made.state.export.folder = "/tmp"
    made.press("Ctrl+E")
    return made


def test_keys_add_and_remove_key_frames_and_play(screen: Screen) -> None:
    assert screen.state.tab is Tab.EXPORT
    export = screen.state.export
    screen.state.move_to(0.25, 0.75)
    screen.press("K")
    screen.state.move_to(0.5, 0.5)
    screen.press("K")
    assert export.shape == KEY_FRAMES
    assert [(key.u, key.v) for key in export.key_frames] == [(0.25, 0.75), (0.5, 0.5)]
    screen.press("Shift+K")
    assert len(export.key_frames) == 1
    screen.state.swaying = True
    screen.press("Ctrl+Shift+K")
    assert export.playing
    assert not screen.state.swaying
    screen.press("Ctrl+Shift+K")
    assert not export.playing


def test_a_key_frame_that_comes_or_goes_is_seen_in_its_tab(screen: Screen) -> None:
    for key in ("K", "Shift+K"):
        screen.state.tab, screen.state.panel = Tab.LOOK, False
        screen.press(key)
        assert (screen.state.tab, screen.state.panel) == (Tab.EXPORT, True)


def palette(screen: Screen, words: str) -> None:
    """Run the first command that the palette finds for these words."""
    screen.press("Ctrl+P")
    screen.frame(3)
    screen.io.add_input_characters_utf8(words)
    screen.frame(3)
    screen.press("Enter")
    screen.frame(3)


def test_the_palette_reaches_what_has_no_key(screen: Screen) -> None:
    export = screen.state.export
    screen.press("Ctrl+1")
    palette(screen, "export as webm")
    assert export.format is Format.WEBM
    assert screen.state.tab is Tab.EXPORT  # where it is seen
    palette(screen, "export quilt")
    assert export.product is Product.QUILT
    palette(screen, "path of the export spiral")
    assert export.shape == "spiral"
    before = export.radius
    palette(screen, "narrower path")
    assert export.radius < before
    palette(screen, "labels on exported")
    assert export.labels
    palette(screen, "scores by 7x7")
    assert screen.state.comparison.rule == "7x7-Y"
    palette(screen, "larger gamma")
    assert screen.state.looking.tone.curve is Curve.GAMMA
    assert screen.state.looking.tone.gamma == pytest.approx(2.3)
    palette(screen, "type the name")
    screen.frame(3)
    screen.io.add_input_characters_utf8("walk")
    screen.frame(3)
    assert export.name.endswith("walk")


def test_key_frames_take_the_focus_of_a_refocused_picture(screen: Screen) -> None:
    export = screen.state.export
    screen.press("K")
    assert not export.refocus
    screen.state.refocus_at(-2.5)
    screen.state.focusing = replace(screen.state.focusing, aperture=0.75)
    screen.press("K")
    assert (export.refocus, export.aperture) == (True, 0.75)
    assert [key.focus for key in export.key_frames] == [0.0, -2.5]


def test_keys_ask_for_exports(screen: Screen) -> None:
    for key in ("Ctrl+Shift+E", "Ctrl+S", "Ctrl+Shift+S"):
        screen.press(key)
    assert screen.requests == [ExportAction.EXPORT, ExportAction.SAVE_PICTURE, ExportAction.SAVE_PATH]
    screen.state.export.name = ""
    screen.press("Ctrl+Shift+E")
    assert len(screen.requests) == 3  # nothing that cannot be exported is asked for


def test_a_right_click_in_the_pad_adds_and_removes_key_frames(screen: Screen) -> None:
    place = screen.find_in_panel(lambda: (screen.state.u, screen.state.v) != (0.5, 0.5), "left")
    screen.move(*place)
    here = screen.state.u, screen.state.v
    screen.click(*place, button=1)
    (key,) = screen.state.export.key_frames
    assert (key.u, key.v) == pytest.approx(here)
    screen.click(*place, button=1)
    assert screen.state.export.key_frames == ()
    screen.press("Ctrl+1")
    screen.click(*place, button=1)
    assert screen.state.export.key_frames == ()  # only where the path is seen


@pytest.mark.parametrize("product", Product)
@pytest.mark.parametrize("shape", ["circle", KEY_FRAMES])
@pytest.mark.parametrize("scale", [1.0, 2.0])
def test_every_choice_is_drawn(screen: Screen, product: Product, shape: str, scale: float) -> None:
    export = screen.state.export
    screen.scale = scale
    has_focus = product in (Product.SWEEP, Product.QUILT)
    for height in (800.0, 2000.0):  # some of the tab, and all of it at once
        drawn = []
        for refocus in (False, True):
            export.product, export.shape, export.refocus = product, shape, refocus
            screen.size = (1280.0, height)
            screen.frame(3)
            assert (export.product, export.shape, export.refocus) == (product, shape, refocus)
            drawn.append(screen.drawn())
        assert (drawn[0] != drawn[1]) == has_focus
    assert not has_focus or len(drawn[1]) > len(drawn[0]) + 50 * 12  # not only a tick, but what is then asked for


def status(phase: Phase, done: int = 0, seconds: float = 0.0, message: str = "") -> Status:
    return Status(7, "a title", Path("/tmp/a.mp4"), 120, phase, done, seconds, message)


def test_the_button_exports_and_the_queue_can_be_cancelled_and_cleared(screen: Screen) -> None:
    panel = screen.layout.panel
    assert panel is not None
    screen.size = (1280.0, 2000.0)  # all of the tab at once
    screen.frame(3)
    screen.find_in_panel(lambda: ExportAction.EXPORT in screen.requests, "left")
    screen.readout = replace(screen.readout, exports=(status(Phase.RUNNING, 30, 10.0),))
    screen.frame(3)
    screen.find_in_panel(lambda: CancelExport(7) in screen.requests)
    screen.readout = replace(
        screen.readout, exports=(status(Phase.DONE, 120, 9.0), status(Phase.FAILED, message="full"), status(Phase.CANCELLED))
    )
    screen.frame(3)
    screen.find_in_panel(lambda: ExportAction.CLEAR in screen.requests, "left")


def test_progress_is_told_in_words() -> None:
    assert progress_words(status(Phase.WAITING)) == "Waiting"
    assert progress_words(status(Phase.RUNNING)) == "0 of 120"
    assert progress_words(status(Phase.RUNNING, 30, 10.0)) == "30 of 120, 3.0/s, 0:30 left"


# The program behind it.


@pytest.fixture
def controller(tmp_path: Path) -> Iterator[Controller]:
    models = {"truth": ModelChoice(TruthSynthesizer, False)}
    made = Controller(
        Engine(TruthSynthesizer, 2**24, name="truth"),
        lambda path, progress, cancelled: light_field(),
        wake=lambda: None,
        model="truth",
        models=models,
    )
    made.show_light_field(light_field())
    made.state.export.folder = str(tmp_path)
    yield made
    made.stop()


def test_an_export_is_made_and_told(controller: Controller, tmp_path: Path) -> None:
    export = controller.state.export
    export.frames, export.name = 4, "round"
    controller.exports.fulfil(ExportAction.EXPORT, export, controller.light_field, "truth")
    wait_until(lambda: not controller.exports.busy, "the export", 60)
    (told,) = controller.readout(None).exports
    assert (told.phase, told.done, told.message) == (Phase.DONE, 4, "")
    assert told.target == tmp_path / "round.mp4"
    assert told.target.stat().st_size > 0
    assert controller.exports.words(told.ended + 1) == "written: round.mp4"
    assert controller.exports.words(told.ended + 60) == ""
    with pytest.raises(InputError, match="cannot be used"):
        controller.exports.fulfil(ExportAction.EXPORT, export, controller.light_field, "unknown")


def test_an_export_that_fails_is_said_once(controller: Controller, tmp_path: Path) -> None:
    export = controller.state.export
    export.folder = str(tmp_path / "gone")
    controller.exports.fulfil(ExportAction.EXPORT, export, controller.light_field, "truth")
    wait_until(lambda: not controller.exports.busy, "the export", 60)
    controller.tick(1.0)
    assert len(controller.messages) == 1
    assert "gone" in controller.messages[0]
    controller.dismiss()
    controller.tick(2.0)
    assert controller.messages == []


def test_a_saved_path_comes_back_when_it_is_opened(controller: Controller, tmp_path: Path) -> None:
    export = controller.state.export
    export.add_key_frame(0.25, 0.5, 0.0)
    export.add_key_frame(1, 1, 0.0)
    export.name = "mine"
    plan = export.plan()
    controller.exports.fulfil(ExportAction.SAVE_PATH, export, controller.light_field, "truth")
    assert load_plan(tmp_path / "mine.json") == plan
    export.shape, export.name = "circle", "other"
    controller.open(tmp_path / "mine.json")
    assert export.plan() == plan
    assert (export.name, controller.state.tab) == ("mine", Tab.EXPORT)
    assert controller.messages == []


def test_a_broken_path_is_told(controller: Controller, tmp_path: Path) -> None:
    save_plan(tmp_path / "a.json", SweepPlan(ShapePath("circle", 0.3)))
    (tmp_path / "a.json").write_text((tmp_path / "a.json").read_text().replace("0.3", "0.9"))
    controller.open(tmp_path / "a.json")
    assert "radius" in controller.messages[0]


def test_the_preview_moves_the_viewpoint_until_it_is_dragged(controller: Controller, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Asking, "ask", lambda *_: None)  # a synthesis that comes would be faded in, frame by frame
    export = controller.state.export
    export.frames, export.fps = 8, 2
    stops = export.plan().stops()
    export.play()
    for second in range(4):
        controller.tick(100.0 + second)
        assert controller.viewpoint == pytest.approx((stops[2 * second].u, stops[2 * second].v))
        assert controller.next_frame_in == pytest.approx(0.5)
    controller.state.drag_to(0.9, 0.9)
    controller.tick(105.0)
    assert not export.playing
    assert controller.viewpoint == (0.9, 0.9)
    controller.state.dragging = False
    export.play()
    controller.tick(106.0)
    controller.tick(106.1)
    assert export.playing
    controller.state.move_to(0.5, 0.5)  # by a key
    controller.tick(107.0)
    assert not export.playing
    assert controller.viewpoint == (0.5, 0.5)


def test_the_preview_of_a_focus_sweep_refocuses(controller: Controller) -> None:
    export = controller.state.export
    export.refocus, export.focus, export.aperture, export.frames, export.fps = True, (-3.0, 5.0), 0.4, 8, 1
    export.play()
    controller.tick(10.0)
    controller.tick(14.0)  # a circle is back at the first focus in the end
    focusing = controller.state.focusing
    assert (focusing.focus, focusing.aperture, controller.state.look) == (pytest.approx(5.0), 0.4, Look.REFOCUS)


class Dialog:
    def __init__(self, answers: list[Answered | None]) -> None:
        self.answers = answers

    def poll(self) -> Answered | None:
        return self.answers.pop(0)


def test_the_folder_is_chosen_by_a_dialog(controller: Controller, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    export = controller.state.export
    controller.state.export.format = Format.PNG  # a folder of frames
    monkeypatch.setattr(dialogs, "available", lambda: False)
    with pytest.raises(InputError, match="type the folder"):
        controller.exports.fulfil(ExportAction.CHOOSE_FOLDER, export, controller.light_field, "truth")
    asked: list[Question] = []
    shown = Dialog([None, Answered(tmp_path / "chosen")])
    monkeypatch.setattr(dialogs, "available", lambda: True)
    monkeypatch.setattr(dialogs, "ask", lambda question, wake: (asked.append(question), shown)[1])
    for _ in range(2):  # the second while the first is open
        controller.exports.fulfil(ExportAction.CHOOSE_FOLDER, export, controller.light_field, "truth")
    assert [(question.purpose, question.start) for question in asked] == [(Purpose.OPEN_FOLDER, tmp_path)]
    controller.tick(1.0)
    assert export.folder == str(tmp_path)
    controller.tick(2.0)
    assert export.folder == str(tmp_path / "chosen")


def test_key_frames_stay_when_the_path_is_played(controller: Controller) -> None:
    export = controller.state.export
    export.add_key_frame(0.1, 0.2, 0.0)
    export.play()
    controller.tick(1.0)
    assert controller.viewpoint == (0.1, 0.2)
    assert export.key_frames == (Stop(0.1, 0.2, 0.0),)


def test_the_file_is_chosen_by_the_save_dialog(controller: Controller, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    export = controller.state.export
    export.folder, export.name = str(tmp_path), "rock sweep"
    asked: list[Question] = []
    shown = Dialog([Answered(tmp_path / "videos" / "walk.mp4")])
    monkeypatch.setattr(dialogs, "available", lambda: True)
    monkeypatch.setattr(dialogs, "ask", lambda question, wake: (asked.append(question), shown)[1])
    controller.exports.fulfil(ExportAction.CHOOSE_FOLDER, export, None, "")
    assert [(each.purpose, each.start, each.patterns) for each in asked] == [
        (Purpose.SAVE_FILE, tmp_path / "rock sweep.mp4", ("*.mp4",))
    ]
    controller.exports.follow_dialog(export)
    assert export.target_path == tmp_path / "videos" / "walk.mp4"


@pytest.mark.parametrize("value", [math.nan, -math.nan, math.inf, -math.inf])
def test_what_is_typed_and_no_number_changes_nothing(value: float) -> None:
    assert typed(value, 24.0, (0.1, 100.0)) == 24.0
    assert within(math.nan, (0.1, 100.0)) == 0.1
    assert [typed(each, 24.0, (0.1, 100.0)) for each in (-3.0, 7.0, 1e30)] == [0.1, 7.0, 100.0]


def test_the_size_of_a_saved_sweep_stays_whatever_it_is(screen: Screen) -> None:
    for scale in (0.50001, 0.5, 1.0, 0.123456, 2.9999999):
        screen.state.export.scale = scale
        screen.frame(2)
        assert screen.state.export.scale == scale


def test_any_folder_and_any_name_can_be_typed(screen: Screen, tmp_path: Path) -> None:
    export = screen.state.export
    closed = tmp_path / "closed"
    closed.mkdir()
    (closed / "inside").mkdir()
    closed.chmod(0)
    impossible = ("", "~nobody of this name", "a\0b")
    for folder in (*impossible, "~", str(closed / "inside"), str(tmp_path / "gone" / "x")):
        for name in ("sweep", "x" * 300, ".."):
            export.folder, export.name = folder, name
            with without_privileges():
                screen.frame(2)
                assert bool(export.fault) == (folder in impossible or name == "..")
    closed.chmod(0o700)


def test_a_picture_that_cannot_be_written_is_said(controller: Controller, tmp_path: Path) -> None:
    choices = controller.state.export
    choices.folder = str(tmp_path)
    controller.exports.save_picture(np.zeros((2, 2, 3), np.uint8), choices, "x" * 300)
    wait_until(lambda: not controller.exports.busy, "the export", 60)
    controller.tick(1.0)
    assert "x" * 300 in controller.messages[0]
    choices.folder = "~nobody of this name"
    with pytest.raises(InputError, match="unknown here"):
        controller.exports.save_picture(np.zeros((2, 2, 3), np.uint8), choices, "view")
