"""The curve of a training run, as CSV and as a picture."""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from lfcore.atomic import atomic_path


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


def write_curve(folder: Path, curve: Sequence[CurvePoint]) -> None:
    """Write curve.csv."""
    names = sorted({name for point in curve for name in point.scores})
    with atomic_path(folder / "curve.csv") as temporary, temporary.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["step", "seconds", "learning_rate", "loss", *names])
        for point in curve:
            scores = [f"{point.scores[name]:.3f}" if name in point.scores else "" for name in names]
            writer.writerow([point.step, round(point.seconds), f"{point.learning_rate:.3g}", f"{point.loss:.3g}", *scores])
