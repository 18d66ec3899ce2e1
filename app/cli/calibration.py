"""--calibration, for the verbs that read Lytro captures: pointed to once, calibration is found for ever after."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path


def add_calibration(parser: argparse.ArgumentParser) -> None:
    """--calibration PATH."""
    parser.add_argument(
        "--calibration",
        type=Path,
        metavar="PATH",
        help="where the white images of the camera are: caldata-*.tar, data.C.0, or a folder; remembered for later",
    )


def keep(calibration: Path | None) -> None:
    """Remember calibration that was named and could be used. A list that cannot be written is told, and is no failure."""
    from lfcore.decode.remembered import remember
    from lfcore.errors import OutputError

    if calibration is None:
        return
    try:
        remember(calibration)
    except OutputError as error:
        print(f"lfview: {error} The calibration is used now, but not remembered.", file=sys.stderr)
