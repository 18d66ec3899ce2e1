"""What surrounds the picture: files and windows that are remembered, undo, dialogs, folders. Without a window."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import pytest
from moving_scene import TruthSynthesizer, light_field
from test_formats import plain, random_views, save_views
from test_watching import first_look

from app import dialogs
from app.commands import Action, Ask, Browse
from app.controller import Controller
from app.desk import Card, Folder
from app.dialogs import Answered, Purpose, Question
from app.engine import Engine
from app.geometry import Zoom
from app.history import RUN_SECONDS
from app.opening import open_by_content
from app.settings import Settings, SettingsFile, Theme, WindowPlace
from app.state import Look
from app.surroundings import SAVE_SECONDS, Keeping, Surroundings
from app.watching import Change, Watching
from lfcore.errors import InputError
from lfcore.lightfield import LightField

PATIENCE = 60.0


class Program:
    """A controller and what surrounds it, with a clock of its own. Light fields are named by their grids: "/a/3x3"."""

    def __init__(self, file: SettingsFile | None = None, settings: Settings | None = None) -> None:
        stored = settings or (file.load()[0] if file is not None else Settings())
        engine = Engine(lambda: TruthSynthesizer(), 64 * 2**20)
        self.controller = Controller(engine, self.opened, lambda: None, "truth")
        self.around = Surroundings(self.controller, lambda: None, Keeping(stored, None, file))
        self.now = 100.0
        self.tick()

    def opened(self, path: Path, progress: object, cancelled: Callable[[], bool]) -> LightField | Folder:
        if "x" in path.name:
            rows, columns = map(int, path.name.split("x"))
            return replace(light_field(rows, columns), source=str(path), name=path.name)
        found = open_by_content(path, lambda share: None, cancelled)
        assert isinstance(found, Folder)
        return found

    def tick(self, seconds: float = 0.02, holding: bool = False) -> None:
        self.now += seconds
        self.controller.tick(self.now)
        self.around.arrive()
        self.controller.tick(self.now)
        self.around.tick(self.now, holding)

    def until(self, condition: Callable[[], bool]) -> None:
        deadline = time.monotonic() + PATIENCE
        while not condition():
            assert time.monotonic() < deadline
            time.sleep(0.002)
            self.tick()

    def open(self, path: str) -> None:
        self.controller.open(Path(path))
        self.until(lambda: self.controller.name == Path(path).name)
        self.tick()

    def stop(self) -> None:
        self.around.stop()
        self.controller.stop()


@pytest.fixture
def file(tmp_path: Path) -> SettingsFile:
    return SettingsFile(tmp_path / "settings.json")


@pytest.fixture
def made() -> Iterator[list[Program]]:
    programs: list[Program] = []
    yield programs
    for program in programs:
        program.stop()


@pytest.fixture
def program(made: list[Program]) -> Program:
    made.append(Program())
    return made[0]


def test_a_file_is_looked_at_as_it_was_left_also_in_the_next_run(file: SettingsFile, made: list[Program]) -> None:
    first = Program(file)
    first.open("/a/3x3")
    state = first.controller.state
    state.move_to(0.25, 0.75)
    state.look, state.zoom, state.captured = Look.DISPARITY, Zoom(2.0, (0.25, 0.5)), True
    first.tick()
    first.open("/a/2x2")
    assert (state.u, state.v, state.zoom) == (0.5, 0.5, Zoom())
    first.open("/a/3x3")  # the same pixels, so the same file
    assert (state.u, state.v, state.look, state.zoom, state.captured) == (
        0.25,
        0.75,
        Look.DISPARITY,
        Zoom(2.0, (0.25, 0.5)),
        True,
    )
    first.stop()

    second = Program(SettingsFile(file.path))
    made.append(second)
    second.open("/elsewhere/3x3")  # wherever it lies
    state = second.controller.state
    assert (state.u, state.v, state.look, state.zoom, state.captured) == (
        0.25,
        0.75,
        Look.DISPARITY,
        Zoom(2.0, (0.25, 0.5)),
        True,
    )
    assert second.around.settings.recent == ("/elsewhere/3x3", "/a/3x3", "/a/2x2")


def test_what_is_chosen_in_the_window_comes_back(file: SettingsFile, made: list[Program]) -> None:
    first = Program(file)
    state = first.controller.state
    state.panel, state.foresight, state.desk.theme, state.desk.scale = False, False, Theme.LIGHT, 1.5
    state.model = "planesweep"
    first.tick = lambda *_: None  # type: ignore[method-assign]  # the controller knows no models here
    first.around.window = WindowPlace(5, 6, 700, 500)
    first.stop()
    second = Program(SettingsFile(file.path))
    made.append(second)
    state = second.controller.state
    assert (state.panel, state.foresight, state.desk.theme, state.desk.scale) == (False, False, Theme.LIGHT, 1.5)
    assert second.around.settings.model == "planesweep"
    assert second.around.settings.window == WindowPlace(5, 6, 700, 500)


def test_settings_are_written_a_while_after_a_change_and_not_while_nothing_changes(
    file: SettingsFile, made: list[Program]
) -> None:
    program = Program(file)
    made.append(program)
    program.tick(10 * SAVE_SECONDS)
    assert program.around.next_frame_in is None
    assert not file.path.exists()
    program.controller.state.panel = False
    program.tick()
    due = program.around.next_frame_in
    assert due is not None
    assert 0 < due <= SAVE_SECONDS + 0.01
    program.tick(SAVE_SECONDS)
    program.until(file.path.exists)
    assert SettingsFile(file.path).load()[0].panel is False
    program.tick(10 * SAVE_SECONDS)
    assert program.around.next_frame_in is None


def test_an_unwritable_place_is_said_once_and_the_program_lives_on(tmp_path: Path, made: list[Program]) -> None:
    (tmp_path / "blocked").write_text("a file")
    program = Program(SettingsFile(tmp_path / "blocked" / "settings.json"), Settings())
    made.append(program)
    for panel in (False, True, False):
        program.controller.state.panel = panel
        program.tick()
        program.tick(SAVE_SECONDS)
        program.tick(SAVE_SECONDS)
    program.until(lambda: bool(program.controller.messages))
    assert len(program.controller.messages) == 1
    assert "not kept" in program.controller.messages[0]
    program.open("/a/2x2")


def test_undo_and_redo_and_nothing_of_another_file(program: Program) -> None:
    program.open("/a/3x3")
    state = program.controller.state
    for u in (0.4, 0.3, 0.2):
        state.drag_to(u, 0.5)
        program.tick(holding=True)
    state.dragging = False
    program.tick()
    program.tick(RUN_SECONDS + 0.1)
    state.look = Look.DISPARITY
    program.tick()
    program.around.fulfil(Action.UNDO)
    assert (state.look, state.u) == (Look.SYNTHESIS, 0.2)
    program.around.fulfil(Action.UNDO)
    assert state.u == 0.5
    program.around.fulfil(Action.UNDO)
    program.around.fulfil(Action.REDO)
    assert state.u == 0.2
    program.open("/a/2x2")
    program.around.fulfil(Action.UNDO)
    assert (state.u, state.v) == (0.5, 0.5)


def test_a_file_that_has_changed_is_said_and_opened_again_as_it_was_looked_at(
    made: list[Program], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("app.surroundings.Watching", lambda wake: Watching(wake, 0.02))
    program = Program()
    made.append(program)
    (tmp_path / "3x3").write_text("a stand-in")
    looked = first_look(monkeypatch, tmp_path / "3x3")
    program.open(str(tmp_path / "3x3"))
    assert looked.wait(PATIENCE)
    (tmp_path / "3x3").write_text("another")
    program.until(lambda: bool(program.controller.messages))
    assert "has changed on disk" in program.controller.messages[0]
    program.controller.state.move_to(0.25, 0.5)
    program.tick()
    before = program.controller.light_field
    program.around.fulfil(Action.REOPEN)
    program.until(lambda: program.controller.light_field is not before)
    assert program.controller.state.u == 0.25


def test_recent_files_and_looks_can_be_forgotten(file: SettingsFile) -> None:
    program = Program(file)
    program.open("/a/3x3")
    program.controller.state.move_to(0.1, 0.1)
    program.tick()
    program.open("/a/2x2")
    program.around.fulfil(Action.FORGET)
    program.stop()
    kept = SettingsFile(file.path).load()[0]
    assert kept.recent == ()
    assert not kept.files


def test_a_folder_of_light_fields_is_shown_to_choose_from(program: Program, tmp_path: Path) -> None:
    scenes = [save_views(tmp_path / "all" / name, random_views(2, 2), plain) for name in ("a", "b")]
    program.controller.open(tmp_path / "all")
    desk = program.controller.state.desk
    program.until(lambda: desk.card is Card.BROWSER)
    assert program.around.shelf().folder == Folder(tmp_path / "all", tuple(scenes))
    thumbnail = program.around.shelf().thumbnail
    assert thumbnail(scenes[0]).caption == ""

    def seen() -> bool:
        return thumbnail(scenes[0]).caption == "2 × 2 views of 30 × 20 px"

    program.until(seen)
    program.open("/a/2x2")
    assert desk.card is None


def test_the_folder_around_what_is_open_is_listed(program: Program, tmp_path: Path) -> None:
    for name in ("a", "b"):
        save_views(tmp_path / name, random_views(2, 2), plain)
    program.open(str(tmp_path / "3x3"))
    program.around.fulfil(Browse(None))
    program.until(lambda: program.controller.folder is not None)
    assert program.controller.folder is not None
    assert program.controller.folder.path == tmp_path
    program.around.fulfil(Browse(tmp_path / "nowhere"))
    program.until(lambda: bool(program.controller.messages))
    assert "nowhere" in program.controller.messages[0]
    assert program.controller.state.desk.card is Card.BROWSER  # what was listed before stays


def test_several_dropped_files_are_shown_to_choose_from(program: Program) -> None:
    paths = [Path("/a/1"), Path("/b/2")]
    program.around.choose_among(paths)
    assert program.controller.folder == Folder(None, tuple(paths))
    assert program.controller.state.desk.card is Card.BROWSER


class MadeUpDialog:
    def __init__(self, answers: Sequence[Answered | None]) -> None:
        self.answers = list(answers)

    def poll(self) -> Answered | None:
        return self.answers.pop(0) if len(self.answers) > 1 else self.answers[0]

    def close(self) -> None:
        self.answers = [Answered(None)]


@pytest.mark.parametrize(
    ("answer", "opens", "field"),
    [(Answered(Path("/a/3x3")), "3x3", False), (Answered(None), "", False), (Answered(None, shown=False), "", True)],
)
def test_a_dialogs_answer_is_opened_or_the_path_field_takes_its_place(
    program: Program, monkeypatch: pytest.MonkeyPatch, answer: Answered, opens: str, field: bool
) -> None:
    asked: list[Question] = []

    def ask(question: Question, wake: Callable[[], None]) -> MadeUpDialog:
        asked.append(question)
        return MadeUpDialog([None, None, answer])

    monkeypatch.setattr(dialogs, "available", lambda: True)
    monkeypatch.setattr(dialogs, "ask", ask)
    for _ in range(2):  # the second finds one open already
        program.around.fulfil(Ask(Purpose.OPEN_FILE))
    for _ in range(5):
        program.tick()
    program.until(lambda: program.controller.name == opens)
    assert len(asked) == 1
    assert program.controller.state.path_field is field


def test_without_dialogs_the_path_field_is_shown(program: Program, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dialogs, "available", lambda: False)
    program.around.fulfil(Ask(Purpose.OPEN_FOLDER))
    assert program.controller.state.path_field


def test_looks_of_a_light_field_that_stands_in_for_another_are_not_kept(made: list[Program]) -> None:
    """While a raw capture is decoded, a coarse picture is shown; it is no file of its own."""
    program = Program()
    made.append(program)
    program.controller.previewing = True
    program.controller.light_field = light_field(2, 2)
    program.tick()
    assert program.around.settings.recent == ()


def test_a_name_beyond_text_is_survived(file: SettingsFile, made: list[Program]) -> None:
    program = Program(file)
    made.append(program)
    program.controller.open(Path(os.fsdecode(b"/tmp/\xff3x3")))
    program.until(lambda: bool(program.controller.messages) or bool(program.controller.name))
    with pytest.raises(InputError):
        open_by_content(Path(os.fsdecode(b"/tmp/\xff")), lambda share: None, lambda: False)


def test_no_frame_is_asked_for_once_a_change_has_been_taken_back(file: SettingsFile, made: list[Program]) -> None:
    program = Program(file)
    made.append(program)
    program.open("/a/3x3")
    program.tick(SAVE_SECONDS)
    program.tick(SAVE_SECONDS)
    assert program.around.next_frame_in is None
    program.controller.state.move_to(0.25, 0.5)
    program.tick()
    assert program.around.next_frame_in is not None
    program.controller.state.move_to(0.5, 0.5)
    program.tick()
    assert program.around.next_frame_in is None


def test_the_browser_shows_where_what_is_open_lies_and_begins_with_it(program: Program, tmp_path: Path) -> None:
    for folder in ("first", "second"):
        for name in ("2x2", "3x3"):
            save_views(tmp_path / folder / name, random_views(2, 2), plain)
    state, first, second = program.controller.state, tmp_path / "first", tmp_path / "second"

    def browse() -> Folder:
        state.desk.card = None
        program.around.fulfil(Browse(None))
        program.until(lambda: state.desk.card is Card.BROWSER)
        assert program.controller.folder is not None
        return program.controller.folder

    program.open(str(first / "3x3"))
    assert browse().path == first and state.desk.chosen == 1
    program.open(str(second / "2x2"))
    assert browse().path == second and state.desk.chosen == 0
    program.open(str(second / "3x3"))
    assert browse().path == second and state.desk.chosen == 1


def test_what_was_said_of_a_file_is_taken_back_when_another_is_open(program: Program) -> None:
    program.open("/a/3x3")
    program.around._watching._news.put((Path("/a/3x3"), Change.CHANGED))
    program.tick()
    assert len(program.controller.messages) == 1 and "Ctrl+R" in program.controller.messages[0]
    program.controller.say("something else")
    program.open("/a/2x2")
    assert program.controller.messages == ["something else"]


def test_foresight_that_the_command_line_switched_off_is_on_the_next_time(file: SettingsFile) -> None:
    def run(foresight: bool) -> bool:
        controller = Controller(Engine(lambda: TruthSynthesizer(), 2**20), lambda *_: light_field(), lambda: None, "truth")
        controller.state.foresight = foresight
        around = Surroundings(controller, lambda: None, Keeping(file.load()[0], None, file))
        around.tick(1.0, False)
        was = controller.state.foresight
        around.stop()
        controller.stop()
        return was

    assert not run(False)
    assert run(True)
