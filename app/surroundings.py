"""What surrounds the picture: settings, undo, dialogs, recent files, folders to choose from and their thumbnails.

No GL, no imgui, no glfw. The frame loop calls `tick` once a frame, and hands it the requests that are meant for it.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from app import dialogs
from app.commands import Action, Ask, Browse, Request
from app.controller import Controller
from app.desk import Card, Folder, Placed, Shelf, Thumbnail
from app.dialogs import Purpose, Question
from app.exhibits import Exhibition
from app.gallery import Gallery, Seen
from app.history import History
from app.opening import SHIPPED, folder_around, list_folder
from app.settings import Settings, SettingsFile, Theme, WindowPlace
from app.snapshot import Snapshot, put_back, take
from app.state import ViewState
from app.watching import Watching
from app.worker import Cancel, Done, Failed, LatestWorker
from assets import sample_path
from lfcore.errors import InputError, OutputError
from lfcore.lightfield import LightField

if TYPE_CHECKING:  # the readers of files are loaded when they are needed
    from lfcore.thumbnails import ThumbnailStore

SAVE_SECONDS = 3.0  # after a change, settings are written
STOP_SECONDS = 3.0
PATTERNS = (
    "*.lfp",
    "*.LFP",
    "*.lfr",
    "*.LFR",
    "*.png",
    "*.webp",
    "*.jpg",
    "*.jpeg",
    "*.tif",
    "*.tiff",
    "*.exr",
    "*.mat",
    "*.h5",
)


@dataclass(frozen=True)
class Keeping:
    """What was kept from the last run, and where things are kept for the next; a file or store of None keeps nothing."""

    settings: Settings = field(default_factory=Settings)
    fault: str | None = None  # why the settings could not be read
    file: SettingsFile | None = None
    thumbnails: Callable[[], ThumbnailStore] | None = None


@dataclass(frozen=True)
class _Noted:
    """What the person chooses in the window that is kept in the settings."""

    panel: bool
    foresight: bool
    theme: Theme
    scale: float | None
    model: str


class Surroundings:
    """All methods belong to the main thread, and none waits but `stop` and `save_now`."""

    def __init__(self, controller: Controller, wake: Callable[[], None], keeping: Keeping | None = None) -> None:
        keeping = keeping or Keeping()
        self.controller = controller
        self.settings = keeping.settings
        self.window: WindowPlace | None = None  # where the window is now, if it is to be kept
        self.picture_of: Callable[[Seen], Placed | None] = lambda seen: None  # the interface knows where pictures lie
        self._file = keeping.file
        self._gallery = Gallery(keeping.thumbnails, wake)
        self._history = History()
        self._watching = Watching(wake)
        self._change: str | None = None  # what has last been said of the open file
        self._dialog: dialogs.Dialog | None = None
        self._wake = wake
        self._lister: LatestWorker[Folder] = LatestWorker("folders", wake)
        self._saver: LatestWorker[None] = LatestWorker("settings", wake)
        self._open: LightField | Exhibition | None = None  # at the last tick
        self._left: Snapshot | None = None  # how it was looked at then
        self._wanted: dict[Path, None] = {}  # asked for in this frame, in order
        state = controller.state
        state.panel, state.foresight = self.settings.panel, self.settings.foresight and state.foresight
        state.desk.theme, state.desk.scale = self.settings.theme, self.settings.scale
        self._noted = self._now_chosen()
        self._saved = self.settings
        self._save_at: float | None = None
        self._now = 0.0
        if keeping.fault is not None:
            controller.say(keeping.fault)

    def stop(self) -> None:
        """End the threads, and write the settings."""
        if self._dialog is not None:
            self._dialog.close()
        self._watching.stop(STOP_SECONDS)
        self._gallery.stop(STOP_SECONDS)
        self._lister.stop(STOP_SECONDS)
        self._saver.stop(STOP_SECONDS)
        self.save_now()

    def save_now(self) -> None:
        """Write the settings here and now; a fault has nobody left to be told to."""
        self._note()
        settings = self._with_open_file()
        if self.window is not None:
            settings = replace(settings, window=self.window)
        if self._file is not None:
            with contextlib.suppress(OutputError):
                self._file.save(settings)

    # Once a frame.

    def tick(self, now: float, holding: bool) -> None:
        """Follow what has happened since the last frame. holding: a hand holds a button. `now` in seconds."""
        self._now = now
        self._gallery.want(list(self._wanted))
        self._wanted.clear()
        self._follow_dialog()
        self._follow_folders()
        self._follow_saver()
        change = self._watching.news()
        if change is not None:
            self._change = change
            self.controller.say(change)
        self.arrive()
        controller = self.controller
        if isinstance(self._open, LightField) and controller.light_field is self._open:
            self._left = take(controller.state)
            self._history.observe(self._left, now, holding)
        self._keep(now)

    def arrive(self) -> None:
        """Where another light field has just been opened, look at it as it was looked at the last time."""
        controller = self.controller
        opened = controller.light_field or controller.exhibition
        if opened is self._open or controller.previewing:
            return
        self.settings = self._with_open_file()
        self.controller.unsay(self._change)  # it was about what has been open until now
        before, left = self._open, self._left
        self._open, self._left = opened, None
        self._watching.follow(Path(opened.source).absolute() if opened is not None else None)
        if opened is None:
            return
        if controller.state.desk.card is Card.BROWSER:
            controller.state.desk.card = None
        if not _is_sample(opened.source):
            self.settings = self.settings.with_recent(str(Path(opened.source).absolute()))
        if isinstance(opened, LightField):
            again = before is not None and before.source == opened.source  # with other contents, perhaps
            put_back(controller.state, self.settings.files.get(opened.content_key) or (left if again and left else {}))
            self._history.start(take(controller.state))

    @property
    def next_frame_in(self) -> float | None:
        """Seconds until something is to be done by itself, or None."""
        return None if self._save_at is None else max(self._save_at - self._now, 0.0) + 1e-3

    @property
    def all_seen(self) -> bool:
        """Whether a folder is shown, and every light field that is in sight."""
        return self.controller.folder is not None and self._gallery.complete

    def shelf(self) -> Shelf:
        """What the panels list."""
        recent = tuple(map(Path, self.settings.recent))
        return Shelf(recent, self.controller.folder, self._lister.busy, self._thumbnail)

    def _thumbnail(self, path: Path) -> Thumbnail:
        self._wanted[path] = None
        seen = self._gallery.seen(path)
        if seen is None:
            return Thumbnail()
        caption = "" if seen.glance is None else seen.glance.caption
        return Thumbnail(caption, seen.reason, self.picture_of(seen))

    # What the person asks for.

    def fulfil(self, request: Request) -> None:
        """Do what is asked, where it is this module's to do."""
        if isinstance(request, Ask):
            self._ask(request.purpose)
        elif isinstance(request, Browse):
            self._browse(request.folder)
        elif request is Action.UNDO:
            self._put(self._history.undo())
        elif request is Action.REDO:
            self._put(self._history.redo())
        elif request is Action.REOPEN:
            opened = self.controller.light_field or self.controller.exhibition
            if opened is not None:
                self.controller.open(Path(opened.source).absolute())
        elif request is Action.FORGET:
            self.settings = replace(self.settings, recent=(), files={})
            self._left = None

    def choose_among(self, paths: Sequence[Path]) -> None:
        """Several files and folders were dropped."""
        self._show(Folder(None, tuple(paths)))

    def _put(self, snapshot: Snapshot | None) -> None:
        if snapshot is not None:
            put_back(self.controller.state, snapshot)

    def _ask(self, purpose: Purpose) -> None:
        state = self.controller.state
        if self._dialog is not None:
            return  # one is open already
        title = "Open a folder" if purpose is Purpose.OPEN_FOLDER else "Open a light field"
        question = Question(purpose, title, self._start_folder(), "Light fields", PATTERNS)
        try:
            self._dialog = dialogs.ask(question, self._wake) if dialogs.available() else None
        except OSError:
            self._dialog = None
        if self._dialog is None:
            state.path_field = True

    def _follow_dialog(self) -> None:
        answer = self._dialog.poll() if self._dialog is not None else None
        if answer is None:
            return
        self._dialog = None
        if answer.path is not None:
            self.controller.open(answer.path)
        elif not answer.shown:
            self.controller.state.path_field = True

    def _start_folder(self) -> Path:
        """Where a dialog begins: in the folder that is shown, or beside what is open or was opened last."""
        shown = self.controller.folder
        if self.controller.state.desk.card is Card.BROWSER and shown is not None and shown.path is not None:
            return shown.path
        source = self._source()
        return source.parent if source is not None else Path.home()

    def _source(self) -> Path | None:
        opened = self.controller.light_field or self.controller.exhibition
        if opened is not None and not _is_sample(opened.source):
            return Path(opened.source).absolute()
        return Path(self.settings.recent[0]) if self.settings.recent else None

    def _browse(self, folder: Path | None) -> None:
        source = self._source()
        listed = self.controller.folder
        if folder is None and listed is not None and (source is None or listed.member_with(source) is not None):
            self._gallery.forget()
            folder = listed.path
            if folder is None:
                return

        def job(cancelled: Cancel) -> Folder:
            if folder is not None:
                return list_folder(folder)
            if source is None:
                raise InputError("Only the sample was opened yet, which lies in no folder of yours: choose another folder.")
            return list_folder(folder_around(source))

        self._lister.submit(job)

    def _follow_folders(self) -> None:
        while not self._lister.outcomes.empty():
            outcome = self._lister.outcomes.get()
            if isinstance(outcome, Done):
                self._show(outcome.value)
            else:
                self.controller.say(outcome.message)
                if self.controller.folder is None and self.controller.state.desk.card is Card.BROWSER:
                    self.controller.state.desk.card = None

    def _show(self, folder: Folder) -> None:
        self.controller.folder = folder
        desk = self.controller.state.desk
        desk.card = None  # so that the choice begins anew
        desk.show(Card.BROWSER)
        source = self._source()
        desk.chosen = (source is not None and folder.member_with(source)) or 0

    # Settings.

    def _keep(self, now: float) -> None:
        """Have what has changed written after a while."""
        self._note()
        changed = self.settings is not self._saved or self._with_open_file() is not self.settings
        if not changed or self._file is None:
            self._save_at = None  # what had changed has been taken back
            return
        if self._save_at is None:
            self._save_at = now + SAVE_SECONDS
        elif now >= self._save_at:
            self._save_at = None
            self.settings = self._saved = self._with_open_file()
            file, settings = self._file, self.settings
            self._saver.submit(lambda cancelled: file.save(settings))

    def _with_open_file(self) -> Settings:
        """The settings, with how the open light field is looked at."""
        if not isinstance(self._open, LightField) or self._left is None:
            return self.settings
        key = self._open.content_key
        if self._left == self.settings.files.get(key, _UNTOUCHED):
            return self.settings
        return self.settings.with_file(key, self._left)

    def _note(self) -> None:
        """Take over into the settings what the person has chosen in the window since the last time."""
        chosen, before = self._now_chosen(), self._noted
        if chosen == before:
            return
        self._noted = chosen
        changes = {name: value for name, value in vars(chosen).items() if value != getattr(before, name)}
        self.settings = replace(self.settings, **changes)

    def _now_chosen(self) -> _Noted:
        state = self.controller.state
        model = state.model if state.model in SHIPPED else ""
        return _Noted(state.panel, state.foresight, state.desk.theme, state.desk.scale, model)

    def _follow_saver(self) -> None:
        while not self._saver.outcomes.empty():
            outcome = self._saver.outcomes.get()
            if isinstance(outcome, Failed):
                self.controller.say(outcome.message)


_UNTOUCHED = take(ViewState())


def _is_sample(source: str) -> bool:
    return Path(source) == sample_path()
