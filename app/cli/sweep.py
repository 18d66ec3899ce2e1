"""`lfview sweep PATH --path circle --frames N --out FILE`: a video of views along a path of viewpoints."""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterable, Iterator
from typing import Any, TypeVar

from app.cli.common import Verbs, add_light_field, add_model, add_verb, open_with_progress
from app.progress import Progress

PATH_NAMES = ("circle", "horizontal", "vertical", "lawnmower", "spiral")

_T = TypeVar("_T")


def add_parser(verbs: Verbs[Any], name: str) -> None:
    """Declare the verb."""
    parser = add_verb(
        verbs,
        name,
        "export a video of synthesized views along a path",
        "lfview sweep capture.png --path circle --frames 60 --fps 30 --out sweep.mp4",
    )
    add_light_field(parser)
    parser.add_argument("--path", dest="sweep_path", choices=PATH_NAMES, default="circle", help="the path (default: circle)")
    parser.add_argument("--frames", type=int, default=60, metavar="N", help="number of frames (default: 60)")
    parser.add_argument("--fps", type=float, default=30.0, metavar="F", help="frames per second (default: 30)")
    parser.add_argument(
        "--radius",
        type=float,
        metavar="R",
        help="reach from the middle view; 0.5 is the edge of the corner views (default: circle 0.3, others 0.5)",
    )
    parser.add_argument("--out", required=True, metavar="FILE", help="the video: .mp4, .webm, .webp or .gif")
    add_model(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Synthesize the frames one by one and encode them."""
    from lfcore.sweep import PATHS
    from lfcore.video import check_video_target, write_video

    target = check_video_target(options.out, options.fps)
    radius = {} if options.radius is None else {"radius": options.radius}
    viewpoints = PATHS[options.sweep_path](options.frames, **radius)

    from lfcore.cache import SynthesisCache
    from lfcore.sweep import rendered
    from lfcore.synthesizer import make_synthesizer

    synthesizer = make_synthesizer(options.model)
    light_field = open_with_progress(options.path, options.views)
    start = time.perf_counter()
    with Progress("synthesizing", len(viewpoints), "frames") as bar:
        frames = rendered(viewpoints, light_field, synthesizer, SynthesisCache())
        write_video(target, _counted(frames, bar), options.fps)
    seconds = time.perf_counter() - start
    print(f"{target}: {len(viewpoints)} frames of {light_field.name} by {synthesizer.name}, {seconds:.1f} s")
    return 0


def _counted(items: Iterable[_T], bar: Progress) -> Iterator[_T]:
    for item in items:
        yield item
        bar.step()
