"""Syntheses kept on disk between runs of the program: bounded in bytes, checked when read, safe with several programs at once.

One file a view, in one folder per light field and model. There are no locks and no index: files appear by a rename, are
removed when they were used longest ago, and any program may find one gone at any time. A file that is not what it should
be is removed and counts as never written.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lfcore.atomic import atomic_path
from lfcore.cache import CacheKey
from lfcore.errors import OutputError
from lfcore.kept_files import (
    LEFTOVER_SECONDS,
    KeptFile,
    check_all_removed,
    code_digest,
    entries,
    make_room,
    mark_used,
    remove,
)
from lfcore.synthesis import Synthesis

DEFAULT_LIMIT = 2**30
UNUSED_DAYS = 60.0  # views not looked at for so long are removed
_MAGIC = b"lfview view 1\n"
_HEADER_LIMIT = 4096
_DIGEST_BYTES = 16
_SUFFIX = ".view"
_DAY = 86400.0
_ATTEMPTS = 5
_MALFORMED = (
    ValueError,
    KeyError,
    TypeError,
    AttributeError,
    OverflowError,
    RecursionError,
)  # what reading another header raises


@dataclass(frozen=True)
class Usage:
    """What a store holds."""

    views: int
    light_fields: int
    bytes: int


class ViewStore:
    """Views under `root` (made when first written to), at most `limit_bytes` of them. Safe to use from threads and programs.

    Image and disparity are kept as float16, as in the memory cache. A view is found again only by the light field's pixels,
    the model's weights and the code of lfcore that made it.
    """

    def __init__(self, root: Path, limit_bytes: int = DEFAULT_LIMIT) -> None:
        self.root = root
        self.limit_bytes = limit_bytes

    def positions(self, content: str, model: str) -> list[tuple[float, float]]:
        """The viewpoints (u, v), to 4 decimals, kept of this light field and model."""
        found = (_position(file.path) for file in _files(self._folder(content, model)))
        return [position for position in found if position is not None]

    def get(self, key: CacheKey, size: tuple[int, int]) -> Synthesis | None:
        """The view under this key, whose pictures have `size` (H, W), float32 and without warped inputs; None where there
        is none, or a damaged one, which is removed."""
        path = self._path(key)
        try:
            if path.stat().st_size > _largest(size):
                raise ValueError("too large")
            synthesis = _unpacked(path.read_bytes(), size)
        except OSError:
            return None
        except _MALFORMED:
            remove(path)
            return None
        mark_used(path)
        return synthesis

    def put(self, key: CacheKey, synthesis: Synthesis) -> None:
        """Keep this view, and remove those used longest ago where there would be too many. Raises OutputError."""
        data = _packed(synthesis)
        if len(data) > self.limit_bytes:
            return
        held = (file for folder in self._folders() for file in _files(folder))
        make_room(held, len(data), self.limit_bytes)
        path = self._path(key)
        for attempt in range(_ATTEMPTS):
            try:
                self._write(path, data)
                return
            except OutputError as error:
                # A program that tidies or clears may just have removed the folder, and another have made it again.
                passing = isinstance(error.__cause__, FileNotFoundError | FileExistsError)
                if not passing or attempt == _ATTEMPTS - 1:
                    raise

    def _write(self, path: Path, data: bytes) -> None:
        try:
            self.root.mkdir(mode=0o700, parents=True, exist_ok=True)  # pictures are nobody else's business
            path.parent.mkdir(mode=0o700, exist_ok=True)
        except OSError as error:
            raise OutputError(f"Cannot make the folder {path.parent}: {error.strerror or error}.") from error
        with atomic_path(path) as temporary:
            temporary.write_bytes(data)

    def tidy(self) -> None:
        """Remove what has not been used for UNUSED_DAYS, and what programs that were killed have left."""
        now = time.time()
        for folder in self._folders():
            for entry in entries(folder):
                age = UNUSED_DAYS * _DAY if entry.path.suffix == _SUFFIX and entry.path.name[0] != "." else LEFTOVER_SECONDS
                if now - entry.used_at > age:
                    remove(entry.path)
            with contextlib.suppress(OSError):
                folder.rmdir()  # only an empty one goes

    def usage(self) -> Usage:
        """How much is kept."""
        files = [file for folder in self._folders() for file in _files(folder)]
        light_fields = {file.path.parent.name.partition("-")[0] for file in files}
        return Usage(len(files), len(light_fields), sum(file.size for file in files))

    def clear(self) -> None:
        """Remove every view. Raises OutputError where some cannot be removed."""
        stuck = 0
        for folder in self._folders():
            for entry in entries(folder):
                stuck += not remove(entry.path)
            with contextlib.suppress(OSError):
                folder.rmdir()
        check_all_removed(stuck, self.root)

    def _folders(self) -> Iterator[Path]:
        """The folders of views; others are left alone."""
        with contextlib.suppress(OSError), os.scandir(self.root) as found:
            for entry in found:
                if len(entry.name) == 33 and entry.name[16] == "-" and entry.is_dir(follow_symlinks=False):
                    yield Path(entry.path)

    def _folder(self, content: str, model: str) -> Path:
        maker = hashlib.blake2b(f"{model} {code_digest('lfcore', 'lfcore.kernels')}".encode(), digest_size=8).hexdigest()
        seen = hashlib.blake2b(content.encode(), digest_size=8).hexdigest()
        return self.root / f"{seen}-{maker}"

    def _path(self, key: CacheKey) -> Path:
        return self._folder(key.content, key.model) / f"{key.u:+.4f}{key.v:+.4f}{_SUFFIX}"


def _position(path: Path) -> tuple[float, float] | None:
    name = path.name.removesuffix(_SUFFIX)
    half = len("+0.0000")
    try:
        return float(name[:half]), float(name[half:])
    except ValueError:
        return None


def _files(folder: Path) -> Iterator[KeptFile]:
    """The views of a folder, without files that are still being written."""
    return (entry for entry in entries(folder) if entry.path.suffix == _SUFFIX and entry.path.name[0] != ".")


def _largest(size: tuple[int, int]) -> int:
    return len(_MAGIC) + 4 + _HEADER_LIMIT + 8 * size[0] * size[1] + _DIGEST_BYTES


def _packed(synthesis: Synthesis) -> bytes:
    """Magic, length of the header, header (JSON), image and disparity (float16, little-endian), digest of all that."""
    header = json.dumps(
        {
            "u": synthesis.u,
            "v": synthesis.v,
            "model": synthesis.model,
            "size": synthesis.image.shape[:2],
            "disparity": synthesis.disparity is not None,
            "timings": dict(synthesis.timings),
        }
    ).encode()
    parts = [_MAGIC, len(header).to_bytes(4, "little"), header, synthesis.image.astype("<f2").tobytes()]
    if synthesis.disparity is not None:
        parts.append(synthesis.disparity.astype("<f2").tobytes())
    data = b"".join(parts)
    return data + hashlib.blake2b(data, digest_size=_DIGEST_BYTES).digest()


def _unpacked(data: bytes, size: tuple[int, int]) -> Synthesis:
    """The inverse of _packed. Raises one of _MALFORMED for anything else."""
    body, digest = data[:-_DIGEST_BYTES], data[-_DIGEST_BYTES:]
    if not body.startswith(_MAGIC) or hashlib.blake2b(body, digest_size=_DIGEST_BYTES).digest() != digest:
        raise ValueError("damaged")
    start = len(_MAGIC) + 4
    length = int.from_bytes(body[len(_MAGIC) : start], "little")
    header = json.loads(body[start : start + length])
    height, width = size
    pixels = height * width
    channels = 4 if header["disparity"] else 3
    if tuple(header["size"]) != size or len(body) != start + length + 2 * channels * pixels:
        raise ValueError("of another size")
    values = np.frombuffer(body, "<f2", channels * pixels, start + length).astype(np.float32)
    image = values[: 3 * pixels].reshape(height, width, 3)
    disparity = values[3 * pixels :].reshape(height, width) if header["disparity"] else None
    timings = {str(stage): float(seconds) for stage, seconds in header["timings"].items()}
    return Synthesis(float(header["u"]), float(header["v"]), str(header["model"]), image, disparity, None, timings)
