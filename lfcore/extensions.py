"""Modules in C that are optional: compiled when the package is installed, where there is a compiler."""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from types import ModuleType


def extension(name: str, functions: Sequence[str]) -> ModuleType | None:
    """The compiled module of that full name, or None where there is none.

    One that lacks a function has been compiled from older source, and lies in a checkout still: it does not count.
    """
    try:
        module = importlib.import_module(name)
    except ImportError:
        return None
    return module if all(hasattr(module, function) for function in functions) else None
