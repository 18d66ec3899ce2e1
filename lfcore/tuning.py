"""How convolutions are computed on this machine: number type, the way of small and of large kernels, width of tiles, filled
channels. Measured once, remembered.

What is fastest differs widely: bfloat16 gains four-fold with AMX and loses without AVX-512; channel counts that are multiples
of 32 gain three-fold with AMX and lose a quarter without; Fourier transforms gain three-fold without AMX. So the layers
that cost most are timed the first time, within two seconds or so, and the choice is kept in a file beside the kept views.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import math
import os
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import torch

from lfcore.atomic import atomic_path
from lfcore.errors import OutputError
from lfcore.kernels import compiled
from lfcore.layers import DirectConvolution, Layer, Way, make_layer
from lfcore.networks import BORDER, PaperStack
from lfcore.planesweep import Levels
from lfcore.tuned_stack import TunedStack, Tuning

_BUDGET_SECONDS = 1.5  # after it nothing new is timed; what has not been, is not chosen
_SURE_ROUNDS = 4
_ROUNDS_BEHIND, _FAR_BEHIND = 2, 3.0  # so many are enough for a choice that took so many times what the fastest takes
_SMALL_WIDTH = 144
_FOURIER_ROWS = 32  # with which, at _SMALL_WIDTH, few pixels of the transforms' own tiles are lost
_ROUNDS = 10  # in turn, and the best of each, so that a busy moment of the machine does not decide
_WIDTHS = (288, 144, 208, 384, 576)  # what is usual first
_CHANNELS = (1, 16, 32)
_KEPT_MACHINES = 32
_LARGEST_FILE = 100_000  # bytes


@lru_cache(maxsize=1)
def machine_tuning() -> Tuning:
    """The choice for this machine: the remembered one, else measured and remembered."""
    with _measuring:
        return remembered() or retune()


_measuring = threading.Lock()  # two threads that measure at once would spoil each other's times


def retune() -> Tuning:
    """Measure anew and remember. Where time was too short for a sure choice, as on a busy machine, or nothing can be written,
    the choice lasts as long as the process."""
    tuning, sure = measured()
    if sure:
        with contextlib.suppress(OutputError):
            _remember(tuning)
    return tuning


def measured(
    widths: Sequence[int] = _WIDTHS, channels: Sequence[int] = _CHANNELS, transforms: bool | None = None
) -> tuple[Tuning, bool]:
    """Type, way and filling first, at a small width, then the width; and whether there was time to time all choices well.

    transforms: whether convolutions by transforms are among the choices; None: where they are compiled. The plain choices come
    first and stay unless another gains clearly: timings are never free of noise, and bfloat16 has to be worth its lost digits.
    """
    began = time.perf_counter()
    by_transforms = compiled() if transforms is None else transforms
    exact_kinds, short_kinds = (_kinds(dtype, channels, by_transforms) for dtype in (torch.float32, torch.bfloat16))
    # By turns, so that where time is short the plain ones of both types are compared.
    kinds = [kind for pair in zip(exact_kinds, short_kinds, strict=True) for kind in pair]
    cost, sure_kind = _fastest(kinds, 4 if by_transforms else 2, began + _BUDGET_SECONDS / 2)
    kind = _clearly_least([_clearly_least(same, cost, 0.9) for same in (exact_kinds, short_kinds)], cost, 0.8)
    if kind.fourier:
        return Tuning.by_fourier(kind.dtype, kind.way), sure_kind
    shapes = [replace(kind, tile_width=width) for width in widths]
    cost, sure_shape = _fastest(shapes, 0, began + _BUDGET_SECONDS)
    return _clearly_least(shapes, cost, 0.93), sure_kind and sure_shape


def _kinds(dtype: torch.dtype, channels: Sequence[int], by_transforms: bool) -> list[Tuning]:
    """The choices in a type, of a small width, the plain one first."""
    way = best_way(dtype) if by_transforms else Way.TORCH
    kinds = [Tuning(dtype, _SMALL_WIDTH, multiple, way=way) for multiple in channels]
    if by_transforms:
        kinds.insert(1, replace(Tuning.by_fourier(dtype, way), tile_width=_SMALL_WIDTH))
    return kinds


def best_way(dtype: torch.dtype) -> Way:
    """The one that is clearly faster than torch's for a layer like those of the small pair; where there is none, torch's."""
    with torch.random.fork_rng(devices=[]), torch.inference_mode():
        weight, bias = torch.randn(32, 32, 3, 3), torch.randn(32)
        x = torch.randn(1, 32, 96, 144).to(dtype).contiguous(memory_format=torch.channels_last)
        layers = {way: make_layer(weight, bias, dtype, way, padding=1) for way in Way}
        layers = {way: layer for way, layer in layers.items() if way is Way.TORCH or not isinstance(layer, DirectConvolution)}
        turns = [{way: _seconds(layer, x) for way, layer in layers.items()} for _ in range(_ROUNDS)]
    least = {way: min(turn[way] for turn in turns) for way in layers}
    best = min(least, key=least.__getitem__)
    return best if least[best] < 0.9 * least[Way.TORCH] else Way.TORCH


def _seconds(layer: Layer, x: torch.Tensor) -> float:
    start = time.perf_counter()
    layer(x, positive=True)
    return time.perf_counter() - start


def _clearly_least(choices: list[Tuning], cost: Mapping[Tuning, float], factor: float) -> Tuning:
    """The cheapest, if it costs less than `factor` of the first; else the first."""
    least = min(choices, key=cost.__getitem__)
    return least if cost[least] < factor * cost[choices[0]] else choices[0]


def _fastest(choices: Sequence[Tuning], needed: int, deadline: float) -> tuple[dict[Tuning, float], bool]:
    """Seconds a pixel of the disparity network's hidden layers, by choice, infinite where it had too few turns; and whether
    none had. The first `needed` always have enough; those that are far behind need no more, and those that differ from
    such a one by filled channels none, for filling hardly gains more than that."""
    seconds = dict.fromkeys(choices, math.inf)
    probes: dict[Tuning, Callable[[], float]] = {}
    turns = dict.fromkeys(choices, 0)

    def far_behind(choice: Tuning) -> bool:
        least = min(seconds.values())
        alike = [each for each in (choice, replace(choice, channel_multiple=1)) if each in turns]
        return any(turns[each] >= _ROUNDS_BEHIND and seconds[each] > _FAR_BEHIND * least for each in alike)

    def decided(choice: Tuning) -> bool:
        return turns[choice] >= _SURE_ROUNDS or far_behind(choice)

    with torch.inference_mode():
        for turn in range(_ROUNDS):
            for index, choice in enumerate(choices):
                late, first = time.perf_counter() > deadline, index < needed
                if far_behind(choice) or (late and (decided(choice) or not first)):
                    continue
                if needed and not first and turn < _ROUNDS_BEHIND:  # the first ones may decide it
                    continue
                if choice not in probes:
                    probes[choice] = _probe(choice)
                seconds[choice] = min(seconds[choice], probes[choice]())
                turns[choice] += 1
    surely = {choice: decided(choice) for choice in choices}
    return {choice: value if surely[choice] else math.inf for choice, value in seconds.items()}, all(surely.values())


def _probe(tuning: Tuning) -> Callable[[], float]:
    """Times a strip of the disparity network: seconds a pixel."""
    with torch.random.fork_rng(devices=[]):  # its random weights must not shift anybody's sequence
        stack = TunedStack(PaperStack(tuning.means + Levels().count, 1), tuning)
    rows = _FOURIER_ROWS if tuning.fourier else max(8, 2 * torch.get_num_threads())  # the threads share out rows
    x = stack.empty_input(rows + 2 * BORDER, tuning.tile_width + 2 * BORDER).zero_()

    def timed() -> float:
        start = time.perf_counter()
        stack(x)
        return (time.perf_counter() - start) / (rows * tuning.tile_width)

    return timed


def tuning_file() -> Path:
    """Where choices are kept."""
    from lfcore.kept_files import default_root

    return default_root() / "tuning.json"


def remembered() -> Tuning | None:
    """This machine's choice, or None where there is none, or a damaged file."""
    values = _file_content().get(_machine_key(), {})
    try:
        dtype = _DTYPES[str(values["dtype"])]
        way = Way(values["way"])
        if values["fourier"] is True:
            return Tuning.by_fourier(dtype, way)
        width, multiple = _within(values["tile_width"], 16, 4096), _within(values["channel_multiple"], 1, 64)
        return Tuning(dtype, width, multiple, way=way)
    except (KeyError, ValueError):
        return None


