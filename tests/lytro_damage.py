"""Ways of damaging a Lytro file: its bytes, its lengths, its sections, its JSON, the data in it, headers of archives.

Most keep the checksums right, so that the damage is not found out at the door.
"""

from __future__ import annotations

import json
import random
import re
import struct
from collections.abc import Callable, Iterator
from itertools import islice
from typing import Any

from lfcore.formats.lytro.container import TABLE, reference_to
from tests.lytro_seeds import Seed

Parts = list[tuple[bytes, bytes]]  # (kind, data) of sections

_MAX_TEXT = 2**21  # of JSON made
_MAX_PLACES = 3000  # in a document, of which one is changed


def mutate(seed: Seed, chance: random.Random) -> tuple[str, bytes]:
    """The name of a kind of damage and the damaged file."""
    plain = [_cut, _flip, _overwrite, _insert, _delete, _lie_about_length]
    structured = [_shuffle_sections, _change_json, _change_json, _change_json, _change_data, _change_data, _cut_data]
    archive = [_change_header]
    kinds: list[Callable[[bytes, random.Random], bytes]] = plain + (
        archive * 6 if seed.data[:4] != b"\x89LFP" else structured * 2
    )
    names, data = [], seed.data
    for _ in range(chance.choice((1, 1, 1, 2, 3))):
        kind = chance.choice(kinds)
        try:
            data = kind(data, chance)
        except (ValueError, IndexError, struct.error, RecursionError):
            continue  # damaged beyond this kind of damage
        names.append(kind.__name__.strip("_"))
    return "+".join(names) or "none", data


def _cut(data: bytes, chance: random.Random) -> bytes:
    return data[: chance.randrange(len(data))]


def _flip(data: bytes, chance: random.Random) -> bytes:
    damaged = bytearray(data)
    for _ in range(chance.choice((1, 1, 2, 8, 64))):
        damaged[chance.randrange(len(damaged))] ^= 1 << chance.randrange(8)
    return bytes(damaged)


def _overwrite(data: bytes, chance: random.Random) -> bytes:
    place = chance.randrange(len(data))
    return data[:place] + _odd_bytes(chance) + data[place + 4 :]


def _odd_bytes(chance: random.Random) -> bytes:
    value = chance.choice((0, 1, 2**31 - 1, 2**31, 2**32 - 1, 2**32 - 96, chance.randrange(2**32)))
    return struct.pack(chance.choice((">I", "<I")), value)


def _insert(data: bytes, chance: random.Random) -> bytes:
    place = chance.randrange(len(data))
    return data[:place] + data[place : place + chance.randrange(200)] * chance.choice((1, 2, 50)) + data[place:]


def _delete(data: bytes, chance: random.Random) -> bytes:
    place = chance.randrange(len(data))
    return data[:place] + data[place + chance.randrange(1, 200) :]


def _lie_about_length(data: bytes, chance: random.Random) -> bytes:
    places = [match.start() for match in re.finditer(rb"\x89LF[MC]\r\n\x1a\n", data)]
    place = chance.choice(places) + chance.choice((8, 12))
    return data[:place] + _odd_bytes(chance) + data[place + 4 :]


def _shuffle_sections(data: bytes, chance: random.Random) -> bytes:
    parts = _split(data)
    action = chance.randrange(4)
    index = chance.randrange(len(parts))
    if action == 0:
        chance.shuffle(parts)
    elif action == 1:
        del parts[index]
    elif action == 2:
        parts.insert(chance.randrange(len(parts)), parts[index])
    else:
        parts[index] = (chance.choice((b"LFM", b"LFC", b"LFX")), parts[index][1])
    return _join(parts)


