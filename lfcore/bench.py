"""How fast this machine synthesizes, against what its processor can do at most.

Everything is measured in a process of its own, so that memory is counted per model and nothing is warm by accident.
"""

from __future__ import annotations

import multiprocessing
import signal
import statistics
import sys
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from lfcore.operations import network_operations
from lfcore.sweep import circle

if TYPE_CHECKING:
    from lfcore.tuned_stack import Tuning

_MATRICES = (1024, 2048)  # rows and columns, ascending; which of them is fastest depends on the caches
_CEILING_SECONDS = 1.5  # spent per number type and size

_T = TypeVar("_T")


@dataclass(frozen=True)
class Ceiling:
    """The fastest large matrix product seen, in 10^12 operations per second, by number type."""

    bf16: float
    fp32: float

    def or_higher(self, other: Ceiling) -> Ceiling:
        """The higher of two measurements by type: other programs can only lower one."""
        return Ceiling(max(self.bf16, other.bf16), max(self.fp32, other.fp32))


@dataclass(frozen=True)
class Measurement:
    """What was measured of a model: medians over several viewpoints after a warm-up.

    `operations`: what the convolutions of each stage with a network ask for; a multiply-add is two. `dtype`: "bf16" or "fp32",
    in which they are computed, or None without networks.
    """

    seconds_per_view: float
    stages: Mapping[str, float]  # seconds
    operations: Mapping[str, float]
    dtype: str | None
    peak_mib: float | None

    def speed(self, ceiling: Ceiling) -> ModelSpeed:
        """The measurement beside the ceiling."""
        highest = asdict(ceiling)[self.dtype] if self.dtype else float("nan")
        networks = {
            stage: _network_speed(operations, self.stages[stage], highest) for stage, operations in self.operations.items()
        }
        together = None
        if self.operations:
            spent = sum(self.stages[stage] for stage in self.operations)
            together = _network_speed(sum(self.operations.values()), spent, highest)
        return ModelSpeed(
            self.seconds_per_view,
            dict(self.stages),
            together.tflops if together else None,
            together.share_of_ceiling if together else None,
            self.peak_mib,
            networks,
        )


@dataclass(frozen=True)
class NetworkSpeed:
    """Operations per second in 10^12, and that as a share of the ceiling of the number type computed in."""

    tflops: float
    share_of_ceiling: float


@dataclass(frozen=True)
class ModelSpeed:
    """Medians over several viewpoints after a warm-up.

    `stages`: seconds of each. `networks`: the speed of each stage that is a network, counted in the operations that its
    convolutions ask for: what tiles compute twice and filled channels do not count, and where transforms save operations
    (lfcore.fourier, lfcore.winograd) it can be above the ceiling. `tflops` and `share_of_ceiling` are of the networks together,
    over their seconds; None for models without. `peak_mib`: most memory that the process held, with Python, torch and the
    light field, in MiB, or None where the system does not tell (Windows).
    """

    seconds_per_view: float
    stages: dict[str, float]
    tflops: float | None
    share_of_ceiling: float | None
    peak_mib: float | None
    networks: dict[str, NetworkSpeed]


def in_fresh_process(function: Callable[..., _T], *arguments: object) -> _T:
    """Call a module's function in a new process and hand back its result, or raise its exception."""
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, mp_context=context, initializer=_let_ctrl_c_kill) as pool:
        return pool.submit(function, *arguments).result()


def measure_ceiling() -> Ceiling:
    """Time large matrix products in both number types on as many threads as torch uses."""
    import torch

    return Ceiling(bf16=_matmul_tflops(torch.bfloat16), fp32=_matmul_tflops(torch.float32))


def measure_model(model: str, path: Path, views: int) -> Measurement:
    """Synthesize `views` viewpoints on a circle from the light field at `path`, after one to warm up."""
    import torch

    from lfcore.formats import open_light_field
    from lfcore.synthesizer import make_synthesizer

    synthesizer = make_synthesizer(model)
    light_field = open_light_field(path)
    synthesizer.set_light_field(light_field)
    synthesizer.synthesize(0.5, 0.5)
    timings = []
    for u, v in circle(views):
        start = time.perf_counter()
        synthesis = synthesizer.synthesize(u, v)
        timings.append({**synthesis.timings, "total": time.perf_counter() - start})
    peak = _peak_mib()  # before anything else is loaded
    stages = {stage: statistics.median(timing[stage] for timing in timings) for stage in timings[0]}
    seconds = stages.pop("total")
    config = getattr(synthesizer, "config", None)
    if config is None:
        return Measurement(seconds, stages, {}, None, peak)
    dtype = "bf16" if getattr(synthesizer, "dtype", None) == torch.bfloat16 else "fp32"
    return Measurement(seconds, stages, network_operations(config, light_field.views.shape[2:4]), dtype, peak)


def retune() -> Tuning:
    """Choose anew how convolutions are laid out on this machine, and remember it."""
    from lfcore import tuning

    return tuning.retune()


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
        lines.append(f"{name}: {speed['seconds_per_view']:.3f} s a view")
        for stage, seconds in speed["stages"].items():
            network = speed["networks"].get(stage)
            lines.append(f"  {stage:<9} {seconds:.3f} s" + (f", {_rate(network)}" if network else ""))
        if speed["tflops"] is not None:
            lines.append(f"  networks together: {_rate(speed)}")
        if speed["peak_mib"] is not None:
            lines.append(f"  at most {speed['peak_mib']:.0f} MiB of memory")
    if "viewer" in measured:
        viewer = measured["viewer"]
        times = f"{viewer['frame_ms_p50']:.1f} ms a frame, 95 of 100 within {viewer['frame_ms_p95']:.1f} ms"
        lines.append(f"viewer ({viewer['where']}): {times}; {viewer['views_per_second']:.1f} syntheses a second on screen")
    return "\n".join(lines)


def _network_speed(operations: float, seconds: float, ceiling: float) -> NetworkSpeed:
    tflops = operations / seconds / 1e12
    return NetworkSpeed(tflops, tflops / ceiling)


def _rate(speed: Mapping[str, float]) -> str:
    return f"{speed['tflops']:.3f} TFLOP/s, {speed['share_of_ceiling']:.0%} of the ceiling"


def _matmul_tflops(dtype: Any) -> float:
    """The best of many products of each size: whatever else the machine does can only slow some of them.

    Larger ones are left out where one of this size takes too long already: torch's products of bfloat16 take a minute on
    processors without instructions for them.
    """
    import torch

    best = 0.0
    for size in _MATRICES:
        a = torch.randn(size, size).to(dtype)
        began = time.perf_counter()
        while time.perf_counter() - began < _CEILING_SECONDS:
            start = time.perf_counter()
            torch.mm(a, a)
            spent = time.perf_counter() - start
            best = max(best, 2 * size**3 / spent / 1e12)
        if spent > _CEILING_SECONDS:
            break
    return best


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
