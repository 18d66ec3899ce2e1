"""What there is to say about a Lytro file: as text facts in the order in which they are best read, and as JSON."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any

from lfcore.decode.calibration import Choice
from lfcore.formats.lytro.container import TABLE, Container
from lfcore.formats.lytro.contents import Contents, Kind, StoredMap, StoredPicture, raw_file, roles
from lfcore.formats.lytro.metadata import Capture, CaptureFacts

# Sections that `as_facts` lists one by one; those beyond are summed up.
_LISTED = 12


def as_facts(container: Container, contents: Contents, choice: Choice | None) -> dict[str, str]:
    """Label to text. `choice` is the white image that would be used, None for files without a mosaic."""
    facts = {"Source": str(container.path), "Kind": contents.kind.value}
    if contents.capture is not None:
        facts.update(_capture_facts(contents.capture))
    if contents.pictures:
        facts["Pictures"] = _pictures(contents)
    if contents.maps:
        facts["Maps"] = ", ".join(_map(stored) for stored in contents.maps)
    if contents.files:
        facts["Files"] = f"{len(contents.files)}: {', '.join(file.name for file in contents.files[:6])}" + (
            ", .." if len(contents.files) > 6 else ""
        )
    if choice is not None:
        facts["White image"] = choice.sentence
        facts.update(_numbered("Calibration", choice.notes))
    if contents.kind not in (Kind.CAPTURE, Kind.CALIBRATION):
        facts["Raw capture"] = f"not in this file; it would be {raw_file(container, contents.capture)}"
    facts.update(_numbered("Section", _sections(container)))
    rest = container.sections[_LISTED:]
    if rest:
        facts["More sections"] = f"{len(rest)}, of {sum(section.length for section in rest):,} bytes"
    return facts


def as_json(container: Container, contents: Contents, choice: Choice | None) -> dict[str, Any]:
    """The same in JSON's types, lengths in metres, times in seconds, white images by their labels."""
    found = roles(container)
    return {
        "source": str(container.path),
        "kind": contents.kind.name.lower(),
        "capture": None if contents.capture is None else _capture_json(contents.capture),
        "pictures": [_stored_json(picture) for picture in contents.pictures],
        "maps": [_stored_json(stored) for stored in contents.maps],
        "files": [{"name": file.name, "section": file.section.name, "bytes": file.section.length} for file in contents.files],
        "sections": [
            {
                "kind": section.kind.decode(),
                "name": section.name,
                "bytes": section.length,
                "referred_to_by": found.get(section.name),
            }
            for section in container.sections
        ],
        "white_image": None if choice is None else _choice_json(choice),
    }


def _capture_facts(capture: Capture) -> dict[str, str]:
    facts, raw, lenslets = capture.facts, capture.raw, capture.lenslets
    camera = facts.generation.value
    if facts.firmware:
        camera += f", firmware {facts.firmware[:40]}"
    across, down = lenslets.spacing
    text = {
        "Camera": camera,
        "Serial number": facts.serial or "not in the file",
        "Taken": facts.taken,
        "Lens": _joined(
            _unit("focal length", facts.focal_length, 1000, "mm"),
            None if facts.f_number is None else f"f/{facts.f_number:.1f}",
            None if facts.zoom_step is None else f"zoom step {facts.zoom_step}",
            None if facts.focus_step is None else f"focus step {facts.focus_step}",
        ),
        "Exposure": _joined(_exposure(facts), None if facts.iso is None else f"ISO {facts.iso:.0f}"),
        "Mosaic": (
            f"{raw.width} x {raw.height} px, {raw.packing.bits} bit {raw.cfa}, black {_level(raw.black)}, "
            f"white {_level(raw.white)}{'' if capture.image else ', not in this file'}"
        ),
        "Microlenses": f"{across:.3f} x {down:.3f} px apart, turned by {math.degrees(lenslets.rotation):.3f} degrees",
        "Orientation": f"{facts.orientation} (EXIF)",
    }
    if capture.assumed:
        text["Assumed"] = ", ".join(capture.assumed)
    return {label: value for label, value in text.items() if value}


def _capture_json(capture: Capture) -> dict[str, Any]:
    facts = asdict(capture.facts)
    facts["generation"] = capture.facts.generation.name.lower()
    return {
        "facts": facts,
        "raw": {**asdict(capture.raw), "packing": asdict(capture.raw.packing), "present": capture.image is not None},
        "microlenses": asdict(capture.lenslets),
        "geometry_reference": capture.geometry_reference,
        "assumed": list(capture.assumed),
    }


def _choice_json(choice: Choice) -> dict[str, Any]:
    return {
        "rule": choice.rule.name.lower(),
        "sentence": choice.sentence,
        "image": None if choice.white is None else choice.white.label,
        "zoom_distance": choice.zoom_distance,
        "focus_distance": choice.focus_distance,
        "notes": list(choice.notes),
    }


def _stored_json(stored: StoredPicture | StoredMap) -> dict[str, Any]:
    return {**asdict(stored), "section": stored.section.name}


def _exposure(facts: CaptureFacts) -> str | None:
    time = facts.exposure_time
    if not time:
        return None
    return f"1/{1 / time:.0f} s" if time < 0.4 else f"{time:.1f} s"


def _unit(name: str, value: float | None, scale: float, unit: str) -> str | None:
    return None if value is None else f"{name} {value * scale:.1f} {unit}"


def _joined(*parts: str | None) -> str:
    return ", ".join(part for part in parts if part)


def _level(levels: tuple[float, ...]) -> str:
    return f"{levels[0]:g}" if len(set(levels)) == 1 else "/".join(f"{level:g}" for level in levels)


def _pictures(contents: Contents) -> str:
    counts: dict[str, int] = {}
    for picture in contents.pictures:
        size = f" of {picture.width} x {picture.height} px" if picture.width and picture.height else ""
        counts[f"{picture.label}{size}"] = counts.get(f"{picture.label}{size}", 0) + 1
    text = ", ".join(f"{count} in a {what}" if count > 1 else what for what, count in counts.items())
    stack = contents.stack
    if stack:
        text += f", focused at lambda {stack[0].focus:.1f} to {stack[-1].focus:.1f}"
    return text


def _map(stored: StoredMap) -> str:
    span = "" if stored.low is None or stored.high is None else f" from lambda {stored.low:g} to {stored.high:g}"
    return f"{stored.label} of {stored.width} x {stored.height}{span}"


def _sections(container: Container) -> list[str]:
    found = roles(container)
    lines = []
    for section in container.sections[:_LISTED]:
        role = "table of contents" if section.kind == TABLE else found.get(section.name, "nothing refers to it")
        lines.append(f"{section.length:,} bytes, {section.name[:13]}.., {role}")
    return lines


def _numbered(label: str, lines: list[str] | tuple[str, ...]) -> dict[str, str]:
    return {f"{label} {number}": line for number, line in enumerate(lines, start=1)}
