"""Finding the files in a tar archive without unpacking anything.

Python's tarfile believes the sizes in an archive, and so takes memory and time as a damaged or malicious one asks. Here
only headers are read; nothing is written, links and folders are passed over, and names count without their folders.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import BinaryIO

from lfcore.errors import InputError

_BLOCK = 512
_HEADER = struct.Struct("100s8s8s8s12s12s8sc100s6s2s32s32s8s8s155s12s")
_REGULAR = (b"0", b"\0", b"7")
_LONG_NAME, _GNU_SPARSE = b"L", b"S"
_MAX_NAME = 4096
_MAX_MEMBERS = 10_000


@dataclass(frozen=True)
class Member:
    """A file in an archive: its name without folders, and where its data lies, in bytes."""

    name: str
    offset: int
    size: int


def is_tar(path: Path) -> bool:
    """Whether the file begins with a header of a tar archive. Raises InputError where it cannot be read."""
    try:
        with path.open("rb") as file:
            block = file.read(_BLOCK)
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}; check the path and its permissions.") from error
    return _checksum_fits(block)


def members(path: Path) -> list[Member]:
    """The plain files of an archive. Raises InputError where a header is damaged or a file ends behind the archive's end."""
    try:
        with path.open("rb") as file:
            return list(_members(path, file, os.fstat(file.fileno()).st_size))
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}; check the path and its permissions.") from error


def _members(path: Path, file: BinaryIO, end: int) -> Iterator[Member]:
    position, long_name = 0, None
    for number in range(1, _MAX_MEMBERS + 1):
        file.seek(position)
        block = file.read(_BLOCK)
        if not block.strip(b"\0"):
            return  # two empty blocks end an archive; writers that died leave one or none
        if not _checksum_fits(block):
            raise InputError(f"{path}: the header of file {number} in the archive is damaged; copy it again.")
        fields = _HEADER.unpack(block)
        kind, size = fields[7], _number(fields[4])
        data = position + _BLOCK
        if size is None or size > end - data:
            raise InputError(f"{path}: file {number} in the archive ends behind its end; it is cut off or damaged.")
        if kind in _REGULAR:
            name = long_name or _joined(fields[15], fields[0])
            yield Member(PurePosixPath(name.replace("\\", "/")).name, data, size)
        long_name = None
        if kind == _LONG_NAME:
            file.seek(data)
            long_name = _text(file.read(min(size, _MAX_NAME)))
        position = data + size + -size % _BLOCK
        if kind == _GNU_SPARSE:
            position += _sparse_headers(file, block, data)
    raise InputError(f"{path} holds more than {_MAX_MEMBERS:,} files; expected the calibration files of a camera.")


def _sparse_headers(file: BinaryIO, block: bytes, position: int) -> int:
    """Bytes of the further headers of a sparse file, which stand between its header and its data."""
    start, extended = position, block[482:483]
    while extended.strip(b"\0"):
        file.seek(position)
        further = file.read(_BLOCK)
        extended = further[504:505]
        position += _BLOCK
    return position - start


def _checksum_fits(block: bytes) -> bool:
    if len(block) < _BLOCK:
        return False
    stored = _number(block[148:156])
    # The checksum is taken with its own eight bytes as blanks.
    return stored == sum(block[:148] + b" " * 8 + block[156:])


def _number(field: bytes) -> int | None:
    """A whole number in octal digits, or in binary where the first bit is set; None where it is neither or negative."""
    if field[0] & 0x80:
        return None if field[0] & 0x40 else int.from_bytes(bytes([field[0] & 0x3F]) + field[1:], "big")
    digits = field.split(b"\0")[0].strip()
    try:
        return int(digits, 8) if digits.isdigit() or not digits else None
    except ValueError:
        return None


def _joined(prefix: bytes, name: bytes) -> str:
    before = _text(prefix)
    return f"{before}/{_text(name)}" if before else _text(name)


def _text(field: bytes) -> str:
    return field.split(b"\0")[0].decode("utf-8", "replace")
