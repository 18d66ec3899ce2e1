"""What the program does about exports: fulfils what the tab asks for, and tells how far the queue is."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from app import dialogs
from app.engine import ModelChoice
from app.export_choices import ExportChoices
from app.export_requests import CancelExport, ExportAction, ExportRequest
from app.exporting import ExportQueue, Phase, Status
from app.readable import readable
from app.typed_paths import expanded
from lfcore.errors import InputError
from lfcore.lightfield import LightField
from lfcore.sweep_plan import load_plan, save_plan

if TYPE_CHECKING:
    from lfcore.synthesizer import Synthesizer


_SHOWN_SECONDS = 6.0


class Exports:
    """The export queue and the models that it uses. All methods belong to the main thread; `hand_waits`, which says whether the
    person waits for a view, and `wake` are called from the queue's."""

    def __init__(self, models: Mapping[str, ModelChoice], wake: Callable[[], None], hand_waits: Callable[[], bool]) -> None:
        self._models = models
        self._queue = ExportQueue(wake)
        self._wake = wake
        self._hand_waits = hand_waits
        self._told: set[int] = set()  # exports whose end is known
        self._dialog: dialogs.Dialog | None = None  # for the place of the export, while it is open
        self._asked = dialogs.Purpose.OPEN_FOLDER  # by that dialog
        self._made: dict[str, Synthesizer] = {}  # in the queue's thread; the one used last

    @property
    def statuses(self) -> tuple[Status, ...]:
        """All jobs, in the order in which they came."""
        return self._queue.statuses

    @property
    def _targets(self) -> frozenset[Path]:
        """Of the jobs that are not over."""
        return frozenset(status.target for status in self.statuses if not status.phase.over)

    @property
    def busy(self) -> bool:
        """Whether something is being exported."""
        return self._queue.busy

    def faults(self) -> list[str]:
        """Why exports have failed since the last call."""
        over = {status.number: status for status in self.statuses if status.phase.over}
        new = [status for number, status in over.items() if number not in self._told]
        self._told = set(over)
        return [status.message for status in new if status.phase is Phase.FAILED]

    def words(self, now: float) -> str:
        """How far the queue is, or, for a while, what has just been written. `now` in seconds, monotonic."""
        statuses = self.statuses
        running = next((status for status in statuses if status.phase is Phase.RUNNING), None)
        if running is not None:
            return f"exporting {readable(running.target.name)}, {running.done} of {running.total}"
        last = statuses[-1] if statuses else None
        if last is not None and last.phase is Phase.DONE and now - last.ended < _SHOWN_SECONDS:
            return f"written: {readable(last.target.name)}"
        return ""

    def fulfil(self, request: ExportRequest, choices: ExportChoices, light_field: LightField | None, model: str) -> None:
        """Do what was asked for, but saving a picture. Raises LfviewError where it is impossible as chosen."""
        if isinstance(request, CancelExport):
            self._queue.cancel(request.number)
        elif request is ExportAction.CANCEL_ALL:
            for status in self.statuses:
                self._queue.cancel(status.number)
        elif request is ExportAction.CLEAR:
            self._queue.clear()
        elif request is ExportAction.CHOOSE_FOLDER:
            self._ask_place(choices)
        elif request is ExportAction.SAVE_PATH:
            save_plan(plan_file(choices), choices.plan())
        elif request is ExportAction.EXPORT and light_field is not None:
            self._begin(choices, light_field, choices.model or model)

    def save_picture(self, pixels: npt.NDArray[np.uint8], choices: ExportChoices, stem: str) -> None:
        """Write the picture as shown, uint8 (H, W, 3), into the folder of the exports. LfviewError where it cannot be."""
        from app.export_jobs import picture_job

        self._queue.add(picture_job(pixels, expanded(choices.folder), stem, self._targets))

    def follow_dialog(self, choices: ExportChoices) -> None:
        """Take the folder that was chosen in the dialog, once it has been."""
        answer = self._dialog.poll() if self._dialog is not None else None
        if answer is None:
            return
        self._dialog = None
        if answer.path is None:
            return
        if self._asked is dialogs.Purpose.SAVE_FILE:
            choices.folder, choices.name = str(answer.path.parent), answer.path.name.removesuffix(choices.target_path.suffix)
        else:
            choices.folder = str(answer.path)
        choices.folder, choices.name = readable(choices.folder), readable(choices.name)

    def stop(self, timeout: float) -> None:
        """End the thread; what is not finished is given up."""
        if self._dialog is not None:
            self._dialog.close()
        self._queue.stop(timeout)

    def _ask_place(self, choices: ExportChoices) -> None:
        """The file that is to be made, or the folder for what is a folder itself."""
        if self._dialog is not None:
            return  # one is open already
        if not dialogs.available():
            raise InputError("This system has no dialog for folders (zenity or kdialog): type the folder's path.")
        target = choices.target_path
        if not choices.is_folder:
            self._asked = dialogs.Purpose.SAVE_FILE
            question = dialogs.Question(self._asked, "Export to", target, target.suffix[1:], (f"*{target.suffix}",))
        else:  # a folder of frames or views
            self._asked = dialogs.Purpose.OPEN_FOLDER
            question = dialogs.Question(self._asked, "Folder for exports", expanded(choices.folder))
        try:
            self._dialog = dialogs.ask(question, self._wake)
        except OSError as error:
            raise InputError(
                f"The dialog for folders could not be opened ({error.strerror}): type the folder's path."
            ) from error

    def _begin(self, choices: ExportChoices, light_field: LightField, model: str) -> None:
        from app.export_jobs import Source, chosen_job

        if model not in self._models:
            raise InputError(f"The model {model} cannot be used for exports; choose another one.")
        source = Source(light_field, model, partial(self._synthesizer, model), self._hand_waits)
        self._queue.add(chosen_job(choices, source))

    def _synthesizer(self, model: str) -> Synthesizer:
        """The model, loaded; only one is kept."""
        if model not in self._made:
            self._made = {model: self._models[model].make()}
        return self._made[model]


def plan_file(choices: ExportChoices) -> Path:
    """Where the sweep is saved as JSON: beside the export, under its name. Raises InputError as `expanded`."""
    return expanded(choices.folder) / f"{choices.name}.json"


def take_plan(path: Path, choices: ExportChoices) -> None:
    """Choose what a saved sweep says. Raises InputError where it is none."""
    plan = load_plan(path)
    choices.take(plan)
    choices.name = readable(path.stem)
