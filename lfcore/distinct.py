"""Names that tell things of one kind apart."""

from __future__ import annotations


def unused(name: str, taken: set[str]) -> str:
    """The name, numbered where it is taken ("scene (2)"); it is taken from now on."""
    found, number = name, 2
    while found in taken:
        found, number = f"{name} ({number})", number + 1
    taken.add(found)
    return found
