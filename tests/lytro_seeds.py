"""Small whole Lytro files of every kind, to be damaged by the fuzzer."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio

from lfcore.decode.unpack import pack
from lfcore.formats.lytro.compose import white_image_text, write_backup, write_caldata
from lfcore.formats.lytro.container import reference_to, write_container
from tests.lytro_files import HEIGHT, ILLUM_PACKING, WIDTH, illum_public, private, white_files, write_f01, write_illum
from tests.lytro_video import encode_video


@dataclass(frozen=True)
class Seed:
    """A whole file to damage. Calibration is damaged beside a whole capture, captures beside whole calibration."""

    name: str
    data: bytes
    is_calibration: bool = False


def make_seeds(folder: Path) -> list[Seed]:
    """Small files of every kind, written to the folder; the first is a capture of an Illum."""
    white = white_files({"MOD_0001": (90, 480, 700), "MOD_0002": (100, 500, 64), "MOD_0003": (120, 500, 900)})
    write_illum(folder / "illum.LFR", geometryCorrectionRef=reference_to(white["MOD_0003.GCT"]))
    text = white_image_text(illum_public(101, 499), private())
    flat = pack(np.full((HEIGHT, WIDTH), 800, np.uint16), ILLUM_PACKING)
    write_illum(folder / "embedded.LFR", modulationDataRef=flat, modulationDataMetadataRef=text)
    write_f01(folder / "f01.lfp")
    _write_stack(folder / "stack-stk.lfp", folder)
    _write_video_stack(folder / "video-stk.lfp")
    _write_depth(folder / "depth-dm.lfp")
    _write_preview(folder / "preview.LFP", folder)
    write_caldata(folder / "caldata-1.tar", white)
    write_backup(folder, white, parts=1)
    captures = ["illum.LFR", "embedded.LFR", "f01.lfp"]
    others = ["stack-stk.lfp", "video-stk.lfp", "depth-dm.lfp", "preview.LFP", "data.C.0"]
    seeds = [Seed(name, (folder / name).read_bytes()) for name in captures + others]
    return seeds + [Seed(name, (folder / name).read_bytes(), True) for name in ("caldata-1.tar", "data.C.0")]


def real_seeds(folder: Path) -> list[Seed]:
    """The containers in a folder."""
    return [Seed(path.name, path.read_bytes()) for path in sorted(folder.iterdir()) if path.suffix.lower() in (".lfp", ".lfr")]


def _picture(folder: Path, shade: int, suffix: str = ".jpg") -> bytes:
    y, x = np.mgrid[:24, :32]
    pixels = np.stack([x * 8, y * 10, np.full_like(x, shade)], axis=-1).astype(np.uint8)
    output = oiio.ImageOutput.create(str(folder / f"p{suffix}"))
    assert output.open(str(folder / f"p{suffix}"), oiio.ImageSpec(32, 24, 3, "uint8"))
    assert output.write_image(pixels)
    output.close()
    return (folder / f"p{suffix}").read_bytes()


def _structure(kind: str, content: dict[str, Any]) -> dict[str, Any]:
    structure = {"type": f"com.lytro.acceleration.{kind}", "vendorContent": content}
    return {"picture": {"frameArray": [], "accelerationArray": [structure]}}


def _write_stack(path: Path, folder: Path) -> None:
    parts = [_picture(folder, shade) for shade in (10, 100, 200)]
    entries = [
        {"representation": "jpeg", "width": 32, "height": 24, "lambda": index - 1.5, "imageRef": reference_to(part)}
        for index, part in enumerate(parts)
    ]
    table = np.linspace(-3, 3, 16, dtype=np.float32).tobytes()
    lut = {"width": 4, "height": 4, "representation": "raw", "imageRef": reference_to(table)}
    write_container(path, _structure("refocusStack", {"imageArray": entries, "depthLut": lut}), [table, *parts])


def _write_video_stack(path: Path) -> None:
    y, x = np.mgrid[:48, :64]
    pictures = [np.stack([x * 4, y * 5, np.full_like(x, shade)], axis=-1).astype(np.uint8) for shade in (0, 99)]
    data = encode_video(pictures, "h264")
    entries = [{"width": 64, "height": 48, "lambda": focus} for focus in (2.0, -1.0)]
    block = {"representation": "h264", "blockOfImagesRef": reference_to(data), "metadataArray": entries}
    write_container(path, _structure("refocusStack", {"blockOfImages": block}), [data])


def _write_depth(path: Path) -> None:
    maps = [np.full((6, 8), value, np.float32).tobytes() for value in (1.5, 0.5)]
    keys = ("depthMap", "confidenceMap")
    entries = {key: {"representation": "raw", "imageRef": reference_to(part)} for key, part in zip(keys, maps, strict=True)}
    content = {"width": 8, "height": 6, "minLambda": -20, "maxLambda": 11, **entries}
    write_container(path, _structure("depthMap", content), maps)


def _write_preview(path: Path, folder: Path) -> None:
    near, far, small = _picture(folder, 1), _picture(folder, 2), _picture(folder, 3, ".png")
    depth = np.zeros((3, 4), np.float32).tobytes()
    stack = {
        "kind": "focusStack",
        "width": 32,
        "height": 24,
        "representation": "jpeg",
        "depthMap": {"width": 4, "height": 3, "representation": "packedFloat", "imageRef": reference_to(depth)},
        "perImage": [{"imageRef": reference_to(near), "focus": -5}, {"imageRef": reference_to(far), "focus": 5}],
    }
    table = {
        "thumbnails": [{"width": 32, "height": 24, "imageRef": reference_to(small)}],
        "frames": [{"frame": {"metadata": illum_public(), "privateMetadata": private()}}],
        "views": [{"accelerations": [stack]}],
    }
    write_container(path, table, [depth, near, far, small])
