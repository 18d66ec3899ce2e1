"""The files that the camera of the model writes: captures and calibration, with metadata as of the real cameras."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any

from lfcore.camera_model import CameraModel
from lfcore.decode.unpack import Mosaic, Packing, pack
from lfcore.formats.lytro.compose import white_image_text, write_caldata, write_f01_capture, write_illum_capture

Json = dict[str, Any]

_COLOURS = ("r", "gr", "gb", "b")


def packing(camera: CameraModel) -> Packing:
    """How this camera packs its pixels."""
    return Packing(camera.bits, "little" if camera.bits == 10 else "big")


def public_metadata(camera: CameraModel, orientation: int = 1) -> Json:
    """What stands in the metadata about the picture and the camera, in the layout of its generation."""
    upper_left = "gr" if camera.cfa == "GRBG" else "b"
    levels = {name: dict.fromkeys(_COLOURS, level) for name, level in (("black", camera.black), ("white", camera.white))}
    details: Json = {
        "pixelFormat": {"rightShift": 0, **levels},
        "pixelPacking": {"bitsPerPixel": camera.bits, "endianness": packing(camera).endianness},
        "mosaic": {"tile": "r,gr:gb,b", "upperLeftPixel": upper_left},
    }
    red, green, blue = camera.gains
    matrix = [value for row in camera.matrix for value in row]
    is_f01 = camera.generation == "f01"
    image: Json = {
        "width": camera.width,
        "height": camera.height,
        "orientation": orientation,
        "modulationExposureBias": camera.exposure_bias,
        "color": {
            "whiteBalanceGain": {"r": red, "gr": green, "gb": green, "b": blue},
            ("ccmRgbToSrgbArray" if is_f01 else "ccm"): matrix,
        },
    }
    image.update({"rawDetails": details, "representation": "rawPacked"} if is_f01 else {**details, "iso": 80})
    x, y = (shift * camera.pixel_pitch for shift in camera.offset)
    return {
        "image": image,
        "camera": {"make": "Lytro, Inc.", "model": "F01" if is_f01 else "ILLUM", "firmware": "0"},
        "devices": {
            "clock": {"zuluTime": "2015-01-01T12:00:00.000Z"},
            "sensor": {"pixelPitch": camera.pixel_pitch, "bitsPerPixel": camera.bits},
            "shutter": {"pixelExposureDuration": 0.01},
            "lens": {
                "zoomStep": camera.zoom_step,
                "focusStep": camera.focus_step,
                "fNumber": 2.0,
                "focalLength": 0.0068 if is_f01 else 0.0242,
                "infinityLambda": 20.0,
                "exitPupilOffset": {"z": 0.1},
            },
            "mla": {
                "tiling": "hexUniformRowMajor",
                "lensPitch": camera.lens_pitch,
                "rotation": camera.rotation,
                "scaleFactor": {"x": camera.scale[0], "y": camera.scale[1]},
                "sensorOffset": {"x": x, "y": y, "z": 3e-5},
            },
        },
    }


def private_metadata(camera: CameraModel) -> Json:
    """What the cameras keep apart: serial numbers."""
    return {"camera": {"serialNumber": camera.serial}, "devices": {"sensor": {"sensorSerial": "0x0badcafe"}}}


def write_capture(
    path: str | os.PathLike[str],
    camera: CameraModel,
    mosaic: Mosaic,
    orientation: int = 1,
    mistakes: Mapping[str, Any] | None = None,
) -> None:
    """Write a raw capture as this camera does. `mistakes` replaces entries of devices.mla, to tell the reader a wrong grid."""
    public = public_metadata(camera, orientation)
    public["devices"]["mla"].update(mistakes or {})
    write = write_f01_capture if camera.generation == "f01" else write_illum_capture
    write(path, pack(mosaic, packing(camera)), public, private_metadata(camera))


def write_calibration(path: str | os.PathLike[str], images: Sequence[tuple[CameraModel, Mosaic]]) -> None:
    """Write an archive of white images, each with the camera at the zoom and focus that it was taken with."""
    files = {}
    for index, (camera, mosaic) in enumerate(images):
        files[f"MOD_{index:04}.RAW"] = pack(mosaic, packing(camera))
        files[f"MOD_{index:04}.TXT"] = white_image_text(public_metadata(camera), private_metadata(camera))
    write_caldata(path, files)