_DTYPES = {"float32": torch.float32, "bfloat16": torch.bfloat16}


def _within(value: object, low: int, high: int) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or not low <= value <= high:
        raise ValueError(f"{value!r} is not within {low} to {high}")
    return value


def _remember(tuning: Tuning) -> None:
    path = tuning_file()
    others = [item for item in _file_content().items() if item[0] != _machine_key()]
    newest = dict(others[-_KEPT_MACHINES + 1 :])
    values = {
        "dtype": str(tuning.dtype).removeprefix("torch."),
        "tile_width": tuning.tile_width,
        "channel_multiple": tuning.channel_multiple,
        "fourier": tuning.fourier,
        "way": tuning.way.value,
    }
    try:
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"Cannot make the folder {path.parent}: {error.strerror or error}.") from error
    with atomic_path(path) as temporary:
        temporary.write_text(json.dumps({**newest, _machine_key(): values}, indent=1), encoding="utf-8")


def _file_content() -> Mapping[str, Mapping[str, object]]:
    try:
        with tuning_file().open("rb") as file:
            content = json.loads(file.read(_LARGEST_FILE))
    except (OSError, ValueError, RecursionError):  # the last: brackets nested without end
        return {}
    if not isinstance(content, dict):
        return {}
    return {key: values for key, values in content.items() if isinstance(values, dict)}


def _machine_key() -> str:
    """Digest of all that the choice depends on: processor, its instructions, what is allowed of them, threads, torch, and
    whether there are compiled kernels."""
    facts = (
        sorted(torch.cpu.get_capabilities().items()),
        torch.backends.cpu.get_cpu_capability(),
        os.environ.get("ONEDNN_MAX_CPU_ISA", ""),
        torch.get_num_threads(),
        torch.__version__,
        compiled(),
    )
    return hashlib.blake2b(repr(facts).encode(), digest_size=16).hexdigest()
