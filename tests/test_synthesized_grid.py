"""Grids of synthesized views: opened by the readers, they are the views that were synthesized; quilts hold their order."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

from app.__main__ import main
from lfcore.errors import Cancelled, InputError, OutputError
from lfcore.export import write_picture, write_rows
from lfcore.formats import open_light_field
from lfcore.lightfield import FloatArray
from lfcore.metrics import to_uint8
from lfcore.quilt import Quilt, quilt_path
from lfcore.synthesized_grid import (
    check_grid_target,
    check_quilt_target,
    write_eslf,
    write_quilt,
    write_views,
)
from tests.moving_scene import DISPARITY, light_field, truth

SIZE = (40, 56)


def view(u: float, v: float) -> FloatArray:
    return truth(u, v, SIZE)


def read(path: Path) -> np.ndarray:
    return np.asarray(oiio.ImageBuf(str(path)).get_pixels(oiio.UINT8))


@pytest.mark.parametrize("side", [2, 5, 8, 14])
@pytest.mark.parametrize("name", ["eslf é.png", "folder é"])
def test_what_is_written_opens_as_the_same_views(tmp_path: Path, name: str, side: int) -> None:
    scene = light_field(3, 3, SIZE)
    target = check_grid_target(tmp_path / name, side, scene)
    counts: list[int] = []
    if target.suffix:
        write_eslf(target, side, scene, view, counts.append)
    else:
        write_views(target, side, view, counts.append)
    assert counts == list(range(1, side**2 + 1))
    found = open_light_field(target, views=side)
    assert (found.kind == "ESLF") == bool(target.suffix)
    assert (found.rows, found.columns) == (side, side)
    for row in range(side):
        for column in range(side):
            assert np.array_equal(found.views[row, column], to_uint8(view(*found.position(row, column))))
    assert list(tmp_path.iterdir()) == [target]


def test_a_quilt_begins_at_the_bottom_left_with_the_leftmost_view(tmp_path: Path) -> None:
    quilt = Quilt(3, 2)
    scene = light_field(3, 3, SIZE)
    target = check_quilt_target(tmp_path / "glass.png", quilt, scene)
    assert target.name == "glass_qs3x2a1.4.png"  # 56 / 40
    write_quilt(target, quilt, scene, view, lambda count: None)
    found = read(target)
    height, width = SIZE
    assert found.shape == (2 * height, 3 * width, 3)
    # The maker's order: along the bottom row from the left, then the row above.
    tiles = [found[top:, left:][:height, :width] for top in (height, 0) for left in (0, width, 2 * width)]
    for number, tile in enumerate(tiles):
        assert np.array_equal(tile, to_uint8(view(number / 5, 0.5)))


def test_focus_puts_a_disparity_into_the_plane_of_the_screen(tmp_path: Path) -> None:
    quilt = Quilt(2, 2, focus=DISPARITY)
    write_quilt(tmp_path / "q.png", quilt, light_field(3, 3, SIZE), view, lambda count: None)
    found = read(tmp_path / "q.png").astype(int)
    height, width = SIZE
    tiles = [found[top:, left:][:height, :width][:, 6:-6] for top in (0, height) for left in (0, width)]
    middle = to_uint8(view(0.5, 0.5))[:, 6:-6]
    assert all(np.abs(tile - middle).max() <= 2 for tile in tiles)


@pytest.mark.parametrize(
    ("given", "named"),
    [
        ("a.png", "a_qs8x6a1.4.png"),
        ("a", "a_qs8x6a1.4.png"),
        ("a_qs4x4a0.75.png", "a_qs8x6a1.4.png"),
        ("b.c", "b.c_qs8x6a1.4.png"),
    ],
)
def test_the_name_of_a_quilt_tells_columns_rows_and_aspect(given: str, named: str) -> None:
    assert quilt_path(Path("d") / given, Quilt(8, 6), SIZE[::-1]) == Path("d") / named


@pytest.mark.parametrize("name", ["eslf.png", "folder", "quilt.png"])
def test_a_cancelled_grid_leaves_nothing(tmp_path: Path, name: str) -> None:
    scene = light_field(2, 2, SIZE)
    made: list[int] = []
    target = tmp_path / name
    with pytest.raises(Cancelled):
        if name == "folder":
            write_views(target, 3, view, made.append, lambda: len(made) >= 4)
        elif name == "eslf.png":
            write_eslf(target, 3, scene, view, made.append, lambda: len(made) >= 9)  # while it is written
        else:
            write_quilt(target, Quilt(3, 3), scene, view, made.append, lambda: len(made) >= 4)
    assert list(tmp_path.iterdir()) == []


def test_a_quilt_needs_one_row_of_views_in_memory(tmp_path: Path) -> None:
    bands: list[int] = []

    def rows() -> object:
        for band in range(3):
            bands.append(band)
            yield np.full((4, 5, 3), band, np.uint8)

    write_rows(tmp_path / "a.png", (12, 5), rows())  # type: ignore[arg-type]
    assert read(tmp_path / "a.png")[::4, 0, 0].tolist() == [0, 1, 2]


def test_impossible_grids_are_refused(tmp_path: Path) -> None:
    scene = light_field(2, 2, SIZE)
    for side, name, words in [(1, "v", "2 to"), (65, "v", "2 to"), (15, "e.png", "name a folder")]:
        with pytest.raises(InputError, match=words):
            check_grid_target(tmp_path / name, side, scene)
    for columns, rows in [(1, 1), (0, 4), (65, 1)]:
        with pytest.raises(InputError, match="quilt"):
            Quilt(columns, rows)
    with pytest.raises(InputError, match="fewer views"):
        check_quilt_target(tmp_path / "q.png", Quilt(64, 2), light_field(2, 2, (20, 600)))
    (tmp_path / "view_00_00.png").write_bytes(b"another")
    with pytest.raises(OutputError, match="holds some already"):
        check_grid_target(tmp_path, 3, scene)


def test_the_verb_writes_grids_and_quilts(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "scene"
    folder.mkdir()
    for row, views in enumerate(light_field(3, 3, SIZE).views):
        for column, stored in enumerate(views):
            write_picture(folder / f"view_{row:02}_{column:02}.png", stored)
    common = ["synth", str(folder), "--model", "mean"]
    assert main([*common, "--grid", "4", "--out", str(tmp_path / "views")]) == 0
    assert open_light_field(tmp_path / "views").rows == 4
    assert main([*common, "--grid", "8", "--out", str(tmp_path / "eslf.png")]) == 0
    assert open_light_field(tmp_path / "eslf.png").views.shape == (8, 8, *SIZE, 3)
    assert main([*common, "--quilt", "2x3", "--focus", "-2", "--out", str(tmp_path / "q")]) == 0
    assert (tmp_path / "q_qs2x3a1.4.png").is_file()
    capsys.readouterr()
    for options, words in [
        (["--quilt", "8by6"], "8x6"),
        (["--grid", "4", "--uv", "0,0"], "not allowed with"),
        (["--grid", "4", "--warped", "w"], "--uv"),
        (["--grid", "4", "--focus", "1"], "--quilt"),
        ([], "required"),
    ]:
        assert main([*common, *options, "--out", str(tmp_path / "x")]) == 2
        said = capsys.readouterr().err
        assert words in said
        assert said.count("\n") == 1
