"""The one way in which lfview writes files: beside the target, then a rename, so that a crash leaves the old file or none."""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

from lfcore.errors import OutputError


def _umask() -> int:
    value = os.umask(0)
    os.umask(value)
    return value


_UMASK = _umask()  # once, before there are threads: it can only be read by setting it, which they must not see
_MOST_OF_NAME = 32  # characters of the target's name in that of the temporary file, since names are at most 255 bytes long


@contextlib.contextmanager
def atomic_path(target: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield the path of a temporary file beside `target`; rename it onto `target` if the block succeeds, else delete it.

    The temporary name keeps the target's extension, since writers of images and video go by it. Ctrl-C inside the block
    counts as failure. Raises OutputError where the folder is missing or not writable, or the disk is full.
    """
    target = Path(target)
    try:
        if target.is_dir():
            raise OutputError(f"Cannot write {target}: it is a folder; give the name of a file.")
        handle, name = tempfile.mkstemp(prefix=f".{target.stem[:_MOST_OF_NAME]}.", suffix=target.suffix, dir=target.parent)
    except OSError as error:
        raise _output_error(target, error) from error
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        # mkstemp makes files that only the owner may read; give the target the mode a plain open() would have given it.
        temporary.chmod(0o666 & ~_UMASK)
        temporary.replace(target)
    except OSError as error:
        raise _output_error(target, error) from error
    finally:
        temporary.unlink(missing_ok=True)


def _output_error(target: Path, error: OSError) -> OutputError:
    reason = error.strerror or str(error)
    return OutputError(f"Cannot write {target}: {reason}; choose another place or make room there.")
