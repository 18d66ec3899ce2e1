"""Captures by the model of the camera become the light fields that the model saw."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from app.__main__ import main
from lfcore.camera_files import private_metadata, public_metadata, write_capture
from lfcore.camera_model import CameraModel, expose, f01, illum
from lfcore.decode import output
from lfcore.decode.kept import DecodedStore
from lfcore.decode.pipeline import DecodeOptions, coarse_view, decode_capture, open_capture
from lfcore.errors import Cancelled, InputError
from lfcore.formats import open_light_field
from lfcore.formats.lytro.compose import write_illum_capture
from lfcore.lightfield import LightField
from lfcore.plane_scene import PlaneScene
from tests.camera_truth import decoded_psnr, small, srgb, true_picture, true_views, write_model_capture
from tests.plane_scenes import patches_scene, slanted_scene

LOW_NOISE = 20_000.0
ILLUM = small(illum(), 560, 460, full_well=LOW_NOISE)
PLACES = [(0, 0), (0, 7), (3, 3), (4, 6), (7, 0), (7, 7)]


@pytest.fixture(autouse=True)
def _own_folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    monkeypatch.setenv("LFVIEW_CACHE", str(tmp_path / "cache"))


@pytest.fixture(scope="module")
def scene() -> PlaneScene:
    return slanted_scene(ILLUM.size_in_pitches, 3)


@pytest.fixture(scope="module")
def capture(tmp_path_factory: pytest.TempPathFactory, scene: PlaneScene) -> Path:
    return write_model_capture(tmp_path_factory.mktemp("illum"), ILLUM, scene, samples=8)


def _scores(light_field: LightField, camera: CameraModel, scene: PlaneScene) -> list[float]:
    """PSNR of the corners of the middle 8 x 8 views and two between."""
    truths = true_views(camera, scene, 8, places=PLACES)
    return [decoded_psnr(light_field.views[place], truth) for place, truth in truths.items()]


def _middle_of(patch: int, side: float) -> slice:
    return slice(int((patch + 0.35) * side), int((patch + 0.65) * side) + 1)


def test_middle_views_of_an_illum_are_the_true_ones(capture: Path, scene: PlaneScene) -> None:
    shares: list[float] = []
    light_field = decode_capture(capture, None, DecodeOptions(views=8), shares.append)
    scores = [
        decoded_psnr(light_field.views[place], view) for place, view in true_views(ILLUM, scene, 8, places=PLACES).items()
    ]
    assert np.mean(scores) > 38
    assert min(scores) > 36
    assert light_field.views.dtype == np.uint8
    assert "0 steps away in zoom" in light_field.facts["White image"]
    assert "as the metadata has it" in light_field.facts["Microlenses"]
    assert not light_field.warnings
    assert shares == sorted(shares)
    assert shares[-1] == pytest.approx(0.95)


def test_middle_views_of_a_first_generation_camera_are_the_true_ones(tmp_path: Path) -> None:
    camera = small(f01(), 420, 380, full_well=LOW_NOISE)
    # Half the depth: on so small a sensor the edges of the discs, where all decoders err, are a large share of the picture.
    scene = slanted_scene(camera.size_in_pitches, 5, depth=0.5)
    light_field = decode_capture(write_model_capture(tmp_path, camera, scene, samples=8), None, DecodeOptions(views=8))
    scores = [
        decoded_psnr(light_field.views[place], view) for place, view in true_views(camera, scene, 8, places=PLACES).items()
    ]
    assert np.mean(scores) > 38
    assert min(scores) > 36


def test_every_row_of_microlenses_gives_larger_views(capture: Path, scene: PlaneScene) -> None:
    light_field = decode_capture(capture, None, DecodeOptions(views=2, every_row=True))
    picture = true_picture(ILLUM, every_row=True)
    assert (light_field.height, light_field.width) == (picture.height, picture.width)
    (truth,) = true_views(ILLUM, scene, 2, every_row=True, places=[(0, 1)]).values()
    assert decoded_psnr(light_field.views[0, 1], truth) > 36


def test_without_a_white_image_the_views_are_good_to_look_at(tmp_path: Path) -> None:
    camera = small(illum(), 560, 460, full_well=LOW_NOISE, corner_falloff=0.0)
    scene = slanted_scene(camera.size_in_pitches, 3)
    path = write_model_capture(tmp_path, camera, scene, samples=8, white=False)
    light_field = decode_capture(path, None, DecodeOptions(views=8))
    scores = [
        decoded_psnr(light_field.views[place], view) for place, view in true_views(camera, scene, 8, places=PLACES).items()
    ]
    assert min(scores) > 32
    assert "estimated from the capture" in light_field.warnings[0]


def test_plain_colours_are_right(tmp_path: Path) -> None:
    scene = patches_scene(ILLUM.size_in_pitches)
    path = write_model_capture(tmp_path, ILLUM, scene, samples=4)
    light_field = decode_capture(path, None, DecodeOptions(views=8))
    (truth,) = true_views(ILLUM, scene, 8, places=[(3, 3)]).values()
    rows, columns = 4, 6
    for row in range(rows):
        for column in range(columns):
            y = slice(int((row + 0.35) * light_field.height / rows), int((row + 0.65) * light_field.height / rows) + 1)
            x = slice(
                int((column + 0.35) * light_field.width / columns), int((column + 0.65) * light_field.width / columns) + 1
            )
            seen = light_field.views[3:5, 3:5, y, x].astype(float).mean(axis=(0, 1, 2, 3))
            assert np.abs(seen - 255 * srgb(truth[y, x]).mean(axis=(0, 1))).max() <= 2


def test_a_wrong_grid_in_the_metadata_does_no_harm(tmp_path: Path, scene: PlaneScene) -> None:
    mosaic = expose(ILLUM, scene, samples=4)
    honest, lying = tmp_path / "honest.LFR", tmp_path / "lying.LFR"
    write_capture(honest, ILLUM, mosaic)
    wrong = {"rotation": 0.05, "sensorOffset": {"x": -7e-6, "y": 6e-6, "z": 3e-5}}
    write_capture(lying, ILLUM, mosaic, mistakes=wrong)
    views = [decode_capture(path, None, DecodeOptions(views=2)) for path in (honest, lying)]
    np.testing.assert_array_equal(views[0].views, views[1].views)
    assert "The picture's is used" in views[1].facts["Microlenses"]


def test_all_views_go_to_an_eslf_that_opens_again(capture: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["decode", str(capture.parent), "--out", str(tmp_path / "decoded")]) == 0
    written = [Path(line) for line in capsys.readouterr().out.splitlines()]
    assert written == [tmp_path / "decoded" / "capture.png", tmp_path / "decoded" / "capture.json"]
    facts = json.loads(written[1].read_text(encoding="utf-8"))
    assert facts["metadata"][0]["metadata"]["camera"]["model"] == "ILLUM"
    assert [0, 0] in facts["dark"]
    again = open_light_field(written[0], views=14)
    decoded = decode_capture(capture)
    np.testing.assert_array_equal(again.views, decoded.views)
    assert again.dark == decoded.dark


def test_decoding_to_views_names_captures_that_fail(capture: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    broken = tmp_path / "broken.LFR"
    broken.write_bytes(capture.read_bytes()[:5000])
    arguments = [str(broken), str(capture), "--out", str(tmp_path / "out"), "--views", "2", "--linear", "--jobs", "2"]
    assert main(["decode", *arguments]) == 2
    told = capsys.readouterr()
    assert "broken.LFR" in told.err
    assert len(told.err.splitlines()) == 1
    views = open_light_field(tmp_path / "out" / "capture")
    assert views.views.shape[:2] == (2, 2)
    assert views.views.dtype == np.uint16
    tones = decode_capture(capture, None, DecodeOptions(views=2)).views
    linear = 255 * srgb(views.views / 65535)
    assert np.abs(linear - tones).max() < 1

    before = sorted((tmp_path / "out" / "capture").iterdir())
    assert main(["decode", str(capture), "--out", str(tmp_path / "out"), "--views", "3"]) == 2
    assert "holds some already" in capsys.readouterr().err
    assert sorted((tmp_path / "out" / "capture").iterdir()) == before


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--out", "one.png", "--views", "8"], "--out a folder"),
        (["--out", "folder", "--views", "99"], "2 x 2 to 14 x 14"),
        (["--out", "folder", "--views", "8", "--as", "eslf"], "14 x 14 views"),
    ],
)
def test_wishes_that_cannot_be_met_are_told_before_any_work(
    capture: Path, arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["decode", str(capture), *arguments]) == 2
    assert words in capsys.readouterr().err


def test_coarse_view_is_the_middle_view(capture: Path, scene: PlaneScene) -> None:
    picture = coarse_view(capture)
    (truth,) = true_views(ILLUM, scene, 1, places=[(0, 0)]).values()
    assert picture.shape == truth.shape
    assert decoded_psnr(picture, truth) > 25  # the corners of the sensor are darker, since no white image was used


def test_opened_captures_are_kept_and_damage_is_noticed(capture: Path, tmp_path: Path) -> None:
    store = DecodedStore(tmp_path / "kept")
    first = open_capture(capture, DecodeOptions(views=2), store)
    (file,) = (tmp_path / "kept").iterdir()
    again = open_capture(capture, DecodeOptions(views=2), store)
    np.testing.assert_array_equal(again.views, first.views)
    assert (again.facts, again.dark, again.kind) == (first.facts, first.dark, first.kind)

    marked = bytearray(file.read_bytes())
    marked[-1000] ^= 1
    file.write_bytes(marked)
    key = file.stem
    assert store.get(key) is None
    assert not file.exists()

    other = DecodedStore(tmp_path / "kept", limit_bytes=first.views.nbytes + 5000)
    other.put("a", first)
    other.put("b", first)
    assert other.usage()[0] == 1
    assert other.get("b") is not None


def test_views_that_could_not_all_be_written_are_removed(
    capture: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """So that decoding again is not refused for what is left of the last time."""
    light_field = decode_capture(capture, None, DecodeOptions(views=2))

    def fail(path: Path, written: LightField) -> Path:
        raise KeyboardInterrupt

    monkeypatch.setattr(output, "_write_facts", fail)
    with pytest.raises(KeyboardInterrupt):
        output.write_views(tmp_path / "out" / "capture", light_field)
    assert list(tmp_path.iterdir()) == []


def test_orientation_is_honoured(tmp_path: Path) -> None:
    camera = small(illum(), 360, 300, full_well=0.0, hot_pixels=0.0)
    scene = slanted_scene(camera.size_in_pitches, 3)
    lying = write_model_capture(tmp_path, camera, scene, samples=2, white=False)
    upright = write_model_capture(tmp_path, camera, scene, samples=2, white=False, name="turned.LFR", orientation=6)
    stored, turned = (decode_capture(path, None, DecodeOptions(views=2)).views for path in (lying, upright))
    clockwise = stored.transpose(1, 0, 3, 2, 4)[:, ::-1, :, ::-1]
    np.testing.assert_array_equal(turned, clockwise)


def test_decoding_can_be_given_up(capture: Path) -> None:
    with pytest.raises(Cancelled):
        decode_capture(capture, cancelled=lambda: True)


def test_what_is_no_capture_is_told(tmp_path: Path) -> None:
    camera = small(illum(), 360, 300)
    path = tmp_path / "noise.LFR"
    noise = np.random.default_rng(0).poisson(200, (camera.height, camera.width)).astype(np.uint16)
    write_capture(path, camera, noise)
    with pytest.raises(InputError, match="no pattern of microlenses"):
        decode_capture(path)
    short = tmp_path / "short.LFR"
    write_illum_capture(short, bytes(1000), public_metadata(camera), private_metadata(camera))
    with pytest.raises(InputError, match="1,000 bytes"):
        decode_capture(short)
