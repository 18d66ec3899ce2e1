"""What is said to the person at the screen of something that has gone wrong."""

from __future__ import annotations

from lfcore.errors import LfviewError, is_out_of_memory


def sentence(error: Exception) -> str:
    """One sentence, in the error's own words where they were meant for a person."""
    if isinstance(error, LfviewError):
        return str(error)
    if is_out_of_memory(error):
        return "There is not enough memory for this; close other programs or open a smaller light field."
    return f"Unexpected fault in the program: {type(error).__name__}: {error}"


def is_unexpected(error: Exception) -> bool:
    """Whether it is a fault of the program, whose traceback belongs in the log."""
    return not (isinstance(error, LfviewError) or is_out_of_memory(error))
