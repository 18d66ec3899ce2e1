"""What a capture's metadata says, in types and units: the raw mosaic, the microlenses, the camera and its settings.

The two generations of cameras write the same facts in different places; both are read here. What is missing is taken from
a table of the two cameras and listed in `Capture.assumed`; what is there but cannot be is an InputError.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from typing import TypeVar

from lfcore.decode.unpack import Packing
from lfcore.errors import InputError
from lfcore.formats.lytro.container import Container, Section
from lfcore.formats.lytro.fields import Fields

# Larger mosaics than any camera's; what is asked for memory later is bounded by this.
MAX_SIDE = 20_000

# One, as far as is known.
_MAX_FRAMES = 16

Quad = tuple[float, float, float, float]
Matrix3 = tuple[tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]]

_COLOURS = ("r", "gr", "gb", "b")
_TILE = "r,gr:gb,b"  # the only mosaic of these cameras: the colours of two rows of two pixels
_NEUTRAL: Matrix3 = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


class Generation(Enum):
    """The two cameras."""

    F01 = "Lytro (first generation)"
    ILLUM = "Lytro Illum"


@dataclass(frozen=True)
class _Defaults:
    width: int
    height: int
    packing: Packing
    upper_left: str
    black: float
    lens_pitch: float


_DEFAULTS = {
    Generation.F01: _Defaults(3280, 3280, Packing(12, "big"), "b", 168, 1.4e-5),
    Generation.ILLUM: _Defaults(7728, 5368, Packing(10, "little"), "gr", 64, 2.0e-5),
}
_PIXEL_PITCH = 1.4e-6


@dataclass(frozen=True)
class RawImage:
    """How the mosaic is stored. `black` and `white` of the pixels [0, 0], [0, 1], [1, 0], [1, 1] of the pattern."""

    width: int
    height: int
    packing: Packing
    cfa: str  # colours of those four pixels, such as "GRBG"
    black: Quad
    white: Quad

    @property
    def length(self) -> int:
        """Bytes of the packed mosaic."""
        return self.packing.length(self.width, self.height)


@dataclass(frozen=True)
class LensletGeometry:
    """The microlens array as the camera describes it; lengths in metres."""

    lens_pitch: float
    pixel_pitch: float
    rotation: float  # radians; positive is clockwise, seen from the front
    scale: tuple[float, float]  # x, y
    offset: tuple[float, float, float]  # x, y, z; from the middle microlens's centre to the sensor's

    @property
    def spacing(self) -> tuple[float, float]:
        """Distance between the centres of neighbouring microlenses in pixels, along x and (before hexagonal packing) y."""
        pixels = self.lens_pitch / self.pixel_pitch
        return pixels * self.scale[0], pixels * self.scale[1]


@dataclass(frozen=True)
class CaptureFacts:
    """The camera and its settings; None where the file does not say. Lengths in metres, times in seconds, bias in EV."""

    generation: Generation
    make: str | None
    model: str | None
    firmware: str | None
    serial: str | None
    sensor_serial: str | None
    taken: str | None  # date and time as the file writes them
    file_name: str | None  # the name that the camera gave the capture, without extension
    zoom_step: int | None
    focus_step: int | None
    focal_length: float | None
    f_number: float | None
    infinity_lambda: float | None
    exit_pupil: float | None
    exposure_time: float | None
    iso: float | None
    orientation: int  # EXIF, 1 to 8
    white_balance: Quad  # gains of r, gr, gb, b; not applied to the raw
    colour_matrix: Matrix3  # camera RGB to linear sRGB, after white balance; rows sum to 1
    modulation_bias: float
    dark_frame: bool
    white_frame: bool


@dataclass(frozen=True)
class Capture:
    """One frame: its facts, and the sections that it refers to where the file has them."""

    raw: RawImage
    lenslets: LensletGeometry
    facts: CaptureFacts
    image: Section | None = None  # the packed mosaic, of the length that `raw` says
    modulation: Section | None = None  # a white image in the file itself
    modulation_metadata: Section | None = None
    geometry_reference: str | None = None  # name of the geometry correction that belongs to the white image
    assumed: tuple[str, ...] = field(default=())  # what was missing and taken from the table, in words


def read_capture(container: Container) -> Capture | None:
    """The first frame that has metadata, preferably with its mosaic; None where no frame has. Raises InputError."""
    first: Capture | None = None
    for frame in frames(container):
        capture = _frame_capture(container, frame)
        if capture is not None and capture.image is not None:
            return capture
        first = first or capture
    return first


def frames(container: Container) -> list[Fields]:
    """The objects that describe the frames, of either generation's table of contents. Raises InputError."""
    table = container.table
    entries = [*table.child("picture").children("frameArray"), *table.children("frames")]
    if len(entries) > _MAX_FRAMES:
        raise InputError(f"{container.path} claims {len(entries)} frames, but a camera writes one; the file is damaged.")
    return [entry.child("frame") for entry in entries]


