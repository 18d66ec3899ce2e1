"""`lfview eval PATH...`: score models on light fields whose captured views are known."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from app.cli.common import Verbs, add_verb, check_json_target, labelled, open_with_progress, scenes_in, write_json
from app.progress import Progress
from lfcore.errors import LfviewError

if TYPE_CHECKING:
    from lfcore.evaluation import SceneScore
    from lfcore.synthesizer import Synthesizer


def add_parser(verbs: Verbs[Any], name: str) -> None:
    """Declare the verb."""
    parser = add_verb(
        verbs,
        name,
        "score a model: a captured view against its synthesis from the corners",
        "lfview eval scenes/* --model full --model mean --json scores.json --out figures",
    )
    parser.add_argument(
        "paths", metavar="PATH", type=Path, nargs="+", help="light fields with more than the corner views, or folders of them"
    )
    parser.add_argument(
        "--model",
        action="append",
        dest="models",
        metavar="NAME",
        help="full (default), mean, or a .safetensors file; given more than once, the models stand side by side",
    )
    parser.add_argument(
        "--protocol",
        choices=["K16"],
        default="K16",
        help="K16, the paper's: view 5, 5 of 8 x 8 (the middle one of 7 x 7), 8 bits, 22 px cropped, over RGB",
    )
    parser.add_argument(
        "--json", metavar="FILE", help="write the scores as JSON (-: standard output), a list if there are several models"
    )
    parser.add_argument("--out", metavar="DIR", help="write a figure per scene: truth, synthesis, error, disparity")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Score every scene by every model; scenes that cannot be scored are named, the others still count."""
    from lfcore.export import check_folder_target

    check_json_target(options.json)
    if options.out:
        check_folder_target(options.out)
    scenes = scenes_in(options.paths)

    from lfcore.evaluation import Evaluation, score_table
    from lfcore.machine import machine
    from lfcore.synthesizer import make_synthesizer

    models = {label: make_synthesizer(name) for label, name in labelled(options.models or ["full"]).items()}
    scores, failures = _score_all(scenes, models, options.out)
    for failure in failures:
        print(f"lfview: {failure}", file=sys.stderr)
    if not scores:
        return 2
    here = machine()
    evaluations = [Evaluation(label, here, tuple(scene[label] for scene in scores)) for label in models]
    if options.json:
        rows = [evaluation.as_json() for evaluation in evaluations]
        write_json(rows[0] if len(rows) == 1 else rows, options.json)
    if options.json != "-":
        print(score_table(evaluations))
    return 2 if failures else 0


def _score_all(
    scenes: list[Path], models: dict[str, Synthesizer], folder: str | None
) -> tuple[list[dict[str, SceneScore]], list[str]]:
    """Scores by scene and model, and a sentence for each scene that could not be opened or scored."""
    scores: list[dict[str, SceneScore]] = []
    failures: list[str] = []
    taken: set[str] = set()
    with Progress("scoring", len(scenes) * len(models), "views") as bar:
        for path in scenes:
            try:
                scores.append(_score_scene(path, models, folder, taken, bar))
            except LfviewError as error:
                failures.append(str(error))
    return scores, failures


def _score_scene(
    path: Path, models: dict[str, Synthesizer], folder: str | None, taken: set[str], bar: Progress
) -> dict[str, SceneScore]:
    from lfcore.evaluation import evaluate_scene, scene_figure
    from lfcore.export import make_folder, write_picture

    light_field = open_with_progress(path)
    scores: dict[str, SceneScore] = {}
    for label, synthesizer in models.items():
        result = evaluate_scene(light_field, synthesizer)
        scores[label] = result.score
        if folder is not None:
            stem = light_field.name if len(models) == 1 else f"{light_field.name} {label}"
            write_picture(make_folder(folder) / f"{_unused(stem, taken)}.png", scene_figure(light_field, result))
        bar.step()
    return scores


def _unused(stem: str, taken: set[str]) -> str:
    """The stem, numbered where two scenes share it; remembered in `taken`."""
    safe = stem.replace("/", "_").replace("\\", "_")
    name, number = safe, 2
    while name in taken:
        name, number = f"{safe} ({number})", number + 1
    taken.add(name)
    return name
