"""What a weight file says of itself at its beginning; read without torch, which takes more than a second to load."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

FORMAT = "lfview weights 1"
_LENGTH_BYTES = 8  # of the number at the beginning of a safetensors file, low byte first: how long the header is
_LONGEST = 2**20


@dataclass(frozen=True)
class Stated:
    """The name of a model and the key of its weights in caches, as their file states them."""

    name: str
    key: str


def read_stated(path: Path) -> Stated | None:
    """What the file states; None where it is no weight file that can be read, which loading it will say in a sentence.

    Whether the weights fit the key is checked when they are loaded.
    """
    try:
        with path.open("rb") as file:
            length = int.from_bytes(file.read(_LENGTH_BYTES), "little")
            header = json.loads(file.read(length)) if length <= _LONGEST else None
    except (OSError, ValueError, RecursionError):
        return None
    metadata = header.get("__metadata__") if isinstance(header, dict) else None
    if not isinstance(metadata, dict) or metadata.get("format") != FORMAT:
        return None
    name, key = _name(metadata), metadata.get("digest")
    return Stated(name, key) if isinstance(name, str) and isinstance(key, str) else None


def _name(metadata: dict[str, Any]) -> object:
    try:
        config = json.loads(metadata.get("config", ""))
    except (TypeError, ValueError, RecursionError):
        return None
    return config.get("name") if isinstance(config, dict) else None
