"""A decoded capture to files: one ESLF picture or a folder of views, with the camera's metadata in a JSON beside."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from lfcore.atomic import atomic_path
from lfcore.errors import InputError
from lfcore.export import check_no_views, removed_on_failure, write_stored
from lfcore.formats.lytro.container import Container, is_container, open_container
from lfcore.formats.lytro.fields import Fields
from lfcore.formats.lytro.metadata import frames, read_capture
from lfcore.lightfield import LightField


def write_eslf(path: Path, light_field: LightField) -> list[Path]:
    """Write all 14 x 14 views as an ESLF (.png), each microlens a block of 14 x 14 px, and the JSON; returns both paths.

    OutputError where that cannot be done.
    """
    rows, columns, height, width, _ = light_field.views.shape
    blocks = light_field.views.transpose(2, 0, 3, 1, 4)  # (H, V, W, U, 3)
    write_stored(path, np.ascontiguousarray(blocks).reshape(rows * height, columns * width, 3))
    return [path, _write_facts(facts_path(path, True), light_field)]


def write_views(folder: Path, light_field: LightField) -> list[Path]:
    """Write view_RR_CC.png into the folder, which is made, and the JSON beside it; returns the folder's and the JSON's path.

    OutputError where it holds views already: those of two light fields would be taken for one. An error or Ctrl-C on the way
    removes what was written.
    """
    check_no_views(folder)
    with removed_on_failure(folder) as written:
        for row in range(light_field.rows):
            for column in range(light_field.columns):
                written.append(folder / f"view_{row:02}_{column:02}.png")
                write_stored(written[-1], light_field.views[row, column])
        return [folder, _write_facts(facts_path(folder, False), light_field)]


def facts_path(target: Path, is_eslf: bool) -> Path:
    """The JSON beside an ESLF, or beside a folder of views."""
    return target.with_suffix(".json") if is_eslf else target.with_name(f"{target.name}.json")


def _write_facts(path: Path, light_field: LightField) -> Path:
    """What was decoded and how, and all that the capture says about itself."""
    container = open_container(light_field.source)
    facts: dict[str, Any] = {
        "source": light_field.source,
        "kind": light_field.kind,
        "rows": light_field.rows,
        "columns": light_field.columns,
        "height": light_field.height,
        "width": light_field.width,
        "type": str(light_field.views.dtype),
        "dark": [list(view) for view in sorted(light_field.dark)],
        "facts": dict(light_field.facts),
        "warnings": list(light_field.warnings),
        "metadata": [_documents(container, frame) for frame in frames(container)],
    }
    with atomic_path(path) as temporary:
        temporary.write_text(json.dumps(facts, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
    return path


def _documents(container: Container, frame: Fields) -> dict[str, Any]:
    """The public and the private metadata of a frame, as they are."""
    documents = {}
    for key in ("metadata", "privateMetadata"):
        section = container.find(frame.text(f"{key}Ref"))
        if key in frame:
            documents[key] = frame.child(key).values
        elif section is not None:
            documents[key] = container.json(section).values
    return documents


def captures_in(paths: list[Path]) -> list[Path]:
    """The paths, each folder replaced by the raw captures below it, sorted. Raises InputError for a folder without any."""
    found: list[Path] = []
    for path in paths:
        if not path.is_dir():
            found.append(path)
            continue
        inside = [file for file in sorted(path.rglob("*")) if file.is_file() and _is_capture(file)]
        if not inside:
            raise InputError(f"{path} holds no raw captures; expected files of a Lytro camera, such as .LFR or .lfp.")
        found += inside
    return list(dict.fromkeys(found))


def _is_capture(path: Path) -> bool:
    try:
        if not is_container(path):
            return False
        capture = read_capture(open_container(path))
    except InputError:
        # Damaged ones are named when they are decoded; others, such as calibration, are left alone.
        return path.suffix.lower() in (".lfr", ".lfp")
    return capture is not None and capture.image is not None
