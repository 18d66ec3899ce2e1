"""`lfview synth PATH --uv U,V --out FILE`: one synthesized view; or a grid of them, or a quilt."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from app.cli.common import Verbs, add_light_field, add_model, add_verb, check_apart_from, count, open_and_warn, viewpoint
from app.progress import Progress
from lfcore.errors import InputError

if TYPE_CHECKING:
    from lfcore.lightfield import FloatArray, LightField
    from lfcore.synthesizer import Synthesis, Synthesizer


def add_parser(verbs: Verbs[Any], name: str) -> None:
    """Declare the verb."""
    parser = add_verb(
        verbs,
        name,
        "synthesize one view from the four corner views, or a grid of views",
        "lfview synth capture.png --uv 0.3,0.7 --out view.png\n"
        "         lfview synth capture.png --grid 9 --out views/\n"
        "         lfview synth capture.png --grid 14 --out eslf.png\n"
        "         lfview synth capture.png --quilt 8x6 --out quilt.png",
    )
    add_light_field(parser)
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument(
        "--uv",
        type=viewpoint,
        metavar="U,V",
        help="the viewpoint: 0,0 is the top left corner view, 1,1 the bottom right; up to 0.25 beyond",
    )
    what.add_argument(
        "--grid",
        type=count,
        metavar="N",
        help="N x N views from corner to corner: a folder of view_RR_CC.png, or, where OUT ends in .png, an ESLF (N up to 14)",
    )
    what.add_argument(
        "--quilt",
        type=columns_and_rows,
        metavar="CxR",
        help="a quilt for a Looking Glass: C x R views from left to right; its name gets the ending _qsCxRa..",
    )
    parser.add_argument(
        "--out", required=True, metavar="OUT", help="the picture: .png (8 bits), .tif (16 bits), .exr (half floats)"
    )
    parser.add_argument(
        "--disparity",
        metavar="FILE",
        help="with --uv, also the disparity, px from corner to corner: .exr or .tif (numbers), .png (colours, with a legend)",
    )
    parser.add_argument("--warped", metavar="DIR", help="with --uv, also the four warped inputs, as files like --out")
    parser.add_argument(
        "--focus",
        type=float,
        metavar="D",
        help="with --quilt, the disparity that lies in the screen's plane, px from corner to corner (default: 0)",
    )
    add_model(parser)
    parser.set_defaults(run=run)


def columns_and_rows(text: str) -> tuple[int, int]:
    """Parse "8x6"."""
    columns, _, rows = text.partition("x")
    if not (columns.isdecimal() and rows.isdecimal()):
        raise argparse.ArgumentTypeError(f"{text!r} is no quilt; give columns and rows such as 8x6")
    return int(columns), int(rows)


def run(options: argparse.Namespace) -> int:
    """Synthesize and write."""
    if options.uv is None and (options.disparity or options.warped):
        raise InputError("--disparity and --warped belong to one view; give its --uv.")
    if options.quilt is None and options.focus is not None:
        raise InputError("--focus belongs to a quilt; give --quilt.")
    if options.uv is not None:
        return _one_view(options)
    return _grid(options) if options.grid is not None else _quilt(options)


def _one_view(options: argparse.Namespace) -> int:
    from lfcore.export import IMAGE_EXTENSIONS, check_folder_target, check_target, warped_paths
    from lfcore.lightfield import check_viewpoint, is_extrapolated

    u, v = options.uv
    check_viewpoint(u, v)
    out = check_target(options.out, IMAGE_EXTENSIONS)
    if options.disparity:
        check_target(options.disparity, (".exr", ".tif", ".tiff", ".png"))
    if options.warped:
        check_folder_target(options.warped)
    warped = [options.warped, *warped_paths(options.warped, out.suffix)] if options.warped else []
    check_apart_from(options.path, [out, options.disparity, *warped])

    from lfcore.synthesizer import make_synthesizer

    synthesizer = make_synthesizer(options.model)
    light_field = open_and_warn(options.path, options.views)
    with Progress("synthesizing", 1):
        synthesizer.set_light_field(light_field)
        synthesis = synthesizer.synthesize(u, v)
    _write(synthesis, out, options.disparity, options.warped)
    if is_extrapolated(u, v):
        print("Note: this viewpoint lies outside the corner views, so the picture is extrapolated.", file=sys.stderr)
    print(f"{out}: {light_field.name} from u {u:g}, v {v:g} by {synthesis.model}, {synthesis.timings['total']:.2f} s")
    return 0


def _grid(options: argparse.Namespace) -> int:
    from lfcore.synthesized_grid import check_grid_target, write_eslf, write_views

    check_apart_from(options.path, [options.out])
    synthesizer, light_field = _opened(options)
    side = options.grid
    out = check_grid_target(options.out, side, light_field)

    def write(done: Callable[[int], None]) -> None:
        if out.suffix.lower() == ".png":
            write_eslf(out, side, light_field, _views(synthesizer), done)
        else:
            write_views(out, side, _views(synthesizer), done)

    seconds = _timed(write, side**2)
    hint = f"; open it with --views {side}" if out.suffix.lower() == ".png" else ""
    print(f"{out}: {side} x {side} views of {light_field.name} by {synthesizer.name}, {seconds:.1f} s{hint}")
    return 0


def _quilt(options: argparse.Namespace) -> int:
    from lfcore.quilt import Quilt
    from lfcore.synthesized_grid import check_quilt_target, write_quilt

    columns, rows = options.quilt
    quilt = Quilt(columns, rows, focus=options.focus or 0.0)
    synthesizer, light_field = _opened(options)
    out = check_quilt_target(options.out, quilt, light_field)
    check_apart_from(options.path, [out])
    seconds = _timed(lambda done: write_quilt(out, quilt, light_field, _views(synthesizer), done), columns * rows)
    print(f"{out}: a quilt of {columns} x {rows} views of {light_field.name} by {synthesizer.name}, {seconds:.1f} s")
    return 0


def _opened(options: argparse.Namespace) -> tuple[Synthesizer, LightField]:
    from lfcore.synthesizer import make_synthesizer

    synthesizer = make_synthesizer(options.model)
    light_field = open_and_warn(options.path, options.views)
    synthesizer.set_light_field(light_field)
    return synthesizer, light_field


def _views(synthesizer: Synthesizer) -> Callable[[float, float], FloatArray]:
    return lambda u, v: synthesizer.synthesize(u, v).image


def _timed(write: Callable[[Callable[[int], None]], None], total: int) -> float:
    """Write with a progress bar; the seconds it took."""
    start = time.perf_counter()
    with Progress("synthesizing", total, "views") as bar:
        write(lambda made: bar.reach(made / total))
    return time.perf_counter() - start


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
