"""Score a model on light fields whose captured views are known: by the paper's protocol K16, from the four corners."""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from lfcore import colormaps
from lfcore.figures import ByteArray, Cell, Legend, disparity_cell, figure
from lfcore.lightfield import FloatArray, LightField
from lfcore.metrics import absolute_error, k16, k16_view, to_uint8

if TYPE_CHECKING:
    from lfcore.synthesizer import Synthesis, Synthesizer

PROTOCOL = "K16"
ERROR_GAIN = 8


@dataclass(frozen=True)
class SceneScore:
    """One scene by one model: PSNR in dB, SSIM, and the seconds that the synthesis took on this machine."""

    name: str
    psnr: float
    ssim: float
    seconds: float


@dataclass(frozen=True)
class Evaluation:
    """All scenes by one model."""

    model: str
    machine: str
    scenes: tuple[SceneScore, ...]

    @property
    def mean_psnr(self) -> float:
        """Mean of the scenes' PSNR in dB, as the paper averages."""
        return statistics.fmean(scene.psnr for scene in self.scenes)

    @property
    def mean_ssim(self) -> float:
        """Mean of the scenes' SSIM."""
        return statistics.fmean(scene.ssim for scene in self.scenes)

    def as_json(self) -> dict[str, Any]:
        """The evaluation in JSON's types; an infinite PSNR (equal pictures) becomes null, which JSON can hold."""
        return {
            "protocol": PROTOCOL,
            "model": self.model,
            "machine": self.machine,
            "scenes": [
                {
                    "name": scene.name,
                    "psnr": _finite(scene.psnr, 4),
                    "ssim": _finite(scene.ssim, 6),
                    "seconds": round(scene.seconds, 4),
                }
                for scene in self.scenes
            ],
            "mean": {"psnr": _finite(self.mean_psnr, 4), "ssim": _finite(self.mean_ssim, 6)},
        }


@dataclass(frozen=True)
class SceneResult:
    """A scene's score with the pictures behind it."""

    score: SceneScore
    view: tuple[int, int]  # (row, column) of the captured view, from 0
    truth: FloatArray  # (H, W, 3)
    synthesis: Synthesis


def evaluate_scene(light_field: LightField, synthesizer: Synthesizer) -> SceneResult:
    """Synthesize the protocol's view from the corners alone and score it. InputError where there is none to score."""
    row, column = k16_view(light_field)
    truth = light_field.view(row, column)
    synthesizer.set_light_field(light_field)
    start = time.perf_counter()
    synthesis = synthesizer.synthesize(*light_field.position(row, column))
    seconds = time.perf_counter() - start
    score = k16(synthesis.image, truth)
    return SceneResult(SceneScore(light_field.name, score.psnr, score.ssim, seconds), (row, column), truth, synthesis)


def scene_figure(light_field: LightField, result: SceneResult) -> ByteArray:
    """Truth, synthesis, error and disparity side by side, two by two, labelled: uint8 (H, W, 3)."""
    row, column = result.view
    score, synthesis = result.score, result.synthesis
    error = absolute_error(synthesis.image, result.truth)
    error_colours = colormaps.error_colours()
    return figure(
        [
            Cell(
                to_uint8(result.truth),
                f"{score.name}: captured view {row + 1}, {column + 1} of {light_field.rows} x {light_field.columns}",
            ),
            Cell(
                to_uint8(synthesis.image),
                f"synthesis, {synthesis.model}: {score.psnr:.2f} dB, SSIM {score.ssim:.4f} ({PROTOCOL})",
            ),
            Cell(
                colormaps.apply(error_colours, error, 0, 1 / ERROR_GAIN),
                f"absolute error, mean of the channels, gain {ERROR_GAIN}",
                Legend(error_colours, "0", f"{255 / ERROR_GAIN:.0f} of 255 or more"),
            ),
            _disparity_cell(synthesis, result.truth.shape[:2]),
        ],
        columns=2,
    )


def _disparity_cell(synthesis: Synthesis, size: tuple[int, ...]) -> Cell:
    if synthesis.disparity is None:
        return Cell(np.full((*size, 3), 48, np.uint8), f"no disparity (model {synthesis.model})")
    return disparity_cell(synthesis.disparity)


def score_table(evaluations: Sequence[Evaluation]) -> str:
    """Scores as text: a heading with protocol and machine, a line per scene, the mean last; models side by side."""
    names = [scene.name for scene in evaluations[0].scenes]
    first = max(len(name) for name in (*names, "scene"))
    widths = [max(26, len(evaluation.model)) for evaluation in evaluations]
    titles = "  ".join(f"{e.model:>{width}}" for e, width in zip(evaluations, widths, strict=True))
    columns = "  ".join(f"{'dB':>{width - 18}} {'SSIM':>7} {'seconds':>9}" for width in widths)
    lines = [
        f"{PROTOCOL} on {evaluations[0].machine}",
        f"{'':<{first}}  {titles}",
        f"{'scene':<{first}}  {columns}",
    ]
    for index, name in enumerate(names):
        scores = [e.scenes[index] for e in evaluations]
        cells = "  ".join(
            f"{score.psnr:>{width - 18}.2f} {score.ssim:>7.4f} {score.seconds:>9.2f}"
            for score, width in zip(scores, widths, strict=True)
        )
        lines.append(f"{name:<{first}}  {cells}")
    means = "  ".join(
        f"{e.mean_psnr:>{width - 18}.2f} {e.mean_ssim:>7.4f} {'':>9}"
        for e, width in zip(evaluations, widths, strict=True)
    )
    return "\n".join([*lines, f"{'mean':<{first}}  {means}".rstrip()])


def _finite(value: float, digits: int) -> float | None:
    return round(value, digits) if math.isfinite(value) else None
