"""`lfview eval PATH...`: score models on light fields whose captured views are known."""

from __future__ import annotations

import argparse
import shlex
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from app.cli.common import Verbs, add_verb, check_json_target, labelled, open_and_warn, scenes_in, write_json
from app.progress import Progress
from lfcore.distinct import unused
from lfcore.errors import LfviewError, is_out_of_memory

if TYPE_CHECKING:
    from lfcore.evaluation import Evaluation, SceneResult, SceneScore
    from lfcore.lightfield import LightField
    from lfcore.noise import SceneNoise
    from lfcore.protocols import Protocol
    from lfcore.report_panels import ScenePanels
    from lfcore.synthesis import Synthesizer

# Said here too, so that --help needs no library; a test holds it to lfcore.protocols.
PROTOCOL_NAMES = ("K16", "7x7-Y", "8x8-BGR")


def add_parser(verbs: Verbs[Any], name: str) -> None:
    """Declare the verb."""
    parser = add_verb(
        verbs,
        name,
        "score a model: captured views against their synthesis from the corners",
        "lfview eval scenes/* --model full --model mean --json scores.json --out figures\n"
        "         lfview eval scenes/* --model full --model planesweep --grid --noise --report report.html",
    )
    parser.add_argument(
        "paths", metavar="PATH", type=Path, nargs="+", help="light fields with more than the corner views, or folders of them"
    )
    parser.add_argument(
        "--model",
        action="append",
        dest="models",
        metavar="NAME",
        help="full (default), realtime, single, planesweep, mean, or a .safetensors file; several stand side by side",
    )
    parser.add_argument(
        "--protocol",
        type=_protocol_name,
        default="K16",
        metavar="NAME",
        help="K16 (default), the paper's: view 5, 5 of 8 x 8 (the middle one of 7 x 7), 8 bits, over RGB; 7x7-Y: mean over 45 "
        "views, luminance; 8x8-BGR: mean over 60 views and three channels; all with 22 px cropped. Never compare across them",
    )
    parser.add_argument(
        "--grid", action="store_true", help="score every novel view of the grid too, for the report's heat maps and the JSON"
    )
    parser.add_argument("--noise", action="store_true", help="measure the noise of synthesis and captured view on flat regions")
    parser.add_argument(
        "--json", metavar="FILE", help="write the scores as JSON (-: standard output), a list if there are several models"
    )
    parser.add_argument("--out", metavar="DIR", help="write a figure per scene: truth, synthesis, error, disparity")
    parser.add_argument("--report", metavar="FILE", help="write everything as one page for the browser (.html)")
    parser.add_argument(
        "--curve",
        action="append",
        default=[],
        dest="curves",
        type=Path,
        metavar="CSV",
        help="show the curve.csv of a training run in the report; may be given more than once",
    )
    parser.set_defaults(run=run)


def _protocol_name(text: str) -> str:
    for name in PROTOCOL_NAMES:
        if text.lower() == name.lower():
            return name
    raise argparse.ArgumentTypeError(f"there is no protocol {text!r}; choose K16, 7x7-Y or 8x8-BGR")


@dataclass
class _Findings:
    """What has been found so far: a dict by model for each scene that could be scored, a sentence for each other."""

    scores: list[dict[str, SceneScore]] = field(default_factory=list)
    noises: dict[int, SceneNoise] = field(default_factory=dict)  # by the scene's place in `scores`
    panels: list[ScenePanels] = field(default_factory=list)
    failures: list[str] = field(default_factory=list)
    figures: set[str] = field(default_factory=set)


