"""Plain values to JSON and back: numbers, texts, enums, tuples, mappings and dataclasses of them, checked against their types.

What comes from a file is read field by field: a field that is missing or is not what it should be takes its default.
"""

from __future__ import annotations

import dataclasses
import math
import types
import typing
from collections.abc import Callable, Mapping
from enum import Enum
from functools import cache
from typing import Any, TypeVar

Json = Any  # what json.loads returns

Value = TypeVar("Value")


def to_json(value: object) -> Json:
    """The value as json.dumps takes it: enums by name, tuples as lists, dataclasses as objects."""
    if isinstance(value, Enum):
        return value.name
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {each.name: to_json(getattr(value, each.name)) for each in dataclasses.fields(value)}
    if isinstance(value, tuple):
        return [to_json(each) for each in value]
    if isinstance(value, Mapping):
        return {str(key): to_json(each) for key, each in value.items()}
    return value


def read_fields(kind: type[Value], data: Json) -> Value:
    """A dataclass from what `to_json` made of one; fields that are missing or wrong take their defaults."""
    if not isinstance(data, dict):
        return kind()
    values = {}
    for name, expected in field_types(typing.cast(Any, kind)).items():
        if name in data:
            try:
                values[name] = from_json(expected, data[name])
            except (TypeError, ValueError):
                continue
    return kind(**values)


@cache
def field_types(kind: Any) -> Mapping[str, Any]:
    """The types of a dataclass's fields, by name."""
    hints = typing.get_type_hints(kind)
    return {each.name: hints[each.name] for each in dataclasses.fields(kind)}


def from_json(expected: Any, data: Json) -> Any:
    """A value of the expected type from what `to_json` made of one. Raises ValueError or TypeError for anything else."""
    origin = typing.get_origin(expected)
    if origin in (types.UnionType, typing.Union):
        return _first_that_fits(typing.get_args(expected), data)
    if origin is tuple:
        return _tuple(typing.get_args(expected), data)
    if origin is not None and issubclass(origin, Mapping):
        return _mapping(typing.get_args(expected), data)
    if expected is Any:
        return data
    if expected is type(None):
        return _checked(data is None, lambda: None)
    if issubclass(expected, Enum):
        return _checked(isinstance(data, str) and data in expected.__members__, lambda: expected[data])
    if dataclasses.is_dataclass(expected):
        return _dataclass(expected, data)
    if expected is float:
        number = isinstance(data, int | float) and not isinstance(data, bool)
        return _checked(number and abs(data) < 1e300 and math.isfinite(data), lambda: float(data))
    if expected is int:
        return _checked(isinstance(data, int) and not isinstance(data, bool) and abs(data) < 2**53, lambda: data)
    return _checked(expected in (bool, str) and isinstance(data, expected), lambda: data)


def _checked(fits: bool, value: Callable[[], Any]) -> Any:
    if not fits:
        raise ValueError("of another type")
    return value()


def _first_that_fits(choices: tuple[Any, ...], data: Json) -> Any:
    for choice in choices:
        try:
            return from_json(choice, data)
        except (TypeError, ValueError):
            continue
    raise ValueError("of another type")


def _tuple(parts: tuple[Any, ...], data: Json) -> tuple[Any, ...]:
    if not isinstance(data, list):
        raise ValueError("no list")
    if len(parts) == 2 and parts[1] is Ellipsis:
        return tuple(from_json(parts[0], each) for each in data)
    return tuple(from_json(part, each) for part, each in zip(parts, data, strict=True))


def _mapping(parts: tuple[Any, ...], data: Json) -> dict[Any, Any]:
    if not isinstance(data, dict):
        raise ValueError("no object")
    return {from_json(parts[0], key): from_json(parts[1], each) for key, each in data.items()}


def _dataclass(kind: Any, data: Json) -> Any:
    if not isinstance(data, dict):
        raise ValueError("no object")
    expected = field_types(kind)
    if not data.keys() <= expected.keys():
        raise ValueError("an unknown field")
    return kind(**{name: from_json(expected[name], each) for name, each in data.items()})
