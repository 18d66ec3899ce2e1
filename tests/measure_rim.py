"""`python -m tests.measure_rim PATH... --model NAME...`: how good pictures are along their edges, where no score looks.

Of the view that K16 scores, PSNR over RGB by distance from the edge; and how much pixels change (root of the mean square, of
255) as the viewpoint moves by 0.01 of the baseline: where a rim flickers they change more than in the middle.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import numpy.typing as npt

from lfcore.formats import open_light_field
from lfcore.lightfield import FloatArray
from lfcore.metrics import k16_view, psnr
from lfcore.synthesizer import make_synthesizer

FRAMES = ((0, 3), (3, 6), (6, 12), (12, 22), (22, 10**6))  # px from the edge
STEP = 0.01


def frames(size: tuple[int, int]) -> list[npt.NDArray[np.bool_]]:
    """Which pixels of a picture (H, W) lie in each of FRAMES."""
    y, x = (np.minimum(np.arange(length), length - 1 - np.arange(length)) for length in size)
    distance = np.minimum(y[:, None], x)
    return [(distance >= first) & (distance < last) for first, last in FRAMES]


def change(one: FloatArray, other: FloatArray) -> float:
    """Root of the mean square of their difference, of 255."""
    return 255 * float(np.sqrt(np.square(one - other).mean()))


def main() -> None:
    """Print two rows for each light field and model, and the means of each model's PSNR."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("paths", type=Path, nargs="+")
    parser.add_argument("--model", action="append", default=[], help="a name, or a .safetensors file")
    options = parser.parse_args()
    synthesizers = {name: make_synthesizer(name) for name in options.model or ["full"]}
    scores: dict[str, list[list[float]]] = {name: [] for name in synthesizers}
    print("px from the edge: " + ", ".join(f"{first} to {last}" for first, last in FRAMES[:-1]) + ", the rest")
    for path in options.paths:
        field = open_light_field(path)
        row, column = k16_view(field)
        u, v = field.position(row, column)
        truth, parts = field.view(row, column), frames((field.height, field.width))
        for name, synthesizer in synthesizers.items():
            synthesizer.set_light_field(field)
            here, beside = (synthesizer.synthesize(at, v).image for at in (u, u + STEP))
            scores[name].append([psnr(here[part], truth[part]) for part in parts])
            print(field.name, Path(name).name, "dB", " ".join(f"{score:.2f}" for score in scores[name][-1]))
            print(
                field.name, Path(name).name, "change", " ".join(f"{change(here[p], beside[p]):.2f}" for p in parts), flush=True
            )
    for name, rows in scores.items():
        print("mean of all", Path(name).name, "dB", " ".join(f"{score:.2f}" for score in np.mean(rows, 0)))


if __name__ == "__main__":
    main()
