"""Arrays of numbers in files of MATLAB (.mat, through scipy) and HDF5 (.h5, and .mat from MATLAB 7.3 on, through h5py).

Both libraries are loaded when such a file is met. Links from an HDF5 file to others are not followed.
"""

from __future__ import annotations

import contextlib
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lfcore.errors import Cancelled, InputError
from lfcore.formats.images import Pixels

EXTENSIONS = (".mat", ".h5", ".hdf5")

_HDF5 = b"\x89HDF\r\n\x1a\n"
_MATLAB = b"MATLAB "
_USER_BLOCK = 512  # bytes before the part that is HDF5 in files of MATLAB 7.3
_PARTS = 16  # at least so many are read one after the other, for progress

# MATLAB's classes of numbers, by numpy's names.
_CLASSES = {"single": "float32", "double": "float64"} | {
    name: name for name in ("uint8", "int8", "uint16", "int16", "uint32", "int32", "uint64", "int64")
}

Progress = Callable[[float], None]


@dataclass(frozen=True)
class StoredArray(ABC):
    """An array in a file; its axes are those of the program that wrote it, in their order."""

    path: Path
    name: str
    shape: tuple[int, ...]
    dtype: str

    @property
    def nbytes(self) -> int:
        """What all of it takes in memory."""
        return math.prod(self.shape) * np.dtype(self.dtype).itemsize

    @abstractmethod
    def read(
        self, places: Mapping[int, int], progress: Progress | None = None, cancelled: Callable[[], bool] = lambda: False
    ) -> Pixels:
        """What lies at these places of these axes, which keep a length of 1; all of it, where there are none.

        Raises InputError where the file is damaged, Cancelled where `cancelled` says so.
        """


def sniff(path: Path) -> bool:
    """Whether the file begins as one of MATLAB or HDF5. Raises InputError where it cannot be read."""
    begin = _begin(path)
    return begin.startswith(_MATLAB) or _is_hdf5(begin)


def stored_arrays(path: Path) -> list[StoredArray]:
    """The arrays of numbers at the top of the file. Raises InputError where it cannot be read or is damaged."""
    begin = _begin(path)
    if _is_hdf5(begin):
        return list(_in_hdf5(path, backwards=begin.startswith(_MATLAB)))
    return list(_in_matlab(path))


def _begin(path: Path) -> bytes:
    try:
        with path.open("rb") as file:
            return file.read(_USER_BLOCK + len(_HDF5))
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}; check the path and its permissions.") from error


def _is_hdf5(begin: bytes) -> bool:
    return begin.startswith(_HDF5) or (begin.startswith(_MATLAB) and begin[_USER_BLOCK:] == _HDF5)


@contextlib.contextmanager
def _damage_told(path: Path) -> Iterator[None]:
    """Whatever the libraries raise, which in damaged files may be anything, as a sentence."""
    try:
        yield
    except (InputError, Cancelled):
        raise
    except Exception as error:
        reason = (str(error).strip().splitlines() or [type(error).__name__])[0].rstrip(".")
        raise InputError(f"{path} is damaged or cut off ({reason}); copy or export it again.") from error


def _slices(places: Mapping[int, int], axes: int) -> list[slice]:
    return [slice(places[axis], places[axis] + 1) if axis in places else slice(None) for axis in range(axes)]


@dataclass(frozen=True)
class _MatlabArray(StoredArray):
    """Of a file before MATLAB 7.3, which is read as a whole."""

    def read(
        self, places: Mapping[int, int], progress: Progress | None = None, cancelled: Callable[[], bool] = lambda: False
    ) -> Pixels:
        from scipy.io import loadmat

        if cancelled():
            raise Cancelled
        with _damage_told(self.path):
            values: Pixels = loadmat(self.path, variable_names=[self.name])[self.name]
        if progress is not None:
            progress(1.0)
        return values[tuple(_slices(places, len(self.shape)))]


def _in_matlab(path: Path) -> Iterator[StoredArray]:
    from scipy.io import whosmat

    with _damage_told(path):
        found = whosmat(path)
    for name, shape, kind in found:
        if kind in _CLASSES:
            yield _MatlabArray(path, name, tuple(map(int, shape)), _CLASSES[kind])


@dataclass(frozen=True)
class _HDF5Array(StoredArray):
    """`backwards`: the file has the axes in the opposite order, since MATLAB stores the first one densest."""

    backwards: bool

    def read(
        self, places: Mapping[int, int], progress: Progress | None = None, cancelled: Callable[[], bool] = lambda: False
    ) -> Pixels:
        import h5py

        slices = self._turned(_slices(places, len(self.shape)))
        with _damage_told(self.path), h5py.File(self.path, "r") as file:
            dataset = file[self.name]
            values = np.empty([len(range(*s.indices(n))) for s, n in zip(slices, dataset.shape, strict=True)], self.dtype)
            first, *rest = slices
            for part in _parts(len(values), dataset.chunks[0] if dataset.chunks else 1):
                if cancelled():
                    raise Cancelled
                begin = (first.start or 0) + part.start
                values[part] = dataset[(slice(begin, begin + part.stop - part.start), *rest)]
                if progress is not None:
                    progress(part.stop / len(values))
        return values.transpose(self._turned(list(range(values.ndim))))

    def _turned(self, axes: list[Any]) -> list[Any]:
        """One thing for each axis, from the program's order to the file's or back."""
        return axes[::-1] if self.backwards else axes


def _parts(length: int, chunk: int) -> Iterator[slice]:
    """Slices of whole chunks, so that none is read twice."""
    step = -(-length // (_PARTS * chunk)) * chunk
    for begin in range(0, length, step):
        yield slice(begin, min(begin + step, length))


def _in_hdf5(path: Path, backwards: bool) -> Iterator[StoredArray]:
    import h5py

    with _damage_told(path), h5py.File(path, "r") as file:
        for name in file:
            if not isinstance(file.get(name, getlink=True), h5py.HardLink):
                continue
            dataset = file[name]
            if isinstance(dataset, h5py.Dataset) and _is_plain(dataset):
                shape = tuple(map(int, dataset.shape))
                yield _HDF5Array(path, str(name), shape[::-1] if backwards else shape, str(dataset.dtype), backwards)


def _is_plain(dataset: Any) -> bool:
    """Whether it is of numbers that lie in this file."""
    return dataset.dtype.kind in "uif" and not dataset.external and not dataset.is_virtual
