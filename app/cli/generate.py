"""`lfview generate --count N --out DIR`: generated light fields with their true disparity, to look at and to train on."""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

from app.cli.common import Verbs, add_verb, at_most, count, whole
from app.progress import Progress
from lfcore.errors import InputError

if TYPE_CHECKING:
    from lfcore.training.generated import GeneratedScene

_MOST_SCENES = 100_000
_MOST_WORKERS = 1024


def add_parser(verbs: Verbs[Any], name: str) -> None:
    """Declare the verb."""
    parser = add_verb(
        verbs,
        name,
        "write generated light fields with their true disparity",
        "lfview generate --count 12 --seed 1 --textures photographs/ --out scenes/",
    )
    parser.add_argument(
        "--count", type=at_most(_MOST_SCENES, count), default=1, metavar="N", help="how many scenes (default: 1)"
    )
    parser.add_argument(
        "--seed", type=whole, default=0, metavar="S", help="number of the first scene; the same number gives the same scene (0)"
    )
    parser.add_argument(
        "--textures", type=Path, metavar="DIR", help="photographs that surfaces are covered with (default: patterns only)"
    )
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="one folder per scene is made in this folder")
    parser.add_argument("--views", type=count, default=5, metavar="N", help="N x N views (default: 5)")
    parser.add_argument("--size", type=count, default=352, metavar="PX", help="height and width of a view (default: 352)")
    parser.add_argument(
        "--workers", type=at_most(_MOST_WORKERS, count), default=1, metavar="N", help="processes that generate (default: 1)"
    )
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Generate and write."""
    from lfcore.export import make_folder
    from lfcore.formats.images import MAX_BYTES

    if options.views < 2 or options.size < 32:
        raise InputError(
            f"{options.views} x {options.views} views of {options.size} px cannot be generated; ask for 2 x 2 or more, "
            "of 32 px or more."
        )
    if options.seed < 0:
        raise InputError(f"The seed is {options.seed}; it must be 0 or more.")
    # Bytes: light and disparity of each view's pixel, colours and coverage of each layer's.
    needed = options.size**2 * (20 * options.views**2 + 400)
    if needed > MAX_BYTES:
        raise InputError(
            f"{options.views} x {options.views} views of {options.size} px take {needed / 2**30:.1f} GiB to generate; at most "
            f"{MAX_BYTES / 2**30:.0f} GiB are taken: make them smaller or fewer."
        )
    _check_free(options.out, options.seed, options.count)

    from lfcore.training.generated import SceneConfig, Textures, generate_pool

    textures = Textures(options.textures)
    config = SceneConfig(views=options.views, height=options.size, width=options.size)
    folder = make_folder(options.out)
    with Progress("generating", options.count, "scenes") as bar:
        for k, scene in enumerate(generate_pool(options.count, options.seed, textures, config, options.workers)):
            _write(scene, folder / _name(options.seed + k))
            bar.step()
    print(f"{folder}: {options.count} scenes of {options.views} x {options.views} views, {options.size} x {options.size} px")
    return 0


def _name(seed: int) -> str:
    return f"generated_{seed:05}"


def _check_free(out: Path, seed: int, scenes: int) -> None:
    """Scenes are not mixed with what is there already. Raises InputError."""
    there = {entry.name for entry in out.iterdir()} if out.is_dir() else set()
    taken = next((name for name in map(_name, range(seed, seed + scenes)) if name in there), None)
    if taken is not None:
        raise InputError(f"{out / taken} is there already; take it away, or choose another --seed or --out.")


def _write(scene: GeneratedScene, folder: Path) -> None:
    """Views as lossless PNG, and the middle view's disparity as EXR in a folder of its own, which readers of views pass over.

    The folder appears when it is complete.
    """
    from lfcore.export import make_folder, write_disparity, write_picture

    views = scene.light_field.views
    with tempfile.TemporaryDirectory(prefix=".", dir=folder.parent) as temporary:
        unfinished = make_folder(Path(temporary) / folder.name)
        for row in range(views.shape[0]):
            for column in range(views.shape[1]):
                write_picture(unfinished / f"view_{row:02}_{column:02}.png", views[row, column])
        middle = scene.disparity[scene.light_field.rows // 2, scene.light_field.columns // 2]
        write_disparity(make_folder(unfinished / "truth") / "disparity.exr", middle)
        unfinished.rename(folder)
