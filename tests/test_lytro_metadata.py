"""Metadata of both cameras in types and units; what is missing is assumed and told, what cannot be is refused and named."""

from __future__ import annotations

import copy
import json
from pathlib import Path
from typing import Any

import pytest

from lfcore.errors import InputError
from lfcore.formats.lytro.container import open_container, reference_to, write_container
from lfcore.formats.lytro.fields import Fields, parse_object
from lfcore.formats.lytro.metadata import Capture, Generation, capture_of, frame_in_text, read_capture
from tests.lytro_files import SERIAL, SHARED, f01_public, illum_public, private, write_f01, write_illum

real_files = pytest.mark.skipif(not SHARED.is_dir(), reason="needs the real Lytro files of ../shared/data/lfp")


def read(public: dict[str, Any], secret: dict[str, Any] | None = None) -> Capture:
    return capture_of(Fields(public, "a.lfp"), Fields(secret or {}, "a.lfp"), Fields({}, "a.lfp"))


def changed(public: dict[str, Any], place: str, value: Any) -> dict[str, Any]:
    """A copy with the value at "image.width" and such replaced, or taken out where it is ...."""
    result = copy.deepcopy(public)
    *keys, last = place.split(".")
    target = result
    for key in keys:
        target = target[key]
    if value is ...:
        del target[last]
    else:
        target[last] = value
    return result


def test_illum(tmp_path: Path) -> None:
    capture = read_capture(open_container(write_illum(tmp_path / "a.LFR")))
    assert capture is not None
    raw, lenslets, facts = capture.raw, capture.lenslets, capture.facts
    assert (raw.width, raw.height, raw.packing.bits, raw.packing.endianness, raw.cfa) == (64, 48, 10, "little", "GRBG")
    # In the order of the pattern: gr r / b gb.
    assert raw.black == (62, 61, 64, 63)
    assert raw.white == (1021, 1020, 1023, 1022)
    assert capture.image is not None
    assert capture.image.length == raw.length == 64 * 48 * 10 // 8
    assert lenslets.spacing == pytest.approx((14.2857, 14.29), abs=0.001)
    assert lenslets.rotation == -0.0005
    assert lenslets.offset == (8.4e-06, -9.5e-07, 3.7e-05)
    assert facts.generation is Generation.ILLUM
    assert (facts.serial, facts.sensor_serial, facts.model) == (SERIAL, "0x0C220593", "ILLUM")
    assert (facts.zoom_step, facts.focus_step, facts.orientation, facts.iso) == (100, 500, 6, 80)
    assert (facts.exposure_time, facts.f_number, facts.focal_length) == (0.01, 2.2, 0.024)
    assert facts.white_balance == (1.5, 1.0, 1.0, 1.25)
    assert facts.colour_matrix == ((2.0, -0.75, -0.25), (-0.5, 1.75, -0.25), (-0.25, -0.75, 2.0))
    assert facts.modulation_bias == 0.25
    assert capture.assumed == ()


def test_first_generation(tmp_path: Path) -> None:
    capture = read_capture(open_container(write_f01(tmp_path / "a.lfp")))
    assert capture is not None
    assert (capture.raw.packing.bits, capture.raw.packing.endianness, capture.raw.cfa) == (12, "big", "BGGR")
    assert capture.raw.black == (168, 168, 168, 168)
    assert capture.lenslets.spacing[0] == pytest.approx(10)
    assert capture.facts.generation is Generation.F01
    assert capture.facts.colour_matrix[0] == (3.0, -1.75, -0.25)
    assert (capture.facts.iso, capture.facts.exposure_time) == (207, 0.0165)


def test_an_embedded_white_image_is_found(tmp_path: Path) -> None:
    path = write_illum(tmp_path / "a.LFR", modulationDataRef=b"white", geometryCorrectionRef="sha1-" + "ab" * 20)
    capture = read_capture(open_container(path))
    assert capture is not None
    assert capture.modulation is not None
    assert open_container(path).data(capture.modulation) == b"white"
    assert capture.geometry_reference == "sha1-" + "ab" * 20


