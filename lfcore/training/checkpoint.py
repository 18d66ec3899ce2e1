"""Checkpoints of a training run: tensors and a JSON header in one safetensors file, written atomically."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from torch import Tensor

from lfcore.atomic import atomic_path
from lfcore.errors import InputError
from lfcore.training.curve import CurvePoint

CHECKPOINT = "checkpoint.safetensors"  # its name in a run folder

# What may differ between a run and its continuation: how long it lasts.
_CONTINUABLE = ("steps", "decay_share")

_LONGEST_HEADER = 16 * 2**20  # characters; it has a line per validation
_LARGEST = 2**53  # up to which a float holds every whole number

Shapes = Mapping[str, tuple[int, ...]]


@dataclass(frozen=True)
class Checkpoint:
    """The state of a run after `step` steps and `seconds` of work."""

    step: int
    seconds: float
    curve: Sequence[CurvePoint]
    model: Mapping[str, Tensor]
    average: Mapping[str, Tensor]
    moments: Sequence[Mapping[str, Tensor]]  # the optimiser's state of each parameter, in the model's order


@dataclass(frozen=True)
class _Header:
    """What a checkpoint says beside its tensors."""

    step: int
    seconds: float
    curve: Sequence[CurvePoint]
    config: Mapping[str, Any]
    moments: int


def save_checkpoint(path: Path, checkpoint: Checkpoint, config: Mapping[str, Any]) -> None:
    """Write it beside the old one and rename, so that a kill leaves one or the other."""
    tensors = {f"model/{name}": value for name, value in checkpoint.model.items()}
    tensors |= {f"average/{name}": value for name, value in checkpoint.average.items()}
    for index, state in enumerate(checkpoint.moments):
        tensors |= {f"moments/{index}/{name}": value for name, value in state.items()}
    header = {
        "step": checkpoint.step,
        "seconds": checkpoint.seconds,
        "curve": [_point_as_json(point) for point in checkpoint.curve],
        "config": config,
        "moments": len(checkpoint.moments),
    }
    metadata = {"run": json.dumps(header, allow_nan=False)}
    data = save({name: value.detach().cpu().contiguous() for name, value in tensors.items()}, metadata)
    with atomic_path(path) as temporary:
        temporary.write_bytes(data)


def load_checkpoint(path: Path, config: Mapping[str, Any], model: Shapes, moments: Sequence[Shapes]) -> Checkpoint | None:
    """The checkpoint at `path`, or None where there is none. Raises InputError if it is damaged or of another config.

    model: the shapes of the model's tensors. moments: of what the optimiser keeps of each parameter; of one that has never had
    a gradient nothing is kept.
    """
    if not path.exists():
        return None
    if not path.is_file():
        raise InputError(f"{path} is no file, and so not a readable checkpoint; remove it to start anew.")
    try:
        with safe_open(path, framework="pt") as file:
            header = _header((file.metadata() or {}).get("run", ""))
            _check_same_run(path, header.config, config)
            found = {name: file.get_slice(name) for name in file.keys()}  # noqa: SIM118, not a dict
            _check_tensors(header, {name: _shape(part) for name, part in found.items()}, model, moments)
            tensors: dict[str, Tensor] = {name: file.get_tensor(name) for name in found}
    except (SafetensorError, OSError, ValueError, RecursionError) as error:
        raise InputError(f"{path} is not a readable checkpoint ({error}); remove it to start anew.") from error
    return Checkpoint(
        header.step,
        header.seconds,
        header.curve,
        _below(tensors, "model/"),
        _below(tensors, "average/"),
        [_below(tensors, f"moments/{index}/") for index in range(header.moments)],
    )


def _check_same_run(path: Path, found: Mapping[str, Any], config: Mapping[str, Any]) -> None:
    wanted = json.loads(json.dumps(config))
    different = [key for key in wanted if key not in _CONTINUABLE and found.get(key) != wanted[key]]
    if different:
        raise InputError(
            f"{path} belongs to a run with another {', '.join(different)}; give the same settings to go on, "
            "or another run folder to start anew."
        )


def _header(text: str) -> _Header:
    """Raises ValueError or RecursionError for anything that `save_checkpoint` does not write."""
    if len(text) > _LONGEST_HEADER:
        raise ValueError(f"its header has {len(text)} characters")
    values = _table("header", json.loads(text))
    curve = values.get("curve")
    if not isinstance(curve, list):
        raise ValueError("its curve is no list")
    return _Header(
        _whole("step", values.get("step")),
        _number("seconds", values.get("seconds")),
        [_point(value) for value in curve],
        _table("config", values.get("config")),
        _whole("moments", values.get("moments")),
    )


def _point_as_json(point: CurvePoint) -> dict[str, Any]:
    """JSON has no numbers that are not finite, as the score of equal pictures is, or a loss that is not known."""
    scores = {name: _finite(value) for name, value in point.scores.items()}
    return {**asdict(point), "loss": _finite(point.loss), "scores": scores}


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _point(value: object) -> CurvePoint:
    values = _table("curve", value)
    scores = {
        name: math.inf if score in (None, math.inf) else _number("score", score)
        for name, score in _table("scores", values.get("scores")).items()
    }
    loss = values.get("loss")
    return CurvePoint(
        _whole("step", values.get("step")),
        _number("seconds", values.get("seconds")),
        _number("learning_rate", values.get("learning_rate")),
        math.nan if loss is None else _number("loss", loss),
        scores,
    )


def _table(name: str, value: object) -> Mapping[str, Any]:
    if not isinstance(value, dict):
        raise ValueError(f"its {name} is no table")
    return value


def _whole(name: str, value: object) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value <= _LARGEST:
        raise ValueError(f"its {name} is no whole number")
    return value


def _number(name: str, value: object) -> float:
    if not isinstance(value, int | float) or isinstance(value, bool) or not -_LARGEST <= value <= _LARGEST:
        raise ValueError(f"its {name} is no number")
    return float(value)


def _shape(part: Any) -> tuple[int, ...]:
    if part.get_dtype() != "F32":
        raise ValueError(f"a tensor in it is of type {part.get_dtype()}")
    return tuple(part.get_shape())


def _check_tensors(header: _Header, found: Shapes, model: Shapes, moments: Sequence[Shapes]) -> None:
    """Raises ValueError unless these are the tensors of the model that is trained."""
    if header.moments != len(moments):
        raise ValueError(f"it has the moments of {header.moments} parameters, not of {len(moments)}")
    wanted = {f"{part}/{name}": shape for part in ("model", "average") for name, shape in model.items()}
    for index, shapes in enumerate(moments):
        kept = {f"moments/{index}/{name}": shape for name, shape in shapes.items()}
        if kept.keys() & found.keys():
            wanted |= kept
    if found != wanted:
        differing = min(name for name in found.keys() | wanted.keys() if found.get(name) != wanted.get(name))
        raise ValueError(f"its tensor {differing} is not that of the model")


def _below(tensors: Mapping[str, Tensor], prefix: str) -> dict[str, Tensor]:
    return {name.removeprefix(prefix): value for name, value in tensors.items() if name.startswith(prefix)}
