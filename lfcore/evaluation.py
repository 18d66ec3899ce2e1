"""Score a model on light fields whose captured views are known, by one of the protocols of `lfcore.protocols`."""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from lfcore import colormaps
from lfcore.errors import InputError
from lfcore.figures import ByteArray, Cell, Legend, disparity_cell, figure
from lfcore.lightfield import FloatArray, LightField
from lfcore.metrics import absolute_error, check_size, to_uint8
from lfcore.nearest_inputs import NEIGHBOURS, NearestInputs
from lfcore.protocols import K16, Protocol, novel_views

if TYPE_CHECKING:
    from lfcore.noise import SceneNoise
    from lfcore.synthesis import Synthesis, Synthesizer

ERROR_GAIN = 8


@dataclass(frozen=True)
class ViewScore:
    """One view of a scene by one model; row and column from 0 in the protocol's grid, PSNR in dB, seconds of its synthesis."""

    row: int
    column: int
    psnr: float
    ssim: float
    seconds: float


@dataclass(frozen=True)
class SceneScore:
    """One scene by one model: PSNR in dB, SSIM, and the seconds that one synthesis took on this machine.

    They are the means over the protocol's views. `views` holds every view that was scored, also those that only a heat map
    asked for; `grid` is the (rows, columns) that they are part of. `stages`: mean seconds a view by stage of the synthesis.
    """

    name: str
    psnr: float
    ssim: float
    seconds: float
    views: tuple[ViewScore, ...] = ()
    grid: tuple[int, int] = (0, 0)
    stages: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Evaluation:
    """All scenes by one model and one protocol."""

    model: str
    machine: str
    scenes: tuple[SceneScore, ...]
    protocol: Protocol = K16

    @property
    def mean_psnr(self) -> float:
        """Mean of the scenes' PSNR in dB, as the paper averages."""
        return statistics.fmean(scene.psnr for scene in self.scenes)

    @property
    def mean_ssim(self) -> float:
        """Mean of the scenes' SSIM."""
        return statistics.fmean(scene.ssim for scene in self.scenes)

    @property
    def mean_seconds(self) -> float:
        """Mean of the scenes' seconds a view."""
        return statistics.fmean(scene.seconds for scene in self.scenes)

    def as_json(self) -> dict[str, Any]:
        """The evaluation in JSON's types; an infinite PSNR (equal pictures) becomes null, which JSON can hold.

        Scenes of which more than one view was scored list them under "views".
        """
        return {
            "protocol": self.protocol.name,
            "model": self.model,
            "machine": self.machine,
            "scenes": [_scene_json(scene) for scene in self.scenes],
            "mean": {"psnr": _finite(self.mean_psnr, 4), "ssim": _finite(self.mean_ssim, 6)},
        }


@dataclass(frozen=True)
class SceneResult:
    """A scene's score with the pictures behind it."""

    score: SceneScore
    view: tuple[int, int]  # (row, column) of the captured view shown, from 0 in the protocol's grid
    truth: FloatArray  # (H, W, 3)
    synthesis: Synthesis


def views_to_score(light_field: LightField, protocol: Protocol, whole_grid: bool) -> list[tuple[int, int]]:
    """(row, column) in the protocol's grid of the views to synthesize: the protocol's own, or every novel view.

    Raises InputError where the light field does not fit the protocol.
    """
    grid = protocol.grid(light_field)
    own = protocol.views(grid)
    return novel_views(grid) if whole_grid else own


def check_inputs(synthesizer: Synthesizer) -> None:
    """Raise InputError for a model that is given other views than the corners."""
    if isinstance(synthesizer, NearestInputs):
        raise InputError(
            f"The model {NEIGHBOURS} takes captured views between the corners as inputs, but protocols score what is made "
            "of the four corners alone; score realtime, whose networks it uses."
        )