@real_files
def test_real_metadata() -> None:
    preview = read_capture(open_container(SHARED / "illum_preview.LFP"))
    assert preview is not None
    assert preview.image is None
    assert (preview.facts.serial, preview.facts.zoom_step, preview.facts.focus_step) == ("45142500380", 123, 814)
    assert preview.facts.exit_pupil == 10000
    assert preview.facts.file_name == "IMG_0480"
    f01 = read_capture(open_container(SHARED / "f01_metadata_only.lfp"))
    assert f01 is not None
    assert (f01.facts.serial, f01.lenslets.lens_pitch) == ("A202110453", 1.389861488342285e-05)
    for name, generation, cfa in (("illum", Generation.ILLUM, "GRBG"), ("f01", Generation.F01, "BGGR")):
        capture = read(*(json.loads((SHARED / f"{name}_{part}.json").read_text()) for part in ("metadata", "private_metadata")))
        assert capture.facts.generation is generation
        assert capture.raw.cfa == cfa
        assert capture.assumed == ()
        for row in capture.facts.colour_matrix:
            assert sum(row) == pytest.approx(1, abs=1e-5)


@real_files
def test_real_text_of_a_white_image() -> None:
    stored = parse_object((SHARED / "white_image.TXT").read_bytes(), "white_image.TXT")
    capture = frame_in_text(Fields(stored, "white_image.TXT"))
    assert (capture.facts.zoom_step, capture.facts.focus_step, capture.facts.serial) == (-1040, -300, "B5143909630")
    assert capture.facts.white_frame
    assert not capture.facts.dark_frame
    assert capture.raw.length == 51_854_880


@pytest.mark.parametrize(
    "place, told",
    [
        ("image.width", "width 7728"),
        ("image.pixelPacking", "byte order little"),
        ("image.pixelFormat", "black level 64"),
        ("image.pixelFormat.white", "white level 1023"),
        ("image.mosaic", "first pixel of the mosaic gr"),
        ("devices.mla", "microlens pitch 2e-05"),
        ("devices.sensor.pixelPitch", "pixel pitch 1.4e-06"),
    ],
)
def test_missing_values_are_those_of_the_camera_and_told(place: str, told: str) -> None:
    capture = read(changed(illum_public(), place, ...))
    assert told in capture.assumed
    assert capture.raw.packing.bits == 10


def test_an_unknown_model_of_a_known_size_is_that_camera() -> None:
    assert read(changed(illum_public(width=7728, height=5368), "camera", ...)).facts.generation is Generation.ILLUM
    assert read(changed(f01_public(width=3280, height=3280), "camera.model", "X")).facts.generation is Generation.F01
    with pytest.raises(InputError, match=r"^a\.lfp names the camera model 'Lumia'; expected"):
        read(changed(illum_public(), "camera.model", "Lumia"))


@pytest.mark.parametrize("model", ["B01", "ILLUM", "Illum", "Lytro Illum", "illum "])
def test_names_of_the_illum(model: str) -> None:
    assert read(changed(illum_public(), "camera.model", model)).facts.generation is Generation.ILLUM


