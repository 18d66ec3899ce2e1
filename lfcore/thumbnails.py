"""Glances kept on disk between runs of the program, so that a folder of captures is looked at once: bounded, checked when read.

One small file a glance, found by where the light field lies, by its size and time, and by the code that looked. Written by
a rename, removed when it was used longest ago. A file that is not what it should be is removed and counts as never written.
"""

from __future__ import annotations

import hashlib
import json
import os
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np

from lfcore.atomic import atomic_path
from lfcore.errors import InputError
from lfcore.formats.glance import LONGEST_SIDE, Glance
from lfcore.kept_files import FileStore, code_digest, default_root, entries, mark_used, remove

DEFAULT_LIMIT = 64 * 2**20
_FOLDER = "thumbnails"
_MAGIC = b"lfview thumbnail 1\n"
_LARGEST = 2**20
_DIGEST_BYTES = 16
_CAPTION_LIMIT = 200
_LOOKERS = ("lfcore.formats", "lfcore.formats.lytro", "lfcore.decode")


@dataclass(frozen=True)
class ThumbnailStore(FileStore):
    """Glances."""

    limit_bytes: int = DEFAULT_LIMIT
    suffix: ClassVar[str] = ".thumbnail"

    def get(self, key: str) -> Glance | None:
        """The glance under this key; None where there is none, or a damaged one, which is removed."""
        path = self.path(key)
        try:
            with path.open("rb") as file:
                seen = _unpacked(file.read(_LARGEST + 1))
        except OSError:
            return None
        except (ValueError, KeyError, TypeError, zlib.error):
            remove(path)
            return None
        mark_used(path)
        return seen

    def put(self, key: str, seen: Glance) -> None:
        """Keep this glance, and remove those used longest ago where there would be too many. Raises OutputError."""
        data = _packed(seen)
        with atomic_path(self.room_for(key, len(data))) as temporary:
            temporary.write_bytes(data)


def default_store() -> ThumbnailStore:
    """Where this user's thumbnails are kept: below lfcore.kept_files.default_root()."""
    return ThumbnailStore(default_root() / _FOLDER)


def key_of(path: Path) -> str:
    """A key for what lies at this path as it is now: a file by its size and time, a folder by those of the files in it.

    Raises InputError where it cannot be looked at.
    """
    digest = hashlib.blake2b(os.fsencode(path.absolute()), digest_size=16)
    digest.update(code_digest(*_LOOKERS).encode())
    try:
        facts = path.stat()
        digest.update(repr((facts.st_size, facts.st_mtime_ns)).encode())
        if path.is_dir():
            for file in sorted(entries(path), key=lambda file: file.path.name):
                digest.update(repr((file.path.name, file.size, file.used_at)).encode())
    except OSError as error:
        raise InputError(f"{path} cannot be opened: {error.strerror or error}; it may have been moved or removed.") from error
    return digest.hexdigest()


def _packed(seen: Glance) -> bytes:
    """Magic, length of the header, header (JSON), pixels (deflated), digest of all that."""
    picture = seen.picture
    facts = {"caption": seen.caption[:_CAPTION_LIMIT], "size": None if picture is None else picture.shape[:2]}
    header = json.dumps(facts).encode()
    pixels = b"" if picture is None else zlib.compress(picture.tobytes(), 1)
    data = b"".join((_MAGIC, len(header).to_bytes(4, "little"), header, pixels))
    return data + hashlib.blake2b(data, digest_size=_DIGEST_BYTES).digest()


def _unpacked(data: bytes) -> Glance:
    """The inverse of _packed. Raises ValueError, KeyError, TypeError or zlib.error for anything else."""
    body, digest = data[:-_DIGEST_BYTES], data[-_DIGEST_BYTES:]
    if not body.startswith(_MAGIC) or hashlib.blake2b(body, digest_size=_DIGEST_BYTES).digest() != digest:
        raise ValueError("damaged")
    start = len(_MAGIC) + 4
    length = int.from_bytes(body[len(_MAGIC) : start], "little")
    header = json.loads(body[start : start + length])
    caption = str(header["caption"])
    if header["size"] is None:
        return Glance(None, caption)
    height, width = (int(side) for side in header["size"])
    if not (0 < height <= LONGEST_SIDE and 0 < width <= LONGEST_SIDE):
        raise ValueError("of another size")
    inflated = zlib.decompressobj()
    pixels = inflated.decompress(body[start + length :], 3 * height * width)
    return Glance(np.frombuffer(pixels, np.uint8).reshape(height, width, 3), caption)
