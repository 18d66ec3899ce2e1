"""Lytro containers: what is written comes back, real files are read in full, and every kind of damage is named."""

from __future__ import annotations

import hashlib
import os
import struct
from pathlib import Path

import pytest

from lfcore.errors import InputError
from lfcore.formats.lytro.container import (
    COMPONENT,
    TABLE,
    Container,
    is_container,
    open_container,
    reference_to,
    write_container,
)
from tests.lytro_files import SHARED

PARTS = [b"first part", bytes(range(256)) * 3, b"", b"x" * 16]
TABLE_OF_PARTS = {"parts": [reference_to(part) for part in PARTS]}

real_files = pytest.mark.skipif(not SHARED.is_dir(), reason="needs the real Lytro files of ../shared/data/lfp")


def header(kind: bytes, length: int, name: bytes, version: int = 0) -> bytes:
    """A section's header, by the format's description."""
    return b"\x89" + kind + b"\r\n\x1a\n" + struct.pack(">II", version, length) + name.ljust(80, b"\0")


def section(kind: bytes, data: bytes) -> bytes:
    """A whole section, padded."""
    name = f"sha1-{hashlib.sha1(data).hexdigest()}".encode()
    whole = header(kind, len(data), name) + data
    return whole + bytes(-len(whole) % 16)


BEGIN = b"\x89LFP\r\n\x1a\n" + struct.pack(">II", 1, 0)
NAME = b"sha1-" + b"0" * 40


def save(path: Path, data: bytes) -> Path:
    path.write_bytes(data)
    return path


def refusal(path: Path) -> str:
    """The one sentence with which the headers or the data of a file are refused."""
    with pytest.raises(InputError) as caught:
        container = open_container(path)
        _ = container.table
        for part in container.sections:
            container.data(part)
    message = str(caught.value)
    assert "\n" not in message
    assert message.startswith(str(path))
    assert message.endswith(".")
    return message


@pytest.fixture
def written(tmp_path: Path) -> Container:
    write_container(tmp_path / "whole.lfp", TABLE_OF_PARTS, PARTS)
    return open_container(tmp_path / "whole.lfp")


def test_parts_come_back_by_their_hashes(written: Container) -> None:
    assert written.table.values == TABLE_OF_PARTS
    for part, name in zip(PARTS, TABLE_OF_PARTS["parts"], strict=True):
        assert name == "sha1-" + hashlib.sha1(part).hexdigest()
        found = written.find(name.upper())
        assert found is not None
        assert written.data(found) == part
    assert written.find("sha1-" + "0" * 40) is None
    assert written.find(None) is None


def test_layout_is_the_format_s(written: Container) -> None:
    data = written.path.read_bytes()
    assert data.startswith(BEGIN)
    assert len(data) % 16 == 0
    table = written.data(written.sections[0])
    assert data == BEGIN + section(b"LFM", table) + b"".join(section(b"LFC", part) for part in PARTS)


@pytest.mark.parametrize("place", [0, 2, 4])
def test_the_table_may_stand_anywhere(tmp_path: Path, place: int) -> None:
    write_container(tmp_path / "a.lfp", TABLE_OF_PARTS, PARTS, table_at=place)
    container = open_container(tmp_path / "a.lfp")
    assert [part.kind for part in container.sections].index(TABLE) == place
    assert container.table.values == TABLE_OF_PARTS


