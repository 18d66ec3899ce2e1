"""`lfview train`: train the networks on light fields with captured views between the corners."""

from __future__ import annotations

import argparse
from typing import Any

from app.cli.common import Verbs, add_verb


def add_parser(verbs: Verbs[Any], name: str) -> None:
    """Declare the verb."""
    parser = add_verb(
        verbs,
        name,
        "train the networks; goes on where it was stopped",
        "lfview train --data training/* --val held_out/* --out weights.safetensors --minutes 60",
    )
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Train."""
    return 0
