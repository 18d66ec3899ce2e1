"""The container that every file of the Lytro cameras is: sections named by the SHA-1 of their data, one of them the table.

A file begins with 16 bytes: a magic number, version 1, length 0 (all numbers are big-endian, 32 bits). Then come the
sections: magic number, version 0, length of the data, the name "sha1-" + 40 hexadecimal digits, 35 zeros, the data, and
zeros up to a multiple of 16 bytes from the file's beginning. One section is the table of contents (LFM), JSON that refers
to the others (LFC) by their names. Neither their order nor their number means anything.
"""

from __future__ import annotations

import hashlib
import os
import re
import stat
import struct
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, BinaryIO

from lfcore.atomic import atomic_path
from lfcore.errors import InputError
from lfcore.formats.lytro.fields import Fields, check_json_size, parse_object, to_json

MAGIC = b"\x89LFP\r\n\x1a\n"
TABLE = b"LFM"
COMPONENT = b"LFC"

_FILE_HEADER = struct.Struct(">8sII")  # magic, version, length
_SECTION_HEADER = struct.Struct(">8sII45s35s")  # magic, version, length of data, name, zeros
_SECTION_MAGIC = re.compile(rb"\x89(LF[A-Z])\r\n\x1a\n")
_NAME = re.compile(rb"sha1-[0-9A-Fa-f]{40}")
_ALIGNMENT = 16

# A refocus stack has 14 sections, a first-generation camera's backup about 130.
_MAX_SECTIONS = 10_000


@dataclass(frozen=True, slots=True)
class Section:
    """Where the data of one section lies: kind b"LFM" or b"LFC", name "sha1-...", offset and length in bytes."""

    kind: bytes
    name: str
    offset: int
    length: int


@dataclass(frozen=True)
class Container:
    """The sections of a file; their data is read when it is asked for."""

    path: Path
    size: int  # of the file, bytes
    sections: tuple[Section, ...]

    @cached_property
    def table(self) -> Fields:
        """The table of contents, parsed. Raises InputError where it is missing, there twice, or no JSON object."""
        tables = [section for section in self.sections if section.kind == TABLE]
        if len(tables) != 1:
            found = "no table of contents" if not tables else f"{len(tables)} tables of contents"
            raise InputError(f"{self.path} has {found} where one is expected; the file is damaged.")
        return self.json(tables[0])

    def find(self, reference: str | None) -> Section | None:
        """The section of that name, or None; the case of the letters is not told apart."""
        return None if reference is None else self._by_name.get(reference.lower())

    def data(self, section: Section) -> bytes:
        """The bytes of a section, checked against its name. Raises InputError, naming the section, where they differ."""
        try:
            with self.path.open("rb") as file:
                file.seek(section.offset)
                data = file.read(section.length)
        except OSError as error:
            raise InputError(f"{self.path} cannot be read: {error.strerror}; check the path and its permissions.") from error
        if len(data) < section.length:
            raise InputError(f"{self.path} has become shorter while it was read; open it again.")
        if reference_to(data) != section.name:
            raise InputError(f"{self.describe(section)} does not match its checksum; the file is damaged: copy it again.")
        return data

    def json(self, section: Section) -> Fields:
        """The JSON object in a section. Raises InputError where it is none."""
        source = self.describe(section)
        check_json_size(section.length, source)
        return Fields(parse_object(self.data(section), source), str(self.path))

    def describe(self, section: Section) -> str:
        """A section for messages: the file, its place among the sections, its name."""
        return f"{self.path}: section {self.sections.index(section) + 1} of {len(self.sections)} ({section.name[:13]}..)"

    @cached_property
    def _by_name(self) -> dict[str, Section]:
        # Sections of one name have the same data; the first will do.
        return {section.name: section for section in reversed(self.sections)}


def reference_to(data: bytes) -> str:
    """The name under which a section with this data is found: "sha1-" and 40 hexadecimal digits."""
    return f"sha1-{hashlib.sha1(data, usedforsecurity=False).hexdigest()}"


def is_container(path: Path) -> bool:
    """Whether the file begins like a Lytro container. Raises InputError where it cannot be read."""
    with _open_regular(path) as file:
        return _read(file, path, len(MAGIC)) == MAGIC


