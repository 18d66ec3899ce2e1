"""`python -m tests.measure_decoding FOLDER`: how exact and how fast raw captures are decoded, on captures by the model.

Captures and white images of whole sensors are made in FOLDER where they are missing (some minutes each), decoded, and
compared with the scene that the model saw. `--raw PICTURE...` tells instead how straight the views of real mosaics (grey
pictures of a whole first-generation sensor) are.
"""

from __future__ import annotations

import argparse
import os
import resource
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from lfcore.camera_files import packing, write_calibration, write_capture
from lfcore.camera_model import CameraModel, expose, f01, illum, white_image
from lfcore.decode.grid_fit import grid_of_capture, grid_of_white_image
from lfcore.decode.pipeline import DecodeOptions, coarse_view, decode_capture
from lfcore.decode.unpack import unpack
from lfcore.disparity_sign import check_disparity
from lfcore.formats.images import open_picture
from lfcore.formats.lytro.container import open_container
from lfcore.formats.lytro.metadata import read_capture
from lfcore.machine import machine
from tests.camera_truth import decoded_psnr, grid_errors, small, srgb, true_views
from tests.plane_scenes import patches_scene, slanted_scene

LOW_NOISE = 20_000.0  # electrons of a full pixel; the cameras have about 5,000 at their base sensitivity
SAMPLES = 6


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--camera", choices=("illum", "f01"), action="append")
    parser.add_argument("--size", type=int, nargs=2, metavar=("WIDTH", "HEIGHT"), help="a smaller sensor, for a quick look")
    parser.add_argument("--raw", type=Path, nargs="+", default=[])
    options = parser.parse_args()
    os.environ["XDG_CONFIG_HOME"] = tempfile.mkdtemp()  # no calibration but the model's
    print(f"{machine()}, load {os.getloadavg()[0]:.1f}")
    for picture in options.raw:
        _real(picture, options.folder)
    if options.raw:
        return
    for name in options.camera or ("illum", "f01"):
        camera = {"illum": illum, "f01": f01}[name](full_well=LOW_NOISE)
        if options.size:
            camera = small(camera, *options.size)
        folder = options.folder / f"{name}_{camera.width}x{camera.height}"
        folder.mkdir(parents=True, exist_ok=True)
        _measure(camera, folder)


def _measure(camera: CameraModel, folder: Path) -> None:
    scene = slanted_scene(camera.size_in_pitches, 3)
    capture, calibration = folder / "scene.LFR", folder / "caldata-model.tar"
    if not calibration.exists():
        write_calibration(calibration, [(camera, white_image(camera, 5, samples=SAMPLES))])
    if not capture.exists():
        write_capture(capture, camera, expose(camera, scene, samples=SAMPLES))
    print(f"\n{folder.name}")
    _grid(camera, capture)
    coarse_view(capture)  # libraries are loaded, pages are in memory
    with _timed("coarse picture"):
        coarse_view(capture)
    with _timed("decoded to 14 x 14 views"):
        light_field = decode_capture(capture)
    print(f"peak memory: {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**10:.0f} MiB")
    scores = []
    for place in [(row, column) for row in range(8) for column in range(8)]:
        (truth,) = true_views(camera, scene, 8, places=[place]).values()
        scores.append(decoded_psnr(light_field.views[place[0] + 3, place[1] + 3], truth))
    print(f"middle 8 x 8 views: mean {np.mean(scores):.2f} dB, least {min(scores):.2f} dB")
    print(f"plain patches: at most {_patches(folder, camera):.1f} of 255 levels off")
    print("facts:", dict(light_field.facts))


@contextmanager
def _timed(what: str) -> Iterator[None]:
    started, work = time.perf_counter(), time.process_time()
    yield
    print(f"{what}: {time.perf_counter() - started:.2f} s, of which the processor worked {time.process_time() - work:.2f} s")


def _grid(camera: CameraModel, capture: Path) -> None:
    container = open_container(capture)
    facts = read_capture(container)
    assert facts is not None
    assert facts.image is not None
    mosaic = unpack(container.data(facts.image), packing(camera), camera.width, camera.height)
    pitch = camera.lens_pitch / camera.pixel_pitch
    found = grid_of_capture(mosaic, camera.black, pitch)
    errors = grid_errors(found.grid, camera)
    print(f"grid by the capture: greatest error {errors.max():.3f} px, rms {np.sqrt((errors**2).mean()):.3f} px")
    part = small(camera, min(camera.width, 1600), min(camera.height, 1200))
    errors = grid_errors(grid_of_white_image(white_image(part, samples=3), camera.black, pitch).grid, part)
    print(f"grid by a white image ({part.width} x {part.height} px of it): greatest error {errors.max():.3f} px")


def _patches(folder: Path, camera: CameraModel) -> float:
    """Greatest difference, in levels of 255, of 24 plain patches from the truth, after decoding."""
    camera = small(camera, min(camera.width, 1600), min(camera.height, 1200))
    folder = folder / "patches"
    folder.mkdir(exist_ok=True)
    scene = patches_scene(camera.size_in_pitches)
    write_calibration(folder / "caldata-model.tar", [(camera, white_image(camera, 5, samples=SAMPLES))])
    write_capture(folder / "patches.LFR", camera, expose(camera, scene, samples=SAMPLES))
    light_field = decode_capture(folder / "patches.LFR", None, DecodeOptions(8))
    (truth,) = true_views(camera, scene, 8, places=[(3, 3)]).values()
    worst = 0.0
    for row in range(4):
        for column in range(6):
            y = slice(int((row + 0.3) * light_field.height / 4), int((row + 0.7) * light_field.height / 4))
            x = slice(int((column + 0.3) * light_field.width / 6), int((column + 0.7) * light_field.width / 6))
            seen = light_field.views[3:5, 3:5, y, x].astype(float).mean(axis=(0, 1, 2, 3))
            worst = max(worst, float(np.abs(seen - 255 * srgb(truth[y, x]).mean(axis=(0, 1))).max()))
    return worst


def _real(picture: Path, folder: Path) -> None:
    """Decode a grey picture of a mosaic as if a camera had written it, without calibration."""
    with open_picture(picture) as source:
        values = source.read()[..., 0]
    # What the makers' file would tell is unknown: no offset, no rotation, no colour.
    unknown = {"rotation": 0.0, "offset": (0.0, 0.0), "gains": (1.0, 1.0, 1.0), "exposure_bias": 0.0}
    camera = f01(black=0, white=255 * 16, matrix=((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), **unknown)
    path = folder / f"{picture.stem}.lfp"
    write_capture(path, camera, values.astype(np.uint16) * 16)
    light_field = decode_capture(path, None, DecodeOptions(8))
    check = check_disparity(light_field)
    print(f"{picture.name}: {check.sentence} Disparities {check.low:.1f} to {check.high:.1f} px corner to corner.")
    print(f"  {light_field.facts['Microlenses']}")


if __name__ == "__main__":
    main()
