"""`lfview decode RAW... --out DIR|FILE.png`: raw captures of Lytro cameras to ESLF pictures or folders of views."""

from __future__ import annotations

import argparse
import sys
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait
from pathlib import Path
from typing import TYPE_CHECKING, Any

from app.cli.calibration import add_calibration, keep
from app.cli.common import Verbs, add_verb, count, whole
from app.progress import Progress
from lfcore.errors import InputError, LfviewError, is_out_of_memory

if TYPE_CHECKING:
    from lfcore.lightfield import LightField

# Memory that decoding one capture of an Illum takes, its views included: as many run at a time as have room.
_BYTES_PER_CAPTURE = 3 * 2**29
_LOOK_SECONDS = 0.1  # between two looks at how far the work is

Write = Callable[[Path, "LightField"], list[Path]]


def add_parser(verbs: Verbs[Any], name: str) -> None:
    """Declare the verb."""
    parser = add_verb(
        verbs,
        name,
        "decode raw captures of Lytro cameras",
        "lfview decode IMG_0001.LFR --out IMG_0001.png\n"
        "         lfview decode captures/ --out decoded/ --calibration caldata-B5143.tar",
    )
    parser.add_argument("paths", metavar="RAW", nargs="+", type=Path, help="raw captures (.LFR, .lfp), or folders of them")
    parser.add_argument(
        "--out", required=True, type=Path, metavar="DIR|FILE.png", help="a folder, or for one capture the ESLF picture"
    )
    add_calibration(parser)
    parser.add_argument(
        "--views", type=whole, default=14, metavar="N", help="side of the middle square of the 14 x 14 views (default: 14, all)"
    )
    parser.add_argument(
        "--as",
        dest="kind",
        choices=("eslf", "views"),
        help="one picture of 14 x 14 px per microlens (default), or a folder of views (default where --views is not 14)",
    )
    parser.add_argument(
        "--every-row",
        action="store_true",
        help="keep every row of microlenses: views of 625 x 434 px from an Illum in place of 541 x 376",
    )
    parser.add_argument("--linear", action="store_true", help="linear light in 16 bits, without the sRGB curve")
    parser.add_argument("--depth", type=int, choices=(8, 16), default=8, help="bits per value (default: 8)")
    parser.add_argument("--jobs", type=count, metavar="N", help="captures at a time (default: as cores and memory allow)")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Decode all captures; those that fail are named, the rest is decoded."""
    from lfcore.decode.output import captures_in, facts_path, write_eslf, write_views
    from lfcore.decode.pipeline import DecodeOptions, decode_capture
    from lfcore.export import check_apart

    wanted = DecodeOptions(options.views, options.every_row, options.linear, options.depth)
    captures = captures_in(options.paths)
    kind = options.kind or ("eslf" if options.views == 14 else "views")
    targets = _targets(captures, kind, options)
    check_apart(
        [path for target in targets for path in (target, facts_path(target, kind == "eslf"))],
        [*captures, *([options.calibration] if options.calibration else [])],
    )
    write: Write = write_eslf if kind == "eslf" else write_views
    jobs = options.jobs or _jobs(len(captures))

    def decode(index: int, progress: Callable[[float], None], cancelled: Callable[[], bool]) -> list[Path]:
        capture = captures[index]
        try:
            light_field = decode_capture(capture, options.calibration, wanted, lambda share: progress(0.7 * share), cancelled)
            return write(targets[index], light_field)
        except Exception as error:
            if is_out_of_memory(error):
                raise InputError(f"{capture}: there is not enough memory to decode it; close other programs.") from error
            raise

    failed = _run_all(decode, len(captures), jobs)
    if failed < len(captures):
        keep(options.calibration)
    return 2 if failed else 0


def _targets(captures: list[Path], kind: str, options: argparse.Namespace) -> list[Path]:
    """Where each capture goes: a .png is an ESLF, anything else a folder of views. Raises LfviewError before any work."""
    from lfcore.export import check_folder_target, check_no_views, check_target, make_folder

    if kind == "eslf" and options.views != 14:
        raise InputError(f"An ESLF holds 14 x 14 views, but --views is {options.views}; leave --views out, or add --as views.")
    if options.out.suffix.lower() == ".png":
        if len(captures) != 1 or kind != "eslf":
            reason = "a single picture is an ESLF" if kind != "eslf" else f"there are {len(captures)} captures"
            raise InputError(f"{options.out} is one file, but {reason}; give --out a folder.")
        return [check_target(options.out, (".png",))]
    check_folder_target(options.out)
    names = [capture.stem for capture in captures]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise InputError(f"Two captures are named {twice}; decode them into different folders.")
    folder = make_folder(options.out)
    targets = [folder / (f"{name}.png" if kind == "eslf" else name) for name in names]
    if kind != "eslf":
        for target in targets:
            check_no_views(target)
    return targets


def _jobs(captures: int) -> int:
    from lfcore.machine import core_count, free_memory

    return max(min(captures, core_count(), free_memory() // _BYTES_PER_CAPTURE), 1)


Job = Callable[[int, Callable[[float], None], Callable[[], bool]], list[Path]]


def _run_all(decode: Job, captures: int, jobs: int) -> int:
    """Decode captures number 0 to captures - 1, `jobs` at a time; prints what was written and returns how many failed."""
    import torch

    from lfcore.machine import core_count

    torch.set_num_threads(max(core_count() // jobs, 1))
    shares = [0.0] * captures
    stop = threading.Event()
    failed = 0
    with Progress("decoding", captures, "captures") as bar, ThreadPoolExecutor(jobs) as pool:

        def work(index: int) -> list[Path]:
            def progress(share: float) -> None:
                shares[index] = share

            return decode(index, progress, stop.is_set)

        waiting = [pool.submit(work, index) for index in range(captures)]
        try:
            for index, future in enumerate(waiting):
                while not future.done():
                    wait([future], timeout=_LOOK_SECONDS)
                    bar.reach(sum(shares) / captures)
                shares[index] = 1.0
                try:
                    print(*future.result(), sep="\n")
                except LfviewError as error:
                    failed += 1
                    print(f"lfview: {error}", file=sys.stderr)
        except BaseException:  # Ctrl-C as well: what runs ends at its next step, what waits does not begin
            stop.set()
            for future in waiting:
                future.cancel()
            raise
    return failed