def frame_in_text(table: Fields) -> Capture:
    """The capture that a white image's text file (MOD_0000.TXT, its JSON in `table`) describes. Raises InputError."""
    for entry in table.child("master", "picture").children("frameArray"):
        frame, tags = entry.child("frame"), entry.child("parameters", "vendorContent", "com.lytro.tags")
        return capture_of(frame.child("metadata"), frame.child("privateMetadata"), tags)
    raise InputError(f"{table.source} describes no frame; expected the text file of a white image, such as MOD_0000.TXT.")


def _frame_capture(container: Container, frame: Fields) -> Capture | None:
    public = _document(container, frame, "metadata")
    if not public:
        return None
    capture = capture_of(public, _document(container, frame, "privateMetadata"), Fields({}, public.source))
    image = container.find(frame.text("imageRef"))
    if image is not None and image.length != capture.raw.length:
        raw = capture.raw
        raise InputError(
            f"{container.describe(image)} holds {image.length:,} bytes, but a mosaic of {raw.width} x {raw.height} px in "
            f"{raw.packing.bits} bits takes {raw.length:,}; the file is damaged."
        )
    return Capture(
        raw=capture.raw,
        lenslets=capture.lenslets,
        facts=capture.facts,
        image=image,
        modulation=container.find(frame.text("modulationDataRef")),
        modulation_metadata=container.find(frame.text("modulationDataMetadataRef")),
        geometry_reference=frame.text("geometryCorrectionRef"),
        assumed=capture.assumed,
    )


def _document(container: Container, frame: Fields, key: str) -> Fields:
    """Metadata that stands in the frame itself, or in the section that it refers to; empty where there is neither."""
    if key in frame:
        return frame.child(key)
    section = container.find(frame.text(f"{key}Ref"))
    return Fields({}, str(container.path)) if section is None else container.json(section)


def capture_of(public: Fields, private: Fields, tags: Fields) -> Capture:
    """Everything that the public and the private metadata of a frame, and its tags, say. Raises InputError."""
    reader = _Reader(public)
    generation = _generation(public)
    image, devices = public.child("image"), public.child("devices")
    raw = reader.raw(image, devices.child("sensor"), _DEFAULTS[generation])
    return Capture(
        raw=raw,
        lenslets=reader.lenslets(devices.child("mla"), devices.child("sensor"), _DEFAULTS[generation]),
        facts=_facts(generation, public, private, tags),
        assumed=tuple(reader.assumed),
    )


def _generation(public: Fields) -> Generation:
    model = public.child("camera").text("model")
    known = {"f01": Generation.F01, "b01": Generation.ILLUM, "illum": Generation.ILLUM, "lytro illum": Generation.ILLUM}
    if model is not None and model.strip().lower() in known:
        return known[model.strip().lower()]
    width = public.child("image").number("width")
    for generation, defaults in _DEFAULTS.items():
        if width == defaults.width:
            return generation
    named = "names no camera model" if model is None else f"names the camera model {model[:40]!a}"
    raise InputError(f"{public.source} {named}; expected a first-generation Lytro (F01) or a Lytro Illum.")


