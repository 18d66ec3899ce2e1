"""JSON of unknown origin, read with care: every value is checked for its type and range, and named where it is wrong."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from typing import Any, NoReturn

from lfcore.errors import InputError

# The largest JSON found in a camera's file takes 13 KB. Parsed, JSON may take thirty times its size in memory.
MAX_JSON_BYTES = 2**20

_SHOWN = 40  # characters of a wrong value that a message quotes


def parse_object(data: bytes, source: str) -> dict[str, Any]:
    """Parse a JSON object in UTF-8. `source` begins the messages, such as "a.lfp: section 2 of 3".

    Raises InputError for whatever is no JSON object, for JSON over 1 MiB, and for numbers that are not finite.
    """
    check_json_size(len(data), source)
    try:
        value = json.loads(data.rstrip(b"\0").decode("utf-8"), parse_constant=_refuse_constant)
    except RecursionError as error:
        raise InputError(f"{source} holds JSON nested too deeply to be metadata; the file is damaged.") from error
    except ValueError as error:  # among them UnicodeDecodeError and JSONDecodeError
        raise InputError(f"{source} holds no valid JSON where metadata is expected; the file is damaged.") from error
    if not isinstance(value, dict):
        raise InputError(f"{source} holds JSON that is no object where metadata is expected; the file is damaged.")
    return value


def to_json(value: Mapping[str, Any]) -> bytes:
    """JSON laid out as in the cameras' files: tabs, and blanks on both sides of colons."""
    return json.dumps(value, indent="\t", separators=(",", " : "), allow_nan=False).encode()


def printable(text: str) -> str:
    """The text with a question mark for each character that cannot be printed, such as line breaks."""
    return text if text.isprintable() else "".join(letter if letter.isprintable() else "?" for letter in text)


def check_json_size(length: int, source: str) -> None:
    """Raise InputError for more bytes than a camera's metadata takes; `source` begins the message."""
    if length > MAX_JSON_BYTES:
        raise InputError(f"{source} holds {length:,} bytes where metadata of at most {MAX_JSON_BYTES:,} is expected.")


def _refuse_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is no JSON")


class Fields:
    """One object of a JSON document, and where in the document it stands.

    The getters return None where the key is missing or null, and raise InputError, naming the place, where the value has
    another type or lies outside the range.
    """

    def __init__(self, values: Mapping[str, Any], source: str, place: str = "") -> None:
        self.values = values
        self.source = source
        self.place = place

    def __bool__(self) -> bool:
        return bool(self.values)

    def __contains__(self, key: str) -> bool:
        return self.values.get(key) is not None

    def child(self, *keys: str) -> Fields:
        """The object under that key (or chain of keys); an empty one where it is missing."""
        fields = self
        for key in keys:
            value = fields.values.get(key)
            if value is not None and not isinstance(value, dict):
                raise fields._wrong(key, value, "an object")
            fields = Fields(value or {}, self.source, fields._place(key))
        return fields

    def children(self, key: str) -> Iterator[Fields]:
        """The objects of the list under that key; none where it is missing."""
        for index, value in enumerate(self._list(key)):
            name = f"{key}[{index}]"
            if not isinstance(value, dict):
                raise self._wrong(name, value, "an object")
            yield Fields(value, self.source, self._place(name))

    def number(self, key: str, low: float = -math.inf, high: float = math.inf) -> float | None:
        """A finite number from `low` to `high`, as float."""
        value = self.values.get(key)
        return None if value is None else self._number(key, value, low, high)

    def whole(self, key: str, low: int, high: int) -> int | None:
        """A whole number from `low` to `high`; 3.0 counts as whole."""
        value = self.number(key, low, high)
        if value is not None and value != int(value):
            raise self._wrong(key, value, f"a whole number from {low} to {high}")
        return None if value is None else int(value)

    def numbers(self, key: str, count: int, low: float = -math.inf, high: float = math.inf) -> tuple[float, ...] | None:
        """A list of exactly that many finite numbers."""
        if key not in self:
            return None
        values = self._list(key)
        if len(values) != count:
            raise self._wrong(key, values, f"a list of {count} numbers")
        return tuple(self._number(f"{key}[{index}]", value, low, high) for index, value in enumerate(values))

    def text(self, key: str) -> str | None:
        """A string, characters that cannot be printed replaced; the empty one counts as missing."""
        value = self.values.get(key)
        if value is not None and not isinstance(value, str):
            raise self._wrong(key, value, "text")
        return printable(value) if value else None

    def flag(self, key: str) -> bool | None:
        """true or false."""
        value = self.values.get(key)
        if value is not None and not isinstance(value, bool):
            raise self._wrong(key, value, "true or false")
        return value

    def wrong(self, key: str, expected: str) -> InputError:
        """The error to raise for the value of that key: "...: image.width is 7; expected ..."."""
        return self._wrong(key, self.values.get(key), expected)

    def _list(self, key: str) -> list[Any]:
        value = self.values.get(key)
        if value is not None and not isinstance(value, list):
            raise self._wrong(key, value, "a list")
        return value or []

    def _number(self, key: str, value: Any, low: float, high: float) -> float:
        # bool is an int to Python, but not to JSON.
        good = isinstance(value, int | float) and not isinstance(value, bool) and low <= value <= high
        if good and abs(value) <= 1e300:
            return float(value)
        anything = math.isinf(low) and math.isinf(high)
        raise self._wrong(key, value, "a number" if anything else f"a number from {low:g} to {high:g}")

    def _place(self, key: str) -> str:
        return f"{self.place}.{key}" if self.place else key

    def _wrong(self, key: str, value: Any, expected: str) -> InputError:
        found = "missing" if value is None else _short(value)
        place = self._place(key)
        return InputError(f"{self.source}: {place} is {found}; expected {expected}, so the file's metadata is damaged.")


def _short(value: Any) -> str:
    if isinstance(value, dict | list):
        return f"{'an object' if isinstance(value, dict) else 'a list'} of {len(value)}"
    # ascii() leaves no line breaks; whole numbers beyond 4300 digits cannot be written, nor do they come out of the parser.
    text = ascii(value)
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}.."