@pytest.mark.parametrize(
    "place, value, expected",
    [
        ("image", [], "image is a list of 0; expected an object"),
        ("image.width", "7728", "image.width is '7728'; expected a number from 2 to 20000"),
        ("image.width", 7728.5, "image.width is 7728.5; expected a whole number"),
        ("image.width", True, "image.width is True"),
        ("image.width", -64, "image.width is -64"),
        ("image.width", 10**400, "image.width is 1000"),
        ("image.width", 66, "expected a multiple of 4 px"),
        ("image.height", 2**31, "image.height is 2147483648"),
        ("image.height", 47, "image.height is 47; expected an even number"),
        ("image.orientation", 9, "image.orientation is 9"),
        ("image.pixelPacking.bitsPerPixel", 14, "a.lfp: Pixels are packed in 14 bits, little"),
        ("image.pixelPacking.endianness", "middle", "packed in 10 bits, middle"),
        ("image.pixelPacking.endianness", 5, "endianness is 5; expected text"),
        ("image.pixelFormat.rightShift", 6, "rightShift is 6; expected 0"),
        ("image.pixelFormat.black.r", 1e400, "black.r is inf"),
        ("image.pixelFormat.black.r", 1022, "white is an object of 4; expected levels above those of black"),
        ("image.pixelFormat.white.gb", 1024, "white.gb is 1024; expected a number from 0 to 1023"),
        ("image.mosaic.tile", "c,m:y,k", "tile is 'c,m:y,k'; expected the Bayer mosaic"),
        ("image.mosaic.upperLeftPixel", "w", "upperLeftPixel is 'w'; expected r, gr, gb or b"),
        ("image.color.ccm", [1, 2, 3], "ccm is a list of 3; expected a list of 9 numbers"),
        ("image.color.ccm", [None] * 9, "ccm[0] is missing; expected a number"),
        ("image.color.whiteBalanceGain.r", 0, "whiteBalanceGain.r is 0"),
        ("devices.mla.tiling", "square", "tiling is 'square'; expected hexUniformRowMajor"),
        ("devices.mla.lensPitch", 4e-4, "lensPitch is 0.0004; expected a number from 5e-06 to 0.0001"),
        ("devices.mla.scaleFactor.y", 0, "scaleFactor.y is 0"),
        ("devices.mla.rotation", 3, "rotation is 3"),
        ("devices.lens.zoomStep", {}, "zoomStep is an object of 0"),
        ("devices.lens.zoomStep", 1e300, "zoomStep is 1e+300"),
        ("camera.model", 7, "camera.model is 7; expected text"),
        ("camera.model", "x\n" * 99, "names the camera model"),
    ],
)
def test_wrong_values_are_named(place: str, value: Any, expected: str) -> None:
    with pytest.raises(InputError) as caught:
        read(changed(illum_public(), place, value))
    message = str(caught.value)
    assert expected in message
    assert message.startswith("a.lfp")
    assert message.endswith(".")
    assert "\n" not in message
    assert len(message) < 200


def test_unknown_and_null_values_change_nothing() -> None:
    public = changed(changed(illum_public(), "image.novelty", {"deep": [1, {"x": None}]}), "devices.lens.temperature", None)
    assert read(public) == read(illum_public())


def test_references_into_nothing(tmp_path: Path) -> None:
    nowhere = "sha1-" + "0" * 40
    table = {"frames": [{"frame": {"metadataRef": nowhere, "imageRef": nowhere}}, {"frame": {}}]}
    write_container(tmp_path / "a.LFR", table, [b"nothing refers to this"])
    assert read_capture(open_container(tmp_path / "a.LFR")) is None
    table = {"frames": [{"frame": {"metadata": illum_public(), "privateMetadata": private(), "imageRef": nowhere}}]}
    write_container(tmp_path / "b.LFR", table, [])
    capture = read_capture(open_container(tmp_path / "b.LFR"))
    assert capture is not None
    assert capture.image is None
    assert capture.facts.serial == SERIAL


def test_a_mosaic_of_another_length(tmp_path: Path) -> None:
    table = {"frames": [{"frame": {"metadata": illum_public(), "imageRef": reference_to(bytes(3841))}}]}
    write_container(tmp_path / "a.LFR", table, [bytes(3841)])
    with pytest.raises(InputError, match=r"holds 3,841 bytes, but a mosaic of 64 x 48 px in 10 bits takes 3,840;"):
        read_capture(open_container(tmp_path / "a.LFR"))


def test_many_frames(tmp_path: Path) -> None:
    write_container(tmp_path / "a.LFR", {"frames": [{"frame": {"metadata": illum_public()}}] * 17}, [])
    with pytest.raises(InputError, match="claims 17 frames"):
        read_capture(open_container(tmp_path / "a.LFR"))


@pytest.mark.parametrize("frames", [7, [7], [{"frame": 7}], [{"frame": {"metadata": 7}}], [{"frame": {"metadataRef": 7}}]])
def test_frames_of_other_types(tmp_path: Path, frames: Any) -> None:
    write_container(tmp_path / "a.LFR", {"frames": frames}, [])
    with pytest.raises(InputError, match=r"frames.* is .*; expected"):
        read_capture(open_container(tmp_path / "a.LFR"))
