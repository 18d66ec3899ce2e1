"""The curve of a training run, as CSV and as a picture."""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from lfcore.atomic import atomic_path
from lfcore.distinct import unused
from lfcore.errors import InputError

_LARGEST_FILE = 16 * 2**20  # bytes; a curve has a line per validation
_COLUMNS = ("step", "seconds", "learning_rate", "loss")  # those of scenes come after


@dataclass(frozen=True)
class CurvePoint:
    """One validation: K16 PSNR of each held-out light field."""

    step: int
    seconds: float
    learning_rate: float
    loss: float  # mean squared error on training patches, running average
    scores: Mapping[str, float]

    @property
    def mean(self) -> float:
        """Mean PSNR over the held-out light fields, or minus infinity where there is none."""
        return sum(self.scores.values()) / len(self.scores) if self.scores else -math.inf


def column_names(names: Sequence[str]) -> list[str]:
    """Names of held-out light fields by which their scores are told apart: a second one of a name is numbered, and so is one
    that is called like another column."""
    taken = set(_COLUMNS)
    return [unused(name, taken) for name in names]


def write_curve(folder: Path, curve: Sequence[CurvePoint]) -> None:
    """Write curve.csv."""
    names = sorted({name for point in curve for name in point.scores})
    with atomic_path(folder / "curve.csv") as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow([*_COLUMNS, *names])
        for point in curve:
            scores = [f"{point.scores[name]:.3f}" if name in point.scores else "" for name in names]
            writer.writerow([point.step, round(point.seconds), f"{point.learning_rate:.3g}", f"{point.loss:.3g}", *scores])


def read_curve(path: Path) -> list[CurvePoint]:
    """Read a curve.csv. Raises InputError where there is none, or where the file is something else."""
    if not path.is_file():
        raise InputError(f"No training curve found at {path}; give the curve.csv of a run folder of `lfview train`.")
    if path.stat().st_size > _LARGEST_FILE:
        raise InputError(f"{path} has {path.stat().st_size / 2**20:.0f} MiB, too much for a training curve.")
    try:
        with path.open(newline="", encoding="utf-8") as file:
            table = csv.DictReader(file, strict=True)
            if missing := set(_COLUMNS) - set(table.fieldnames or ()):
                raise ValueError(f"no column {min(missing)}")
            rows = list(table)
        return [
            CurvePoint(
                int(row["step"]),
                float(row["seconds"]),
                float(row["learning_rate"]),
                float(row["loss"]),
                {name: float(text) for name, text in row.items() if name not in _COLUMNS and text},
            )
            for row in rows
        ]
    except (KeyError, TypeError, ValueError, csv.Error) as error:
        raise InputError(f"{path} is not a training curve (columns step, seconds, learning_rate, loss, scenes).") from error
