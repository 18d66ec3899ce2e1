"""`python -m tests.measure_shear FOLDER... --model NAME...`: how the score of a model depends on how large disparities are.

Each light field is sheared by whole pixels per view, which adds the same to every disparity and changes nothing else; the
same part of the same captured view is scored (PSNR over RGB). A model that knows all disparities alike scores alike.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

from lfcore.formats import open_light_field
from lfcore.lightfield import LightField, as_float
from lfcore.metrics import k16_view, psnr
from lfcore.synthesizer import make_synthesizer

MOST = 2  # px per view
CROPPED = 22  # px on each side, as K16 does


def sheared(field: LightField, m: int) -> LightField:
    """View (r, c) cropped at a place that moves by m px per view: disparities from corner to corner grow by m (n - 1) px."""
    spread = abs(m) * (field.rows - 1)
    height, width, start = field.height - spread, field.width - spread, max(m, 0) * (field.rows - 1)
    views = [
        [field.views[r, c, start - m * r :, start - m * c :][:height, :width] for c in range(field.columns)]
        for r in range(field.rows)
    ]
    return replace(field, views=np.array(views))


def part_of_all(field: LightField, m: int) -> tuple[slice, slice]:
    """The part of the scored view that every shear holds, in the sheared view."""
    row, column = k16_view(field)
    start, most = max(m, 0) * (field.rows - 1), MOST * (field.rows - 1)
    top, left = start - m * row, start - m * column
    return (
        slice(most + CROPPED - top, field.height - most - CROPPED - top),
        slice(most + CROPPED - left, field.width - most - CROPPED - left),
    )


def main() -> None:
    """Print a table a light field: a row for each shear, a column for each model."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", type=Path, nargs="+")
    parser.add_argument("--model", action="append", default=[], help="a name, or a .safetensors file")
    options = parser.parse_args()
    synthesizers = {name: make_synthesizer(name) for name in options.model or ["full"]}
    for folder in options.folders:
        field = open_light_field(folder)
        print(f"{field.name}: px added, " + ", ".join(Path(name).name for name in synthesizers))
        for m in range(-MOST, MOST + 1):
            moved, part = sheared(field, m), part_of_all(field, m)
            row, column = k16_view(moved)
            scores = []
            for synthesizer in synthesizers.values():
                synthesizer.set_light_field(moved)
                found = synthesizer.synthesize(*moved.position(row, column)).image
                scores.append(psnr(found[part], as_float(moved.view(row, column))[part]))
            print(f"{m * (field.rows - 1):+d}", " ".join(f"{score:.2f}" for score in scores), flush=True)


if __name__ == "__main__":
    main()
