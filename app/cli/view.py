"""`lfview [view] [PATH]`: the window. The only verb that imports OpenGL, glfw and imgui."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from app.cli.common import Verbs, add_model, add_verb, count, count_or_none


def add_parser(verbs: Verbs[Any], name: str) -> None:
    """Declare the verb."""
    parser = add_verb(verbs, name, "open a light field in the viewer; the verb may be left out", "lfview capture.png")
    parser.add_argument(
        "path",
        metavar="PATH",
        type=Path,
        nargs="?",
        help="a raw capture, an ESLF picture, an array (.mat, .h5), a folder of views or of light fields (default: the start "
        "picture with the files opened lately, the sample where there are none)",
    )
    add_model(parser)
    parser.set_defaults(model=None)  # that of the last run, at first `full`
    parser.add_argument("--cache", type=count, default=512, metavar="MIB", help="memory for past syntheses (default: 512)")
    parser.add_argument(
        "--disk-cache",
        type=count_or_none,
        default=1024,
        metavar="MIB",
        help="disk for syntheses between runs, all light fields together; 0 keeps none (default: 1024)",
    )
    parser.add_argument("--no-foresight", action="store_true", help="compute no views ahead while nothing else is to be done")
    parser.add_argument(
        "--screenshot", metavar="FILE", help="open no window; write what it would show as .png, also without a display"
    )
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Open the window and stay until it is closed, or write a picture of it."""
    if options.screenshot:
        return _write_screenshot(options)

    from app.viewer import run_viewer

    return run_viewer(options.path, options.model, options.cache, options.disk_cache, not options.no_foresight)


def _write_screenshot(options: argparse.Namespace) -> int:
    from app.offscreen import screenshot
    from app.opening import DEFAULT_MODEL
    from assets import sample_path
    from lfcore.export import check_target

    out = check_target(options.screenshot, (".png",))
    screenshot(options.path or sample_path(), out, options.model or DEFAULT_MODEL)
    print(f"{out}: the viewer on {options.path or 'the sample light field'}")
    return 0
