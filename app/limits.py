"""Values held within limits."""

from __future__ import annotations

from typing import TypeVar

_Number = TypeVar("_Number", int, float)


def within(value: _Number, limits: tuple[_Number, _Number]) -> _Number:
    """The value, or the limit that it is beyond; the lower one for a value that is not a number."""
    return min(max(limits[0], value), limits[1])  # in this order: of a number and NaN, `max` takes the first
