"""The packed pixels of a raw mosaic to uint16 and back.

10 bits, little: of five bytes the first four are the upper eight bits of four pixels, the fifth their lower two (the first
pixel's lowest in the byte). 12 bits, big: three bytes are two pixels, one after the other, the highest bits first.
8 and 16 bits are whole bytes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lfcore.errors import InputError

Mosaic = npt.NDArray[np.uint16]

# Groups of pixels unpacked at a time: few enough that they stay in the processor's cache.
_BAND = 1 << 14


@dataclass(frozen=True)
class Packing:
    """How pixels are packed: bits per pixel, and "little" or "big". Raises InputError for ways that are not known."""

    bits: int
    endianness: str

    def __post_init__(self) -> None:
        if (self.bits, self.endianness) not in _GROUPS:
            raise InputError(
                f"Pixels are packed in {self.bits} bits, {self.endianness}; expected 10 bits little (Illum), 12 bits big "
                "(first generation), 8 or 16 bits."
            )

    @property
    def group(self) -> tuple[int, int]:
        """(pixels, bytes) of the smallest whole group."""
        return _GROUPS[self.bits, self.endianness]

    def length(self, width: int, height: int) -> int:
        """Bytes that a mosaic of this size takes. Raises InputError where its rows are no whole groups of pixels."""
        pixels, taken = self.group
        if width % pixels:
            raise InputError(f"Rows of {width} px cannot be packed in {self.bits} bits; expected a multiple of {pixels} px.")
        return width // pixels * taken * height


_GROUPS = {
    (8, "little"): (1, 1),
    (8, "big"): (1, 1),
    (10, "little"): (4, 5),
    (12, "big"): (2, 3),
    (16, "little"): (1, 2),
    (16, "big"): (1, 2),
}


def unpack(data: bytes | memoryview, packing: Packing, width: int, height: int) -> Mosaic:
    """The mosaic (H, W), uint16, values of 0 to 2^bits - 1. Raises InputError where `data` has another length."""
    expected = packing.length(width, height)
    if len(data) != expected:
        raise InputError(
            f"A mosaic of {width} x {height} px in {packing.bits} bits takes {expected:,} bytes, but {len(data):,} were found; "
            "the file is damaged or of another camera."
        )
    packed = np.frombuffer(data, np.uint8)
    if packing.bits == 10:
        return _unpack10(packed.reshape(-1, 5)).reshape(height, width)
    if packing.bits == 12:
        return _unpack12(packed.reshape(-1, 3)).reshape(height, width)
    stored = packed if packing.bits == 8 else packed.view(_words(packing))
    return stored.astype(np.uint16).reshape(height, width)


def pack(mosaic: Mosaic, packing: Packing) -> bytes:
    """The inverse of `unpack`: a mosaic (H, W), uint16, to bytes. ValueError where a value has too many bits."""
    if mosaic.size and int(mosaic.max()) >> packing.bits:
        raise ValueError(f"the value {int(mosaic.max())} does not fit into {packing.bits} bits")
    packing.length(mosaic.shape[1], mosaic.shape[0])
    if packing.bits == 10:
        return _pack10(mosaic.reshape(-1, 4)).tobytes()
    if packing.bits == 12:
        return _pack12(mosaic.reshape(-1, 2)).tobytes()
    return mosaic.astype(np.uint8 if packing.bits == 8 else _words(packing)).tobytes()


def _words(packing: Packing) -> np.dtype[np.uint16]:
    return np.dtype("<u2" if packing.endianness == "little" else ">u2")


def _unpack10(packed: npt.NDArray[np.uint8]) -> Mosaic:  # (N, 5) -> (N, 4)
    pixels = np.empty((len(packed), 4), np.uint16)
    for begin in range(0, len(packed), _BAND):
        source, target = packed[begin : begin + _BAND], pixels[begin : begin + _BAND]
        low = source[:, 4].astype(np.uint16)
        for index in range(4):
            np.left_shift(source[:, index], 2, out=target[:, index], dtype=np.uint16)
            target[:, index] |= (low >> 2 * index) & 3
    return pixels


def _pack10(pixels: Mosaic) -> npt.NDArray[np.uint8]:  # (N, 4) -> (N, 5)
    packed = np.empty((len(pixels), 5), np.uint8)
    packed[:, :4] = pixels >> 2
    low = pixels & 3
    packed[:, 4] = low[:, 0] | low[:, 1] << 2 | low[:, 2] << 4 | low[:, 3] << 6
    return packed


def _unpack12(packed: npt.NDArray[np.uint8]) -> Mosaic:  # (N, 3) -> (N, 2)
    pixels = np.empty((len(packed), 2), np.uint16)
    for begin in range(0, len(packed), _BAND):
        first, middle, last = packed[begin : begin + _BAND].T.astype(np.uint16)
        target = pixels[begin : begin + _BAND]
        target[:, 0] = first << 4 | middle >> 4
        target[:, 1] = (middle & 15) << 8 | last
    return pixels


def _pack12(pixels: Mosaic) -> npt.NDArray[np.uint8]:  # (N, 2) -> (N, 3)
    packed = np.empty((len(pixels), 3), np.uint8)
    packed[:, 0] = pixels[:, 0] >> 4
    packed[:, 1] = (pixels[:, 0] & 15) << 4 | pixels[:, 1] >> 8
    packed[:, 2] = pixels[:, 1] & 255
    return packed
