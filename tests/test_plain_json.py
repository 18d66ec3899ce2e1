"""Values to JSON and back."""

from __future__ import annotations

from dataclasses import dataclass, field

from app.plain_json import read_fields, to_json


@dataclass(frozen=True)
class Inner:
    size: float = 1.0


@dataclass(frozen=True)
class Outer:
    name: str = "a"
    inner: Inner = field(default_factory=Inner)
    pair: tuple[int, int] = (1, 2)


def test_values_come_back() -> None:
    value = Outer("b", Inner(2.5), (3, 4))
    assert read_fields(Outer, to_json(value)) == value


def test_a_field_that_another_version_knows_costs_no_more_than_its_value() -> None:
    data = {"name": "b", "later": 1, "inner": {"size": 3.0, "later": 2}}
    assert read_fields(Outer, data) == Outer("b", Inner(), (1, 2))
