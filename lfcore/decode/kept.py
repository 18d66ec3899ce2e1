"""Decoded light fields kept on disk, so that a capture is decoded once: bounded, checked when read, shared by programs.

One file a light field, beside the views that lfcore.store keeps: found by what it was decoded from and by which code, written
by a rename, removed when it was used longest ago. A file that is not what it should be is removed and counts as never written.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from lfcore.atomic import atomic_path
from lfcore.kept_files import FileStore, code_digest, default_root, mark_used, remove
from lfcore.lightfield import LightField

DEFAULT_LIMIT = 2**30
_FOLDER = "decoded"
_DECODERS = "lfcore.decode", "lfcore.formats", "lfcore.formats.lytro"  # whose code decides what comes out
_MAGIC = b"lfview decoded 1\n"
_HEADER_LIMIT = 2**20
_DIGEST_BYTES = 16


@dataclass(frozen=True)
class DecodedStore(FileStore):
    """Light fields."""

    limit_bytes: int = DEFAULT_LIMIT
    suffix: ClassVar[str] = ".lightfield"

    def get(self, key: str) -> LightField | None:
        """The light field under this key; None where there is none, or a damaged one, which is removed."""
        path = self.path(key)
        try:
            with path.open("rb") as file:
                light_field = _read(file.read(len(_MAGIC) + 4), file, path.stat().st_size)
        except OSError:
            return None
        except (ValueError, KeyError, TypeError):
            remove(path)
            return None
        mark_used(path)
        return light_field

    def holds(self, key: str) -> bool:
        """Whether there is a light field under this key, be it damaged."""
        return self.path(key).is_file()

    def put(self, key: str, light_field: LightField) -> None:
        """Keep this light field, and remove those used longest ago where there would be too many. Raises OutputError."""
        header = _header(light_field)
        size = len(_MAGIC) + 4 + len(header) + light_field.views.nbytes + _DIGEST_BYTES
        if size > self.limit_bytes:
            return
        with atomic_path(self.room_for(key, size)) as temporary, temporary.open("wb") as file:
            start = _MAGIC + len(header).to_bytes(4, "little") + header
            views = np.ascontiguousarray(light_field.views)
            file.write(start)
            file.write(views.data)
            file.write(_digest(start, views))


def default_store() -> DecodedStore:
    """Where this user's decoded light fields are kept: below lfcore.kept_files.default_root()."""
    return DecodedStore(default_root() / _FOLDER)


def key_of(*parts: object) -> str:
    """A key for what was decoded from these parts (anything whose repr says all), by the code as it is."""
    return hashlib.blake2b(repr((parts, code_digest(*_DECODERS))).encode(), digest_size=16).hexdigest()


def _header(light_field: LightField) -> bytes:
    facts: dict[str, Any] = {
        "shape": light_field.views.shape,
        "type": str(light_field.views.dtype),
        "name": light_field.name,
        "source": light_field.source,
        "kind": light_field.kind,
        "facts": dict(light_field.facts),
        "warnings": list(light_field.warnings),
        "dark": sorted(light_field.dark),
    }
    return json.dumps(facts).encode()


def _digest(start: bytes, views: npt.NDArray[np.generic]) -> bytes:
    digest = hashlib.blake2b(start, digest_size=_DIGEST_BYTES)
    digest.update(views.data)
    return digest.digest()


def _read(opening: bytes, file: Any, size: int) -> LightField:
    """What `put` wrote. Raises ValueError, KeyError or TypeError for anything else."""
    length = int.from_bytes(opening[len(_MAGIC) :], "little")
    if not opening.startswith(_MAGIC) or length > _HEADER_LIMIT:
        raise ValueError("no decoded light field")
    header = file.read(length)
    facts = json.loads(header)
    shape = tuple(int(side) for side in facts["shape"])
    types: dict[str, np.dtype[Any]] = {"uint8": np.dtype(np.uint8), "uint16": np.dtype(np.uint16)}
    dtype = types[facts["type"]]
    values = int(np.prod(shape, dtype=np.int64))
    if len(shape) != 5 or len(opening) + length + values * dtype.itemsize + _DIGEST_BYTES != size:
        raise ValueError("of another size")
    views: npt.NDArray[np.generic] = np.empty(shape, dtype)
    file.readinto(views.data)
    if _digest(opening + header, views) != file.read(_DIGEST_BYTES):
        raise ValueError("damaged")
    return LightField(
        views=views,
        name=facts["name"],
        source=facts["source"],
        kind=facts["kind"],
        facts=facts["facts"],
        warnings=tuple(facts["warnings"]),
        dark=frozenset((int(row), int(column)) for row, column in facts["dark"]),
    )