_Value = TypeVar("_Value")


class _Reader:
    """Reads values, falls back to those of the camera's table, and notes what it had to assume."""

    def __init__(self, public: Fields) -> None:
        self.source = public.source
        self.assumed: list[str] = []

    def known(self, value: _Value | None, name: str, fallback: _Value) -> _Value:
        """The value, or the fallback with a note."""
        if value is not None:
            return value
        self.assumed.append(f"{name} {fallback}")
        return fallback

    def raw(self, image: Fields, sensor: Fields, defaults: _Defaults) -> RawImage:
        """The mosaic. The first generation keeps it in image.rawDetails, the Illum in image."""
        details = image.child("rawDetails") or image
        width = self.known(image.whole("width", 2, MAX_SIDE), "width", defaults.width)
        height = self.known(image.whole("height", 2, MAX_SIDE), "height", defaults.height)
        if width % 2 or height % 2:
            raise image.wrong("height" if height % 2 else "width", "an even number of pixels")
        packing = self.packing(details.child("pixelPacking"), sensor, defaults)
        order = self.order(details.child("mosaic") or sensor.child("mosaic"), defaults)
        levels = details.child("pixelFormat")
        if levels.whole("rightShift", 0, 16):
            raise levels.wrong("rightShift", "0")
        top = float(2**packing.bits - 1)
        black = self.levels(levels.child("black"), "black level", order, defaults.black, top)
        white = self.levels(levels.child("white"), "white level", order, top, top)
        if any(high <= low for low, high in zip(black, white, strict=True)):
            raise levels.wrong("white", "levels above those of black")
        raw = RawImage(width, height, packing, "".join(colour[0] for colour in order).upper(), black, white)
        if width % packing.group[0]:
            raise image.wrong("width", f"a multiple of {packing.group[0]} px, as {packing.bits} bits are packed")
        return raw

    def packing(self, stored: Fields, sensor: Fields, defaults: _Defaults) -> Packing:
        """Bits and byte order."""
        bits = stored.whole("bitsPerPixel", 1, 64)
        bits = self.known(bits or sensor.whole("bitsPerPixel", 1, 64), "bits per pixel", defaults.packing.bits)
        order = self.known(stored.text("endianness"), "byte order", defaults.packing.endianness)
        try:
            return Packing(bits, order[:20])
        except InputError as error:
            raise InputError(f"{self.source}: {error}") from error

    def order(self, mosaic: Fields, defaults: _Defaults) -> tuple[str, ...]:
        """Which of r, gr, gb, b stand at [0, 0], [0, 1], [1, 0], [1, 1]."""
        tile = self.known(mosaic.text("tile"), "mosaic", _TILE)
        if tile.replace(" ", "").lower() != _TILE:
            raise mosaic.wrong("tile", f"the Bayer mosaic {_TILE}")
        corner = self.known(mosaic.text("upperLeftPixel"), "first pixel of the mosaic", defaults.upper_left).lower()
        if corner not in _COLOURS:
            raise mosaic.wrong("upperLeftPixel", "r, gr, gb or b")
        y, x = divmod(_COLOURS.index(corner), 2)
        return tuple(_COLOURS[2 * ((y + row) % 2) + (x + column) % 2] for row in (0, 1) for column in (0, 1))

    def levels(self, stored: Fields, name: str, order: tuple[str, ...], fallback: float, top: float) -> Quad:
        """Black or white levels in the order of the pattern."""
        values = {colour: stored.number(colour, 0, top) for colour in _COLOURS}
        if None in values.values():
            self.assumed.append(f"{name} {fallback:g}")
        first, second, third, fourth = (fallback if (value := values[colour]) is None else value for colour in order)
        return first, second, third, fourth

    def lenslets(self, mla: Fields, sensor: Fields, defaults: _Defaults) -> LensletGeometry:
        """The microlens array."""
        tiling = mla.text("tiling")
        if tiling not in (None, "hexUniformRowMajor"):
            raise mla.wrong("tiling", "hexUniformRowMajor")
        scale, offset = mla.child("scaleFactor"), mla.child("sensorOffset")
        pitch = self.known(mla.number("lensPitch", 5e-6, 1e-4), "microlens pitch", defaults.lens_pitch)
        pixel = self.known(sensor.number("pixelPitch", 5e-7, 1e-5), "pixel pitch", _PIXEL_PITCH)
        if pitch < 4 * pixel:
            raise mla.wrong("lensPitch", "at least four pixels")
        return LensletGeometry(
            lens_pitch=pitch,
            pixel_pitch=pixel,
            rotation=self.known(mla.number("rotation", -0.2, 0.2), "microlens rotation", 0.0),
            scale=(scale.number("x", 0.9, 1.1) or 1.0, scale.number("y", 0.9, 1.1) or 1.0),
            offset=(_offset(offset, "x"), _offset(offset, "y"), _offset(offset, "z")),
        )


