"""`lfview train`: train the networks on light fields with captured views between the corners."""

from __future__ import annotations

import argparse
import contextlib
import math
import shutil
import signal
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any

from app.cli.common import (
    Verbs,
    add_verb,
    at_most,
    check_all_there,
    count,
    count_or_none,
    open_and_warn,
    positive,
    scenes_in,
    share,
)
from app.progress import Progress as Bar
from app.progress import bar, clock
from lfcore.errors import InputError

if TYPE_CHECKING:
    from lfcore.lightfield import LightField
    from lfcore.training.loop import Progress, TrainConfig
    from lfcore.training.patches import TrainingScene

_MOST_PATCHES, _MOST_GENERATED = 10_000, 100_000
_MOST_THREADS = 1024  # thousands of them end the program from within torch
_FIRST_SCENE = 1000  # seed of the first generated scene: the same pool for every run
_LINE_SECONDS = 60.0  # between two lines where the output is no terminal


def add_parser(verbs: Verbs[Any], name: str) -> None:
    """Declare the verb."""
    parser = add_verb(
        verbs,
        name,
        "train the networks; the same command goes on where it was stopped",
        "lfview train --data training/* --val held_out/* --out weights.safetensors --minutes 60",
    )
    parser.add_argument(
        "--model",
        choices=["full", "realtime", "single"],
        default="full",
        help="what to train: the paper's networks (full, the default), the small pair of this program (realtime), or the "
        "paper's one-network ablation (single)",
    )
    parser.add_argument(
        "--data",
        metavar="DIR",
        type=Path,
        nargs="+",
        required=True,
        help="light fields of at least 3 x 3 views, or folders of them; one named twice is drawn twice as often",
    )
    parser.add_argument(
        "--val",
        metavar="DIR",
        type=Path,
        nargs="+",
        default=[],
        help="held-out light fields; the weights that score best on them are kept",
    )
    parser.add_argument("--out", metavar="FILE", required=True, help="the weights: .safetensors")
    parser.add_argument("--minutes", type=positive, metavar="M", default=math.inf, help="stop after so long (default: never)")
    parser.add_argument("--steps", type=count, metavar="N", default=20000, help="steps of the whole schedule (default: 20000)")
    parser.add_argument("--patch", type=count, metavar="PX", default=60, help="side of a training patch (default: 60)")
    parser.add_argument(
        "--batch", type=at_most(_MOST_PATCHES, count), metavar="N", default=20, help="patches a step (default: 20)"
    )
    parser.add_argument(
        "--group", type=count, metavar="N", default=4, help="patches that share a viewpoint and its sweep; divides --batch (4)"
    )
    parser.add_argument("--lr", type=positive, metavar="R", default=1e-4, help="learning rate (default: 1e-4)")
    parser.add_argument("--decay", type=share, metavar="F", default=0.3, help="last share of the steps, of a falling rate")
    parser.add_argument(
        "--average", type=share, metavar="F", default=0.999, help="decay of the running average of the weights (0.999)"
    )
    parser.add_argument(
        "--balance", type=share, metavar="F", default=0.0, help="0: the paper's loss (default); to 1: dark patches weigh more"
    )
    parser.add_argument(
        "--matching", type=count_or_none, metavar="N", default=1000, help="first steps that also match planes (default: 1000)"
    )
    parser.add_argument(
        "--matching-weight", type=positive, metavar="W", default=0.03, help="how much that counts at first (default: 0.03)"
    )
    parser.add_argument(
        "--revival",
        type=count_or_none,
        metavar="N",
        default=500,
        help="steps after which dead channels get new weights, while the rate is high; 0: never, and idle ones of --init are "
        "left out (500)",
    )
    parser.add_argument("--tones", type=share, metavar="F", default=0.5, help="share of patches whose tone is changed (0.5)")
    parser.add_argument(
        "--generated",
        type=at_most(_MOST_GENERATED, count_or_none),
        metavar="N",
        default=0,
        help="generated scenes to train on beside the data (0)",
    )
    parser.add_argument(
        "--generated-share", type=share, metavar="F", default=0.5, help="share of patches from generated scenes (0.5)"
    )
    parser.add_argument("--textures", metavar="DIR", type=Path, help="photographs for generated scenes (default: patterns)")
    parser.add_argument("--teacher", metavar="FILE", type=Path, help="weights of realtime whose disparity guides the training")
    parser.add_argument(
        "--teacher-weight", type=positive, metavar="W", default=0.1, help="how much the teacher counts (default: 0.1)"
    )
    parser.add_argument(
        "--init",
        metavar="FILE",
        type=Path,
        help="weights to go on from, in place of random ones",
    )
    parser.add_argument("--seed", type=count_or_none, metavar="N", default=1, help="seed of all that is drawn (default: 1)")
    parser.add_argument(
        "--run-dir",
        metavar="DIR",
        type=Path,
        help="checkpoint and curve; a checkpoint found there is resumed (default: --out without its extension)",
    )
    parser.add_argument("--device", choices=["auto", "cpu", "cuda"], default="auto", help="where to compute (default: auto)")
    parser.add_argument("--threads", type=count, metavar="N", help="processor threads (default: torch's choice)")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Train; Ctrl-C or SIGTERM ends the step, saves a checkpoint and leaves."""
    from lfcore.export import check_apart, check_folder_target, check_target

    out = check_target(options.out, (".safetensors",))
    run_dir = check_folder_target(options.run_dir or out.with_suffix(""))
    check_all_there([*options.data, *options.val])
    data, held_out = scenes_in(options.data), scenes_in(options.val)

    import torch

    from lfcore.export import make_folder
    from lfcore.training.checkpoint import CHECKPOINT
    from lfcore.training.loop import Runtime, device_of, train
    from lfcore.training.team import join_team
    from lfcore.weights import load_weights

    config = _config(options)
    # The same command could not go on from weights that it has overwritten.
    read = [*options.data, *options.val, *(path for path in (options.init, options.teacher) if path)]
    check_apart([out, run_dir, run_dir / CHECKPOINT], read)
    device_of(options.device)  # refuses one that is not there now, not after scenes have been generated
    if options.threads and options.threads > _MOST_THREADS:
        raise InputError(
            f"{options.threads} threads were asked for; give at most {_MOST_THREADS}, better as many as there are cores."
        )
    if options.threads:
        torch.set_num_threads(options.threads)
    initial = load_weights(options.init) if options.init else None
    teacher = load_weights(options.teacher) if options.teacher else None
    scenes, validation = _open_all(data), _open_all(held_out)
    generated = _generated(options)
    reporter = _Reporter()
    with _stop_on_signal() as stop, join_team(options.device) as team:
        train(
            config,
            Runtime(device=options.device, stop_after_minutes=options.minutes),
            scenes,
            validation,
            out,
            make_folder(run_dir),
            reporter,
            stop,
            initial=initial,
            team=team,
            generated=generated,
            teacher=teacher,
        )
    if not team.leads:
        return 0
    reporter.finish()
    if stop.number is not None:
        print(f"Stopped; the same command goes on from {run_dir}.", file=sys.stderr)
        return 128 + stop.number
    print(f"{out}: weights; curve and checkpoint in {run_dir}")
    return 0


def _config(options: argparse.Namespace) -> TrainConfig:
    from lfcore.training.loop import TrainConfig, check_patches
    from lfcore.training.loss import LossConfig
    from lfcore.training.patches import PatchConfig

    try:
        patches = PatchConfig(size=options.patch, batch=options.batch, group=options.group, tone_share=options.tones)
    except ValueError as error:
        asked = f"--patch {options.patch} --batch {options.batch} --group {options.group}"
        raise InputError(f"{asked} will not do: {error}.") from error
    config = TrainConfig(
        steps=options.steps,
        learning_rate=options.lr,
        decay_share=options.decay,
        loss=LossConfig(options.matching, options.matching_weight, options.teacher_weight, options.balance),
        average=options.average,
        seed=options.seed,
        generated_share=options.generated_share,
        patches=patches,
        model=options.model,
        revival_steps=options.revival,
    )
    check_patches(config, options.teacher is not None)
    return config


def _generated(options: argparse.Namespace) -> list[TrainingScene]:
    """The pool of generated scenes; about a second and a half of one core each."""
    from lfcore.machine import core_count
    from lfcore.training.generated import SceneConfig, Textures, generate_pool
    from lfcore.training.patches import TrainingScene

    if not options.generated:
        return []
    textures = Textures(options.textures)
    with Bar("generating scenes", options.generated, "scenes") as shown:
        pool = generate_pool(
            options.generated,
            _FIRST_SCENE,
            textures,
            SceneConfig(),
            core_count(),
            lambda done: shown.reach(done / options.generated),
        )
        return [TrainingScene(scene.light_field, scene.low, scene.high) for scene in pool]


def _open_all(paths: list[Path]) -> list[LightField]:
    """The light fields; one that is named twice is opened once, and drawn twice as often."""
    opened = {path: open_and_warn(path) for path in dict.fromkeys(paths)}
    return [opened[path] for path in paths]


class _Stop:
    """Whether a signal has asked for the end; asked again, it ends the program at once."""

    def __init__(self) -> None:
        self.number: int | None = None

    def __call__(self) -> bool:
        return self.number is not None

    def handle(self, number: int, frame: FrameType | None) -> None:
        """Take note of the first signal; turn the second into the usual exception."""
        if self.number is not None:
            raise KeyboardInterrupt
        self.number = number


@contextlib.contextmanager
def _stop_on_signal() -> Iterator[_Stop]:
    stop = _Stop()
    before = {number: signal.signal(number, stop.handle) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield stop
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


class _Reporter:
    """Shows how training goes: a bar on a terminal; elsewhere a line a minute; validations always."""

    def __init__(self) -> None:
        self._terminal = sys.stderr.isatty()
        self._last_line = -math.inf

    def __call__(self, progress: Progress) -> None:
        """Take one report of the training loop."""
        now = time.monotonic()
        if progress.revived:
            self.finish()
            print(f"before step {progress.step}: {progress.revived} dead channels given new weights", flush=True)
        validation = progress.validation
        if validation is not None:
            self.finish()
            scores = ", ".join(f"{name} {psnr:.2f} dB" for name, psnr in validation.scores.items())
            print(f"step {progress.step}: loss {progress.loss:.6f}" + (f", {scores}" if scores else ""), flush=True)
        if self._terminal:
            rate = max(progress.steps_per_second, 1e-9)
            label = f"training, loss {progress.loss:.5f}"
            line = bar(label, progress.step, progress.steps, "steps", progress.step / rate)
            sys.stderr.write("\r\x1b[K" + line[: shutil.get_terminal_size().columns - 1])
            sys.stderr.flush()
        elif validation is None and now - self._last_line > _LINE_SECONDS:
            self._last_line = now
            left = (progress.steps - progress.step) / max(progress.steps_per_second, 1e-9)
            print(f"step {progress.step} of {progress.steps}: loss {progress.loss:.6f}, {clock(left)} left", flush=True)

    def finish(self) -> None:
        """Wipe the bar."""
        if self._terminal:
            sys.stderr.write("\r\x1b[K")
            sys.stderr.flush()
