"""`lfview info` on Lytro files: what they are, which white image would be used, and what is written out of them."""

from __future__ import annotations

import json
from pathlib import Path

import OpenImageIO as oiio
import pytest

from app.__main__ import main
from lfcore.errors import InputError
from lfcore.formats import open_light_field
from lfcore.formats.lytro.compose import write_backup, write_caldata
from lfcore.formats.lytro.container import open_container, reference_to, write_container
from tests.lytro_files import SERIAL, SHARED, white_files, write_illum
from tests.lytro_seeds import make_seeds

real_files = pytest.mark.skipif(not SHARED.is_dir(), reason="needs the real Lytro files of ../shared/data/lfp")


@pytest.fixture(autouse=True)
def own_configuration(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    """An empty configuration folder for each test."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path_factory.mktemp("configuration")))


def info(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    assert main(["info", *map(str, arguments)]) == 0
    return capsys.readouterr().out


def test_a_capture(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write_illum(tmp_path / "a.LFR")
    write_caldata(tmp_path / "caldata-1.tar", white_files({"MOD_0004": (103, 490, 700)}))
    text = info(capsys, path)
    for expected in (
        "raw capture",
        "Lytro Illum, firmware 1.1.1 (23)",
        SERIAL,
        "focal length 24.0 mm, f/2.2, zoom step 100, focus step 500",
        "1/100 s, ISO 80",
        "64 x 48 px, 10 bit GRBG, black 62/61/64/63, white 1021/1020/1023/1022",
        "MOD_0004.RAW, the nearest of 1 of this camera: 3 steps away in zoom, 10 steps away in focus.",
        "3,840 bytes",
        "frames[0].frame.imageRef",
    ):
        assert expected in text
    found = json.loads(info(capsys, path, "--json"))
    assert found["kind"] == "capture"
    assert found["capture"]["facts"]["serial"] == SERIAL
    assert found["capture"]["raw"]["cfa"] == "GRBG"
    assert found["white_image"]["rule"] == "nearest"
    assert (found["white_image"]["zoom_distance"], found["white_image"]["focus_distance"]) == (3, 10)
    assert [section["kind"] for section in found["sections"]].count("LFM") == 1


def test_calibration_is_named_once_and_remembered(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write_illum(tmp_path / "a.LFR")
    place = tmp_path / "elsewhere"
    place.mkdir()
    write_caldata(place / "caldata-1.tar", white_files({"MOD_0004": (103, 490, 700)}))
    assert json.loads(info(capsys, path, "--json"))["white_image"]["rule"] == "none"
    calibration: tuple[object, ...] = ("--calibration", place)
    for _ in ("named", "remembered"):
        assert json.loads(info(capsys, path, "--json", *calibration))["white_image"]["rule"] == "nearest"
        calibration = ()


def test_calibration_that_cannot_be_remembered_is_still_used(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "file"))
    path = write_illum(tmp_path / "a.LFR")
    (tmp_path / "elsewhere").mkdir()
    write_caldata(tmp_path / "elsewhere" / "caldata-1.tar", white_files({"MOD_0004": (103, 490, 700)}))
    assert main(["info", str(path), "--calibration", str(tmp_path / "elsewhere")]) == 0
    output = capsys.readouterr()
    assert "MOD_0004.RAW, the nearest" in output.out
    assert "not remembered" in output.err


@real_files
def test_real_files_are_written_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    info(capsys, SHARED / "illum_preview.LFP", "--extract", tmp_path / "out")
    names = sorted(path.name for path in (tmp_path / "out").iterdir())
    assert len(names) == 12
    assert names[:2] == ["depth_map_00.tif", "refocus_stack_00_lambda-15.00.jpg"]
    container = open_container(SHARED / "illum_preview.LFP")
    stored = {container.data(section) for section in container.sections}
    for path in (tmp_path / "out").glob("*.jpg"):
        assert path.read_bytes() in stored
    picture = oiio.ImageInput.open(str(tmp_path / "out" / "depth_map_00.tif"))
    assert picture.read_image("float").shape == (60, 88, 1)
    assert "lambda" in picture.spec().getattribute("ImageDescription")


def test_stacks_stored_as_video_are_written_out_as_pictures(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    make_seeds(tmp_path)
    info(capsys, tmp_path / "video-stk.lfp", "--extract", tmp_path / "out")
    names = sorted(path.name for path in (tmp_path / "out").glob("*.png"))
    assert names == ["refocus_stack_00_lambda+2.00.png", "refocus_stack_01_lambda-1.00.png"]
    # The first frame has no blue, the second some.
    blue = [oiio.ImageInput.open(str(tmp_path / "out" / name)).read_image("uint8")[..., 2].mean() for name in names]
    assert blue[0] < 20
    assert 80 < blue[1] < 120


def test_backups_are_written_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files = {"MOD_0000.RAW": bytes(300), "MOD_0000.TXT": b"{}"}
    path = write_backup(tmp_path, files, parts=1)[0]
    assert "calibration files of a first-generation camera" in info(capsys, path, "--extract", tmp_path / "out")
    for name, data in files.items():
        assert (tmp_path / "out" / name).read_bytes() == data


def test_what_is_whole_is_written_before_damage_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table = {
        "thumbnails": [{"imageRef": reference_to(b"\xff\xd8\xff whole")}],
        "views": [{"accelerations": [{"kind": "x", "depthMap": {"width": 1, "height": 2, "imageRef": reference_to(b"map")}}]}],
    }
    write_container(tmp_path / "a.LFP", table, [b"\xff\xd8\xff whole", b"map"])
    assert main(["info", str(tmp_path / "a.LFP"), "--extract", str(tmp_path / "out")]) == 2
    message = capsys.readouterr().err
    assert "holds 3 bytes, but a depth map of 1 x 2 takes 8" in message
    assert "what is whole was written to" in message
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["table.json", "thumbnail_00.jpg"]
    assert (tmp_path / "out" / "thumbnail_00.jpg").read_bytes() == b"\xff\xd8\xff whole"


def test_text_from_a_file_cannot_speak_to_the_terminal(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    camera = {"model": "ILLUM", "firmware": "\x1b[2Jboo\n\ud800"}
    table = {"frames": [{"frame": {"metadata": {"camera": camera}}}], "x\x1b[2J": {"deep" * 99: reference_to(b"a")}}
    write_container(tmp_path / "a.LFP", table, [b"a"])
    text = info(capsys, tmp_path / "a.LFP")
    assert all(letter.isprintable() or letter == "\n" for letter in text)
    assert "?[2Jboo??" in text


def test_options_for_lytro_files_only(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "a.png").write_bytes(b"")
    assert main(["info", str(tmp_path / "a.png"), "--extract", str(tmp_path / "out")]) == 2
    assert "is no file of a Lytro camera; --extract is for these" in capsys.readouterr().err


@real_files
@pytest.mark.parametrize(
    "name, kind",
    [
        ("f01_refocus_stack.lfp", "refocus stack"),
        ("f01_depth_map.lfp", "depth map"),
        ("illum_preview.LFP", "refocus stack"),
        ("f01_metadata_only.lfp", "metadata only"),
    ],
)
def test_files_without_mosaic_say_what_they_are_when_opened(name: str, kind: str) -> None:
    with pytest.raises(InputError, match=f"is a Lytro file: {kind}, without the raw capture; the raw capture would be"):
        open_light_field(SHARED / name)


def test_a_damaged_container_is_named_when_opened(tmp_path: Path) -> None:
    path = write_illum(tmp_path / "a.LFR")
    damaged = bytearray(path.read_bytes())
    damaged[-200] ^= 1
    path.write_bytes(damaged)
    with pytest.raises(InputError, match="does not match its checksum"):
        open_light_field(path)