def run(options: argparse.Namespace) -> int:
    """Score every scene by every model; scenes that cannot be scored are named, the others still count."""
    from lfcore.export import check_folder_target, check_target

    check_json_target(options.json)
    if options.out:
        check_folder_target(options.out)
    if options.report:
        check_target(options.report, (".html", ".htm"))
    scenes = scenes_in(options.paths)

    from lfcore.evaluation import Evaluation, check_inputs
    from lfcore.machine import machine
    from lfcore.protocols import PROTOCOLS
    from lfcore.synthesizer import make_synthesizer
    from lfcore.training.curve import read_curve

    curves = {str(path): read_curve(path) for path in options.curves}
    protocol = PROTOCOLS[options.protocol.lower()]
    models = {label: make_synthesizer(name) for label, name in labelled(options.models or ["full"]).items()}
    for synthesizer in models.values():
        check_inputs(synthesizer)
    found = _score_all(scenes, models, protocol, options)
    for failure in found.failures:
        print(f"lfview: {failure}", file=sys.stderr)
    if not found.scores:
        return 2
    here = machine()
    evaluations = [Evaluation(label, here, tuple(scene[label] for scene in found.scores), protocol) for label in models]
    if options.json:
        rows = [_json_row(evaluation, found.noises) for evaluation in evaluations]
        write_json(rows[0] if len(rows) == 1 else rows, options.json)
    if options.report:
        from lfcore.report import Report, write_report

        command = shlex.join(["lfview", *sys.argv[1:]])
        write_report(
            options.report, Report(evaluations, found.panels, list(found.noises.values()), curves, found.failures, command)
        )
    if options.json != "-":
        _print_tables(evaluations, found, options.noise)
    return 2 if found.failures else 0


def _print_tables(evaluations: list[Evaluation], found: _Findings, noise: bool) -> None:
    from lfcore.evaluation import score_table
    from lfcore.noise import noise_table

    print(score_table(evaluations))
    if noise and found.noises:
        print(f"\n{noise_table(list(found.noises.values()))}")
    elif noise:
        print("\nnoise: no view has flat regions large enough to measure it on")


def _json_row(evaluation: Evaluation, noises: dict[int, SceneNoise]) -> dict[str, Any]:
    from lfcore.noise import as_json

    row = evaluation.as_json()
    for number, noise in noises.items():
        row["scenes"][number]["noise"] = as_json(noise, evaluation.model)
    return row


def _score_all(
    scenes: list[Path], models: dict[str, Synthesizer], protocol: Protocol, options: argparse.Namespace
) -> _Findings:
    found = _Findings()
    with Progress("scoring", len(scenes) * len(models), "scores") as bar:
        for path in scenes:
            try:
                _score_scene(path, models, protocol, options, bar, found)
            except LfviewError as error:
                found.failures.append(_named(path, str(error)))
            except Exception as error:
                if not is_out_of_memory(error):
                    raise
                found.failures.append(f"{path}: there is not enough memory for it; use smaller views or close other programs.")
    return found


def _named(path: Path, sentence: str) -> str:
    """The sentence, with the light field that it is about where it does not say so."""
    names = (str(path), f"{path.name}:", f"{path.stem}:")
    return sentence if any(name in sentence for name in names) else f"{path}: {sentence}"


def _score_scene(
    path: Path,
    models: dict[str, Synthesizer],
    protocol: Protocol,
    options: argparse.Namespace,
    bar: Progress,
    found: _Findings,
) -> None:
    from lfcore.evaluation import evaluate_scene, scene_noise, views_to_score

    light_field = open_and_warn(path)
    count = len(views_to_score(light_field, protocol, options.grid))
    results: dict[str, SceneResult] = {}
    for label, synthesizer in models.items():
        results[label] = evaluate_scene(light_field, synthesizer, protocol, options.grid, lambda: bar.step(1 / count))
    if options.out is not None:
        _write_figures(options.out, light_field, results, protocol, found.figures)
    if options.noise and (noise := scene_noise(light_field, protocol, results)) is not None:
        found.noises[len(found.scores)] = noise
    if options.report:
        from lfcore.report_panels import scene_panels

        found.panels.append(scene_panels(results))
    found.scores.append({label: result.score for label, result in results.items()})


def _write_figures(
    folder: str, light_field: LightField, results: dict[str, SceneResult], protocol: Protocol, taken: set[str]
) -> None:
    from lfcore.evaluation import scene_figure
    from lfcore.export import make_folder, write_picture

    for label, result in results.items():
        stem = light_field.name if len(results) == 1 else f"{light_field.name} {label}"
        name = unused(stem.replace("/", "_").replace("\\", "_"), taken)
        write_picture(make_folder(folder) / f"{name}.png", scene_figure(result, protocol))
