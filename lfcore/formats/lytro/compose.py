"""Captures and calibration written as the cameras write them: for the camera model and the tests."""

from __future__ import annotations

import io
import os
import tarfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from lfcore.atomic import atomic_path
from lfcore.formats.lytro.container import reference_to, write_container
from lfcore.formats.lytro.fields import to_json

Json = Mapping[str, Any]


def write_illum_capture(
    path: str | os.PathLike[str],
    image: bytes,
    public: Json,
    private: Json,
    references: Mapping[str, bytes | str] | None = None,
) -> None:
    """Write an .LFR of a Lytro Illum: packed mosaic, metadata, and further entries of the frame.

    `references` gives for a key such as "modulationDataRef" the data, which becomes a section, or the name of data that is
    not in the file, as "geometryCorrectionRef" may be. Atomic; OutputError where the target cannot be written.
    """
    parts = [image, to_json(public), to_json(private)]
    frame = {"imageRef": parts[0], "metadataRef": parts[1], "privateMetadataRef": parts[2], **(references or {})}
    parts += [part for part in (references or {}).values() if isinstance(part, bytes)]
    table = {
        "schema": "http://schema.lytro.com/lfp/picture/2.1.4/picture_schema.json",
        "generators": ["lightning"],
        "thumbnails": [],
        "derivations": [""],
        "frames": [{"frame": {key: _name(part) for key, part in frame.items()}}],
        "annotations": [],
        "views": [],
    }
    write_container(path, table, parts, table_at=len(parts))


def write_f01_capture(path: str | os.PathLike[str], image: bytes, public: Json, private: Json) -> None:
    """Write a raw .lfp of the first-generation camera. Atomic; OutputError where the target cannot be written."""
    parts = [to_json(public), image, to_json(private)]
    frame = {"metadataRef": parts[0], "imageRef": parts[1], "privateMetadataRef": parts[2]}
    table = {
        "picture": {
            "frameArray": [{"frame": {key: _name(part) for key, part in frame.items()}, "parameters": _tags(False, False)}],
            "viewArray": [],
            "accelerationArray": [],
            "derivationArray": [],
        },
        "thumbnailArray": [],
        "version": {"major": 1, "minor": 0, "provisionalDate": "2011-08-03"},
    }
    write_container(path, table, parts)


def white_image_text(public: Json, private: Json, dark: bool = False) -> bytes:
    """The MOD_nnnn.TXT beside a white image (or a black frame): its metadata as the makers' files have it."""
    frame = {"metadata": public, "privateMetadata": private, "imageRef": "unknown"}
    entry = {"frame": frame, "parameters": _tags(dark, not dark)}
    return to_json({"master": {"picture": {"viewArray": [], "accelerationArray": [], "frameArray": [entry]}}})


def write_caldata(path: str | os.PathLike[str], files: Mapping[str, bytes], folder: str = "unitdata") -> None:
    """Write an Illum's caldata-<serial>.tar with these files and the manifest of their hashes."""
    listed = [{"name": name, "hash": reference_to(data)} for name, data in files.items()]
    manifest = {"cal_file_manifest.json": to_json({"calibrationFiles": listed})}
    with atomic_path(path) as temporary, tarfile.open(temporary, "w", format=tarfile.USTAR_FORMAT) as archive:
        for name, data in {**manifest, **files}.items():
            member = tarfile.TarInfo(f"{folder}/{name}")
            member.size = len(data)
            archive.addfile(member, io.BytesIO(data))


def write_backup(folder: str | os.PathLike[str], files: Mapping[str, bytes], parts: int = 4) -> list[Path]:
    """Write data.C.0, data.C.1, ... of the first-generation camera with these files shared out among them."""
    names = list(files)
    paths = [Path(folder) / f"data.C.{index}" for index in range(parts)]
    for index, path in enumerate(paths):
        own = names[index::parts]
        listed = [{"name": f"C:\\T1CALIB\\{name}", "dataRef": reference_to(files[name])} for name in own]
        write_container(path, {"files": listed}, [files[name] for name in own])
    return paths


def _name(part: bytes | str) -> str:
    return part if isinstance(part, str) else reference_to(part)


def _tags(dark: bool, white: bool) -> Json:
    return {"vendorContent": {"com.lytro.tags": {"darkFrame": dark, "modulationFrame": white}}}
