"""What the viewer remembers of its user between runs: window, theme, model, recent files, and how each file was looked at.

One JSON file in the folder that the system means for settings. It is read whole, checked field by field, and written
beside itself and renamed; whatever is wrong with it, the viewer starts with what can be used of it.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from pathlib import Path

from app.limits import within
from app.plain_json import Json, read_fields, to_json
from lfcore.atomic import atomic_path
from lfcore.errors import OutputError

VERSION = 1
RECENT_LIMIT = 20
FILES_LIMIT = 200
SIZE_LIMIT = 2**20  # bytes; a file of settings that is larger is none
SCALE_LIMITS = (1.0, 3.0)
_TEXT_LIMIT = 4096  # characters of a path or a key
_LOOK_LIMIT = 4096  # bytes, as JSON, of what is kept for one file
_LOOK_DEPTH = 8  # of objects and lists in one another


class Theme(Enum):
    """The colours of the interface; the value is the name on screen."""

    DARK = "Dark"
    LIGHT = "Light"


@dataclass(frozen=True)
class WindowPlace:
    """Where the window was, in screen coordinates; of a maximised one where it would go back to."""

    x: int
    y: int
    width: int
    height: int
    maximised: bool = False


@dataclass(frozen=True)
class Settings:
    """All of it. `scale` None: by the monitor. `model` empty: the program's own choice. `recent`: paths, the newest first.
    `files`: by content key, the newest last, the fields of the view state that belong to the file, as JSON."""

    window: WindowPlace | None = None
    panel: bool = True
    theme: Theme = Theme.DARK
    scale: float | None = None
    model: str = ""
    foresight: bool = True
    recent: tuple[str, ...] = ()
    files: Mapping[str, Mapping[str, Json]] = field(default_factory=dict)

    def with_recent(self, path: str) -> Settings:
        """With this path as the newest."""
        others = tuple(each for each in self.recent if each != path)
        return replace(self, recent=(path, *others)[:RECENT_LIMIT])

    def with_file(self, key: str, look: Mapping[str, Json]) -> Settings:
        """With this kept for the file of this content key, which is now the newest."""
        files = {name: each for name, each in self.files.items() if name != key}
        files[key] = look
        return replace(self, files=dict(list(files.items())[-FILES_LIMIT:]))


class SettingsFile:
    """The file that settings are kept in. A fault becomes a sentence, once; then the viewer goes on without the file."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._stored: str | None = None  # what is known to be in the file
        self._writable = True

    def load(self) -> tuple[Settings, str | None]:
        """The settings, as far as they can be read, and a sentence where they cannot."""
        try:
            with self.path.open("rb") as file:
                data = file.read(SIZE_LIMIT + 1)
            if len(data) > SIZE_LIMIT:
                raise ValueError("too large")
            stored = json.loads(data)
            if not isinstance(stored, dict) or not isinstance(stored.get("version"), int):
                raise ValueError("no settings")
        except FileNotFoundError:
            return Settings(), None
        except (ValueError, RecursionError):
            return Settings(), f"The settings in {self.path} are damaged; the viewer starts with its defaults."
        except OSError as error:
            reason = error.strerror or error
            return Settings(), f"The settings in {self.path} cannot be read: {reason}; the viewer starts with its defaults."
        if stored["version"] > VERSION:
            self._writable = False
            return Settings(), (
                f"The settings in {self.path} are those of a newer lfview; they are left as they are, and not used."
            )
        return _bounded(read_fields(Settings, stored)), None

    def save(self, settings: Settings) -> None:
        """Write the settings, unless they stand there already. Raises OutputError the first time that it cannot be done."""
        text = json.dumps({"version": VERSION, **to_json(settings)}, indent=1)
        if not self._writable or text == self._stored:
            return
        try:
            self.path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            with atomic_path(self.path) as temporary:
                temporary.write_text(text, encoding="utf-8")
        except OSError as error:
            self._writable = False
            raise OutputError(
                f"Settings are not kept from now on: {self.path} cannot be written ({error.strerror or error})."
            ) from error
        except OutputError as error:
            self._writable = False
            raise OutputError(f"Settings are not kept from now on: {error}") from error
        self._stored = text


def default_path() -> Path:
    """The file of this user's settings: below $XDG_CONFIG_HOME or ~/.config, %APPDATA%, or ~/Library/Application Support."""
    if sys.platform == "win32":
        base = Path(os.environ.get("APPDATA") or Path.home() / "AppData" / "Roaming")
    elif sys.platform == "darwin":
        base = Path.home() / "Library" / "Application Support"
    else:
        given = os.environ.get("XDG_CONFIG_HOME", "")
        base = Path(given) if given.startswith("/") else Path.home() / ".config"  # relative ones are to be ignored
    return base / "lfview" / "settings.json"


def _bounded(settings: Settings) -> Settings:
    """What a file says, within bounds."""
    window, scale = settings.window, settings.scale
    if window is not None and not (1 <= window.width <= 2**15 and 1 <= window.height <= 2**15):
        window = None
    if scale is not None:
        scale = within(scale, SCALE_LIMITS)
    model = settings.model if _is_path(settings.model) else ""
    recent = tuple(dict.fromkeys(filter(_is_path, settings.recent)))[:RECENT_LIMIT]
    usable = [(key, look) for key, look in settings.files.items() if len(key) <= _TEXT_LIMIT and _is_look(look)]
    return replace(settings, window=window, scale=scale, model=model, recent=recent, files=dict(usable[-FILES_LIMIT:]))


def _is_path(text: str) -> bool:
    """Whether the system could have a file of this name."""
    try:
        return 0 < len(text) <= _TEXT_LIMIT and b"\0" not in os.fsencode(text)
    except UnicodeEncodeError:
        return False


def _is_look(look: Json) -> bool:
    """Whether this is no larger than what is kept for one file, in either way."""
    return _is_shallow(look, _LOOK_DEPTH) and len(json.dumps(look)) <= _LOOK_LIMIT


def _is_shallow(data: Json, levels: int) -> bool:
    inner = data.values() if isinstance(data, Mapping) else data if isinstance(data, list | tuple) else ()
    return all(levels > 0 and _is_shallow(each, levels - 1) for each in inner)