def evaluate_scene(
    light_field: LightField,
    synthesizer: Synthesizer,
    protocol: Protocol = K16,
    whole_grid: bool = False,
    on_view: Callable[[], object] = lambda: None,
) -> SceneResult:
    """Synthesize the protocol's views from the corners of its grid alone and score them.

    `whole_grid` scores every novel view too; the scene's own score stays that of the protocol. `on_view` is called after each
    view. Raises InputError where the light field does not fit the protocol, and for a model with other inputs.
    """
    check_inputs(synthesizer)
    check_size(light_field, protocol.name)
    grid = protocol.grid(light_field)
    own = set(protocol.views(grid))
    shown = protocol.shown_view(grid)
    synthesizer.set_light_field(grid)
    views: list[ViewScore] = []
    timings: list[Mapping[str, float]] = []
    kept: Synthesis | None = None
    for row, column in views_to_score(light_field, protocol, whole_grid):
        start = time.perf_counter()
        synthesis = synthesizer.synthesize(*grid.position(row, column))
        seconds = time.perf_counter() - start
        score = protocol.score(synthesis.image, grid.view(row, column))
        views.append(ViewScore(row, column, score.psnr, score.ssim, seconds))
        timings.append(synthesis.timings)
        if (row, column) == shown:
            kept = synthesis
        on_view()
    assert kept is not None  # the view shown is one of the protocol's
    counted = [view for view in views if (view.row, view.column) in own]
    return SceneResult(
        SceneScore(
            grid.name,
            statistics.fmean(view.psnr for view in counted),
            statistics.fmean(view.ssim for view in counted),
            statistics.fmean(view.seconds for view in counted),
            tuple(views),
            (grid.rows, grid.columns),
            {stage: statistics.fmean(timing[stage] for timing in timings) for stage in timings[0] if stage != "total"},
        ),
        shown,
        grid.view(*shown),
        kept,
    )


def scene_noise(light_field: LightField, protocol: Protocol, results: Mapping[str, SceneResult]) -> SceneNoise | None:
    """Noise on the flat regions of the view shown: captured, average of the four corners, and each model's synthesis.

    None where the view has too few flat pixels.
    """
    from lfcore.noise import SceneNoise, enough, flat_regions, noise_sigma

    truth = next(iter(results.values())).truth
    flat = flat_regions(truth)
    if not enough(flat):
        return None
    pictures = {"mean": protocol.grid(light_field).corners().mean(0)}
    pictures |= {label: result.synthesis.image for label, result in results.items()}
    sigmas = {label: noise_sigma(picture, flat) for label, picture in pictures.items()}
    return SceneNoise(light_field.name, float(flat.mean()), noise_sigma(truth, flat), sigmas)


def scene_figure(result: SceneResult, protocol: Protocol = K16) -> ByteArray:
    """Truth, synthesis, error and disparity side by side, two by two, labelled: uint8 (H, W, 3)."""
    row, column = result.view
    score, synthesis = result.score, result.synthesis
    shown = next(view for view in score.views if (view.row, view.column) == result.view)
    error = absolute_error(synthesis.image, result.truth)
    error_colours = colormaps.error_colours()
    return figure(
        [
            Cell(
                to_uint8(result.truth),
                f"{score.name}: captured view {row + 1}, {column + 1} of {score.grid[0]} x {score.grid[1]}",
            ),
            Cell(
                to_uint8(synthesis.image),
                f"synthesis, {synthesis.model}: {shown.psnr:.2f} dB, SSIM {shown.ssim:.4f} ({protocol.name})",
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
        f"{evaluations[0].protocol.name} on {evaluations[0].machine}",
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
        f"{e.mean_psnr:>{width - 18}.2f} {e.mean_ssim:>7.4f} {'':>9}" for e, width in zip(evaluations, widths, strict=True)
    )
    return "\n".join([*lines, f"{'mean':<{first}}  {means}".rstrip()])


def _scene_json(scene: SceneScore) -> dict[str, Any]:
    values: dict[str, Any] = {
        "name": scene.name,
        "psnr": _finite(scene.psnr, 4),
        "ssim": _finite(scene.ssim, 6),
        "seconds": round(scene.seconds, 4),
    }
    if len(scene.views) > 1:
        values["grid"] = list(scene.grid)
        values["views"] = [
            {
                "row": view.row,
                "column": view.column,
                "psnr": _finite(view.psnr, 4),
                "ssim": _finite(view.ssim, 6),
                "seconds": round(view.seconds, 4),
            }
            for view in scene.views
        ]
    return values


def _finite(value: float, digits: int) -> float | None:
    return round(value, digits) if math.isfinite(value) else None