def open_container(path: str | os.PathLike[str]) -> Container:
    """Read the headers of all sections, not their data.

    Raises InputError, one sentence naming the section, for what is no container, is cut off, or has lengths that cannot be.
    """
    path = Path(path)
    with _open_regular(path) as file:
        size = os.fstat(file.fileno()).st_size
        _check_file_header(path, _read(file, path, _FILE_HEADER.size))
        sections = tuple(_sections(path, file, size))
    if not sections:
        raise InputError(f"{path} is a Lytro container without any section; it is cut off: copy it again.")
    return Container(path, size, sections)


def write_container(path: str | os.PathLike[str], table: Mapping[str, Any], parts: Sequence[bytes], table_at: int = 0) -> None:
    """Write a container as the cameras do: the table as JSON, before part number `table_at`, and the parts.

    The table names the parts by `reference_to(part)`. Atomic; OutputError where the target cannot be written.
    """
    sections = [(COMPONENT, part) for part in parts]
    sections.insert(table_at, (TABLE, to_json(table)))
    with atomic_path(path) as temporary, temporary.open("wb") as file:
        file.write(_FILE_HEADER.pack(MAGIC, 1, 0))
        for kind, data in sections:
            magic = b"\x89" + kind + MAGIC[4:]
            file.write(_SECTION_HEADER.pack(magic, 0, len(data), reference_to(data).encode(), b""))
            file.write(data)
            file.write(bytes(-file.tell() % _ALIGNMENT))


def _open_regular(path: Path) -> BinaryIO:
    try:
        # A pipe would be waited for without end.
        if not stat.S_ISREG(path.stat().st_mode):
            raise InputError(f"{path} is no file; expected a Lytro container.")
        return path.open("rb")
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(f"{path} cannot be opened: {reason}; check the path and its permissions.") from error


def _read(file: BinaryIO, path: Path, count: int) -> bytes:
    try:
        return file.read(count)
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}; check the disk that it is on.") from error


def _check_file_header(path: Path, header: bytes) -> None:
    if not header.startswith(MAGIC):
        found = "empty (0 bytes)" if not header else "no Lytro container"
        raise InputError(f"{path} is {found}; expected a file of a Lytro camera such as .lfp or .LFR.")
    if len(header) < _FILE_HEADER.size:
        raise InputError(f"{path} is cut off within its first {_FILE_HEADER.size} bytes; copy it again.")
    _, version, length = _FILE_HEADER.unpack(header)
    if (version, length) != (1, 0):
        raise InputError(f"{path} is a Lytro container of version {version}, length {length}; expected version 1, length 0.")


def _sections(path: Path, file: BinaryIO, size: int) -> Iterator[Section]:
    """The sections one after the other; `file` stands behind the file's header."""
    position = _FILE_HEADER.size
    number = 0
    while position < size:
        number += 1
        if number > _MAX_SECTIONS:
            raise InputError(f"{path} has more than {_MAX_SECTIONS:,} sections; expected a file of a Lytro camera.")
        file.seek(position)
        header = _read(file, path, _SECTION_HEADER.size)
        if len(header) < _SECTION_HEADER.size:
            if not header.strip(b"\0"):
                return  # padding
            raise InputError(f"{path} is cut off within the header of section {number}; copy it again.")
        section = _section(path, header, number, position, size)
        yield section
        end = section.offset + section.length
        position = end + -end % _ALIGNMENT


def _section(path: Path, header: bytes, number: int, position: int, size: int) -> Section:
    magic, version, length, name, _ = _SECTION_HEADER.unpack(header)
    kind = _SECTION_MAGIC.fullmatch(magic)
    if kind is None:
        raise InputError(
            f"{path}: no section begins at byte {position}, where section {number} of the Lytro container should; it is "
            "damaged: copy it again."
        )
    if version != 0:
        raise InputError(f"{path}: section {number} is of version {version}; expected version 0, so the file is damaged.")
    if _NAME.fullmatch(name) is None:
        raise InputError(f"{path}: section {number} has no checksum for a name; the file is damaged.")
    left = size - position - _SECTION_HEADER.size
    if length > left:
        raise InputError(
            f"{path}: section {number} claims {length:,} bytes, but the file ends after {left:,}; it is cut off or damaged: "
            "copy it again."
        )
    return Section(kind[1], name.decode().lower(), position + _SECTION_HEADER.size, length)
