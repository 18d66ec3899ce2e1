"""White images are found wherever they lie and chosen by the four rules; what does not fit is passed over and told."""

from __future__ import annotations

import io
import os
import tarfile
from pathlib import Path

import numpy as np
import pytest

from app.opening import open_by_content
from lfcore.decode.calibration import Choice, Rule, choose_white_image
from lfcore.decode.calibration_files import holds_calibration
from lfcore.decode.remembered import remember, remembered
from lfcore.decode.unpack import pack
from lfcore.errors import InputError
from lfcore.formats import tar
from lfcore.formats.lytro.compose import white_image_text, write_backup, write_caldata, write_f01_capture
from lfcore.formats.lytro.container import open_container, reference_to
from lfcore.formats.lytro.metadata import read_capture
from tests.lytro_files import (
    F01_PACKING,
    HEIGHT,
    ILLUM_PACKING,
    SERIAL,
    WIDTH,
    f01_public,
    illum_public,
    mosaic,
    private,
    white_files,
    write_illum,
)

# Zoom step, focus step, level. The capture of tests.lytro_files was taken at zoom 100, focus 500.
SETTINGS = {
    "MOD_0000": (100, 500, 64),  # a black frame
    "MOD_0001": (90, 900, 700),
    "MOD_0002": (110, 480, 701),
    "MOD_0003": (-300, 500, 702),
    "MOD_0004": (110, 470, 703),
}


