"""What several verbs share: their options, opening with a progress bar, scenes of a folder, JSON out."""

from __future__ import annotations

import argparse
import contextlib
import json
import math
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from app.progress import Progress
from lfcore.errors import InputError

if TYPE_CHECKING:
    from lfcore.lightfield import LightField

LARGEST = 10**9  # number that any option takes
_LONGEST_SHOWN = 24  # characters of one that is complained of

Verbs = argparse._SubParsersAction  # argparse has no public name for it


def add_verb(verbs: Verbs[Any], name: str, summary: str, example: str) -> argparse.ArgumentParser:
    """A verb's parser with its summary and an example at the end of its help."""
    parser: argparse.ArgumentParser = verbs.add_parser(
        name,
        help=summary,
        description=f"{summary[0].upper()}{summary[1:]}.",
        epilog=f"example: {example}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    return parser


def add_light_field(parser: argparse.ArgumentParser) -> None:
    """PATH and --views, for the verbs that open one light field."""
    parser.add_argument(
        "path", metavar="PATH", type=Path, help="a raw capture, an ESLF picture, a folder or an array (.mat, .h5) of views"
    )
    parser.add_argument(
        "--views",
        type=whole,
        default=8,
        metavar="N",
        help="side of the middle square of views taken from a raw capture, an ESLF or an array with dark corners (default: 8)",
    )


def add_model(parser: argparse.ArgumentParser) -> None:
    """--model, for the verbs that use one."""
    parser.add_argument(
        "--model",
        default="full",
        metavar="NAME",
        help="full (the paper's two networks, default), realtime (a small pair of this program's), single (one network, "
        "without disparity), planesweep (without networks), mean (average of the corners), neighbours (realtime, from "
        "the four captured views around the viewpoint in place of the corners: best from a whole capture), or a "
        ".safetensors file",
    )


def labelled(models: list[str]) -> dict[str, str]:
    """The models by what tables call them: their name, or their file's name without folder and extension.

    Raises InputError where two of them would be called the same.
    """
    names = list(dict.fromkeys(models))
    labels = {Path(name).stem if name.endswith(".safetensors") else name: name for name in names}
    if len(labels) < len(names):
        raise InputError("Two of the models would have the same name in the table; rename one of the weight files.")
    return labels


def viewpoint(text: str) -> tuple[float, float]:
    """Parse "U,V"."""
    parts = text.split(",")
    try:
        u, v = (float(part) for part in parts)
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"{text!r} is not a viewpoint; give two numbers such as 0.5,0.5") from error
    return u, v


def whole(text: str) -> int:
    """Parse a whole number, at most LARGEST in size."""
    if not text.removeprefix("-").isdecimal():
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number")
    return int(_limited(text))


def count(text: str) -> int:
    """Parse a whole number from 1 to LARGEST."""
    if not text.isdecimal() or _limited(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number of 1 or more")
    return int(text)


def count_or_none(text: str) -> int:
    """Parse a whole number from 0 to LARGEST."""
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number of 0 or more")
    return int(_limited(text))


def at_most(limit: int, parse: Callable[[str], int]) -> Callable[[str], int]:
    """A parser of the same numbers up to a lower limit."""

    def limited(text: str) -> int:
        value = parse(text)
        if value > limit:
            raise argparse.ArgumentTypeError(f"{value} is too large; give at most {limit}")
        return value

    return limited


def positive(text: str) -> float:
    """Parse a number above 0 and at most LARGEST."""
    with contextlib.suppress(ValueError):
        value = float(text)
        if 0 < value < math.inf:
            return _limited(text)
    raise argparse.ArgumentTypeError(f"{text!r} is not a number above 0")


def _limited(text: str) -> float:
    """The number, which must not be too large: nothing here asks for more, and libraries may not hold it."""
    value = float(text)
    if abs(value) > LARGEST:
        shown = text if len(text) <= _LONGEST_SHOWN else f"a number of {len(text)} characters"
        raise argparse.ArgumentTypeError(f"{shown} is too large; give at most {LARGEST}")
    return value


def share(text: str) -> float:
    """Parse a number from 0 to 1."""
    with contextlib.suppress(ValueError):
        value = float(text)
        if 0 <= value <= 1:
            return value
    raise argparse.ArgumentTypeError(f"{text!r} is not a number from 0 to 1")


def open_with_progress(path: Path, views: int = 8) -> LightField:
    """Open a light field, with a bar on a terminal."""
    from lfcore.formats import open_light_field

    with Progress(f"reading {path.name}", 1) as bar:
        return open_light_field(path, views=views, progress=bar.reach)


def open_and_warn(path: Path, views: int = 8) -> LightField:
    """As open_with_progress; what is to be minded about the light field goes to standard error."""
    light_field = open_with_progress(path, views)
    for warning in light_field.warnings:
        print(f"Note: {path}: {warning}", file=sys.stderr)
    return light_field


def scenes_in(paths: list[Path]) -> list[Path]:
    """The paths, each folder of folders replaced by the folders in it, and another one of light fields by these, sorted.

    A folder that cannot be read stays as it is: whoever opens it says so.
    """
    return [scene for path in paths for scene in _scenes_below(path)]


def _scenes_below(path: Path) -> list[Path]:
    from lfcore.formats.collection import members
    from lfcore.formats.images import EXTENSIONS

    try:
        children = sorted(path.iterdir()) if path.is_dir() else []
        folders = [child for child in children if child.is_dir() and not child.name.startswith(".")]
        holds_pictures = any(child.suffix.lower() in EXTENSIONS for child in children)
        return folders if folders and not holds_pictures else sorted(members(path)) or [path]
    except (OSError, InputError):
        return [path]


def check_apart_from(path: Path, targets: Iterable[str | Path | None]) -> None:
    """Make sure that no target is a file of the light field at `path`, or another target; None is none. Raises OutputError."""
    from lfcore.export import check_apart
    from lfcore.formats import files_of

    check_apart([target for target in targets if target is not None], [path, *files_of(path)])


def check_all_there(paths: list[Path]) -> None:
    """Raise InputError for the first path that is missing."""
    for path in paths:
        if not path.exists():
            raise InputError(f"{path} does not exist; give a light field, or a folder of light fields.")


def check_json_target(target: str | None) -> None:
    """Make sure that JSON can be written there: "-" is standard output. Raises OutputError."""
    from lfcore.export import check_target

    if target is not None and target != "-":
        check_target(target, (".json",))


def write_json(value: Any, target: str) -> None:
    """Write JSON to a file, or to standard output where the target is "-"."""
    from lfcore.atomic import atomic_path

    text = json.dumps(value, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    if target == "-":
        sys.stdout.write(text)
        return
    with atomic_path(target) as temporary:
        temporary.write_text(text, encoding="utf-8")
