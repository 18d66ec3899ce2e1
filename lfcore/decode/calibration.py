"""Which white image a capture is divided by: found by four rules, the choice told in words.

1. A white image inside the capture. 2. The one whose geometry correction the capture names. 3. Of the images of the same
camera the one nearest in zoom, then in focus. 4. None: shading and grid are then estimated from the capture.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

from lfcore.decode.calibration_files import CalibrationSet, Found, StoredBytes, find_sets, sets_beside
from lfcore.decode.remembered import remembered
from lfcore.decode.unpack import Mosaic, unpack
from lfcore.errors import InputError
from lfcore.formats.lytro.container import Container, reference_to
from lfcore.formats.lytro.fields import Fields, check_json_size, parse_object
from lfcore.formats.lytro.metadata import Capture, CaptureFacts, LensletGeometry, RawImage, capture_of, frame_in_text

_MANIFEST = "CAL_FILE_MANIFEST.JSON"
_TEXT = re.compile(r"(MOD_\d+)\.TXT")

# Geometry corrections are hashed only where no manifest lists their hashes.
_MAX_HASHED = 128 * 2**20

# A camera has about sixty white images, with 6 KB of text each.
_MAX_IMAGES = 1000
_MAX_TEXT = 16 * 2**20

# An image whose middle rows are darker than this share of white, above black, is a black frame.
_BLACK_SHARE = 0.02
_SAMPLED_ROWS = 32


class Rule(Enum):
    """The four rules, in the order in which they are tried."""

    EMBEDDED = "the white image inside the capture"
    GEOMETRY = "the white image whose geometry correction the capture names"
    NEAREST = "the nearest white image of the same camera"
    NONE = "no white image"


@dataclass(frozen=True)
class WhiteImage:
    """A white image: how its mosaic is stored and, where its metadata says so, the grid, zoom and focus it was taken at."""

    label: str
    raw: RawImage
    data: StoredBytes
    lenslets: LensletGeometry | None = None
    zoom_step: int | None = None
    focus_step: int | None = None

    def mosaic(self) -> Mosaic:
        """The mosaic (H, W), uint16, black level not taken off. Raises InputError where it is damaged."""
        return unpack(self.data.read(), self.raw.packing, self.raw.width, self.raw.height)

    def brightness(self) -> float:
        """Mean of the middle rows above black, as a share of white. Raises InputError where they cannot be read."""
        rows = min(_SAMPLED_ROWS, self.raw.height)
        row_bytes = self.raw.length // self.raw.height
        data = self.data.part((self.raw.height - rows) // 2 * row_bytes, rows * row_bytes)
        black, white = sum(self.raw.black) / 4, sum(self.raw.white) / 4
        return float((unpack(data, self.raw.packing, self.raw.width, rows).mean() - black) / (white - black))


@dataclass(frozen=True)
class Choice:
    """The white image to use (None by rule 4), why, and what was passed over on the way, a sentence each."""

    rule: Rule
    sentence: str
    white: WhiteImage | None = None
    zoom_distance: int | None = None  # steps; None where the capture or the white image does not say
    focus_distance: int | None = None
    notes: tuple[str, ...] = ()


def choose_white_image(container: Container, capture: Capture, calibration: str | os.PathLike[str] | None = None) -> Choice:
    """Choose by the four rules, from `calibration` or else from the capture's folder and the remembered places.

    A capture opens without calibration: what is missing or damaged is noted in the choice, never raised, except for a
    `calibration` that was named and cannot be used at all (InputError).
    """
    named = None if calibration is None else find_sets(Path(calibration))
    chooser = _Chooser(capture)
    return chooser.embedded(container) or chooser.among(named or _at_hand(container.path)) or chooser.none()


def _at_hand(path: Path) -> Found:
    """What lies in the capture's own folder and in the remembered places."""
    beside = sets_beside(path)
    sets, problems = list(beside.sets), list(beside.problems)
    try:
        places = remembered()
    except InputError as error:
        places = []
        problems.append(str(error))
    for place in places:
        try:
            found = find_sets(place)
        except InputError as error:
            problems.append(str(error))
        else:
            sets += found.sets
            problems += found.problems
    return Found(tuple(sets), tuple(problems))


