"""Reading pictures through OpenImageIO: header first, then pixels in their stored depth, every failure a sentence."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import OpenImageIO as oiio

from lfcore.errors import InputError

Pixels = npt.NDArray[np.generic]

# The most memory that the views of one light field (or one picture they are sliced from) may take.
MAX_BYTES = 4 * 2**30

EXTENSIONS = (".png", ".webp", ".jpg", ".jpeg", ".tif", ".tiff", ".exr")

# Half and double floats become float32, the one float depth of a LightField; nothing else is converted.
_DTYPES: dict[str, np.dtype[Any]] = {
    "uint8": np.dtype(np.uint8),
    "uint16": np.dtype(np.uint16),
    "half": np.dtype(np.float32),
    "float": np.dtype(np.float32),
    "double": np.dtype(np.float32),
}

# The same depths in OpenImageIO's words, to ask for them when reading.
_FORMATS = {"uint8": "uint8", "uint16": "uint16", "float32": "float"}


@dataclass(frozen=True)
class Header:
    """What a picture file says about itself: size in pixels, which channels to read, depth of the values when read."""

    width: int
    height: int
    first_channel: int
    channels: int  # 3, or 1 for a grey picture
    dtype: np.dtype[Any]
    tiled: bool

    @property
    def size(self) -> str:
        """Size for messages, such as "541 x 376"."""
        return f"{self.width} x {self.height}"

    @property
    def depth(self) -> str:
        """Depth for messages, such as "8 bit"."""
        return depth_name(self.dtype)


def depth_name(dtype: np.dtype[Any]) -> str:
    """The depth of stored values in words: "8 bit", "16 bit" or "32-bit float"."""
    return "32-bit float" if dtype.kind == "f" else f"{dtype.itemsize * 8} bit"


def read_header(path: Path) -> Header:
    """Read the header of a picture. Raises InputError where the file is missing, unreadable or no picture."""
    with open_picture(path) as picture:
        return picture.header


def check_memory(path: Path, header: Header, pictures: int = 1) -> None:
    """Raise InputError if that many pictures of this header's size would take more than MAX_BYTES."""
    needed = header.width * header.height * 3 * header.dtype.itemsize * pictures
    if needed > MAX_BYTES:
        what = f"{pictures} views of {header.size} px" if pictures > 1 else f"{header.size} px"
        raise InputError(
            f"{path} claims {what}, which take {needed / 2**30:.1f} GiB; at most {MAX_BYTES / 2**30:.0f} GiB are "
            "opened: make the pictures smaller or fewer."
        )


class Picture:
    """An open picture file; pixels come as stored, alpha and further channels left out."""

    def __init__(self, path: Path, source: Any) -> None:
        self.path = path
        self.header = _header(path, source.spec())
        self._source = source

    def read(self) -> Pixels:
        """All pixels, (H, W, C) with C = 3, or 1 for grey."""
        header = self.header
        end = header.first_channel + header.channels
        pixels = self._source.read_image(0, 0, header.first_channel, end, _FORMATS[header.dtype.name])
        return self._checked(pixels, header.height)

    def read_rows(self, begin: int, end: int) -> Pixels:
        """Pixel rows begin..end-1, (end - begin, W, C); go downwards, and only where the header is not tiled."""
        header = self.header
        last = header.first_channel + header.channels
        # OpenImageIO counts rows from the data window's origin, which EXR files may place anywhere.
        origin = self._source.spec().y
        pixels = self._source.read_scanlines(
            begin + origin, end + origin, 0, header.first_channel, last, _FORMATS[header.dtype.name]
        )
        return self._checked(pixels, end - begin)

    def _checked(self, pixels: Pixels | None, rows: int) -> Pixels:
        # A JPEG that ends early is filled up with grey and returned: only the error text tells.
        reason = _reason(self._source.geterror)
        if pixels is None or reason:
            raise InputError(f"{self.path} is damaged or cut off ({_first_line(reason)}); copy or export it again.")
        return pixels.reshape(rows, self.header.width, self.header.channels)


@contextlib.contextmanager
def open_picture(path: Path) -> Iterator[Picture]:
    """Open a picture and yield it; nothing but its header is read yet. Raises InputError as `read_header` does."""
    # Colours of transparent pixels are wanted as stored, not multiplied by alpha.
    wish = oiio.ImageSpec()
    wish.attribute("oiio:UnassociatedAlpha", 1)
    try:
        # OpenImageIO takes names in UTF-8 only; Linux allows any bytes.
        str(path).encode()
    except UnicodeEncodeError as error:
        raise InputError(f"The name {str(path)!a} is not valid UTF-8; rename the file or its folder.") from error
    source = oiio.ImageInput.open(str(path), wish)
    if source is None:
        raise _cannot_open(path, _reason(oiio.geterror))
    try:
        yield Picture(path, source)
    finally:
        source.close()


def _cannot_open(path: Path, reason: str) -> InputError:
    if not path.exists():
        return InputError(f"{path} does not exist; check the path.")
    try:
        with path.open("rb") as file:
            empty = not file.read(1)
    except OSError as error:
        return InputError(f"{path} cannot be read: {error.strerror}; check its permissions.")
    if empty:
        return InputError(f"{path} is empty (0 bytes); copy or export it again.")
    if "format reader" in reason:
        return InputError(f"{path} is no picture; expected a light field in {', '.join(EXTENSIONS)}.")
    return InputError(f"{path} is not a readable picture ({_first_line(reason)}); it is damaged or of another kind.")


def _header(path: Path, spec: Any) -> Header:
    dtype: np.dtype[Any] | None = _DTYPES.get(str(spec.format))
    if dtype is None:
        raise InputError(f"{path} stores its values as {spec.format}; expected 8 bit, 16 bit or float: convert it.")
    if spec.depth > 1 or min(spec.width, spec.height, spec.nchannels) < 1:
        raise InputError(f"{path} holds no flat picture ({spec.width} x {spec.height} x {spec.depth}).")
    try:
        names = [str(name).upper() for name in spec.channelnames]
    except UnicodeDecodeError as error:
        raise InputError(f"{path} is damaged: the names of its channels are no text; copy or export it again.") from error
    first = names.index("R") if names[:3] != ["R", "G", "B"] and _has_rgb(names) else 0
    channels = 3 if spec.nchannels >= 3 else 1
    return Header(spec.width, spec.height, first, channels, dtype, bool(spec.tile_width))


def _has_rgb(names: list[str]) -> bool:
    return "R" in names and names[names.index("R") :][:3] == ["R", "G", "B"]


def _reason(geterror: Callable[[], str]) -> str:
    """OpenImageIO's own words; those of damaged files may quote bytes that are no text."""
    try:
        return geterror()
    except UnicodeDecodeError:
        return "its header is damaged"


def _first_line(reason: str) -> str:
    lines = reason.strip().splitlines()
    return lines[0].rstrip(". ") if lines else "no reason given"