@real_files
@pytest.mark.parametrize(
    "name, parts",
    [("f01_depth_map.lfp", 2), ("f01_metadata_only.lfp", 2), ("f01_refocus_stack.lfp", 13), ("illum_preview.LFP", 11)],
)
def test_real_files_are_read_whole(name: str, parts: int) -> None:
    container = open_container(SHARED / name)
    assert [part.kind for part in container.sections].count(COMPONENT) == parts
    # Nothing of the file is left over: headers, tables, data and padding make it up.
    padded = sum((96 + part.length + 15) // 16 * 16 for part in container.sections)
    assert 16 + padded == (SHARED / name).stat().st_size
    for part in container.sections:
        assert hashlib.sha1(container.data(part)).hexdigest() == part.name[5:]


@real_files
@pytest.mark.parametrize("name", ["f01_depth_map.lfp", "f01_metadata_only.lfp"])
def test_real_files_are_written_again_byte_for_byte(tmp_path: Path, name: str) -> None:
    container = open_container(SHARED / name)
    parts = [container.data(part) for part in container.sections if part.kind == COMPONENT]
    write_container(tmp_path / name, container.table.values, parts)
    assert (tmp_path / name).read_bytes() == (SHARED / name).read_bytes()


def test_kinds_are_told_by_content(tmp_path: Path, written: Container) -> None:
    assert is_container(written.path)
    assert not is_container(save(tmp_path / "b.lfp", b"\x89PNG\r\n\x1a\n" + bytes(100)))


def test_cut_anywhere(tmp_path: Path, written: Container) -> None:
    whole = written.path.read_bytes()
    last = len(whole) - 1
    for length in range(last):
        path = save(tmp_path / "cut.lfp", whole[:length])
        try:
            container = open_container(path)
        except InputError:
            continue
        # Only what ends with a section, or within the padding behind one, looks whole; it lacks sections then.
        assert len(container.sections) < len(written.sections)
        end = container.sections[-1].offset + container.sections[-1].length
        assert length - end < 96
        assert not whole[end:length].strip(b"\0")


def test_every_flipped_byte_is_noticed_or_harmless(tmp_path: Path, written: Container) -> None:
    whole = written.path.read_bytes()
    truth = {part.name: written.data(part) for part in written.sections}
    noticed = 0
    for place in range(len(whole)):
        damaged = bytearray(whole)
        damaged[place] ^= 0x55
        path = save(tmp_path / "flipped.lfp", bytes(damaged))
        try:
            container = open_container(path)
            found = {part.name: container.data(part) for part in container.sections}
            assert container.table.values == TABLE_OF_PARTS
        except InputError:
            noticed += 1
        else:
            assert found == truth  # a flip in the zeros between
    headers = 16 + len(written.sections) * (96 - 35)
    data = sum(part.length for part in written.sections)
    # Case of a hexadecimal digit apart, everything but zeros is checked.
    assert noticed >= headers + data


def test_lengths_that_lie(tmp_path: Path) -> None:
    good = section(b"LFM", b"{}")
    assert "claims 4,294,967,295 bytes" in refusal(save(tmp_path / "a", BEGIN + header(b"LFM", 0xFFFFFFFF, NAME)))
    assert "claims 2,147,483,648 bytes" in refusal(save(tmp_path / "a", BEGIN + good + header(b"LFC", 1 << 31, NAME)))
    assert "section 2 claims 17 bytes, but the file ends after 16" in refusal(
        save(tmp_path / "a", BEGIN + good + header(b"LFC", 17, NAME) + bytes(16))
    )


def test_tables_of_contents(tmp_path: Path) -> None:
    two = BEGIN + section(b"LFM", b"{}") + section(b"LFM", b'{"a":1}')
    assert "2 tables of contents" in refusal(save(tmp_path / "a", two))
    assert "no table of contents" in refusal(save(tmp_path / "a", BEGIN + section(b"LFC", b"{}")))
    assert "without any section" in refusal(save(tmp_path / "a", BEGIN))


def test_headers(tmp_path: Path) -> None:
    assert "empty (0 bytes)" in refusal(save(tmp_path / "a", b""))
    assert "no Lytro container" in refusal(save(tmp_path / "a", b"II*\0" + bytes(40)))
    assert "cut off within its first 16" in refusal(save(tmp_path / "a", BEGIN[:12]))
    assert "version 2" in refusal(save(tmp_path / "a", BEGIN[:8] + struct.pack(">II", 2, 0)))
    assert "section 1 is of version 7" in refusal(save(tmp_path / "a", BEGIN + header(b"LFM", 0, NAME, version=7)))
    assert "no section begins at byte 16" in refusal(save(tmp_path / "a", BEGIN + b"\x89LFm\r\n\x1a\n" + bytes(200)))
    assert "no checksum for a name" in refusal(save(tmp_path / "a", BEGIN + header(b"LFM", 0, b"md5-" + b"0" * 41)))
    assert "does not match its checksum" in refusal(save(tmp_path / "a", BEGIN + header(b"LFM", 2, NAME) + b"{}"))


@pytest.mark.parametrize(
    "text, expected",
    [
        (b"", "no valid JSON"),
        (b"[1]", "no object"),
        (b'{"a": NaN}', "no valid JSON"),
        (b'{"a": "\xff"}', "no valid JSON"),
        (b'{"a": ' + b"9" * 5000 + b"}", "no valid JSON"),
        (b"[" * 100_000, "nested too deeply"),
        (b'{"a":' * 100_000, "nested too deeply"),
        (b"{" + b" " * 2**20 + b"}", "1,048,578 bytes where metadata of at most 1,048,576"),
    ],
)
def test_tables_that_are_no_json(tmp_path: Path, text: bytes, expected: str) -> None:
    assert expected in refusal(save(tmp_path / "a", BEGIN + section(b"LFM", text)))


def test_what_is_no_file(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for name, expected in (("pipe", "no file"), (".", "no file"), ("missing", "No such file")):
        with pytest.raises(InputError, match=expected):
            open_container(tmp_path / name)


def test_a_file_that_shrinks_while_it_is_read(written: Container) -> None:
    os.truncate(written.path, 200)
    with pytest.raises(InputError, match="has become shorter"):
        written.data(written.sections[-1])


def test_many_sections(tmp_path: Path) -> None:
    many = BEGIN + section(b"LFC", b"") * 10_001
    assert "more than 10,000 sections" in refusal(save(tmp_path / "a", many))
