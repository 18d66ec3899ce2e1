"""What a folder holds to choose from, and a glance at each."""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from lytro_files import SHARED, write_illum
from test_formats import plain, random_views, save, save_views

from lfcore.errors import Cancelled, InputError
from lfcore.formats import open_light_field
from lfcore.formats.collection import folder_around, members
from lfcore.formats.glance import LONGEST_SIDE, glance, shrunk


def block_means(picture: np.ndarray, factor: int) -> np.ndarray:
    """Straightforwardly, block by block, in float64."""
    rows, columns = picture.shape[0] // factor, picture.shape[1] // factor
    means = np.empty((rows, columns, 3))
    for row in range(rows):
        for column in range(columns):
            block = picture[row * factor : (row + 1) * factor, column * factor : (column + 1) * factor]
            means[row, column] = block.reshape(-1, 3).mean(0)
    return means


@pytest.mark.parametrize(("size", "factor"), [((20, 30), 1), ((300, 193), 2), ((376, 541), 3)])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
def test_pictures_are_shrunk_by_means(size: tuple[int, int], factor: int, dtype: type) -> None:
    picture = random_views(1, 1, *size, dtype)[0, 0]
    white = 1.0 if dtype == np.float32 else float(np.iinfo(dtype).max)
    small = shrunk(picture)
    assert small.shape == (size[0] // factor, size[1] // factor, 3)
    assert max(small.shape) <= LONGEST_SIDE
    expected = block_means(picture, factor) / white * 255
    assert np.abs(small - expected).max() <= 0.51


def test_pictures_of_a_single_row_survive() -> None:
    assert shrunk(np.full((1, 1000, 3), 255, np.uint8)).tolist() == [[[255, 255, 255]] * 166]


def test_a_folder_of_views_shows_its_middle_view(tmp_path: Path) -> None:
    views = random_views(3, 4)
    folder = save_views(tmp_path / "light field", views, plain)
    for path in (folder, folder / plain(0, 0)):
        seen = glance(path)
        assert seen.caption == "4 × 3 views of 30 × 20 px"
        assert seen.picture is not None
        assert (seen.picture == views[1, 2]).all()


def test_an_eslf_shows_its_middle_view(tmp_path: Path) -> None:
    whole = random_views(1, 1, 14 * 20, 14 * 25)[0, 0]
    seen = glance(save(tmp_path / "capture.png", whole))
    assert seen.picture is not None
    assert (seen.picture == whole[7::14, 7::14]).all()
    assert seen.caption == "ESLF, 14 × 14 views of 25 × 20 px"


def test_a_raw_capture_shows_its_coarse_picture(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    view = random_views(1, 1, 40, 50)[0, 0]
    decoder = SimpleNamespace(coarse_view=lambda path: view)  # the real one loads torch
    monkeypatch.setitem(sys.modules, "lfcore.decode.pipeline", decoder)
    seen = glance(write_illum(tmp_path / "capture.lfr"))
    assert seen.picture is not None
    assert (seen.picture == view).all()


@pytest.mark.parametrize("name", ["f01_refocus_stack.lfp", "f01_depth_map.lfp", "illum_preview.LFP"])
def test_lytro_files_without_raw_show_a_picture(name: str) -> None:
    if not (SHARED / name).exists():
        pytest.skip(f"{SHARED / name} is not here")
    seen = glance(SHARED / name)
    assert seen.picture is not None
    assert seen.picture.std() > 5


def test_what_cannot_be_opened_is_refused_in_the_same_words(tmp_path: Path) -> None:
    save(tmp_path / "photo.png", random_views(1, 1, 41, 33)[0, 0])
    (tmp_path / "empty.png").touch()
    lacking = save_views(tmp_path / "lacking", random_views(2, 2), plain)
    (lacking / plain(1, 1)).unlink()
    for path in (tmp_path / "empty.png", lacking):
        with pytest.raises(InputError) as opened:
            open_light_field(path)
        with pytest.raises(InputError) as glanced:
            glance(path)
        assert str(glanced.value) == str(opened.value)
    with pytest.raises(InputError, match="33 x 41 px"):
        glance(tmp_path / "photo.png")


def test_a_glance_can_be_given_up(tmp_path: Path) -> None:
    path = save(tmp_path / "capture.png", random_views(1, 1, 14 * 20, 14 * 20)[0, 0])
    with pytest.raises(Cancelled):
        glance(path, lambda: True)


def test_a_folder_tells_what_there_is_to_choose_from(tmp_path: Path) -> None:
    for name in ("scene 10", "scene 9"):
        save_views(tmp_path / name, random_views(2, 2), plain)
    save_views(tmp_path / "deeper" / "views", random_views(2, 2), plain)
    (tmp_path / "empty").mkdir()
    save_views(tmp_path / ".hidden", random_views(2, 2), plain)
    (tmp_path / "capture.LFR").write_bytes(b"\x89LFP")
    save(tmp_path / "eslf.png", random_views(1, 1, 14 * 20, 14 * 20)[0, 0])
    (tmp_path / "notes.txt").write_text("none")
    assert [path.name for path in members(tmp_path)] == ["capture.LFR", "deeper", "eslf.png", "scene 9", "scene 10"]
    seen = glance(tmp_path)
    assert (seen.picture, seen.caption) == (None, "Folder, 5 inside")


def test_a_light_field_is_nothing_to_choose_from(tmp_path: Path) -> None:
    folder = save_views(tmp_path / "one" / "views", random_views(2, 2), plain)
    save(folder / "ground truth.png", random_views(1, 1)[0, 0])
    (folder / plain(1, 1)).unlink()  # opening it says that a view is missing
    for path in (folder, tmp_path / "one", folder / plain(0, 0), tmp_path / "absent"):
        assert members(path) == ()
    nothing = tmp_path / "nothing"
    nothing.mkdir()
    assert members(nothing) == ()


def test_pictures_saved_beside_light_fields_hide_none_of_them(tmp_path: Path) -> None:
    scenes = [save_views(tmp_path / name, random_views(2, 2), plain) for name in ("a", "b")]
    saved = []
    for u in ("0.50", "0.25", "0.75", "1.00"):
        saved.append(save(tmp_path / f"a synthesis u{u} v0.50.png", random_views(1, 1)[0, 0]))
        assert set(members(tmp_path)) == {*scenes, *saved}
    whole = save_views(tmp_path / "whole", random_views(2, 2), plain)
    for name in ("depth", "masks"):
        save_views(whole / name, random_views(2, 2), plain)
    assert members(whole) == ()


def test_pictures_of_different_names_are_a_light_field_each(tmp_path: Path) -> None:
    pixels = random_views(1, 1, 14 * 20, 14 * 20)[0, 0]
    for name in ("IMG_1.png", "IMG_2.png", "IMG_3.png"):
        save(tmp_path / name, pixels)
    assert len(members(tmp_path)) == 3


def test_the_folder_around_a_light_field_is_found(tmp_path: Path) -> None:
    scenes = [save_views(tmp_path / "all" / name, random_views(2, 2), plain) for name in ("a", "b")]
    for path in (scenes[1], scenes[1] / plain(0, 1), scenes[1] / "gone"):
        assert folder_around(path) == tmp_path / "all"
    with pytest.raises(InputError, match="no other light fields"):
        folder_around(tmp_path.joinpath(*"abcdefgh", "a.png"))  # farther from anything than is looked


def test_views_in_a_single_row_are_nothing_to_choose_from(tmp_path: Path) -> None:
    for folder in (
        save_views(tmp_path / "row", random_views(1, 5), plain),
        save_views(tmp_path / "column", random_views(5, 1), plain),
    ):
        assert members(folder) == ()
        with pytest.raises(InputError, match="single row or column"):
            open_light_field(folder)
