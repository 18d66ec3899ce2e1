"""`lfview sweep PATH --path circle --frames N --out FILE`: views along a path of viewpoints, as a video or numbered frames."""

from __future__ import annotations

import argparse
import math
import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from app.cli.common import (
    Verbs,
    add_light_field,
    add_model,
    add_verb,
    check_apart_from,
    count_or_none,
    open_and_warn,
    positive,
    viewpoint,
    whole,
)
from app.progress import Progress
from lfcore.errors import InputError

if TYPE_CHECKING:
    from lfcore.lightfield import LightField
    from lfcore.sweep_plan import SweepPlan, ViewPath
    from lfcore.sweep_target import Target

PATH_NAMES = ("circle", "horizontal", "vertical", "lawnmower", "spiral")
LAYER_NAMES = ("image", "disparity", "error", "image+captured", "image+disparity")
_LINE = "line"
_DEFAULT_PATH = "circle"
_CIRCLE_RADIUS, _RADIUS = 0.3, 0.5


def add_parser(verbs: Verbs[Any], name: str) -> None:
    """Declare the verb."""
    parser = add_verb(
        verbs,
        name,
        "export a video, or frames, of synthesized views along a path",
        "lfview sweep capture.png --path circle --frames 60 --fps 30 --out sweep.mp4\n"
        "         lfview sweep capture.png --path line --from 0,0 --to 1,1 --layer image+disparity --labels --out sweep.webm\n"
        "         lfview sweep capture.png --path sweep.json --out frames/ --as png",
    )
    add_light_field(parser)
    parser.add_argument(
        "--path",
        dest="sweep_path",
        metavar="NAME",
        help=f"{', '.join(PATH_NAMES)}, {_LINE}, or a .json file from the window or --save-path (default: {_DEFAULT_PATH})",
    )
    parser.add_argument("--frames", type=whole, metavar="N", help="number of frames (default: 60)")
    parser.add_argument("--fps", type=float, metavar="F", help="frames per second (default: 30)")
    parser.add_argument(
        "--radius",
        type=float,
        metavar="R",
        help="reach from the middle view; 0.5 is the edge of the corner views (default: circle 0.3, others 0.5)",
    )
    parser.add_argument("--from", dest="start", type=viewpoint, metavar="U,V", help="where a line begins (default: 0,0.5)")
    parser.add_argument("--to", dest="end", type=viewpoint, metavar="U,V", help="where a line ends (default: 1,0.5)")
    parser.add_argument(
        "--focus",
        type=focus_range,
        metavar="A,B",
        help="refocus: the disparity in focus goes from A to B, px from corner to corner; one number keeps it",
    )
    parser.add_argument("--aperture", type=float, metavar="D", help="its diameter in baselines, with a focus (default: 1)")
    parser.add_argument("--layer", metavar="LAYER", help=f"{', '.join(LAYER_NAMES)} (default: image)")
    parser.add_argument("--labels", action="store_true", help="captions with (u, v), and legends of colours")
    size = parser.add_mutually_exclusive_group()
    size.add_argument("--scale", type=positive, metavar="S", help="size of the pictures (default: 1)")
    size.add_argument("--width", type=positive, metavar="PX", help="width of the pictures in px, in place of --scale")
    parser.add_argument(
        "--brighten", action="store_true", help="brighten dark captures for looking: ^(1/1.5), saturation x 1.5"
    )
    parser.add_argument("--gain", type=float, metavar="G", help="the error's colours end at white / G (default: 8)")
    parser.add_argument(
        "--plays", type=count_or_none, metavar="N", help="how often .webp and .gif are played (default, 0: for ever)"
    )
    parser.add_argument(
        "--out", required=True, metavar="OUT", help="the video: .mp4, .webm, .webp or .gif; or, with --as, a folder"
    )
    parser.add_argument(
        "--as",
        dest="kind",
        choices=("png", "exr"),
        help="numbered frames in the folder OUT: .png to look at, .exr to compute with",
    )
    parser.add_argument("--save-path", metavar="FILE", help="also save all these choices as .json, to be used as --path later")
    add_model(parser)
    parser.set_defaults(run=run)


def focus_range(text: str) -> tuple[float, float]:
    """Parse "A,B" or "A"."""
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in (1, 2):
        raise argparse.ArgumentTypeError(f"{text!r} is no focus; give one disparity in px, or two such as -4,2")
    return numbers[0], numbers[-1]


