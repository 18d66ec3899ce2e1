"""Figures, colour maps and picture files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

from lfcore import colormaps
from lfcore.errors import OutputError
from lfcore.export import check_folder_target, check_target, make_folder, write_disparity, write_image, write_warped
from lfcore.figures import Cell, Legend, disparity_cell, figure
from lfcore.lightfield import CORNERS

TABLES = (colormaps.disparity_colours(), colormaps.error_colours())


def luminance(table: np.ndarray) -> np.ndarray:
    """Relative luminance of sRGB colours (N, 3)."""
    encoded = table / 255
    linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    return np.asarray(linear @ [0.2126, 0.7152, 0.0722])


@pytest.mark.parametrize("table", TABLES)
def test_colour_maps_grow_lighter_all_the_way(table: np.ndarray) -> None:
    assert table.shape == (256, 3)
    lightness = np.cbrt(luminance(table))
    assert (np.diff(lightness[::8]) > 0).all()
    assert len(np.unique(table, axis=0)) > 240


def test_values_take_the_colours_between_the_ends() -> None:
    table = colormaps.disparity_colours()
    values = np.array([[-9.0, -2.0, 0.5, 3.0, 9.0, np.nan, np.inf, -np.inf]], np.float32)
    colours = colormaps.apply(table, values, -2, 3)[0]
    assert [colour.tolist() for colour in colours[[0, 1, 2, 3, 4]]] == [table[k].tolist() for k in (0, 0, 128, 255, 255)]
    assert colours[5].tolist() == [128, 128, 128]
    assert [colours[6].tolist(), colours[7].tolist()] == [table[255].tolist(), table[0].tolist()]


def test_a_flat_map_has_a_colour() -> None:
    flat = disparity_cell(np.full((4, 4), 2.5, np.float32))
    assert (flat.picture == flat.picture[0, 0]).all()
    assert flat.legend is not None
    assert flat.legend.low == "2.5 px or less"
    near_zero = disparity_cell(np.full((4, 4), -0.01, np.float32)).legend
    assert near_zero is not None
    assert (near_zero.low, near_zero.high) == ("0.0 px or less", "0.0 px or more")


def test_a_figure_holds_its_cells_captions_and_legends() -> None:
    random = np.random.default_rng(1)
    cells = [Cell(random.integers(0, 256, (40, 160, 3), dtype=np.uint8), "caption") for _ in range(3)]
    table = colormaps.error_colours()
    cells.append(Cell(cells[0].picture, "coloured", Legend(table, "0", "1")))
    page = figure(cells, columns=2)
    blank = figure([Cell(cell.picture, "") for cell in cells], columns=2)
    assert (page[:30] != blank[:30]).any()  # captions are drawn
    found = [np.where((page == cell.picture[0, 0]).all(axis=2)) for cell in cells]
    for cell, (rows, columns) in zip(cells, found, strict=True):
        assert any(np.array_equal(page[y : y + 40, x : x + 160], cell.picture) for y, x in zip(rows, columns, strict=True))
    strip = table[np.linspace(0, 255, 160).round().astype(int)]
    assert any(np.array_equal(row[-168:-8], strip) for row in page)


def test_cells_of_two_sizes_are_refused() -> None:
    with pytest.raises(ValueError, match="cell 1"):
        figure([Cell(np.zeros((4, 4, 3), np.uint8), ""), Cell(np.zeros((4, 5, 3), np.uint8), "")], columns=1)


@pytest.mark.parametrize("extension", [".tif", ".exr"])
def test_disparity_comes_back_exactly(tmp_path: Path, extension: str) -> None:
    disparity = np.random.default_rng(2).normal(0, 7, (20, 30)).astype(np.float32)
    write_disparity(tmp_path / f"d{extension}", disparity)
    back = oiio.ImageBuf(str(tmp_path / f"d{extension}")).get_pixels(oiio.FLOAT)
    assert np.array_equal(np.asarray(back)[..., 0], disparity)


def test_pictures_are_clipped_and_written_in_the_depth_of_their_kind(tmp_path: Path) -> None:
    image = np.array([[[-1, 0, 0.25], [0.5, 1, 2]]], np.float32)
    for name, depth in (("a.png", "uint8"), ("a.tif", "uint16"), ("a.tiff", "uint16"), ("a.EXR", "half")):
        write_image(tmp_path / name, image)
        back = oiio.ImageBuf(str(tmp_path / name))
        assert str(back.spec().format) == depth
        assert np.asarray(back.get_pixels(oiio.FLOAT)).ravel() == pytest.approx([0, 0, 0.25, 0.5, 1, 1], abs=0.51 / 255)


def test_warped_inputs_are_named_by_their_corner(tmp_path: Path) -> None:
    warped = np.arange(4, dtype=np.float32)[:, None, None, None] / 10 * np.ones((4, 3, 5, 3), np.float32)
    paths = write_warped(tmp_path / "warped", warped, ".exr")
    for index, (path, (u, v)) in enumerate(zip(paths, CORNERS, strict=True)):
        assert path.name == f"warped_u{u:.0f}_v{v:.0f}.exr"
        assert np.asarray(oiio.ImageBuf(str(path)).get_pixels(oiio.FLOAT)).mean() == pytest.approx(index / 10, abs=1e-3)


def test_targets_that_cannot_be_written_are_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    (tmp_path / "folder.png").mkdir()
    locked = tmp_path / "locked.png"
    locked.write_text("")
    locked.chmod(0o444)
    for path, reason in (
        (tmp_path / "a.bmp", "ends in .bmp"),
        (tmp_path / "a", "no extension"),
        (tmp_path / "none" / "a.png", "does not exist"),
        (tmp_path / "file" / "a.png", "is not a folder"),
        (tmp_path / "folder.png", "is a folder"),
        (locked, "read-only"),
    ):
        with pytest.raises(OutputError, match=reason):
            check_target(path, (".png",))
    for path in (tmp_path / "file" / "deeper", tmp_path / "file"):
        with pytest.raises(OutputError, match="Cannot make the folder"):
            make_folder(path)
        with pytest.raises(OutputError, match="is not a folder"):
            check_folder_target(path)
    assert check_folder_target(tmp_path / "x" / "y") == tmp_path / "x" / "y"
    assert check_target(tmp_path / "new.PNG", (".png",)) == tmp_path / "new.PNG"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "folder.png", "locked.png"]
