"""Shader sources from the package `shaders`: `#include "file"` is resolved, and a compiler's message names file and line."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources

_INCLUDE = re.compile(r'^#include "([\w.]+)"$')
# "0:23(4): error" (Mesa), "0(23) : error" (NVIDIA), "ERROR: 0:23:" (others): source number, line.
_PLACE = re.compile(r"\b0(?::|\()(\d+)(?=[:(])|\b0\((\d+)\)")


@dataclass(frozen=True)
class Source:
    """One shader's text with its includes, and the (file, line) that each of its lines comes from.

    Not by `#line`, whose source numbers drivers handle in different ways.
    """

    text: str
    places: tuple[tuple[str, int], ...]

    @property
    def files(self) -> tuple[str, ...]:
        """The files it was made of, each once, in the order in which they begin."""
        return tuple(dict.fromkeys(file for file, _ in self.places))

    def located(self, message: str) -> str:
        """A compiler's message with `file:line` in place of the numbers that compilers print."""

        def name(match: re.Match[str]) -> str:
            line = int(match[1] or match[2])
            if not 1 <= line <= len(self.places):
                return match[0]
            file, line_in_file = self.places[line - 1]
            return f"{file}:{line_in_file}"

        return _PLACE.sub(name, message)


def load(name: str, instead: Mapping[str, str] | None = None) -> Source:
    """The shader file of that name with its includes, each file once; `instead` maps included names to others."""
    lines = _lines(name, set(), instead or {})
    return Source("".join(f"{text}\n" for text, _, _ in lines), tuple((file, line) for _, file, line in lines))


def _lines(name: str, seen: set[str], instead: Mapping[str, str]) -> list[tuple[str, str, int]]:
    seen.add(name)
    lines: list[tuple[str, str, int]] = []
    for number, text in enumerate(resources.files("shaders").joinpath(name).read_text("utf-8").splitlines(), start=1):
        include = _INCLUDE.match(text)
        if include is None:
            lines.append((text, name, number))
            continue
        included = instead.get(include[1], include[1])
        if included not in seen:
            lines += _lines(included, seen, instead)
    return lines