def _change_json(data: bytes, chance: random.Random) -> bytes:
    """Change one value of the table or of metadata, with correct hashes and references afterwards."""
    parts = _split(data)
    documents = [index for index, (_, part) in enumerate(parts) if part[:1] == b"{"]
    index = chance.choice(documents)
    document = json.loads(parts[index][1])
    references = [reference_to(part) for _, part in parts] + ["sha1-" + "0" * 40]
    for _ in range(chance.choice((1, 1, 2, 5))):
        _change(document, chance, references)
    # Repetitions of repetitions; every value takes three letters at least.
    if next(islice(_places(document), _MAX_TEXT // 3, None), None) is not None:
        raise ValueError("too long")
    text = json.dumps(document)
    for name, value in _UNWRITABLE.items():
        text = text.replace(f'"{name}"', value)
    if len(text) > _MAX_TEXT:
        raise ValueError("too long")
    return _join(_replaced(parts, index, text.encode()))


# What json does not write.
_UNWRITABLE = {"@inf": "1e999", "@nan": "NaN", "@digits": "9" * 5000, "@deep": "[" * 9000, "@whole": "[" * 9000 + "]" * 9000}


def _change(document: Any, chance: random.Random, references: list[str]) -> None:
    """Take one value, anywhere in the document, out, or exchange, wrap, double or repeat it."""
    places = list(islice(_places(document), _MAX_PLACES))
    if not places:
        return
    holder, key = chance.choice(places)
    action = chance.randrange(6)
    if action == 0:
        del holder[key]
    elif action == 1 and isinstance(holder, dict):
        holder[chance.choice(("", "frames", "picture", "width", "x" * 3000, "\ud800\x1b"))] = holder[key]
    elif action == 2:
        for _ in range(chance.choice((1, 3, 200))):
            holder[key] = [holder[key]] if chance.random() < 0.5 else {"frame": holder[key]}
    elif action == 3:
        holder[key] = chance.choice(references)
    elif action == 4 and isinstance(holder[key], list):
        holder[key] = holder[key] * chance.choice((0, 2, 300))
    else:
        holder[key] = chance.choice(_ODD_VALUES)


_ODD_VALUES: list[Any] = [
    *(None, True, False, "", "x", "\n\x1b[2J", "\ud800", "é" * 1000, [], {}, [[]], [{}], {"frame": {}}),
    *(0, 1, -1, 2, 3, 4, 9, 0.5, -0.0, 1e-320, 1e300, 2**31, 2**32, 2**63, -(2**63), 10**400, 65535, 20000, 19996),
    *("@inf", "@nan", "@digits", "@deep", "@whole"),
    *("jpeg", "h264", "raw", "packedFloat", "ILLUM", "F01", "little", "big", "gr"),
]


def _places(document: Any) -> Iterator[tuple[Any, Any]]:
    """(object or list, key or index) of all values in a document."""
    waiting = [document]
    while waiting:
        holder = waiting.pop()
        items = holder.items() if isinstance(holder, dict) else enumerate(holder) if isinstance(holder, list) else ()
        for key, child in items:
            yield holder, key
            waiting.append(child)


def _change_data(data: bytes, chance: random.Random) -> bytes:
    """Damage the data of one section, with a correct hash and references to it."""
    parts = _split(data)
    index = chance.randrange(len(parts))
    kind = chance.choice((_flip, _overwrite, _insert, _delete))
    return _join(_replaced(parts, index, kind(parts[index][1], chance)))


def _cut_data(data: bytes, chance: random.Random) -> bytes:
    parts = _split(data)
    index = chance.randrange(len(parts))
    return _join(_replaced(parts, index, _cut(parts[index][1], chance)))


def _split(data: bytes) -> Parts:
    """The sections of a container, as far as they go; ValueError where there are none."""
    parts, place = [], 16
    while len(header := data[place : place + 96]) == 96:
        length = struct.unpack(">I", header[12:16])[0]
        parts.append((header[1:4], data[place + 96 : place + 96 + length]))
        place += 96 + length
        place += -place % 16
    if not parts:
        raise ValueError("no section left")
    return parts


def _replaced(parts: Parts, index: int, data: bytes) -> Parts:
    """The parts with one exchanged, and its name in the table exchanged too."""
    kind, old = parts[index]
    names = reference_to(old).encode(), reference_to(data).encode()
    renamed = [(TABLE, part.replace(*names)) if own == TABLE else (own, part) for own, part in parts]
    renamed[index] = (kind, data)
    return renamed


def _join(parts: Parts) -> bytes:
    data = b"\x89LFP\r\n\x1a\n" + struct.pack(">II", 1, 0)
    for kind, part in parts:
        header = b"\x89" + kind + b"\r\n\x1a\n" + struct.pack(">II45s35x", 0, len(part), reference_to(part).encode())
        data += header + part
        data += bytes(-len(data) % 16)
    return data


def _change_header(data: bytes, chance: random.Random) -> bytes:
    """Change a field of a header in a tar archive, mostly with a correct checksum."""
    headers = [place for place in range(0, len(data) - 511, 512) if data[place + 257 : place + 262] == b"ustar"]
    place = chance.choice(headers)
    block = bytearray(data[place : place + 512])
    begin, end = chance.choice(((0, 100), (124, 136), (124, 136), (156, 157), (156, 157), (345, 500), (482, 483)))
    block[begin:end] = chance.choice(_ODD_FIELDS)[: end - begin].ljust(end - begin, b"\0")
    if chance.random() < 0.9:
        block[148:156] = b" " * 8
        block[148:156] = b"%06o\0 " % sum(block)
    return data[:place] + bytes(block) + data[place + 512 :]


_ODD_FIELDS = (
    *(b"77777777777", b"\x80" + b"\xff" * 11, b"\xff" * 12, b"-1", b"\1"),  # sizes
    *(b"S", b"L", b"x", b"2", b"../../MOD_0001.RAW"),  # kinds and names
)
