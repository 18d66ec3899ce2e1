"""`lfview [view] [PATH]`: the window. The only verb that imports OpenGL, glfw and imgui."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from app.cli.common import Verbs, add_model, add_verb


def add_parser(verbs: Verbs[Any], name: str) -> None:
    """Declare the verb."""
    parser = add_verb(verbs, name, "open a light field in the viewer; the verb may be left out", "lfview capture.png")
    parser.add_argument(
        "path", metavar="PATH", type=Path, nargs="?", help="an ESLF picture or a folder of views (default: the sample)"
    )
    add_model(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Open the window and stay until it is closed."""
    from app.viewer import run_viewer

    return run_viewer(options.path, options.model)