class _Chooser:
    """Applies the rules to one capture, and gathers what is passed over."""

    def __init__(self, capture: Capture) -> None:
        self._capture = capture
        self._notes: list[str] = []
        self._seen = 0  # white images that were looked at

    def embedded(self, container: Container) -> Choice | None:
        """Rule 1."""
        capture = self._capture
        if capture.modulation is None:
            return None
        try:
            white = _embedded_image(container, capture)
            self._check_size(white)
        except InputError as error:
            self._notes.append(f"The white image inside the capture cannot be used: {error}")
            return None
        return self._chosen(Rule.EMBEDDED, white, "The white image inside the capture itself")

    def among(self, found: Found) -> Choice | None:
        """Rule 2 over all sets, then rule 3 over all sets."""
        self._notes += found.problems
        for own in found.sets:
            choice = self._by_geometry(own)
            if choice is not None:
                return choice
        return self._nearest([white for own in found.sets for white in self._same_camera(own)])

    def none(self) -> Choice:
        """Rule 4."""
        serial = self._capture.facts.serial
        camera = f"the camera with serial number {serial[:40]}" if serial else "this camera, whose serial number the file lacks"
        if self._seen:
            reason = f"none of {self._seen} white images found fits {camera}"
        else:
            reason = f"no calibration of {camera} was found"
        return Choice(
            Rule.NONE, f"No white image: {reason}; shading and grid are estimated from the capture.", notes=tuple(self._notes)
        )

    def _by_geometry(self, own: CalibrationSet) -> Choice | None:
        wanted = self._capture.geometry_reference
        name = None if wanted is None else self._named_by(own, wanted)
        if name is None:
            return None
        try:
            white, _ = _white_image(own, name)
            self._check_size(white)
        except InputError as error:
            self._notes.append(str(error))
            return None
        return self._chosen(Rule.GEOMETRY, white, f"{white.label}, whose geometry correction the capture names")

    def _named_by(self, own: CalibrationSet, wanted: str) -> str | None:
        """MOD_nnnn whose geometry correction has that hash, by the manifest, or by hashing where there is none."""
        try:
            hashes = _manifest(own) if _MANIFEST in own.files else _geometry_hashes(own)
        except InputError as error:
            self._notes.append(str(error))
            return None
        name = hashes.get(_digest(wanted))
        return name if name is not None and f"{name}.RAW" in own.files else None

    def _same_camera(self, own: CalibrationSet) -> Iterator[WhiteImage]:
        """The white images of a set that are of this camera and of the capture's size, black frames among them."""
        strangers: dict[str, int] = {}
        names = sorted(match[1] for file in own.files if (match := _TEXT.fullmatch(file)))
        if len(names) > _MAX_IMAGES or sum(own.files[f"{name}.TXT"].size for name in names) > _MAX_TEXT:
            self._notes.append(f"{own.source} holds {len(names):,} white images, more than any camera; it is left out.")
            return
        for name in names:
            self._seen += 1
            try:
                white, facts = _white_image(own, name)
                if facts.dark_frame:
                    continue
                if not _is_same_camera(facts, self._capture.facts):
                    serial = (facts.serial or facts.sensor_serial or "unknown")[:40]
                    strangers[serial] = strangers.get(serial, 0) + 1
                    continue
                self._check_size(white)
            except InputError as error:
                self._notes.append(str(error))
            else:
                yield white
        for serial, count in strangers.items():
            images = "a white image is" if count == 1 else f"{count} white images are"
            self._notes.append(f"{own.source}: {images} of another camera (serial number {serial}).")

    def _nearest(self, images: list[WhiteImage]) -> Choice | None:
        """Rule 3. Of two exposures at the same zoom and focus the brighter counts; black frames are passed over."""
        for place in sorted({self._distance(white) for white in images}):
            exposures = [white for white in images if self._distance(white) == place]
            best = max((pair for white in exposures if (pair := self._measured(white))), key=lambda pair: pair[0], default=None)
            if best is not None:
                text = f"{best[1].label}, the nearest of {len(images)} of this camera"
                return self._chosen(Rule.NEAREST, best[1], text)
        return None

    def _measured(self, white: WhiteImage) -> tuple[float, WhiteImage] | None:
        try:
            brightness = white.brightness()
        except InputError as error:
            self._notes.append(str(error))
            return None
        if brightness < _BLACK_SHARE:
            self._notes.append(f"{white.label} is a black frame.")
            return None
        return brightness, white

    def _distance(self, white: WhiteImage) -> tuple[int, int]:
        facts = self._capture.facts
        return _steps(facts.zoom_step, white.zoom_step) or 0, _steps(facts.focus_step, white.focus_step) or 0

    def _check_size(self, white: WhiteImage) -> None:
        own, raw = self._capture.raw, white.raw
        if (raw.width, raw.height, raw.cfa) != (own.width, own.height, own.cfa):
            raise InputError(
                f"{white.label} is {raw.width} x {raw.height} px, {raw.cfa}, but the capture {own.width} x {own.height} px, "
                f"{own.cfa}; it is the white image of another camera."
            )
        if white.data.size != raw.length:
            raise InputError(
                f"{white.label} has {white.data.size:,} bytes, but {raw.width} x {raw.height} px take {raw.length:,}; it is "
                "cut off or of another camera."
            )

    def _chosen(self, rule: Rule, white: WhiteImage, text: str) -> Choice:
        facts = self._capture.facts
        zoom, focus = _steps(facts.zoom_step, white.zoom_step), _steps(facts.focus_step, white.focus_step)
        sentence = f"{text}: {_words(zoom)} in zoom, {_words(focus)} in focus."
        return Choice(rule, sentence, white, zoom, focus, tuple(self._notes))


