"""`python -m tests.measure_neighbours PATH...`: what inputs nearer than the corners are worth (docs/evaluation.md).

Of each light field every second row and column is kept, so that a captured view in the middle of four others is not among the
inputs; PSNR and SSIM of that view with K16's crop: from the four around it, and from the corners of what is kept.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

from lfcore.errors import InputError
from lfcore.formats import open_light_field
from lfcore.illum import aperture_of_part
from lfcore.lightfield import FloatArray, LightField
from lfcore.metrics import k16
from lfcore.nearest_inputs import NEIGHBOURS
from lfcore.synthesizer import make_synthesizer

_LEAST = 6  # views each way, of which three are kept


def without_middle(field: LightField) -> tuple[LightField, tuple[float, float], FloatArray]:
    """Every second row and column; the viewpoint among them of a view near the middle that is not kept, and that view.

    Raises InputError where the four views around it would be the corners of what is kept.
    """
    if min(field.rows, field.columns) < _LEAST:
        raise InputError(f"{field.name}: found {field.rows} x {field.columns} views; {_LEAST} x {_LEAST} or more are needed.")
    row, column = field.rows // 2, field.columns // 2
    first = (row + 1) % 2, (column + 1) % 2
    views = np.ascontiguousarray(field.views[first[0] :: 2, first[1] :: 2])
    kept = replace(field, views=views, dark=frozenset(), aperture=aperture_of_part(field, 2 * (len(views) - 1)))
    u, v = (column - first[1]) / 2 / (kept.columns - 1), (row - first[0]) / 2 / (kept.rows - 1)
    return kept, (u, v), field.view(row, column)


def main() -> None:
    """Print a row for each light field."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("paths", type=Path, nargs="+")
    options = parser.parse_args()
    synthesizers = {name: make_synthesizer(name) for name in ("mean", "full", "realtime", NEIGHBOURS)}
    for path in options.paths:
        kept, viewpoint, truth = without_middle(open_light_field(path))
        cells = []
        for name, synthesizer in synthesizers.items():
            synthesizer.set_light_field(kept)
            score = k16(synthesizer.synthesize(*viewpoint).image, truth)
            cells.append(f"{name} {score.psnr:.2f}, {score.ssim:.3f}")
        print(f"{kept.name}, {kept.rows} x {kept.columns} kept: " + "; ".join(cells), flush=True)


if __name__ == "__main__":
    main()
