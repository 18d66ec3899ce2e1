"""Paths as they are typed, pasted or dropped."""

from __future__ import annotations

from pathlib import Path
from urllib.parse import unquote, urlparse

from lfcore.errors import InputError


def path_from_text(text: str) -> Path:
    """The path that was typed, pasted or dropped: quotes, file:// and ~ are understood. Raises InputError as `expanded`."""
    text = text.strip()
    if len(text) >= 2 and text[0] == text[-1] and text[0] in "'\"":
        text = text[1:-1]
    if text.startswith("file://"):
        text = unquote(urlparse(text).path)
    return expanded(text)


def expanded(text: str) -> Path:
    """The path, from a home folder on where it begins with ~. Raises InputError where nobody of that name is known."""
    try:
        return Path(text).expanduser()
    except RuntimeError as error:
        raise InputError(f"{text} begins with the home folder of somebody unknown here; give the whole path.") from error