def _embedded_image(container: Container, capture: Capture) -> WhiteImage:
    section = capture.modulation
    assert section is not None
    label = container.describe(section)
    data = StoredBytes(label, container.path, section.offset, section.length, section.name)
    if capture.modulation_metadata is None:
        return WhiteImage(label, capture.raw, data)
    stored = container.json(capture.modulation_metadata)
    own = frame_in_text(stored) if "master" in stored else capture_of(stored, Fields({}, stored.source), Fields({}, ""))
    return WhiteImage(label, own.raw, data, own.lenslets, own.facts.zoom_step, own.facts.focus_step)


def _white_image(own: CalibrationSet, name: str) -> tuple[WhiteImage, CaptureFacts]:
    """MOD_nnnn of a set. Raises InputError where its text or mosaic is missing or damaged."""
    missing = next((file for file in (f"{name}.RAW", f"{name}.TXT") if file not in own.files), None)
    if missing is not None:
        raise InputError(f"{own.source}: {missing} is missing, so the white image {name} cannot be used.")
    data = own.files[f"{name}.RAW"]
    described = frame_in_text(_json(own.files[f"{name}.TXT"]))
    facts = described.facts
    return WhiteImage(data.label, described.raw, data, described.lenslets, facts.zoom_step, facts.focus_step), facts


def _manifest(own: CalibrationSet) -> dict[str, str]:
    """Digest to MOD_nnnn, of the geometry corrections that the manifest lists."""
    listed = {}
    for entry in _json(own.files[_MANIFEST]).children("calibrationFiles"):
        name = re.fullmatch(r"(?:.*[/\\])?(MOD_\d+)\.GCT", (entry.text("name") or "").upper())
        digest = entry.text("hash")
        if name is not None and digest is not None:
            listed[_digest(digest)] = name[1]
    return listed


def _geometry_hashes(own: CalibrationSet) -> dict[str, str]:
    corrections = [(file, stored) for file, stored in own.files.items() if file.endswith(".GCT")]
    if sum(stored.size for _, stored in corrections) > _MAX_HASHED:
        return {}
    return {_digest(reference_to(stored.read())): Path(file).stem for file, stored in corrections}


def _json(stored: StoredBytes) -> Fields:
    check_json_size(stored.size, stored.label)
    return Fields(parse_object(stored.read(), stored.label), stored.label)


def _digest(name: str) -> str:
    return name.lower().removeprefix("sha1-")


def _is_same_camera(one: CaptureFacts, other: CaptureFacts) -> bool:
    if one.serial and other.serial:
        return one.serial.strip().upper() == other.serial.strip().upper()
    if one.sensor_serial and other.sensor_serial:
        return _sensor(one.sensor_serial) == _sensor(other.sensor_serial)
    return False


def _sensor(serial: str) -> str:
    return serial.strip().upper().removeprefix("0X")


def _steps(one: int | None, other: int | None) -> int | None:
    return None if one is None or other is None else abs(one - other)


def _words(steps: int | None) -> str:
    if steps is None:
        return "at an unknown distance"
    return f"{steps} {'step' if steps == 1 else 'steps'} away"
