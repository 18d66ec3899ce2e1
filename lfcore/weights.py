"""Weight files: safetensors with the model's config, its training and its scores in the metadata. Nothing is unpickled."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from torch import Tensor

from lfcore.atomic import atomic_path
from lfcore.errors import WeightsError
from lfcore.models import Config, Model, build_model, config_from_json
from lfcore.weights_header import FORMAT

# The paper's pair of networks takes 6.6 MB in float32; anything far beyond is no weight file of ours.
LARGEST_FILE = 256 * 2**20


@dataclass(frozen=True)
class Weights:
    """A model with its weights, the digest that names them in caches, and what the file tells of their training."""

    model: Model
    digest: str
    training: Mapping[str, Any]


def save_weights(path: Path, model: Model, training: Mapping[str, Any]) -> None:
    """Write the weights of `model` in float32, atomically. `training` says how they came about: JSON's values, so that
    numbers are finite."""
    tensors = {name: value.detach().float().cpu().contiguous() for name, value in model.state_dict().items()}
    metadata = {
        "format": FORMAT,
        "config": json.dumps(asdict(model.config)),
        "digest": _digest(asdict(model.config), tensors),
        "training": json.dumps(training, allow_nan=False),
    }
    data = save(tensors, metadata)
    with atomic_path(path) as temporary:
        temporary.write_bytes(data)


def load_weights(path: Path) -> Weights:
    """Read a weight file. Raises WeightsError where it is missing, damaged (a digest is checked) or another model's."""
    if not path.is_file():
        raise WeightsError(f"No weights found at {path}; give the path of a .safetensors file written by `lfview train`.")
    if path.stat().st_size > LARGEST_FILE:
        raise WeightsError(f"{path} has {path.stat().st_size / 2**20:.0f} MiB, too much for weights of this program.")
    try:
        with safe_open(path, framework="pt") as file:
            metadata = file.metadata() or {}
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118, not a dict
    except (SafetensorError, OSError, ValueError) as error:
        raise WeightsError(f"{path} is not a readable safetensors file ({error}); get a fresh copy.") from error
    if metadata.get("format") != FORMAT:
        raise WeightsError(f"{path} holds no weights of lfview (format {metadata.get('format')!r}, expected {FORMAT!r}).")
    config = _config(path, metadata)
    model = build_model(config)
    expected = {name: tuple(value.shape) for name, value in model.state_dict().items()}
    found = {name: tuple(value.shape) for name, value in tensors.items()}
    if expected != found:
        name = config.name
        raise WeightsError(
            f"{path} holds weights of another shape than {name} has here (of an older version, perhaps); train {name} anew."
        )
    if other := {value.dtype for value in tensors.values()} - {torch.float32}:
        raise WeightsError(f"{path} holds weights of type {min(map(str, other))}, expected torch.float32; get a fresh copy.")
    digest = _digest(_json(path, metadata, "config"), tensors)
    if digest != metadata.get("digest"):
        raise WeightsError(f"{path} is damaged: its weights do not match their digest; get a fresh copy.")
    if not all(bool(torch.isfinite(value).all()) for value in tensors.values()):
        raise WeightsError(f"{path} holds weights that are not finite numbers; train or get it anew.")
    model.load_state_dict(tensors)
    return Weights(model, digest, _json(path, metadata, "training"))


def _config(path: Path, metadata: Mapping[str, str]) -> Config:
    try:
        return config_from_json(_json(path, metadata, "config"))
    except ValueError as error:
        raise WeightsError(f"{path} holds weights of {error}, which this program does not have.") from error


def _json(path: Path, metadata: Mapping[str, str], key: str) -> dict[str, Any]:
    try:
        # Files written before say "Infinity", which is no JSON.
        value = json.loads(metadata.get(key, ""), parse_constant=lambda word: None)
    except (ValueError, RecursionError) as error:
        raise WeightsError(f"{path} is damaged: its {key} is not readable; get a fresh copy.") from error
    if not isinstance(value, dict):
        raise WeightsError(f"{path} is damaged: its {key} is not a table; get a fresh copy.")
    return value


def _digest(config: Mapping[str, Any], tensors: Mapping[str, Tensor]) -> str:
    digest = hashlib.blake2b(json.dumps(config, sort_keys=True).encode(), digest_size=16)
    for name in sorted(tensors):
        digest.update(name.encode())
        digest.update(tensors[name].contiguous().numpy().tobytes())
    return digest.hexdigest()
