"""From what was chosen to jobs for the export queue; the views come from a model that gives way to the hand."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Collection
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from app.export_choices import ExportChoices, Product
from app.exporting import Cancel, Done, Job
from lfcore.errors import Cancelled, OutputError
from lfcore.export import write_picture
from lfcore.lightfield import FloatArray, LightField
from lfcore.quilt import Quilt
from lfcore.sweep_plan import SweepPlan
from lfcore.sweep_target import Target
from lfcore.synthesized_grid import check_grid_target, check_quilt_target, write_eslf, write_quilt, write_views

if TYPE_CHECKING:
    from lfcore.synthesizer import Synthesis, Synthesizer

_GIVE_WAY_SECONDS = 0.01
_MOST_NAMES = 10_000


class Polite:
    """A synthesizer that waits while the hand waits for a view, and gives up what it has begun when the hand moves."""

    def __init__(self, synthesizer: Synthesizer, hand_waits: Callable[[], bool], cancelled: Cancel) -> None:
        self._synthesizer = synthesizer
        self._hand_waits = hand_waits
        self._cancelled = cancelled
        self.name, self.key = synthesizer.name, synthesizer.key

    def set_light_field(self, light_field: LightField) -> None:
        """As Synthesizer."""
        self._synthesizer.set_light_field(light_field)

    def synthesize(self, u: float, v: float, cancelled: Cancel = lambda: False) -> Synthesis:
        """As Synthesizer; raises Cancelled once this or the export is."""
        while True:
            while self._hand_waits():
                self._check(cancelled)
                time.sleep(_GIVE_WAY_SECONDS)
            self._check(cancelled)
            try:
                return self._synthesizer.synthesize(u, v, lambda: self._cancelled() or cancelled() or self._hand_waits())
            except Cancelled:
                self._check(cancelled)

    def _check(self, cancelled: Cancel) -> None:
        if self._cancelled() or cancelled():
            raise Cancelled


@dataclass(frozen=True)
class Source:
    """Where the views of an export come from. `make` is called in the queue's thread."""

    light_field: LightField
    model: str
    make: Callable[[], Synthesizer]
    hand_waits: Callable[[], bool]

    def polite(self, cancelled: Cancel) -> Polite:
        """The model, without the light field."""
        return Polite(self.make(), self.hand_waits, cancelled)


def chosen_job(choices: ExportChoices, source: Source) -> Job:
    """The job of what is chosen now. Raises InputError where that is impossible."""
    light_field, path = source.light_field, choices.target_path
    if choices.product is Product.SWEEP:
        return sweep_job(choices.plan(), choices.target, source)
    if choices.product is Product.QUILT:
        quilt = choices.quilt
        named = choices.made((light_field.width, light_field.height))
        write = partial(_write_quilt, path, quilt, source)
        return Job(f"Quilt of {quilt.columns} × {quilt.rows} views, {source.model}", named, quilt.columns * quilt.rows, write)
    side = choices.side
    title = f"{side} × {side} views, {source.model}"
    return Job(title, path, side**2, partial(_write_grid, path, side, source))


def sweep_job(plan: SweepPlan, target: Target, source: Source) -> Job:
    """A sweep."""
    title = f"{plan.frames} frames of {plan.layer.value}, {source.model}"
    return Job(title, target.path, plan.frames, partial(_write_sweep, plan, target, source))


def picture_job(pixels: npt.NDArray[np.uint8], folder: Path, stem: str, taken: Collection[Path]) -> Job:
    """The picture as shown, uint8 (H, W, 3), as PNG under a name that is not taken yet, nor will be by jobs that wait."""
    target = free_name(folder, stem, ".png", taken)

    def write(done: Done, cancelled: Cancel) -> None:
        write_picture(target, pixels)
        done(1)

    return Job("Picture as shown", target, 1, write)


def free_name(folder: Path, stem: str, extension: str, taken: Collection[Path] = ()) -> Path:
    """A path in the folder that does not exist and is not `taken`: the stem, or the stem and a number. Raises OutputError where
    all are."""
    for number in range(1, _MOST_NAMES):
        path = folder / (f"{stem}{extension}" if number == 1 else f"{stem} {number}{extension}")
        if path not in taken and not os.path.lexists(path):
            return path
    raise OutputError(f"{folder} holds {_MOST_NAMES} pictures named {stem}; choose another folder.")


def _write_sweep(plan: SweepPlan, target: Target, source: Source, done: Done, cancelled: Cancel) -> None:
    # Imported in the queue's thread, since encoders are slow to load.
    from lfcore.sweep_export import check_target, export_sweep
    from lfcore.sweep_frames import SweepFrames, remembering

    check_target(plan, target)  # before the model is loaded
    frames = SweepFrames(plan, source.light_field, remembering(source.light_field, source.polite(cancelled)))
    export_sweep(frames, target, done, cancelled)


def _write_grid(path: Path, side: int, source: Source, done: Done, cancelled: Cancel) -> None:
    check_grid_target(path, side, source.light_field)
    view = _views(source, cancelled)
    if path.suffix.lower() == ".png":
        write_eslf(path, side, source.light_field, view, done, cancelled)
    else:
        write_views(path, side, view, done, cancelled)


def _write_quilt(path: Path, quilt: Quilt, source: Source, done: Done, cancelled: Cancel) -> None:
    named = check_quilt_target(path, quilt, source.light_field)
    write_quilt(named, quilt, source.light_field, _views(source, cancelled), done, cancelled)


def _views(source: Source, cancelled: Cancel) -> Callable[[float, float], FloatArray]:
    synthesizer = source.polite(cancelled)
    synthesizer.set_light_field(source.light_field)
    return lambda u, v: synthesizer.synthesize(u, v).image
