"""Names of files as texts that can be shown: what Linux allows in a name need not be a text."""

from __future__ import annotations


def readable(words: str) -> str:
    """The words, with a question mark for each byte of a file's name that is not UTF-8 (a lone surrogate, in Python)."""
    return words.encode("utf-8", "replace").decode("utf-8")
