"""Weights and the sample light field, found through the package so that they work from any directory."""

from __future__ import annotations

from pathlib import Path

_ROOT = Path(__file__).parent


def sample_path() -> Path:
    """The folder of the sample light field: 8 x 8 views of 541 x 376."""
    return _ROOT / "sample"


def weights_path(model: str) -> Path:
    """The shipped weights of the named model, as safetensors."""
    return _ROOT / f"{model}.safetensors"
