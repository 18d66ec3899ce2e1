"""`lfview info PATH`: what a light field or a Lytro file holds, and whether the pictures agree with the order of the views."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from app.cli.calibration import add_calibration, keep
from app.cli.common import Verbs, add_light_field, add_verb, open_with_progress, write_json
from app.progress import Progress
from lfcore.errors import InputError

if TYPE_CHECKING:
    from lfcore.disparity_sign import DisparityCheck
    from lfcore.lightfield import LightField


def add_parser(verbs: Verbs[Any], name: str) -> None:
    """Declare the verb."""
    parser = add_verb(verbs, name, "say what a light field or a Lytro file holds", "lfview info capture.png")
    add_light_field(parser)
    parser.add_argument("--json", action="store_true", help="print JSON instead of text")
    add_calibration(parser)
    parser.add_argument(
        "--extract",
        type=Path,
        metavar="DIR",
        help="also write the pictures, maps and metadata that a Lytro file holds into a folder",
    )
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Print what a file or folder holds."""
    from lfcore.formats.lytro.container import is_container

    if options.path.is_file() and is_container(options.path):
        return _run_lytro(options)
    for name in ("calibration", "extract"):
        if getattr(options, name) is not None:
            raise InputError(f"{options.path} is no file of a Lytro camera; --{name} is for these: leave it out.")
    return _run_light_field(options)


def _run_lytro(options: argparse.Namespace) -> int:
    from lfcore.decode.calibration import choose_white_image
    from lfcore.formats.lytro import extract, report
    from lfcore.formats.lytro.container import open_container
    from lfcore.formats.lytro.contents import Kind, read_contents

    container = open_container(options.path)
    contents = read_contents(container)
    choice = None
    if contents.capture is not None and contents.kind is Kind.CAPTURE:
        choice = choose_white_image(container, contents.capture, options.calibration)
        keep(options.calibration)
    if options.json:
        write_json(report.as_json(container, contents, choice), "-")
    else:
        print(_lines(report.as_facts(container, contents, choice)))
    if options.extract is not None:
        with Progress(f"writing to {options.extract}", 1) as bar:
            extract.extract(container, contents, options.extract, bar.reach)
    return 0


def _run_light_field(options: argparse.Namespace) -> int:
    from lfcore.disparity_sign import check_disparity

    light_field = open_with_progress(options.path, options.views)
    check = check_disparity(light_field)
    if options.json:
        write_json(as_json(light_field, check), "-")
    else:
        print(as_text(light_field, check))
    return 0


def as_json(light_field: LightField, check: DisparityCheck) -> dict[str, Any]:
    """The light field in JSON's types: dark views as [row, column], disparity in px from corner to corner."""
    from lfcore.disparity_sign import Order

    known = check.order is not Order.UNKNOWN
    return {
        "name": light_field.name,
        "source": light_field.source,
        "kind": light_field.kind,
        "rows": light_field.rows,
        "columns": light_field.columns,
        "height": light_field.height,
        "width": light_field.width,
        "type": str(light_field.views.dtype),
        "disparity": {"low": round(check.low, 2), "high": round(check.high, 2)} if known else None,
        "order": check.order.value,
        "facts": dict(light_field.facts),
        "warnings": list(light_field.warnings),
        "dark": [list(view) for view in sorted(light_field.dark)],
    }


def as_text(light_field: LightField, check: DisparityCheck) -> str:
    """The same for people, one fact a line."""
    from lfcore.formats.describe import describe

    facts = {"Source": light_field.source, **describe(light_field, check)}
    facts["Memory"] = f"{light_field.views.nbytes / 2**20:.0f} MiB"
    return _lines(facts)


def _lines(facts: Mapping[str, str]) -> str:
    width = max(len(name) for name in facts) + 1
    return "\n".join(f"{name + ':':<{width}} {value}" for name, value in facts.items())
