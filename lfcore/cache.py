"""A bounded store of syntheses, so that a viewpoint visited before is on screen at once."""

from __future__ import annotations

import dataclasses
import threading
from collections import OrderedDict

import numpy as np
import numpy.typing as npt

from lfcore.lightfield import LightField
from lfcore.synthesis import Synthesis, Synthesizer

_POSITION_DECIMALS = 4  # viewpoints nearer than this are one: 1e-4 of the baseline moves no pixel by more than 0.01
_ENTRY_OVERHEAD = 1024  # bytes counted for the objects around the arrays


@dataclasses.dataclass(frozen=True)
class CacheKey:
    """What a synthesis depends on, by value: the light field's pixels, the model with its weights, the viewpoint."""

    content: str
    model: str
    u: float
    v: float


def cache_key(light_field: LightField, synthesizer: Synthesizer, u: float, v: float) -> CacheKey:
    """The key of the synthesis of (u, v) from this light field by this synthesizer; u and v to 4 decimals."""
    return CacheKey(light_field.content_key, synthesizer.key, *rounded(u, v))


def rounded(u: float, v: float) -> tuple[float, float]:
    """The viewpoint as caches know it: to 4 decimals."""
    # Adding 0.0 turns -0.0, which prints differently, into 0.0.
    return round(u, _POSITION_DECIMALS) + 0.0, round(v, _POSITION_DECIMALS) + 0.0


def held_bytes(height: int, width: int) -> int:
    """What one synthesis with a disparity map, of pictures of this size, takes in the cache."""
    return 8 * height * width + _ENTRY_OVERHEAD


class SynthesisCache:
    """Syntheses by key, at most `limit_bytes` of them; what was used longest ago goes first. Safe to use from threads.

    Image and disparity are held as float16 (rounding: below 0.13 of a level of 8 bits; at most 0.004 px of disparity
    up to 16 px, 0.008 px up to 32 px, twice as much for each doubling), weights as they are, 4 bytes a pixel more; the warped
    inputs, large and quickly made again, are not held.
    """

    def __init__(self, limit_bytes: int = 512 * 2**20) -> None:
        if limit_bytes < 0:
            raise ValueError(f"the limit must be at least 0 bytes, not {limit_bytes}")
        self.limit_bytes = limit_bytes
        self._entries: OrderedDict[CacheKey, Synthesis] = OrderedDict()
        self._bytes_used = 0
        self._lock = threading.Lock()

    @property
    def bytes_used(self) -> int:
        """Bytes held at this moment, never above the limit."""
        with self._lock:
            return self._bytes_used

    def __len__(self) -> int:
        with self._lock:
            return len(self._entries)

    def get(self, key: CacheKey) -> Synthesis | None:
        """The synthesis under this key, float32 again and without warped inputs, or None."""
        with self._lock:
            packed = self._entries.get(key)
            if packed is None:
                return None
            self._entries.move_to_end(key)
        return _with_dtype(packed, np.float32)

    def put(self, key: CacheKey, synthesis: Synthesis) -> None:
        """Hold this synthesis, in place of any older one; one larger than the limit is not held."""
        packed = _with_dtype(dataclasses.replace(synthesis, warped=None), np.float16)
        size = _size(packed)
        with self._lock:
            self._drop(key)
            if size > self.limit_bytes:
                return
            while self._bytes_used + size > self.limit_bytes:
                self._drop(next(iter(self._entries)))
            self._entries[key] = packed
            self._bytes_used += size

    def positions(self, content_key: str, model_key: str) -> list[tuple[float, float]]:
        """The viewpoints (u, v) held for this light field and model, the one used longest ago first."""
        with self._lock:
            return [(k.u, k.v) for k in self._entries if (k.content, k.model) == (content_key, model_key)]

    def clear(self) -> None:
        """Forget everything."""
        with self._lock:
            self._entries.clear()
            self._bytes_used = 0

    def _drop(self, key: CacheKey) -> None:
        """Remove this entry if it is there; the lock is held by the caller."""
        entry = self._entries.pop(key, None)
        if entry is not None:
            self._bytes_used -= _size(entry)


def _with_dtype(synthesis: Synthesis, dtype: npt.DTypeLike) -> Synthesis:
    disparity = synthesis.disparity
    return dataclasses.replace(
        synthesis,
        image=synthesis.image.astype(dtype),
        disparity=None if disparity is None else disparity.astype(dtype),
    )


def _size(packed: Synthesis) -> int:
    disparity = 0 if packed.disparity is None else packed.disparity.nbytes
    weights = 0 if packed.weights is None else packed.weights.nbytes
    return packed.image.nbytes + disparity + weights + _ENTRY_OVERHEAD
