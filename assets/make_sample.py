"""Make the sample light field in `assets/sample`: render it, add a camera's noise, write views, true disparities and facts.

Development only. One command, from the repository's root, with an interpreter of Python 3.11 that has `bpy==5.0.1` (kept
outside the checkout; see docs/sample.md):

    python -m assets.make_sample --blender-python /path/to/bpyvenv/bin/python

The renders (linear EXR) go to a working folder, so that tone and noise can be changed without rendering again
(`--develop-only`).
"""

from __future__ import annotations

import argparse
import json
import subprocess
import tempfile
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import OpenImageIO as oiio

from assets import sample_path
from lfcore.atomic import atomic_path

FloatArray = npt.NDArray[np.float32]

JOB = "job.json"  # in the working folder: what was rendered, and how
TRUTH_VIEWS: tuple[tuple[int, int], ...] = ((0, 0), (0, 7), (7, 0), (7, 7), (4, 4))


@dataclass(frozen=True)
class Rig:
    """Parallel pinhole cameras on a square grid in one plane, their sensors shifted so that they agree at `zero_plane_m`."""

    rows: int = 8
    columns: int = 8
    width: int = 541
    height: int = 376
    focal_px: float = 850.0
    zero_plane_m: float = 1.15
    disparity_at_infinity_px: float = 8.2
    centre: tuple[float, float, float] = (0.0, 0.0, 0.345)
    pitch_degrees: float = 8.0

    @property
    def baseline_m(self) -> float:
        """Distance between the cameras of two neighbouring corners of the grid."""
        return self.disparity_at_infinity_px * self.zero_plane_m / self.focal_px

    def offset(self, row: int, column: int) -> tuple[float, float]:
        """Metres by which that view's camera lies to the right of and below the middle of the grid."""
        return (
            self.baseline_m * (column / (self.columns - 1) - 0.5),
            self.baseline_m * (row / (self.rows - 1) - 0.5),
        )

    def disparity(self, depth: FloatArray) -> FloatArray:
        """Pixels over the full baseline from metres along the camera's axis: 0 at the zero plane, negative before it."""
        inverse = np.divide(1.0, depth, dtype=np.float64)
        value = self.focal_px * self.baseline_m * (1 / self.zero_plane_m - inverse)
        return value.astype(np.float32)


@dataclass(frozen=True)
class Noise:
    """A sensor's noise in linear units, 1 = white: variance = shot x signal + read^2, independent per pixel and channel."""

    shot: float = 9.0e-5
    read: float = 1.2e-3
    seed: int = 20160711


@dataclass(frozen=True)
class Tone:
    """Exposure, contrast (a power about middle grey), a soft shoulder above `knee`, then the sRGB transfer function."""

    exposure: float = 1.35
    contrast: float = 1.14
    knee: float = 0.62


def view_name(row: int, column: int) -> str:
    """File name, without extension, of a view."""
    return f"view_{row:02d}_{column:02d}"


def frame(rig: Rig, row: int, column: int, kind: str, work: Path) -> dict[str, Any]:
    """What the renderer must know of one view; sensor shifts in units of the picture's width, upwards positive."""
    right, down = rig.offset(row, column)
    per_metre = rig.focal_px / rig.zero_plane_m / rig.width
    return {
        "kind": kind,
        "path": str(render_path(work, row, column, kind)),
        "right": right,
        "down": down,
        "shift_x": -right * per_metre,
        "shift_y": down * per_metre,
        "seed": 1 + row * rig.columns + column,
    }


def render_path(work: Path, row: int, column: int, kind: str) -> Path:
    """Where the renderer leaves a view's linear picture or its depth."""
    return work / f"{kind}_{row:02d}_{column:02d}.exr"


def render(rig: Rig, frames: list[dict[str, Any]], samples: int, threads: int, interpreter: Path, work: Path) -> None:
    """Hand the frames to Cycles in the other interpreter and wait for it."""
    version = blender_version(interpreter)
    job = {**asdict(rig), "bpy": version, "samples": samples, "threads": threads, "frames": frames}
    job_path = work / JOB
    job_path.write_text(json.dumps(job, indent=1))
    scene = Path(__file__).with_name("make_sample_scene.py")
    log_path = work / "render.log"
    with log_path.open("w") as log:
        done = subprocess.run([str(interpreter), str(scene), str(job_path)], stdout=log, stderr=subprocess.STDOUT)
    if done.returncode != 0:
        raise SystemExit(f"Rendering stopped with code {done.returncode}; {log_path} says why.")


