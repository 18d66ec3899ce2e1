"""Small files as the Lytro cameras write them, made up, for the tests: sensors of 64 x 48 px with metadata of both cameras."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from lfcore.decode.unpack import Mosaic, Packing, pack
from lfcore.formats.lytro.compose import white_image_text, write_f01_capture, write_illum_capture

SHARED = Path(__file__).parents[2] / "shared" / "data" / "lfp"
WIDTH, HEIGHT = 64, 48
SERIAL = "B5141234567"
ILLUM_PACKING, F01_PACKING = Packing(10, "little"), Packing(12, "big")


def illum_public(zoom: int = 100, focus: int = 500, width: int = WIDTH, height: int = HEIGHT) -> dict[str, Any]:
    """Public metadata as an Illum writes it."""
    return {
        "generator": "lightning",
        "camera": {"make": "Lytro, Inc.", "model": "ILLUM", "firmware": "1.1.1 (23)"},
        "image": {
            "width": width,
            "height": height,
            "orientation": 6,
            "iso": 80,
            "modulationExposureBias": 0.25,
            "pixelPacking": {"bitsPerPixel": 10, "endianness": "little"},
            "pixelFormat": {
                "rightShift": 0,
                "black": {"r": 61, "gr": 62, "gb": 63, "b": 64},
                "white": {"r": 1020, "gr": 1021, "gb": 1022, "b": 1023},
            },
            "mosaic": {"tile": "r,gr:gb,b", "upperLeftPixel": "gr"},
            "color": {
                "whiteBalanceGain": {"r": 1.5, "gr": 1.0, "gb": 1.0, "b": 1.25},
                "ccm": [2.0, -0.75, -0.25, -0.5, 1.75, -0.25, -0.25, -0.75, 2.0],
            },
        },
        "devices": {
            "clock": {"zuluTime": "2015-05-17T13:31:37.412Z"},
            "sensor": {"pixelPitch": 1.4e-06, "bitsPerPixel": 10},
            "shutter": {"frameExposureDuration": 0.01, "pixelExposureDuration": 0.01},
            "mla": {
                "tiling": "hexUniformRowMajor",
                "lensPitch": 2e-05,
                "rotation": -0.0005,
                "scaleFactor": {"x": 1.0, "y": 1.0003},
                "sensorOffset": {"x": 8.4e-06, "y": -9.5e-07, "z": 3.7e-05},
            },
            "lens": {
                "fNumber": 2.2,
                "exitPupilOffset": {"z": 0.097},
                "zoomStep": zoom,
                "focusStep": focus,
                "focalLength": 0.024,
                "infinityLambda": 33.9,
            },
        },
        "picture": {"dcfFile": "IMG_0813"},
    }


def f01_public(zoom: int = 900, focus: int = 600, width: int = WIDTH, height: int = HEIGHT) -> dict[str, Any]:
    """Public metadata as a first-generation camera writes it."""
    return {
        "type": "lightField",
        "camera": {"make": "Lytro, Inc.", "model": "F01", "firmware": "v1.0a208"},
        "image": {
            "width": width,
            "height": height,
            "orientation": 1,
            "representation": "rawPacked",
            "rawDetails": {
                "pixelFormat": {
                    "rightShift": 0,
                    "black": {"r": 168, "gr": 168, "gb": 168, "b": 168},
                    "white": {"r": 4095, "gr": 4095, "gb": 4095, "b": 4095},
                },
                "pixelPacking": {"endianness": "big", "bitsPerPixel": 12},
                "mosaic": {"tile": "r,gr:gb,b", "upperLeftPixel": "b"},
            },
            "color": {
                "ccmRgbToSrgbArray": [3.0, -1.75, -0.25, -0.25, 1.5, -0.25, 0.25, -1.25, 2.0],
                "gamma": 0.4,
                "whiteBalanceGain": {"r": 1, "gr": 1, "gb": 1, "b": 1.26},
            },
            "modulationExposureBias": -1.1,
        },
        "devices": {
            "clock": {"zuluTime": "2014-05-16T13:31:21.000Z"},
            "sensor": {"bitsPerPixel": 12, "iso": 207, "pixelPitch": 1.4e-06},
            "lens": {"focalLength": 0.00684, "zoomStep": zoom, "focusStep": focus, "fNumber": 1.92},
            "shutter": {"frameExposureDuration": 0.0165},
            "mla": {
                "tiling": "hexUniformRowMajor",
                "lensPitch": 1.4e-05,
                "rotation": -0.0008,
                "scaleFactor": {"x": 1, "y": 1.0004},
                "sensorOffset": {"x": -8.2e-06, "y": 8e-07, "z": 2.5e-05},
            },
        },
    }


def private(serial: str = SERIAL) -> dict[str, Any]:
    """Private metadata."""
    return {"camera": {"serialNumber": serial}, "devices": {"sensor": {"sensorSerial": "0x0C220593"}}}


def mosaic(bits: int, seed: int = 0, width: int = WIDTH, height: int = HEIGHT) -> Mosaic:
    """A mosaic of random values of that many bits."""
    return np.random.default_rng(seed).integers(0, 1 << bits, (height, width), dtype=np.uint16)


def write_illum(path: Path, **references: bytes | str) -> Path:
    """A small capture of an Illum."""
    write_illum_capture(path, pack(mosaic(10), ILLUM_PACKING), illum_public(), private(), references)
    return path


def write_f01(path: Path) -> Path:
    """A small capture of a first-generation camera."""
    write_f01_capture(path, pack(mosaic(12), F01_PACKING), f01_public(), private("A303134643"))
    return path


def white_files(settings: dict[str, tuple[int, int, int]], serial: str = SERIAL) -> dict[str, bytes]:
    """MOD_nnnn.RAW, .TXT and .GCT of an Illum, by name: (zoom step, focus step, level in 10 bits)."""
    files = {}
    for name, (zoom, focus, level) in settings.items():
        flat = np.full((HEIGHT, WIDTH), level, np.uint16)
        files[f"{name}.RAW"] = pack(flat, ILLUM_PACKING)
        files[f"{name}.TXT"] = white_image_text(illum_public(zoom, focus), private(serial))
        files[f"{name}.GCT"] = f"geometry of {name} of {serial}".encode()
    return files
