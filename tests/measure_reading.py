"""How long light fields take to open, beside OpenImageIO's plain reading of the same file (run by hand, not by pytest).

    python -m tests.measure_reading [FOLDER]

FOLDER holds views; the sample light field is taken by default. ESLF pictures of 8 and 16 bit are made from it in a temporary
folder: the middle views are those of the folder, the outer ones repeat its rim and are darkened as a Lytro's are, and every
pixel gets noise of its own, so that the files are as hard to unpack as real ones.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import OpenImageIO as oiio

from assets import sample_path
from lfcore.formats import open_light_field
from lfcore.lightfield import LightField

_REPEATS = 3


def main() -> None:
    """Print one line per measurement."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else sample_path()
    light_field = open_light_field(folder)
    seconds = fastest(lambda: open_light_field(folder))
    print(f"{folder.name}: {light_field.rows} x {light_field.columns} views of {light_field.width} x {light_field.height} px")
    print(f"  folder of views  {seconds:5.2f} s")
    picture = eslf(light_field)
    with tempfile.TemporaryDirectory() as temporary:
        for dtype in (np.uint8, np.uint16):
            path = Path(temporary) / f"eslf_{np.dtype(dtype).itemsize * 8}_bit.png"
            save(path, picture if dtype == np.uint16 else (picture >> 8).astype(np.uint8))
            measure(path)


def eslf(light_field: LightField) -> np.ndarray:
    """A 14 x 14 ESLF picture of 16 bit made from the views."""
    generator = np.random.default_rng(1)
    views = light_field.views
    picture = np.empty((light_field.height * 14, light_field.width * 14, 3), np.uint16)
    for row in range(14):
        for column in range(14):
            source = views[min(max(row - 3, 0), len(views) - 1), min(max(column - 3, 0), views.shape[1] - 1)]
            distance = np.hypot(row - 6.5, column - 6.5)
            level = 256 * min(1.0, max(0.05, 1 - 0.55 * (distance - 6.5)))
            noisy = source * level + generator.normal(0, 150, source.shape)
            picture[row::14, column::14] = np.clip(noisy, 0, 65535)
    return picture


def save(path: Path, picture: np.ndarray) -> None:
    """Write a PNG of the array's depth."""
    output = oiio.ImageOutput.create(str(path))
    output.open(str(path), oiio.ImageSpec(picture.shape[1], picture.shape[0], 3, str(picture.dtype)))
    output.write_image(picture)
    output.close()


def measure(path: Path) -> None:
    """Time plain reading against opening the middle 8 x 8 and all 14 x 14 views."""
    plain = fastest(lambda: read_plainly(path))
    print(f"  {path.stem}, {path.stat().st_size / 2**20:.0f} MiB: plain {plain:5.2f} s", end="")
    for views in (8, 14):
        seconds = fastest(lambda count=views: open_light_field(path, views=count))
        print(f", {views} x {views} views {seconds:5.2f} s ({seconds / plain:.2f})", end="")
    print()


def read_plainly(path: Path) -> np.ndarray:
    """All pixels in their native type, as OpenImageIO gives them."""
    source = oiio.ImageInput.open(str(path))
    pixels = source.read_image(0, 0, 0, source.spec().nchannels, oiio.UNKNOWN)
    source.close()
    return pixels


def fastest(action: Callable[[], object]) -> float:
    """Seconds of the fastest of a few runs."""
    durations = []
    for _ in range(_REPEATS):
        began = time.perf_counter()
        action()
        durations.append(time.perf_counter() - began)
    return min(durations)


if __name__ == "__main__":
    main()