def blender_version(interpreter: Path) -> str:
    """The version of bpy in the other interpreter."""
    command = [str(interpreter), "-c", "import bpy; print('bpy', bpy.app.version_string)"]
    try:
        said = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    except (OSError, subprocess.CalledProcessError) as error:
        raise SystemExit(f"{interpreter} cannot import bpy; see docs/sample.md for how to set it up.") from error
    return said.split("bpy ")[-1].strip()


def pixels(picture: oiio.ImageBuf) -> FloatArray:
    """All channels as float32, (H, W, C)."""
    values = picture.get_pixels(oiio.FLOAT)
    if values is None:
        raise SystemExit(f"{picture.name} cannot be read ({picture.geterror()}); render again without --develop-only.")
    return np.asarray(values, np.float32)


def read_linear(path: Path) -> FloatArray:
    """A rendered picture, (H, W, 3)."""
    return pixels(oiio.ImageBuf(str(path)))[..., :3]


def read_depth(path: Path) -> FloatArray:
    """Depth along the camera's axis in metres, (H, W); the sky is very far. The EXR has one part per pass."""
    count = oiio.ImageBuf(str(path)).nsubimages
    parts = [oiio.ImageBuf(str(path), part, 0) for part in range(count)]
    depth = next(part for part in parts if "Depth" in part.spec().channelnames[0])
    return pixels(depth)[..., 0]


def expose(linear: FloatArray, tone: Tone, noise: Noise, generator: np.random.Generator) -> FloatArray:
    """Linear light to display values in [0, 1], as a camera would: exposure, sensor noise, shoulder, sRGB."""
    signal = np.maximum(linear * tone.exposure, 0)
    deviation = np.sqrt(noise.shot * np.minimum(signal, 1) + noise.read**2)
    sensed = np.maximum(signal + deviation * generator.standard_normal(signal.shape, dtype=np.float32), 0)
    sensed = 0.18 * (sensed / 0.18) ** tone.contrast
    room = 1 - tone.knee
    over = np.maximum(sensed - tone.knee, 0)
    shouldered = np.where(sensed > tone.knee, tone.knee + room * (1 - np.exp(-over / room)), sensed)
    encoded = np.where(shouldered <= 0.0031308, 12.92 * shouldered, 1.055 * shouldered ** (1 / 2.4) - 0.055)
    return encoded.astype(np.float32)


def write_view(path: Path, picture: FloatArray, quality: int) -> None:
    """An 8-bit WebP."""
    buffer = oiio.ImageBuf(np.ascontiguousarray(picture))
    buffer.specmod().attribute("compression", f"webp:{quality}")
    with atomic_path(path) as temporary:
        if not buffer.write(str(temporary), oiio.UINT8):
            raise OSError(buffer.geterror())


def write_disparity(path: Path, disparity: FloatArray) -> None:
    """One channel of half floats in an EXR file."""
    buffer = oiio.ImageBuf(np.ascontiguousarray(disparity[..., None]))
    buffer.specmod().attribute("compression", "zip")
    with atomic_path(path) as temporary:
        if not buffer.write(str(temporary), oiio.HALF):
            raise OSError(buffer.geterror())


def develop(rig: Rig, tone: Tone, noise: Noise, webp_quality: int, work: Path, target: Path) -> None:
    """Turn the renders in `work` into the light field in `target`."""
    (target / "truth").mkdir(parents=True, exist_ok=True)
    for row in range(rig.rows):
        for column in range(rig.columns):
            generator = np.random.default_rng([noise.seed, row, column])
            picture = expose(read_linear(render_path(work, row, column, "beauty")), tone, noise, generator)
            write_view(target / f"{view_name(row, column)}.webp", picture, webp_quality)
    limits = []
    for row, column in TRUTH_VIEWS:
        disparity = rig.disparity(read_depth(render_path(work, row, column, "depth")))
        limits.append((float(disparity.min()), float(disparity.max())))
        write_disparity(target / "truth" / f"disparity_{row:02d}_{column:02d}.exr", disparity)
    job = json.loads((work / JOB).read_text())
    known = {
        **facts(rig, tone, noise, limits),
        "quality": {"samples_per_pixel": job["samples"], "denoiser": "OpenImageDenoise", "webp": webp_quality},
        "versions": {"bpy": job["bpy"], "OpenImageIO": oiio.VERSION_STRING, "numpy": np.__version__},
    }
    with atomic_path(target / "sample.json") as temporary:
        temporary.write_text(json.dumps(known, indent=2) + "\n")


