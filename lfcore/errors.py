"""The errors that a person at the screen is meant to read.

Each message is one sentence (or two) saying what was found, what was expected and what to do. The library raises them; the
program shows them in one place (the command line as one line with exit code 2, the window as a message).
"""


class LfviewError(Exception):
    """Base of every error whose text is written for the user; one line, though names of files may hold more."""

    def __str__(self) -> str:
        return " ".join(super().__str__().splitlines())


class InputError(LfviewError):
    """A file, folder or argument that cannot be used: missing, truncated, of the wrong kind, out of range."""


class WeightsError(LfviewError):
    """A weight file that is damaged or belongs to another model."""


class OutputError(LfviewError):
    """A target that cannot be written: no permission, no room, no such folder."""


def is_out_of_memory(error: BaseException) -> bool:
    """Whether it is Python's MemoryError, or torch's, which is a RuntimeError that says so."""
    return isinstance(error, MemoryError) or "can't allocate memory" in str(error) or "CUDA out of memory" in str(error)


class Cancelled(Exception):
    """Work that was given up because nobody wants its result any more; never shown as an error."""
