"""Checkpoints of a training run: tensors and a JSON header in one safetensors file, written atomically."""

from __future__ import annotations

import json
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

# What may differ between a run and its continuation: how long it lasts.
_CONTINUABLE = ("steps", "decay_share")


@dataclass(frozen=True)
class Checkpoint:
    """The state of a run after `step` steps and `seconds` of work."""

    step: int
    seconds: float
    curve: Sequence[CurvePoint]
    model: Mapping[str, Tensor]
    average: Mapping[str, Tensor]
    moments: Sequence[Mapping[str, Tensor]]  # the optimiser's state of each parameter, in the model's order


def save_checkpoint(path: Path, checkpoint: Checkpoint, config: Mapping[str, Any]) -> None:
    """Write it beside the old one and rename, so that a kill leaves one or the other."""
    tensors = {f"model/{name}": value for name, value in checkpoint.model.items()}
    tensors |= {f"average/{name}": value for name, value in checkpoint.average.items()}
    for index, state in enumerate(checkpoint.moments):
        tensors |= {f"moments/{index}/{name}": value for name, value in state.items()}
    header = {
        "step": checkpoint.step,
        "seconds": checkpoint.seconds,
        "curve": [asdict(point) for point in checkpoint.curve],
        "config": config,
        "moments": len(checkpoint.moments),
    }
    data = save({name: value.detach().cpu().contiguous() for name, value in tensors.items()}, {"run": json.dumps(header)})
    with atomic_path(path) as temporary:
        temporary.write_bytes(data)


def load_checkpoint(path: Path, config: Mapping[str, Any]) -> Checkpoint | None:
    """The checkpoint at `path`, or None where there is none. Raises InputError if it is damaged or of another config."""
    if not path.exists():
        return None
    try:
        with safe_open(path, framework="pt") as file:
            header = json.loads((file.metadata() or {})["run"])
            tensors: dict[str, Tensor] = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118, not a dict
        curve = [CurvePoint(**point) for point in header["curve"]]
    except (SafetensorError, OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path} is not a readable checkpoint ({error}); remove it to start anew.") from error
    wanted = json.loads(json.dumps(config))
    different = [key for key in wanted if key not in _CONTINUABLE and header["config"].get(key) != wanted[key]]
    if different:
        raise InputError(
            f"{path} belongs to a run with another {', '.join(different)}; give the same settings to go on, "
            "or another run folder to start anew."
        )
    return Checkpoint(
        header["step"],
        header["seconds"],
        curve,
        _below(tensors, "model/"),
        _below(tensors, "average/"),
        [_below(tensors, f"moments/{index}/") for index in range(header["moments"])],
    )


def _below(tensors: Mapping[str, Tensor], prefix: str) -> dict[str, Tensor]:
    return {name.removeprefix(prefix): value for name, value in tensors.items() if name.startswith(prefix)}
