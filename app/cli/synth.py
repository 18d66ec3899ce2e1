"""`lfview synth PATH --uv U,V --out FILE`: one synthesized view, with its disparity and warped inputs on request."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from app.cli.common import Verbs, add_light_field, add_model, add_verb, open_with_progress, viewpoint
from app.progress import Progress
from lfcore.errors import InputError

if TYPE_CHECKING:
    from lfcore.synthesizer import Synthesis


def add_parser(verbs: Verbs[Any], name: str) -> None:
    """Declare the verb."""
    parser = add_verb(
        verbs, name, "synthesize one view from the four corner views", "lfview synth capture.png --uv 0.3,0.7 --out view.png"
    )
    add_light_field(parser)
    parser.add_argument(
        "--uv",
        type=viewpoint,
        required=True,
        metavar="U,V",
        help="the viewpoint: 0,0 is the top left corner view, 1,1 the bottom right; up to 0.25 beyond",
    )
    parser.add_argument(
        "--out", required=True, metavar="FILE", help="the picture: .png (8 bits), .tif (16 bits), .exr (half floats)"
    )
    parser.add_argument(
        "--disparity",
        metavar="FILE",
        help="also the disparity, px from corner to corner: .exr or .tif (numbers), .png (colours, with a legend)",
    )
    parser.add_argument("--warped", metavar="DIR", help="also the four warped inputs, as files like --out in this folder")
    add_model(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Synthesize and write."""
    from lfcore.export import IMAGE_EXTENSIONS, check_folder_target, check_target
    from lfcore.lightfield import check_viewpoint, is_extrapolated

    u, v = options.uv
    check_viewpoint(u, v)
    out = check_target(options.out, IMAGE_EXTENSIONS)
    if options.disparity:
        check_target(options.disparity, (".exr", ".tif", ".tiff", ".png"))
    if options.warped:
        check_folder_target(options.warped)

    from lfcore.synthesizer import make_synthesizer

    synthesizer = make_synthesizer(options.model)
    light_field = open_with_progress(options.path, options.views)
    with Progress("synthesizing", 1):
        synthesizer.set_light_field(light_field)
        synthesis = synthesizer.synthesize(u, v)
    _write(synthesis, out, options.disparity, options.warped)
    if is_extrapolated(u, v):
        print("Note: this viewpoint lies outside the corner views, so the picture is extrapolated.", file=sys.stderr)
    print(f"{out}: {light_field.name} from u {u:g}, v {v:g} by {synthesis.model}, {synthesis.timings['total']:.2f} s")
    return 0


def _write(synthesis: Synthesis, out: Path, disparity: str | None, warped: str | None) -> None:
    from lfcore.export import write_disparity, write_image, write_picture, write_warped
    from lfcore.figures import disparity_cell, figure

    if (disparity and synthesis.disparity is None) or (warped and synthesis.warped is None):
        raise InputError(
            f"The model {synthesis.model} has no disparity and no warped inputs; leave out --disparity and --warped."
        )
    write_image(out, synthesis.image)
    if disparity and synthesis.disparity is not None:
        if Path(disparity).suffix.lower() == ".png":
            write_picture(disparity, figure([disparity_cell(synthesis.disparity)], columns=1))
        else:
            write_disparity(disparity, synthesis.disparity)
    if warped and synthesis.warped is not None:
        write_warped(warped, synthesis.warped, out.suffix)
