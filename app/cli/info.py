"""`lfview info PATH`: what a light field holds, and whether its pictures agree with the order of its views."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from app.cli.common import Verbs, add_light_field, add_verb, open_with_progress, write_json

if TYPE_CHECKING:
    from lfcore.disparity_sign import DisparityCheck
    from lfcore.lightfield import LightField


def add_parser(verbs: Verbs[Any], name: str) -> None:
    """Declare the verb."""
    parser = add_verb(verbs, name, "say what a light field holds", "lfview info capture.png")
    add_light_field(parser)
    parser.add_argument("--json", action="store_true", help="print JSON instead of text")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Open the light field and print what it holds."""
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
    width = max(len(name) for name in facts) + 1
    return "\n".join(f"{name + ':':<{width}} {value}" for name, value in facts.items())
