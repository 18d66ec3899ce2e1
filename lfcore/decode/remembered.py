"""The places where this user's calibration lies, remembered in the user's configuration folder."""

from __future__ import annotations

import os
from pathlib import Path

from lfcore.atomic import atomic_path
from lfcore.errors import InputError, OutputError
from lfcore.formats.lytro.fields import Fields, check_json_size, parse_object, to_json

_MOST = 16  # places; the oldest is forgotten beyond


def remembered() -> list[Path]:
    """The places given to `remember`, the latest first. Raises InputError where the list is damaged."""
    path = _list_path()
    try:
        size = path.stat().st_size
        check_json_size(size, str(path))
        data = path.read_bytes()
    except FileNotFoundError:
        return []
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}; check its permissions or delete it.") from error
    fields = Fields(parse_object(data, str(path)), str(path))
    return [Path(place) for entry in fields.children("calibration") if (place := entry.text("path")) is not None]


def remember(place: str | os.PathLike[str]) -> None:
    """Remember a folder or file of calibration for ever after. Raises OutputError where the list cannot be written."""
    path, latest = _list_path(), Path(place).resolve()
    try:
        others = [other for other in remembered() if other != latest]
    except InputError:
        others = []  # the damaged list is replaced
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"Cannot make the folder {path.parent}: {error.strerror}; check its permissions.") from error
    entries = [{"path": str(other)} for other in [latest, *others][:_MOST]]
    with atomic_path(path) as temporary:
        temporary.write_bytes(to_json({"calibration": entries}))


def _list_path() -> Path:
    # A relative XDG_CONFIG_HOME is to be ignored, says the specification.
    configured = Path(os.environ.get("XDG_CONFIG_HOME", ""))
    folder = configured if configured.is_absolute() else Path.home() / ".config"
    return folder / "lfview" / "calibration.json"