def facts(rig: Rig, tone: Tone, noise: Noise, limits: list[tuple[float, float]]) -> dict[str, Any]:
    """What `sample.json` says of cameras, truths and tone."""
    return {
        "about": "Sample light field of lfview, rendered and developed by assets/make_sample.py; licence as the project.",
        "rig": {**asdict(rig), "baseline_m": rig.baseline_m},
        "grid": "view_RR_CC: row RR grows with v (the camera moves down), column CC grows with u (the camera moves right)",
        "disparity": {
            "formula": "D = focal_px * baseline_m * (1 / zero_plane_m - 1 / depth_m)",
            "unit": "pixels over the full corner-to-corner baseline; positive: content moves to larger x (y) as u (v) grows",
            "range_px": [round(min(low for low, _ in limits), 3), round(max(high for _, high in limits), 3)],
            "files": [f"truth/disparity_{row:02d}_{column:02d}.exr" for row, column in TRUTH_VIEWS],
            "depth": "along the camera's axis, of the first surface met by the ray through the pixel's centre, glass included",
        },
        "noise": {**asdict(noise), "model": "variance = shot * signal + read^2, linear, 1 = white"},
        "tone": {**asdict(tone), "transfer": "sRGB"},
    }


def preview(rig: Rig, arguments: argparse.Namespace, work: Path) -> None:
    """View (4, 4) and its disparity at a fraction of the size, as preview.png and preview_disparity.png."""
    scale = arguments.preview
    small = replace(
        rig,
        width=round(rig.width * scale),
        height=round(rig.height * scale),
        focal_px=rig.focal_px * scale,
        disparity_at_infinity_px=rig.disparity_at_infinity_px * scale,
    )
    frames = [frame(small, 4, 4, "depth", work), frame(small, 4, 4, "beauty", work)]
    render(small, frames, arguments.samples, arguments.threads, arguments.blender_python, work)
    linear = read_linear(render_path(work, 4, 4, "beauty"))
    picture = expose(linear, Tone(), Noise(), np.random.default_rng(0))
    disparity = small.disparity(read_depth(render_path(work, 4, 4, "depth"))) / scale
    print(
        f"disparity {disparity.min():.2f} .. {disparity.max():.2f} px; linear percentiles",
        np.percentile(linear, [1, 50, 90, 99]),
    )
    grey = np.repeat(np.clip((disparity[..., None] + 9.5) / 18, 0, 1), 3, axis=-1)
    oiio.ImageBuf(np.ascontiguousarray(picture)).write(str(work / "preview.png"), oiio.UINT8)
    oiio.ImageBuf(np.ascontiguousarray(grey)).write(str(work / "preview_disparity.png"), oiio.UINT8)


def main() -> None:
    """Parse the command line and do what it says."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--blender-python", type=Path, help="interpreter that has bpy 5.0.1")
    parser.add_argument("--work", type=Path, default=Path(tempfile.gettempdir()) / "lfview_sample", help="folder for renders")
    parser.add_argument("--samples", type=int, default=16, help="per pixel, before denoising")
    parser.add_argument("--webp-quality", type=int, default=93)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--preview", type=float, metavar="SCALE", help="only one view, at this fraction of the size")
    parser.add_argument("--develop-only", action="store_true", help="use the renders that are there")
    arguments = parser.parse_args()
    if arguments.blender_python is None and not arguments.develop_only:
        parser.error("--blender-python is needed to render; see docs/sample.md")
    arguments.work.mkdir(parents=True, exist_ok=True)
    rig = Rig()
    if arguments.preview:
        preview(rig, arguments, arguments.work)
        return
    if not arguments.develop_only:
        frames = [frame(rig, row, column, "beauty", arguments.work) for row in range(rig.rows) for column in range(rig.columns)]
        frames += [frame(rig, row, column, "depth", arguments.work) for row, column in TRUTH_VIEWS]
        render(rig, frames, arguments.samples, arguments.threads, arguments.blender_python, arguments.work)
    develop(rig, Tone(), Noise(), arguments.webp_quality, arguments.work, sample_path())


if __name__ == "__main__":
    main()
