"""The cache of syntheses: bounded, least recently used out first, by value, safe from threads."""

from __future__ import annotations

import threading
from dataclasses import replace
from typing import cast

import numpy as np
import pytest

from lfcore.cache import CacheKey, SynthesisCache, cache_key
from lfcore.lightfield import LightField
from lfcore.synthesizer import Synthesis, Synthesizer


def synthesis(u: float = 0.5, v: float = 0.5, seed: int = 0, side: int = 32) -> Synthesis:
    random = np.random.default_rng(seed)
    return Synthesis(
        u=u,
        v=v,
        model="full",
        image=random.random((side, side, 3), dtype=np.float32),
        disparity=random.uniform(-21, 21, (side, side)).astype(np.float32),
        warped=random.random((4, side, side, 3), dtype=np.float32),
        timings={"total": 0.25},
    )


def key(u: float = 0.5, v: float = 0.5, content: str = "lf", model: str = "m") -> CacheKey:
    return CacheKey(content, model, u, v)


def test_what_was_put_comes_back_within_half_precision() -> None:
    cache = SynthesisCache()
    put = synthesis(seed=1)
    cache.put(key(), put)
    got = cache.get(key())
    assert got is not None
    assert got.image.dtype == np.float32
    assert np.abs(got.image - put.image).max() < 0.13 / 255
    assert got.disparity is not None
    assert put.disparity is not None
    assert np.abs(got.disparity - put.disparity).max() <= 2**-7
    assert got.warped is None
    assert (got.u, got.v, got.model, got.timings) == (put.u, put.v, put.model, put.timings)
    assert cache.get(key(0.6)) is None


def test_a_synthesis_without_disparity_is_held_too() -> None:
    cache = SynthesisCache()
    cache.put(key(), replace(synthesis(), disparity=None, warped=None))
    got = cache.get(key())
    assert got is not None
    assert got.disparity is None


def test_the_least_recently_used_goes_first_and_the_limit_holds() -> None:
    one = SynthesisCache()
    one.put(key(), synthesis())
    size = one.bytes_used
    assert size >= 32 * 32 * 4 * 2  # four half floats per pixel at the least
    cache = SynthesisCache(3 * size)
    for u in (0.1, 0.2, 0.3):
        cache.put(key(u), synthesis(u))
    cache.get(key(0.1))
    cache.put(key(0.4), synthesis(0.4))
    assert cache.positions("lf", "m") == [(0.3, 0.5), (0.1, 0.5), (0.4, 0.5)]
    assert cache.bytes_used == 3 * size
    assert cache.get(key(0.2)) is None


def test_putting_again_replaces_and_counts_once() -> None:
    cache = SynthesisCache()
    cache.put(key(), synthesis(seed=1))
    size = cache.bytes_used
    newer = synthesis(seed=2)
    cache.put(key(), newer)
    got = cache.get(key())
    assert got is not None
    assert np.allclose(got.image, newer.image, atol=1e-3)
    assert (len(cache), cache.bytes_used) == (1, size)


def test_what_exceeds_the_limit_is_not_held_and_drives_nothing_out() -> None:
    cache = SynthesisCache(20_000)
    cache.put(key(0.1), synthesis())
    cache.put(key(0.2), synthesis(side=64))
    assert cache.positions("lf", "m") == [(0.1, 0.5)]


def test_positions_are_those_of_one_light_field_and_one_model() -> None:
    cache = SynthesisCache()
    cache.put(key(0.1), synthesis())
    cache.put(key(0.2, model="other"), synthesis())
    cache.put(key(0.3, content="other"), synthesis())
    assert cache.positions("lf", "m") == [(0.1, 0.5)]
    cache.clear()
    assert (cache.positions("lf", "m"), cache.bytes_used, len(cache)) == ([], 0, 0)


def test_keys_go_by_value() -> None:
    class Named:
        key = "weights"

    synthesizer = cast(Synthesizer, Named())
    views = np.arange(2 * 2 * 3 * 3 * 3, dtype=np.uint8).reshape(2, 2, 3, 3, 3)
    first = LightField(views, "a", "one.png", "folder")
    same = LightField(views.copy(), "b", "two.png", "folder")
    other = LightField(views[::-1], "a", "one.png", "folder")
    assert cache_key(first, synthesizer, 0.25, 0.5) == cache_key(same, synthesizer, 0.250001, 0.499999)
    assert cache_key(first, synthesizer, -0.00001, 0) == cache_key(first, synthesizer, 0, 0)
    assert str(cache_key(first, synthesizer, -0.00001, 0)) == str(cache_key(first, synthesizer, 0, 0))
    assert cache_key(first, synthesizer, 0.25, 0.5) != cache_key(first, synthesizer, 0.2502, 0.5)
    assert cache_key(first, synthesizer, 0.25, 0.5) != cache_key(other, synthesizer, 0.25, 0.5)


def test_a_negative_limit_is_refused() -> None:
    with pytest.raises(ValueError, match="at least 0"):
        SynthesisCache(-1)


def test_threads_leave_the_count_right() -> None:
    cache = SynthesisCache(40_000)  # four of the nine or so kilobytes that one synthesis takes
    items = {n / 16: synthesis(n / 16, seed=n) for n in range(16)}
    failures: list[str] = []

    def use(seed: int) -> None:
        random = np.random.default_rng(seed)
        for n in random.integers(0, 16, 300):
            u = float(n) / 16
            cache.put(key(u), items[u])
            wanted = float(random.integers(0, 16)) / 16
            got = cache.get(key(wanted))
            if got is not None and (got.u != wanted or not np.allclose(got.image, items[wanted].image, atol=1e-3)):
                failures.append(f"{wanted} came back as {got.u}")
            if cache.bytes_used > cache.limit_bytes:
                failures.append("over the limit")

    threads = [threading.Thread(target=use, args=(seed,)) for seed in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert failures == []
    held = len(cache)
    assert 0 < held <= 4
    one = SynthesisCache()
    one.put(key(), items[0.0])
    assert cache.bytes_used == held * one.bytes_used