def _offset(offset: Fields, axis: str) -> float:
    return offset.number(axis, -0.01, 0.01) or 0.0


def _facts(generation: Generation, public: Fields, private: Fields, tags: Fields) -> CaptureFacts:
    camera, devices, image = public.child("camera"), public.child("devices"), public.child("image")
    lens, sensor, secret = devices.child("lens"), devices.child("sensor"), private.child("devices", "sensor")
    colour = image.child("color")
    exposure = devices.child("shutter").number("pixelExposureDuration", 0, 1e6)
    orientation = image.whole("orientation", 1, 8)
    return CaptureFacts(
        generation=generation,
        make=camera.text("make"),
        model=camera.text("model"),
        firmware=camera.text("firmware"),
        serial=private.child("camera").text("serialNumber") or camera.text("serialNumber"),
        sensor_serial=secret.text("serialNumber") or secret.text("sensorSerial"),
        taken=devices.child("clock").text("zuluTime"),
        file_name=public.child("picture").text("dcfFile"),
        zoom_step=lens.whole("zoomStep", -100_000, 100_000),
        focus_step=lens.whole("focusStep", -100_000, 100_000),
        focal_length=lens.number("focalLength", 0, 10),
        f_number=lens.number("fNumber", 0, 100),
        infinity_lambda=lens.number("infinityLambda"),
        exit_pupil=lens.child("exitPupilOffset").number("z"),
        exposure_time=exposure or devices.child("shutter").number("frameExposureDuration", 0, 1e6),
        iso=_first(image.number("iso", 0, 1e7), sensor.number("iso", 0, 1e7)),
        orientation=1 if orientation is None else orientation,
        white_balance=_white_balance(colour.child("whiteBalanceGain")),
        colour_matrix=_colour_matrix(colour),
        modulation_bias=image.number("modulationExposureBias", -8, 8) or 0.0,
        dark_frame=tags.flag("darkFrame") or False,
        white_frame=tags.flag("modulationFrame") or False,
    )


def _first(*values: _Value | None) -> _Value | None:
    return next((value for value in values if value is not None), None)


def _white_balance(gains: Fields) -> Quad:
    red, green_r, green_b, blue = (gains.number(colour, 0.05, 50) or 1.0 for colour in _COLOURS)
    return red, green_r, green_b, blue


def _colour_matrix(colour: Fields) -> Matrix3:
    values = colour.numbers("ccm", 9, -100, 100) or colour.numbers("ccmRgbToSrgbArray", 9, -100, 100)
    if values is None:
        return _NEUTRAL
    rows = [(values[row], values[row + 1], values[row + 2]) for row in (0, 3, 6)]
    return rows[0], rows[1], rows[2]
