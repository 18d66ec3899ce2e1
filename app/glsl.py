"""Shader sources from the package `shaders`: `#include "file"` is resolved, and a compiler's message names file and line."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources

_INCLUDE = re.compile(r'^#include "([\w.]+)"$')
# "1:23(4): error" (Mesa), "1(23) : error" (NVIDIA), "ERROR: 1:23:" (others): source number, line.
_PLACE = re.compile(r"\b(\d+)(?::|\()(\d+)(?=[):(])")


@dataclass(frozen=True)
class Source:
    """One shader's text with its includes, and the files it was made of in the order of their source numbers."""

    text: str
    files: tuple[str, ...]

    def located(self, message: str) -> str:
        """A compiler's message with `file:line` in place of the numbers that compilers print."""

        def name(match: re.Match[str]) -> str:
            number, line = int(match[1]), match[2]
            return f"{self.files[number]}:{line}" if number < len(self.files) else match[0]

        return _PLACE.sub(name, message)


def load(name: str, instead: Mapping[str, str] | None = None) -> Source:
    """The shader file of that name with its includes, each file once; `instead` maps included names to others."""
    files: list[str] = []
    return Source("\n".join(_lines(name, files, instead or {})) + "\n", tuple(files))


def _lines(name: str, files: list[str], instead: Mapping[str, str]) -> list[str]:
    number = len(files)
    files.append(name)
    lines: list[str] = []
    for at, line in enumerate(resources.files("shaders").joinpath(name).read_text("utf-8").splitlines(), start=1):
        include = _INCLUDE.match(line)
        if include is None:
            lines.append(line)
            continue
        included = instead.get(include[1], include[1])
        if included not in files:
            lines += [f"#line 1 {len(files)}", *_lines(included, files, instead), f"#line {at + 1} {number}"]
        else:
            lines.append("")
    return lines
