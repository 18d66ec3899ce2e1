"""`lfview info PATH`: what a light field holds."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from app.cli.common import Verbs, add_light_field, add_verb, open_with_progress, write_json

if TYPE_CHECKING:
    from lfcore.lightfield import LightField

_DEPTHS = {"uint8": "8 bits", "uint16": "16 bits", "float32": "float"}


def add_parser(verbs: Verbs[Any], name: str) -> None:
    """Declare the verb."""
    parser = add_verb(verbs, name, "say what a light field holds", "lfview info capture.png")
    add_light_field(parser)
    parser.add_argument("--json", action="store_true", help="print JSON instead of text")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Open the light field and print what it holds."""
    light_field = open_with_progress(options.path, options.views)
    if options.json:
        write_json(as_json(light_field), "-")
    else:
        print(as_text(light_field))
    return 0


def as_json(light_field: LightField) -> dict[str, Any]:
    """The light field in JSON's types; dark views as [row, column]."""
    return {
        "name": light_field.name,
        "source": light_field.source,
        "kind": light_field.kind,
        "rows": light_field.rows,
        "columns": light_field.columns,
        "height": light_field.height,
        "width": light_field.width,
        "type": str(light_field.views.dtype),
        "facts": dict(light_field.facts),
        "warnings": list(light_field.warnings),
        "dark": [list(view) for view in sorted(light_field.dark)],
    }


def as_text(light_field: LightField) -> str:
    """The same for people, one fact a line."""
    depth = _DEPTHS[str(light_field.views.dtype)]
    mib = light_field.views.nbytes / 2**20
    lines = {
        "name": light_field.name,
        "source": light_field.source,
        "kind": light_field.kind,
        "views": f"{light_field.rows} rows x {light_field.columns} columns",
        "size": f"{light_field.width} x {light_field.height} px each",
        "values": f"{depth}, {mib:.0f} MiB in memory",
        **light_field.facts,
    }
    if light_field.dark:
        lines["dark"] = f"{len(light_field.dark)} of {light_field.rows * light_field.columns} views are too dark to be used"
    width = max(len(name) for name in lines) + 1
    text = [f"{name + ':':<{width}} {value}" for name, value in lines.items()]
    return "\n".join(text + [f"warning: {warning}" for warning in light_field.warnings])
