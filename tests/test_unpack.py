"""Packed pixels both ways, against an independent reading of the packings bit by bit."""

from __future__ import annotations

import numpy as np
import pytest

from lfcore.decode import unpack as module
from lfcore.decode.unpack import Packing, pack, unpack
from lfcore.errors import InputError

PACKINGS = [Packing(10, "little"), Packing(12, "big"), Packing(8, "big"), Packing(16, "little"), Packing(16, "big")]


def bit(data: bytes, byte: int, place: int) -> int:
    """Bit `place` of a byte, 0 the lowest."""
    return data[byte] >> place & 1


def slow_pixel(data: bytes, packing: Packing, index: int) -> int:
    """One pixel, put together from single bits in the order that lytro's format has them."""
    if packing.bits == 10:
        group, place = divmod(index, 4)
        high = [bit(data, 5 * group + place, 7 - step) for step in range(8)]
        low = [bit(data, 5 * group + 4, 2 * place + 1), bit(data, 5 * group + 4, 2 * place)]
        bits = high + low
    elif packing.bits == 12:
        first = 12 * index  # of a stream of bits, the highest of each byte first
        bits = [bit(data, (first + step) // 8, 7 - (first + step) % 8) for step in range(12)]
    elif packing.bits == 16:
        order = (2 * index + 1, 2 * index) if packing.endianness == "little" else (2 * index, 2 * index + 1)
        bits = [bit(data, byte, 7 - step) for byte in order for step in range(8)]
    else:
        bits = [bit(data, index, 7 - step) for step in range(8)]
    return int("".join(map(str, bits)), 2)


@pytest.mark.parametrize("packing", PACKINGS, ids=str)
def test_unpacks_like_reading_bit_by_bit(packing: Packing) -> None:
    width, height = 12, 7
    length = packing.length(width, height)
    data = np.random.default_rng(1).integers(0, 256, length, dtype=np.uint8).tobytes()
    slow = [slow_pixel(data, packing, index) for index in range(width * height)]
    pixels = unpack(data, packing, width, height)
    assert pixels.dtype == np.uint16
    assert pixels.tolist() == np.reshape(slow, (height, width)).tolist()
    assert pack(pixels, packing) == data


@pytest.mark.parametrize("packing", PACKINGS, ids=str)
def test_packs_what_reading_bit_by_bit_gives_back(packing: Packing) -> None:
    pixels = np.random.default_rng(2).integers(0, 1 << packing.bits, (5, 8), dtype=np.uint16)
    pixels[0, :2] = 0, (1 << packing.bits) - 1
    data = pack(pixels, packing)
    assert [slow_pixel(data, packing, index) for index in range(pixels.size)] == pixels.ravel().tolist()


@pytest.mark.parametrize("packing", PACKINGS[:2], ids=str)
def test_bands_join_without_seam(packing: Packing, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_BAND", 7)
    pixels = np.random.default_rng(3).integers(0, 1 << packing.bits, (9, 20), dtype=np.uint16)
    assert (unpack(pack(pixels, packing), packing, 20, 9) == pixels).all()


def test_sizes_of_the_cameras() -> None:
    assert Packing(12, "big").length(3280, 3280) == 16_137_600
    assert Packing(10, "little").length(7728, 5368) == 51_854_880


@pytest.mark.parametrize("bits, endianness", [(10, "big"), (12, "little"), (14, "big"), (0, "little"), (10, "middle")])
def test_refuses_other_packings(bits: int, endianness: str) -> None:
    with pytest.raises(InputError, match=rf"packed in {bits} bits, {endianness}; expected"):
        Packing(bits, endianness)


def test_refuses_other_lengths() -> None:
    packing = Packing(10, "little")
    with pytest.raises(InputError, match="takes 40 bytes, but 39 were found"):
        unpack(bytes(39), packing, 8, 4)
    with pytest.raises(InputError, match="Rows of 6 px"):
        unpack(bytes(30), packing, 6, 4)
    with pytest.raises(ValueError, match="1024 does not fit"):
        pack(np.full((1, 4), 1024, np.uint16), packing)