@pytest.fixture(autouse=True)
def own_configuration(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty configuration folder for each test."""
    folder = tmp_path_factory.mktemp("configuration")
    monkeypatch.setenv("XDG_CONFIG_HOME", str(folder))
    return folder


@pytest.fixture
def capture(tmp_path: Path) -> Path:
    (tmp_path / "captures").mkdir()
    return write_illum(tmp_path / "captures" / "IMG_0001.LFR")


def choose(path: Path, calibration: Path | None = None) -> Choice:
    container = open_container(path)
    capture = read_capture(container)
    assert capture is not None
    choice = choose_white_image(container, capture, calibration)
    for sentence in (choice.sentence, *choice.notes):
        assert "\n" not in sentence
        assert sentence.endswith(".")
    return choice


def level(choice: Choice) -> int:
    """The one value that the white image of a choice is filled with."""
    assert choice.white is not None
    values = np.unique(choice.white.mosaic())
    assert values.size == 1
    return int(values[0])


def save(folder: Path, files: dict[str, bytes]) -> Path:
    folder.mkdir(exist_ok=True)
    for name, data in files.items():
        (folder / name).write_bytes(data)
    return folder


def caldata(path: Path, settings: dict[str, tuple[int, int, int]] = SETTINGS, serial: str = SERIAL) -> Path:
    write_caldata(path, white_files(settings, serial))
    return path


# The four rules


def test_rule_1_the_white_image_inside_the_capture(tmp_path: Path) -> None:
    white = pack(np.full((HEIGHT, WIDTH), 900, np.uint16), ILLUM_PACKING)
    path = write_illum(tmp_path / "a.LFR", modulationDataRef=white)
    choice = choose(path, caldata(tmp_path / "caldata-1.tar"))
    assert choice.rule is Rule.EMBEDDED
    assert level(choice) == 900
    assert choice.sentence.startswith("The white image inside the capture itself")


def test_rule_1_with_metadata_of_its_own(tmp_path: Path) -> None:
    white = pack(np.full((HEIGHT, WIDTH), 900, np.uint16), ILLUM_PACKING)
    text = white_image_text(illum_public(103, 497), private())
    choice = choose(write_illum(tmp_path / "a.LFR", modulationDataRef=white, modulationDataMetadataRef=text))
    assert choice.rule is Rule.EMBEDDED
    assert (choice.zoom_distance, choice.focus_distance) == (3, 3)


def test_rule_1_gives_way_where_the_image_is_of_another_size(tmp_path: Path) -> None:
    path = write_illum(tmp_path / "a.LFR", modulationDataRef=bytes(77))
    choice = choose(path, caldata(tmp_path / "caldata-1.tar"))
    assert choice.rule is Rule.NEAREST
    assert "77 bytes" in choice.notes[0]


@pytest.mark.parametrize("listed", [True, False], ids=["manifest", "hashed"])
def test_rule_2_by_the_geometry_correction(tmp_path: Path, listed: bool) -> None:
    files = white_files(SETTINGS)
    path = write_illum(tmp_path / "a.LFR", geometryCorrectionRef=reference_to(files["MOD_0003.GCT"]).upper())
    if listed:
        write_caldata(tmp_path / "caldata-1.tar", files)
        choice = choose(path, tmp_path / "caldata-1.tar")
    else:
        choice = choose(path, save(tmp_path / "unpacked", files))
    assert choice.rule is Rule.GEOMETRY
    assert level(choice) == 702
    assert (choice.zoom_distance, choice.focus_distance) == (400, 0)
    assert "MOD_0003.RAW, whose geometry correction the capture names: 400 steps away in zoom, 0 steps" in choice.sentence


def test_rule_2_goes_before_rule_3_of_another_place(tmp_path: Path) -> None:
    files = white_files({"MOD_0007": (500, 0, 800)})
    folder = save(tmp_path / "both", {})
    caldata(folder / "a.tar")
    write_caldata(folder / "b.tar", files)
    path = write_illum(tmp_path / "a.LFR", geometryCorrectionRef=reference_to(files["MOD_0007.GCT"]))
    assert choose(path, folder).rule is Rule.GEOMETRY


def test_rule_3_the_nearest_in_zoom_then_in_focus(tmp_path: Path, capture: Path) -> None:
    choice = choose(capture, caldata(tmp_path / "caldata-1.tar"))
    assert choice.rule is Rule.NEAREST
    # Zoom: 90 and 110 are both 10 steps away; of these focus 480 is nearest. The black frame would be nearest of all.
    assert level(choice) == 701
    assert (choice.zoom_distance, choice.focus_distance) == (10, 20)
    assert choice.sentence.endswith(
        "caldata-1.tar: MOD_0002.RAW, the nearest of 5 of this camera: 10 steps away in zoom, 20 steps away in focus."
    )
    assert any("MOD_0000.RAW is a black frame" in note for note in choice.notes)


def test_rule_3_takes_the_brighter_of_two_exposures(tmp_path: Path, capture: Path) -> None:
    settings = {"MOD_0002": (100, 500, 300), "MOD_0003": (100, 500, 800), "MOD_0004": (100, 500, 500)}
    assert level(choose(capture, caldata(tmp_path / "caldata-1.tar", settings))) == 800


def test_rule_4_without_calibration(capture: Path) -> None:
    choice = choose(capture)
    assert choice.rule is Rule.NONE
    assert choice.white is None
    assert SERIAL in choice.sentence
    assert "estimated from the capture" in choice.sentence


def test_the_white_image_of_another_camera_is_never_taken(tmp_path: Path, capture: Path) -> None:
    choice = choose(capture, caldata(tmp_path / "caldata-1.tar", serial="B5999999999"))
    assert choice.rule is Rule.NONE
    assert "none of 5 white images found fits" in choice.sentence
    assert any("5 white images are of another camera (serial number B5999999999)" in note for note in choice.notes)


def test_the_white_image_of_another_size_is_never_taken(tmp_path: Path, capture: Path) -> None:
    files = white_files({"MOD_0002": (100, 500, 700)})
    files["MOD_0002.TXT"] = white_image_text(illum_public(100, 500, 128, 48), private())
    choice = choose(capture, save(tmp_path / "a", files))
    assert choice.rule is Rule.NONE
    assert "is 128 x 48 px, GRBG, but the capture 64 x 48 px, GRBG" in choice.notes[0]
    files = white_files({"MOD_0002": (100, 500, 700)})
    files["MOD_0002.RAW"] += b"\0"
    choice = choose(capture, save(tmp_path / "b", files))
    assert choice.rule is Rule.NONE
    assert "has 3,841 bytes, but 64 x 48 px take 3,840" in choice.notes[0]


def test_damage_in_one_white_image_leaves_the_others(tmp_path: Path, capture: Path) -> None:
    files = white_files(SETTINGS)
    files["MOD_0002.TXT"] = files["MOD_0002.TXT"][:100]
    del files["MOD_0004.RAW"]
    choice = choose(capture, save(tmp_path / "a", files))
    assert level(choice) == 700
    assert any("MOD_0002.TXT holds no valid JSON" in note for note in choice.notes)
    assert any("MOD_0004.RAW is missing" in note for note in choice.notes)


# Where calibration lies


def test_first_generation_backups(tmp_path: Path) -> None:
    files = {}
    for index, (zoom, value) in enumerate([(0, 169), (880, 3000), (880, 2000), (920, 3100), (2000, 3200)]):
        files[f"MOD_{index:04}.RAW"] = pack(np.full((HEIGHT, WIDTH), value, np.uint16), F01_PACKING)
        files[f"MOD_{index:04}.TXT"] = white_image_text(f01_public(zoom, 600), private("A303134643"), dark=index == 0)
    write_backup(tmp_path, files)
    path = tmp_path / "IMG_0001.lfp"
    write_f01_capture(path, pack(mosaic(12), F01_PACKING), f01_public(890, 600), private("A303134643"))
    for calibration in (None, tmp_path, tmp_path / "data.C.2"):
        choice = choose(path, calibration)
        assert level(choice) == 3000
        assert (choice.rule, choice.zoom_distance) == (Rule.NEAREST, 10)
    damaged = bytearray((tmp_path / "data.C.2").read_bytes())
    damaged[damaged.index(files["MOD_0001.RAW"]) + 1500] ^= 1
    (tmp_path / "data.C.2").write_bytes(damaged)
    choice = choose(path)
    assert choice.white is not None
    with pytest.raises(InputError, match=r"data\.C\.2: MOD_0001\.RAW does not match its checksum"):
        choice.white.mosaic()


def test_a_folder_is_searched_three_levels_deep(tmp_path: Path, capture: Path) -> None:
    deep = tmp_path / "a" / "b" / "c"
    deep.mkdir(parents=True)
    caldata(deep / "caldata-1.tar")
    (tmp_path / "a" / "round").symlink_to(tmp_path / "a")
    assert choose(capture, tmp_path / "a").rule is Rule.NEAREST


def test_a_single_white_image_stands_for_itself(tmp_path: Path, capture: Path) -> None:
    folder = save(tmp_path / "a", white_files(SETTINGS))
    assert level(choose(capture, folder / "MOD_0003.RAW")) == 702


def test_a_white_image_that_was_replaced_is_another_choice(tmp_path: Path, capture: Path) -> None:
    folder = save(tmp_path / "a", white_files(SETTINGS))
    file = caldata(tmp_path / "caldata-1.tar")
    for path in (folder / "MOD_0003.RAW", file):
        before = choose(capture, path)
        assert repr(choose(capture, path)) == repr(before)  # by which decoded captures are found again
        os.utime(path, ns=(1, 1))
        assert repr(choose(capture, path)) != repr(before)


def test_calibration_beside_the_capture_is_found(capture: Path) -> None:
    caldata(capture.parent / "caldata-1.tar")
    assert choose(capture).rule is Rule.NEAREST


def test_calibration_is_found_for_ever_after(tmp_path: Path, capture: Path) -> None:
    place = save(tmp_path / "Kalibrierung für später", {})
    caldata(place / "caldata-1.tar")
    remember(place)
    assert remembered() == [place]
    assert choose(capture).rule is Rule.NEAREST
    other = save(tmp_path / "other", {})
    remember(other)
    remember(place)
    assert remembered() == [place, other]
    (place / "caldata-1.tar").unlink()
    assert choose(capture).rule is Rule.NONE
    for number in range(40):
        remember(tmp_path / str(number))
    assert len(remembered()) == 16


def test_a_damaged_list_of_places_keeps_no_capture_from_opening(own_configuration: Path, tmp_path: Path, capture: Path) -> None:
    remember(tmp_path)
    (own_configuration / "lfview" / "calibration.json").write_text("{")
    choice = choose(capture)
    assert choice.rule is Rule.NONE
    assert any("calibration.json holds no valid JSON" in note for note in choice.notes)
    remember(tmp_path / "again")
    assert remembered() == [tmp_path / "again"]


def test_named_calibration_that_is_none_is_refused(tmp_path: Path, capture: Path) -> None:
    empty = save(tmp_path / "empty", {"photo.jpg": b"", "notes.tar": b"no archive"})
    for place, expected in (
        (tmp_path / "missing", "does not exist"),
        (save(tmp_path / "nothing", {}), "holds no calibration"),
        (empty, "is no calibration"),
        (empty / "photo.jpg", "is no calibration"),
    ):
        with pytest.raises(InputError, match=expected):
            choose(capture, place)


def test_calibration_dropped_on_the_window_is_remembered(tmp_path: Path, capture: Path) -> None:
    folder = save(tmp_path / "a", {"IMG_0001-stk.lfp": b"", "picture.png": b""})
    assert not holds_calibration(folder)
    assert not holds_calibration(capture)
    assert not holds_calibration(tmp_path / "missing")
    files = white_files(SETTINGS)
    write_backup(save(tmp_path / "backup", {}), files)
    for place in (caldata(folder / "caldata-1.tar"), folder, tmp_path / "backup" / "data.C.0", save(tmp_path / "b", files)):
        assert holds_calibration(place)
        with pytest.raises(InputError, match="it is remembered, and used for its captures from now on"):
            open_by_content(place, lambda _: None, lambda: False)
        assert remembered()[0] == place
    assert choose(capture).rule is Rule.NEAREST


# Archives


def archive(path: Path, *infos: tuple[tarfile.TarInfo, bytes], kind: int = tarfile.USTAR_FORMAT) -> Path:
    with tarfile.open(path, "w", format=kind) as target:
        for info, data in infos:
            info.size = len(data)
            target.addfile(info, io.BytesIO(data))
    return path


@pytest.mark.parametrize("kind", [tarfile.USTAR_FORMAT, tarfile.GNU_FORMAT, tarfile.PAX_FORMAT])
def test_archives_are_read_like_python_s_own_reader_does(tmp_path: Path, kind: int) -> None:
    names = ["a.txt", "/".join(["folder"] * 12) + "/MOD_0001.RAW", "x" * 99, "unitdata/MOD_0002.TXT"]
    if kind == tarfile.GNU_FORMAT:
        names += ["/".join(["folder"] * 50) + "/MOD_0003.RAW", "é.bin"]
    data = [bytes([index]) * (index * 300) for index in range(len(names))]
    path = archive(tmp_path / "a.tar", *((tarfile.TarInfo(n), d) for n, d in zip(names, data, strict=True)), kind=kind)
    with tarfile.open(path) as reference:
        expected = [(Path(m.name).name, m.offset_data, m.size) for m in reference.getmembers()]
    found = [(member.name, member.offset, member.size) for member in tar.members(path)]
    assert found == expected
    assert tar.is_tar(path)


def test_paths_links_and_devices_are_passed_over(tmp_path: Path) -> None:
    evil = tarfile.TarInfo("../../../etc/MOD_0001.RAW")
    link = tarfile.TarInfo("MOD_0002.RAW")
    link.type, link.linkname = tarfile.SYMTYPE, "/etc/passwd"
    hard = tarfile.TarInfo("MOD_0003.RAW")
    hard.type, hard.linkname = tarfile.LNKTYPE, "/etc/passwd"
    device = tarfile.TarInfo("MOD_0004.RAW")
    device.type = tarfile.CHRTYPE
    path = archive(tmp_path / "a.tar", (evil, b"abc"), (link, b""), (hard, b""), (device, b""), (tarfile.TarInfo("b"), b"d"))
    # A path that points outside is a name without folders, and is never written anywhere.
    assert [(member.name, member.size) for member in tar.members(path)] == [("MOD_0001.RAW", 3), ("b", 1)]


def test_huge_and_negative_sizes(tmp_path: Path) -> None:
    path = archive(tmp_path / "a.tar", (tarfile.TarInfo("MOD_0001.RAW"), b"abc"))
    whole = path.read_bytes()

    def with_size(field: bytes, kind: bytes = b"0") -> Path:
        block = bytearray(whole[:512])
        block[124:136], block[156:157], block[148:156] = field, kind, b" " * 8
        block[148:156] = b"%06o\0 " % sum(block)
        path.write_bytes(bytes(block) + whole[512:])
        return path

    for field in (b"77777777777\0", b"\x80" + b"\0" * 6 + b"\xff" * 5, b"\xff" * 12, b"-0000000001\0", b"zzzzzzzzzzz\0"):
        for kind in (b"0", b"S", b"L"):
            with pytest.raises(InputError, match="file 1 in the archive ends behind its end"):
                tar.members(with_size(field, kind))
    assert tar.members(with_size(b"00000000003\0"))[0].size == 3


def test_sparse_members(tmp_path: Path) -> None:
    """A GNU sparse file that claims 8 GiB, as tar -S writes it, followed by a plain one."""
    blocks = archive(tmp_path / "a.tar", (tarfile.TarInfo("MOD_0001.RAW"), bytes(512)), (tarfile.TarInfo("b"), b"data"))
    whole = blocks.read_bytes()
    block = bytearray(whole[:512])
    block[156:157] = b"S"
    block[257:265] = b"ustar  \0"
    block[482:483] = b"\1"  # one more block of the sparse map follows
    block[483:495] = b"%011o\0" % (2**33 - 1)
    block[148:156] = b" " * 8
    block[148:156] = b"%06o\0 " % sum(block)
    blocks.write_bytes(bytes(block) + bytes(512) + whole[512:])
    with tarfile.open(blocks) as reference:
        assert [member.size for member in reference.getmembers()] == [2**33 - 1, 4]
    assert [(member.name, member.size) for member in tar.members(blocks)] == [("b", 4)]


def test_archives_cut_or_flipped_anywhere(tmp_path: Path, capture: Path) -> None:
    path = caldata(tmp_path / "caldata-1.tar", {"MOD_0002": (100, 500, 700)})
    whole = path.read_bytes()
    generator = np.random.default_rng(5)
    for length in generator.integers(0, len(whole), 60):
        path.write_bytes(whole[:length])
        _survives(capture, path)
    for place in generator.integers(0, len(whole), 200):
        damaged = bytearray(whole)
        damaged[place] ^= 1 << generator.integers(0, 8)
        path.write_bytes(damaged)
        _survives(capture, path)


def _survives(capture: Path, calibration: Path) -> None:
    try:
        choice = choose(capture, calibration)
        if choice.white is not None:
            choice.white.mosaic()
    except InputError as error:
        assert str(error).endswith(".")
