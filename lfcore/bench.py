"""How fast this machine synthesizes, against what its processor can do at most.

Everything is measured in a process of its own, so that memory is counted per model and nothing is warm by accident.
"""

from __future__ import annotations

import multiprocessing
import signal
import statistics
import sys
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, TypeVar

from lfcore.sweep import circle

_MATRIX = 2048
_CEILING_SECONDS = 2.0  # spent per number type
_CEILING_RUNS = 20

_T = TypeVar("_T")


@dataclass(frozen=True)
class Ceiling:
    """The fastest large matrix product seen, in 10^12 operations per second, by number type."""

    bf16: float
    fp32: float


@dataclass(frozen=True)
class ModelSpeed:
    """Medians over several viewpoints after a warm-up.

    `tflops`: convolution operations carried out (a multiply-add is two) per second of the whole synthesis, in 10^12;
    `share_of_ceiling`: that over the ceiling of the number type that the model computes in. Both are None for models
    without networks. `peak_mib`: most memory that the process held, with Python, torch and the light field, in MiB, or
    None where the system does not tell (Windows).
    """

    seconds_per_view: float
    stages: dict[str, float]
    tflops: float | None
    share_of_ceiling: float | None
    peak_mib: float | None


def in_fresh_process(function: Callable[..., _T], *arguments: object) -> _T:
    """Call a module's function in a new process and hand back its result, or raise its exception."""
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, mp_context=context, initializer=_let_ctrl_c_kill) as pool:
        return pool.submit(function, *arguments).result()


def measure_ceiling() -> Ceiling:
    """Time large matrix products in both number types on as many threads as torch uses."""
    import torch

    return Ceiling(bf16=_matmul_tflops(torch.bfloat16), fp32=_matmul_tflops(torch.float32))


def measure_model(model: str, path: Path, views: int, ceiling: Ceiling) -> ModelSpeed:
    """Synthesize `views` viewpoints on a circle from the light field at `path`, after one to warm up."""
    import torch
    from torch.utils.flop_counter import FlopCounterMode

    from lfcore.formats import open_light_field
    from lfcore.synthesizer import NetworkSynthesizer, make_synthesizer

    synthesizer = make_synthesizer(model)
    synthesizer.set_light_field(open_light_field(path))
    with FlopCounterMode(display=False) as counter:
        synthesizer.synthesize(0.5, 0.5)
    timings = []
    for u, v in circle(views):
        start = time.perf_counter()
        synthesis = synthesizer.synthesize(u, v)
        timings.append({**synthesis.timings, "total": time.perf_counter() - start})
    stages = {stage: statistics.median(timing[stage] for timing in timings) for stage in timings[0]}
    seconds = stages.pop("total")
    tflops = share = None
    if isinstance(synthesizer, NetworkSynthesizer):
        tflops = counter.get_total_flops() / seconds / 1e12
        share = tflops / (ceiling.bf16 if synthesizer.dtype == torch.bfloat16 else ceiling.fp32)
    return ModelSpeed(seconds, stages, tflops, share, _peak_mib())


def as_json(machine: str, ceiling: Ceiling, models: dict[str, ModelSpeed]) -> dict[str, Any]:
    """The measurements in JSON's types."""
    return {
        "machine": machine,
        "ceiling_tflops": asdict(ceiling),
        "models": {name: asdict(speed) for name, speed in models.items()},
    }


def as_text(measured: dict[str, Any]) -> str:
    """The measurements, as as_json gives them, for people."""
    ceiling = measured["ceiling_tflops"]
    lines = [
        measured["machine"],
        f"matrix products: {ceiling['bf16']:.2f} TFLOP/s in bfloat16, {ceiling['fp32']:.2f} in float32",
    ]
    for name, speed in measured["models"].items():
        stages = ", ".join(f"{stage} {seconds:.3f}" for stage, seconds in speed["stages"].items())
        lines.append(f"{name}: {speed['seconds_per_view']:.3f} s a view" + (f" ({stages})" if stages else ""))
        if speed["tflops"] is not None:
            lines.append(f"  {speed['tflops']:.3f} TFLOP/s, {speed['share_of_ceiling']:.0%} of the ceiling")
        if speed["peak_mib"] is not None:
            lines.append(f"  at most {speed['peak_mib']:.0f} MiB of memory")
    if "viewer" in measured:
        viewer = measured["viewer"]
        times = f"{viewer['frame_ms_p50']:.1f} ms a frame, 95 of 100 within {viewer['frame_ms_p95']:.1f} ms"
        lines.append(f"viewer ({viewer['where']}): {times}")
    return "\n".join(lines)


def _matmul_tflops(dtype: Any) -> float:
    import torch

    a = torch.randn(_MATRIX, _MATRIX).to(dtype)
    torch.mm(a, a)
    best, began = float("inf"), time.perf_counter()
    for _ in range(_CEILING_RUNS):
        start = time.perf_counter()
        torch.mm(a, a)
        best = min(best, time.perf_counter() - start)
        if time.perf_counter() - began > _CEILING_SECONDS:
            break
    return 2 * _MATRIX**3 / best / 1e12


def _peak_mib() -> float | None:
    try:
        import resource
    except ImportError:  # Windows
        return None
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / 2**20 if sys.platform == "darwin" else peak / 2**10  # bytes on macOS, KiB elsewhere


def _let_ctrl_c_kill() -> None:
    """Let Ctrl-C, which the terminal sends to all its processes, end this one without a traceback."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