def run(options: argparse.Namespace) -> int:
    """Synthesize the frames one by one and write them."""
    from lfcore.export import check_target as check_file
    from lfcore.sweep_export import check_target, export_sweep
    from lfcore.sweep_plan import save_plan

    plan = _plan(options)
    target = _target(options)
    check_target(plan, target)
    if options.save_path:
        check_file(options.save_path, (".json",))
    check_apart_from(options.path, [target.path, options.save_path])

    from lfcore.sweep_frames import SweepFrames, remembering
    from lfcore.synthesizer import make_synthesizer

    synthesizer = make_synthesizer(options.model)
    light_field = open_and_warn(options.path, options.views)
    plan = _sized(plan, options, light_field)
    start = time.perf_counter()
    frames = SweepFrames(plan, light_field, remembering(light_field, synthesizer))
    with Progress("synthesizing", plan.frames, "frames") as bar:
        export_sweep(frames, target, lambda count: bar.reach(count / plan.frames))
    if options.save_path:
        save_plan(options.save_path, plan)
    seconds = time.perf_counter() - start
    print(f"{target.path}: {plan.frames} frames of {light_field.name} by {synthesizer.name}, {seconds:.1f} s")
    return 0


def _plan(options: argparse.Namespace) -> SweepPlan:
    """The plan that the options ask for: those given stand over what a file says."""
    from lfcore.sweep_plan import Layer, SweepPlan, load_plan

    name = options.sweep_path or _DEFAULT_PATH
    if Path(name).suffix.lower() == ".json":
        given = [option for option in ("radius", "start", "end", "focus") if getattr(options, option) is not None]
        if given:
            raise InputError(f"{name} holds a whole path; leave out --radius, --from, --to and --focus, or change the file.")
        plan = load_plan(name)
    else:
        plan = SweepPlan(_path(name, options))
    changes: dict[str, Any] = {
        field: getattr(options, field)
        for field in ("frames", "fps", "scale", "gain", "aperture", "plays")
        if getattr(options, field) is not None
    }
    changes |= {field: True for field in ("labels", "brighten") if getattr(options, field)}
    if options.layer is not None:
        if options.layer not in LAYER_NAMES:
            raise InputError(f"There is no layer {options.layer!r}; choose one of {', '.join(LAYER_NAMES)}.")
        changes["layer"] = Layer(options.layer)
    return replace(plan, **changes)


def _path(name: str, options: argparse.Namespace) -> ViewPath:
    from lfcore.key_frames import Stop
    from lfcore.sweep_plan import KeyFramePath, ShapePath

    focus = options.focus
    if name == _LINE:
        if options.radius is not None:
            raise InputError("A line has no radius; give its ends by --from and --to.")
        ends = (options.start or (0.0, 0.5), options.end or (1.0, 0.5))
        sharp = focus or (None, None)
        return KeyFramePath(tuple(Stop(u, v, disparity) for (u, v), disparity in zip(ends, sharp, strict=True)))
    if name not in PATH_NAMES:
        raise InputError(
            f"There is no path {name!r}; choose one of {', '.join(PATH_NAMES)}, {_LINE}, or the name of a .json file."
        )
    if options.start is not None or options.end is not None:
        raise InputError(f"--from and --to belong to --path {_LINE}; give the path {name} a --radius.")
    default = _CIRCLE_RADIUS if name == _DEFAULT_PATH else _RADIUS
    return ShapePath(name, default if options.radius is None else options.radius, focus)


def _target(options: argparse.Namespace) -> Target:
    from lfcore.sweep_target import Kind, Target
    from lfcore.video import COUNTING_EXTENSIONS

    kinds = {None: Kind.VIDEO, "png": Kind.PNG, "exr": Kind.EXR}
    path = Path(options.out)
    if options.plays is not None and (options.kind or path.suffix.lower() not in COUNTING_EXTENSIONS):
        raise InputError(f"--plays is for {' and '.join(COUNTING_EXTENSIONS)}; other files leave it to the player.")
    return Target(path, kinds[options.kind])


def _sized(plan: SweepPlan, options: argparse.Namespace, light_field: LightField) -> SweepPlan:
    from lfcore.sweep_plan import SCALE_LIMITS

    if options.width is None:
        return plan
    least, most = math.ceil(SCALE_LIMITS[0] * light_field.width), math.floor(SCALE_LIMITS[1] * light_field.width)
    if not least <= options.width <= most:
        raise InputError(f"--width is {options.width:g} px; for views of {light_field.width} px give {least} to {most}.")
    return replace(plan, scale=options.width / light_field.width)
