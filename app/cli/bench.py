"""`lfview bench`: seconds a view by stage, memory, and the share of what the processor can do."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path
from typing import Any

from app.cli.common import Verbs, add_verb, check_json_target, count, labelled, write_json
from app.progress import Progress

_VIEWER_SECONDS = 10.0


def add_parser(verbs: Verbs[Any], name: str) -> None:
    """Declare the verb."""
    parser = add_verb(verbs, name, "measure the speed of synthesis on this machine", "lfview bench --json bench.json")
    parser.add_argument("path", metavar="PATH", type=Path, nargs="?", help="a light field (default: the sample)")
    parser.add_argument(
        "--model",
        action="append",
        dest="models",
        metavar="NAME",
        help="a shipped model or a .safetensors file; may be given more than once (default: all shipped ones from corners)",
    )
    parser.add_argument("--count", type=count, default=5, metavar="N", help="viewpoints timed after the warm-up (default: 5)")
    parser.add_argument("--retune", action="store_true", help="first choose anew how convolutions are laid out on this machine")
    parser.add_argument("--viewer", action="store_true", help="also time the viewer's frames while it synthesizes")
    parser.add_argument("--json", metavar="FILE", help="write the figures as JSON (- for standard output)")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Measure the ceiling, each model in a process of its own, and the ceiling again; the higher one counts."""
    check_json_target(options.json)

    from assets import sample_path
    from lfcore import bench
    from lfcore.machine import core_count, machine
    from lfcore.synthesizer import MODEL_NAMES

    _say_if_busy(core_count())
    path = options.path or sample_path()
    models = labelled(options.models or list(MODEL_NAMES))
    if options.retune:
        bench.in_fresh_process(bench.retune)
    with Progress("measuring", len(models) + 2, "parts") as bar:
        ceiling = bench.in_fresh_process(bench.measure_ceiling)
        bar.step()
        measurements = {}
        for label, name in models.items():
            measurements[label] = bench.in_fresh_process(bench.measure_model, name, path, options.count)
            bar.step()
        ceiling = ceiling.or_higher(bench.in_fresh_process(bench.measure_ceiling))
        bar.step()
    speeds = {label: measurement.speed(ceiling) for label, measurement in measurements.items()}
    measured = bench.as_json(machine(), ceiling, speeds)
    if options.viewer:
        measured["viewer"] = _frame_times(path, next(iter(models.values())))
    if options.json:
        write_json(measured, options.json)
    if options.json != "-":
        print(bench.as_text(measured))
    return 0


def _say_if_busy(cores: int) -> None:
    """Warn where other programs keep the processor busy, since they take their share from every figure."""
    if not hasattr(os, "getloadavg"):
        return
    load = os.getloadavg()[0]
    if load > cores / 2:
        print(f"Note: this machine is busy (load {load:.1f} on {cores} cores), so the figures will be low.", file=sys.stderr)


def _frame_times(path: Path, model: str) -> dict[str, Any]:
    """The viewer's frame times while it synthesizes, in JSON's types; off screen where there is no display."""
    from app.viewer import measure_frames

    times = measure_frames(path, _VIEWER_SECONDS, model)
    return {
        "frame_ms_p50": round(times.p50_ms, 2),
        "frame_ms_p95": round(times.p95_ms, 2),
        "frames": times.frames,
        "views_per_second": round(times.views_per_second, 1),
        "where": times.where,
    }
