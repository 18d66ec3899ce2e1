"""Light fields in: every kind of file and folder gives back the pixels that were written, and bad input one sentence."""

from __future__ import annotations

import itertools
import json
import os
import struct
import sys
import tempfile
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from privileges import without_privileges

from lfcore.errors import Cancelled, InputError
from lfcore.formats import describe, images, open_light_field


def save(path: Path, pixels: np.ndarray, **attributes: object) -> Path:
    """Write a picture through OpenImageIO, losslessly where the kind of file can."""
    if pixels.ndim == 2:
        pixels = pixels[..., None]
    output = oiio.ImageOutput.create(str(path))
    depth = attributes.pop("depth", {"float32": "float", "uint32": "uint"}.get(str(pixels.dtype), str(pixels.dtype)))
    spec = oiio.ImageSpec(pixels.shape[1], pixels.shape[0], pixels.shape[2], depth)
    spec.attribute("oiio:UnassociatedAlpha", 1)
    if path.suffix == ".webp":
        spec.attribute("Compression", "lossless")
    if "tile" in attributes:
        spec.tile_width = spec.tile_height = attributes.pop("tile")
    assert output.open(str(path), spec), output.geterror()
    assert output.write_image(np.ascontiguousarray(pixels)), output.geterror()
    output.close()
    return path


def random_views(rows: int, columns: int, height: int = 20, width: int = 30, dtype: type = np.uint8) -> np.ndarray:
    generator = np.random.default_rng(rows * 100 + columns)
    if dtype == np.float32:
        return generator.random((rows, columns, height, width, 3), dtype=np.float32)
    return generator.integers(0, np.iinfo(dtype).max, (rows, columns, height, width, 3), dtype=dtype, endpoint=True)


def save_views(folder: Path, views: np.ndarray, name: Callable[[int, int], str]) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    for row, column in itertools.product(range(views.shape[0]), range(views.shape[1])):
        save(folder / name(row, column), views[row, column])
    return folder


def plain(row: int, column: int) -> str:
    return f"view_{row:02}_{column:02}.png"


def refusal(path: Path, **options: int) -> str:
    """The one sentence with which a path is refused."""
    with pytest.raises(InputError) as caught:
        open_light_field(path, **options)
    message = str(caught.value)
    assert "\n" not in message
    assert message.endswith(".")
    return message


# Folders of views


@pytest.mark.parametrize(
    "name",
    [
        plain,
        lambda row, column: f"lf_{row + 1}_{column + 1}.png",
        lambda row, column: f"Scene 12 r{row}c{column} of 2016.png",
        lambda row, column: f"{row:03}-{column:03}.tif",
        lambda row, column: f"view_{row * 3 + 2}_{column * 2 + 7}.webp",
        lambda row, column: f"shot{row * 11 + column:03}_{row}_{column}.png",
        lambda row, column: f"lf_{row}_{column}_{row * 11 + column + 0.5}.png",
    ],
    ids=["view_RR_CC", "lf_R_C", "constant numbers too", "bare numbers", "steps", "running number first", "position behind"],
)
def test_names_give_row_and_column(tmp_path: Path, name: Callable[[int, int], str]) -> None:
    views = random_views(3, 11)
    light_field = open_light_field(save_views(tmp_path, views, name))
    np.testing.assert_array_equal(light_field.views, views)
    assert light_field.views.dtype == np.uint8


@pytest.mark.parametrize(
    ("extension", "dtype"),
    [
        (".png", np.uint8),
        (".png", np.uint16),
        (".webp", np.uint8),
        (".tif", np.uint8),
        (".tif", np.uint16),
        (".tif", np.float32),
        (".exr", np.float32),
    ],
)
def test_lossless_kinds_keep_their_stored_values(tmp_path: Path, extension: str, dtype: type) -> None:
    views = random_views(2, 3, dtype=dtype)
    light_field = open_light_field(save_views(tmp_path, views, lambda row, column: f"v_{row}_{column}{extension}"))
    assert light_field.views.dtype == dtype
    np.testing.assert_array_equal(light_field.views, views)


def test_jpeg_views_come_close(tmp_path: Path) -> None:
    ramp = np.linspace(20, 230, 40)[None, :, None] + np.zeros((24, 40, 3))
    views = np.broadcast_to(ramp.astype(np.uint8), (2, 2, 24, 40, 3))
    light_field = open_light_field(save_views(tmp_path, views, lambda row, column: f"v_{row}_{column}.jpg"))
    assert np.abs(light_field.views.astype(int) - views).max() <= 4


def test_half_float_exr_becomes_float32_and_bad_values_are_set_to_zero(tmp_path: Path) -> None:
    views = random_views(2, 2, dtype=np.float32).astype(np.float16).astype(np.float32)
    expected = views.copy()
    views[1, 0, 3, 4] = (np.nan, np.inf, -np.inf)
    expected[1, 0, 3, 4] = 0
    for row, column in itertools.product(range(2), range(2)):
        save(tmp_path / f"v_{row}_{column}.exr", views[row, column], depth="half")
    light_field = open_light_field(tmp_path)
    np.testing.assert_array_equal(light_field.views, expected)
    assert light_field.warnings == ("3 values that are no finite numbers were set to 0 (first in v_1_0.exr).",)


def test_alpha_is_dropped_and_colours_of_transparent_pixels_kept(tmp_path: Path) -> None:
    views = random_views(2, 2)
    with_alpha = np.concatenate([views, random_views(2, 2)[..., :1] // 2], axis=-1)
    light_field = open_light_field(save_views(tmp_path, with_alpha, plain))
    np.testing.assert_array_equal(light_field.views, views)


def test_grey_views_are_repeated_into_three_channels(tmp_path: Path) -> None:
    views = random_views(2, 2)[..., :1]
    light_field = open_light_field(save_views(tmp_path, views, plain))
    np.testing.assert_array_equal(light_field.views, np.repeat(views, 3, axis=-1))
    assert "grey" in light_field.facts["Colour"]


def test_corner_views_alone_make_a_two_by_two_grid(tmp_path: Path) -> None:
    views = random_views(2, 2)
    folder = save_views(tmp_path, views, lambda row, column: f"view_{row * 7:02}_{column * 7:02}.png")
    light_field = open_light_field(folder)
    assert light_field.kind == "corner views"
    np.testing.assert_array_equal(light_field.views, views)


def hci_config(rows: int, columns: int) -> str:
    return (
        "[intrinsics]\nfocal_length_mm = 100.0\n\n[extrinsics]\n"
        f"num_cams_x = {columns}\nnum_cams_y = {rows}\nbaseline_mm = 50.0\nfocus_distance_m = 8.0\n\n"
        "[meta]\nscene = made\ndisp_min = -1.5\ndisp_max = 2.0\n"
    )


def test_hci_folder_takes_its_grid_from_parameters_cfg(tmp_path: Path) -> None:
    views = random_views(2, 5)
    folder = save_views(tmp_path, views, lambda row, column: f"input_Cam{row * 5 + column:03}.png")
    (folder / "parameters.cfg").write_text(hci_config(2, 5))
    save(folder / "gt_depth_lowres_Cam000.png", views[0, 0])
    light_field = open_light_field(folder)
    assert light_field.kind == "HCI folder"
    np.testing.assert_array_equal(light_field.views, views)
    assert light_field.facts["Baseline"].startswith("50.0 mm")
    assert light_field.facts["Disparity stated"].startswith("-2 to 1.5 px")


def test_hci_folder_without_parameters_is_taken_for_a_square(tmp_path: Path) -> None:
    views = random_views(3, 3)
    folder = save_views(tmp_path, views, lambda row, column: f"input_Cam{row * 3 + column:03}.png")
    light_field = open_light_field(folder)
    np.testing.assert_array_equal(light_field.views, views)
    assert "3 x 3" in light_field.warnings[0]
    (folder / "input_Cam004.png").unlink()
    assert "make no square grid" in refusal(folder)
    (folder / "parameters.cfg").write_text(hci_config(3, 3))
    assert "lacks the view input_Cam004" in refusal(folder)
    (folder / "parameters.cfg").write_text("[extrinsics]\nnum_cams_x = many\n")
    assert "num_cams_x" in refusal(folder)


def moving_views(rows: int, columns: int, disparity: float) -> np.ndarray:
    """A textured plane whose content moves by `disparity` px along x (y) from the first to the last column (row)."""
    generator = np.random.default_rng(7)
    waves = generator.uniform(-0.8, 0.8, (50, 2))
    phases = generator.uniform(0, 6.3, 50)
    y, x = np.mgrid[:120, :160].astype(np.float64)
    views = np.empty((rows, columns, 120, 160, 3), np.uint8)
    for row, column in itertools.product(range(rows), range(columns)):
        moved_y, moved_x = y - disparity * row / (rows - 1), x - disparity * column / (columns - 1)
        picture = np.sin(waves[:, 0] * moved_y[..., None] + waves[:, 1] * moved_x[..., None] + phases).mean(axis=-1)
        views[row, column] = np.clip(127 + 300 * picture, 0, 255)[..., None]
    return views


@pytest.mark.parametrize("rows_upwards", [False, True])
@pytest.mark.parametrize("columns_leftwards", [False, True])
def test_gantry_folder_is_put_in_the_order_of_the_camera_and_the_pictures(
    tmp_path: Path, rows_upwards: bool, columns_leftwards: bool
) -> None:
    views = moving_views(3, 4, -5.0)

    def name(row: int, column: int) -> str:
        # The camera's x grows with our column, whatever the names count.
        named_row = 2 - row if rows_upwards else row
        named_column = 3 - column if columns_leftwards else column
        return f"out_{named_row:02}_{named_column:02}_{-381.9 + row:.6f}_{1103.376 + 8 * column:.6f}_.png"

    light_field = open_light_field(save_views(tmp_path, views, name))
    assert light_field.kind == "Stanford gantry folder"
    np.testing.assert_array_equal(light_field.views, views)
    assert ("Column order" in light_field.facts) == columns_leftwards
    assert ("Row order" in light_field.facts) == rows_upwards


def test_a_reversed_folder_is_named_when_it_is_opened_and_described(tmp_path: Path) -> None:
    views = moving_views(3, 3, 4.0)
    folder = save_views(tmp_path, views[::-1], plain)
    light_field = open_light_field(folder)
    assert "reversed" in light_field.warnings[0]
    facts = describe(light_field)
    assert "reversed" in facts["Order of views"]
    assert json.loads(json.dumps(facts)) == facts
    assert facts["Views"] == "3 rows x 3 columns"


def test_a_view_opens_its_folder_and_a_lone_subfolder_is_entered(tmp_path: Path) -> None:
    views = random_views(2, 3)
    outer = tmp_path / "Blütenträume und Äpfel"
    inner = save_views(outer / "rectified views", views, plain)
    for path in (outer, inner, inner / "view_01_02.png", os.fspath(outer)):
        np.testing.assert_array_equal(open_light_field(path).views, views)
    assert open_light_field(outer).name == outer.name
    save_views(outer / "others", views, plain)
    assert "open one of them" in refusal(outer)


def test_other_pictures_beside_the_views_are_left_out(tmp_path: Path) -> None:
    views = random_views(3, 3)
    folder = save_views(tmp_path, views, plain)
    save(folder / "thumbnail.png", views[0, 0, :4, :5])
    save_views(folder, views, lambda row, column: f"depth_{row}_{column}.png")
    light_field = open_light_field(folder)
    np.testing.assert_array_equal(light_field.views, views)
    assert light_field.facts["Other pictures"].startswith("10 ")


def test_progress_rises_to_one_and_cancelling_stops(tmp_path: Path) -> None:
    folder = save_views(tmp_path, random_views(4, 4), plain)
    seen: list[float] = []
    open_light_field(folder, progress=seen.append)
    assert seen == sorted(seen)
    assert seen[-1] == 1.0
    with pytest.raises(Cancelled):
        open_light_field(folder, cancelled=lambda: True)


# ESLF


def eslf_picture(rows: int, columns: int, channels: int = 3, dtype: type = np.uint8) -> np.ndarray:
    """A picture of rows x columns microlenses, each pixel different enough to tell views and places apart."""
    generator = np.random.default_rng(11)
    return generator.integers(0, np.iinfo(dtype).max, (rows * 14, columns * 14, channels), dtype=dtype)


def as_eslf(views: np.ndarray) -> np.ndarray:
    """(14, 14, H, W, 3) to the picture whose [r::14, c::14] they are."""
    _, _, height, width, _ = views.shape
    return views.transpose(2, 0, 3, 1, 4).reshape(height * 14, width * 14, 3)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("channels", [1, 3, 4])
def test_eslf_is_sliced_into_views(tmp_path: Path, dtype: type, channels: int) -> None:
    picture = eslf_picture(21, 33, channels, dtype)
    path = save(tmp_path / "flower eslf.png", picture)
    colours = picture[..., : 3 if channels > 1 else 1]
    whole = open_light_field(path, views=14)
    middle = open_light_field(path)
    assert whole.views.shape == (14, 14, 21, 33, 3)
    assert middle.views.shape == (8, 8, 21, 33, 3)
    assert whole.views.dtype == middle.views.dtype == dtype
    for row, column in itertools.product(range(14), range(14)):
        truth = np.broadcast_to(colours[row::14, column::14], (21, 33, 3))
        np.testing.assert_array_equal(whole.views[row, column], truth)
        if 3 <= row <= 10 and 3 <= column <= 10:
            np.testing.assert_array_equal(middle.views[row - 3, column - 3], truth)


def test_eslf_opens_from_a_tiled_tiff(tmp_path: Path) -> None:
    picture = eslf_picture(20, 24, dtype=np.uint16)
    light_field = open_light_field(save(tmp_path / "tiled.tif", picture, tile=64))
    np.testing.assert_array_equal(light_field.views[2, 5], picture[5::14, 8::14])


def test_dark_outer_views_of_an_eslf_are_marked(tmp_path: Path) -> None:
    views = np.broadcast_to(moving_views(2, 2, 0.0)[0, 0], (14, 14, 120, 160, 3)).copy()
    expected = set()
    for row, column in itertools.product(range(14), range(14)):
        if np.hypot(row - 6.5, column - 6.5) > 7.2:
            views[row, column] //= 4
            expected.add((row, column))
    path = save(tmp_path / "dark.png", as_eslf(views))
    light_field = open_light_field(path, views=14)
    assert light_field.dark == expected
    assert any("dark" in warning for warning in light_field.warnings)
    middle = open_light_field(path)
    assert not middle.dark
    assert not middle.warnings


def test_a_photograph_whose_size_divides_is_warned_about(tmp_path: Path) -> None:
    generator = np.random.default_rng(3)
    coarse = generator.integers(0, 255, (105, 196, 3), dtype=np.uint8)
    photograph = np.repeat(np.repeat(coarse, 4, axis=0), 3, axis=1)  # 420 x 588: divides, yet has no period of 14 px
    light_field = open_light_field(save(tmp_path / "photo.png", photograph))
    assert any("ordinary photograph" in warning for warning in light_field.warnings)


def test_eslf_progress_rises_to_one_and_cancelling_stops(tmp_path: Path) -> None:
    path = save(tmp_path / "eslf.png", eslf_picture(30, 20))
    seen: list[float] = []
    open_light_field(path, progress=seen.append)
    assert len(seen) > 3
    assert seen == sorted(set(seen))
    assert seen[-1] == 1.0
    with pytest.raises(Cancelled):
        open_light_field(path, cancelled=lambda: len(seen) > 0)


# Bad input


def test_missing_paths_and_things_that_are_no_light_field(tmp_path: Path) -> None:
    assert "does not exist" in refusal(tmp_path / "nowhere")
    assert "empty folder" in refusal(tmp_path)
    (tmp_path / "notes.txt").write_text("no picture")
    assert "holds no pictures" in refusal(tmp_path)
    assert "is no picture" in refusal(tmp_path / "notes.txt")
    (tmp_path / "empty.png").touch()
    assert "is empty" in refusal(tmp_path / "empty.png")
    (tmp_path / "text.png").write_text("no picture at all")
    assert "not a readable picture" in refusal(tmp_path / "text.png")
    os.mkfifo(tmp_path / "pipe.png")
    assert "neither a file nor a folder" in refusal(tmp_path / "pipe.png")


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="Windows has no such permissions")
def test_files_and_folders_without_permission() -> None:
    with tempfile.TemporaryDirectory() as place:  # tmp_path lies in a folder that others may not enter at all
        Path(place).chmod(0o755)
        folder = save_views(Path(place) / "views", random_views(2, 2), plain)
        folder.chmod(0o755)
        with without_privileges():
            assert open_light_field(folder).views.shape[:2] == (2, 2)
        (folder / "view_01_01.png").chmod(0)
        with without_privileges():
            assert "Permission denied" in refusal(folder)
        folder.chmod(0)
        with without_privileges():
            assert "Permission denied" in refusal(folder)
        folder.chmod(0o700)


def test_a_lytro_container_is_recognised_by_its_magic(tmp_path: Path) -> None:
    path = tmp_path / "IMG_0001.png"
    path.write_bytes(b"\x89LFP\r\n\x1a\n" + struct.pack(">II", 1, 0) + bytes(100))
    message = refusal(path)
    assert "section 1 of the Lytro container" in message


def test_a_picture_that_does_not_divide_or_is_asked_for_too_many_views(tmp_path: Path) -> None:
    path = save(tmp_path / "odd.png", random_views(1, 1, 14 * 20 + 1, 14 * 20)[0, 0])
    assert "280 x 281" in refusal(path)
    even = save(tmp_path / "even_eslf.png", eslf_picture(20, 20))
    for count in (1, 15, -3):
        assert "ask for 2 to 14" in refusal(even, views=count)


@pytest.mark.parametrize("extension", [".png", ".webp", ".jpg", ".tif", ".exr"])
def test_a_truncated_view_is_named(tmp_path: Path, extension: str) -> None:
    dtype = np.float32 if extension == ".exr" else np.uint8
    folder = save_views(tmp_path, random_views(2, 2, 60, 80, dtype), lambda row, column: f"v_{row}_{column}{extension}")
    broken = folder / f"v_1_0{extension}"
    broken.write_bytes(broken.read_bytes()[: broken.stat().st_size // 2])
    assert broken.name in refusal(folder)


@pytest.mark.parametrize("extension", [".png", ".webp", ".jpg", ".tif", ".exr"])
def test_damaged_bytes_give_a_picture_or_a_sentence(tmp_path: Path, extension: str) -> None:
    dtype = np.float32 if extension == ".exr" else np.uint8
    folder = save_views(tmp_path, random_views(2, 2, 40, 50, dtype), lambda row, column: f"v_{row}_{column}{extension}")
    broken = folder / f"v_1_0{extension}"
    intact = broken.read_bytes()
    generator = np.random.default_rng(4)
    refused = 0
    for _ in range(40):
        damaged = bytearray(intact)
        # Most of what can go wrong stands in the header.
        for place in generator.integers(0, min(len(intact), 250), 4):
            damaged[place] = generator.integers(0, 256)
        broken.write_bytes(damaged)
        try:
            open_light_field(folder)
        except InputError as error:
            refused += 1
            assert "\n" not in str(error)
    assert refused > 5


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux allows names that are no text")
def test_names_that_are_no_text_are_refused(tmp_path: Path) -> None:
    folder = Path(os.fsdecode(os.fsencode(tmp_path) + b"/\xff\xfe"))
    for row, column in itertools.product(range(2), range(2)):
        source = save(tmp_path / plain(row, column), random_views(2, 2)[row, column])
        folder.mkdir(exist_ok=True)
        source.rename(folder / source.name)
    assert "not valid UTF-8" in refusal(folder)


def test_a_truncated_eslf_is_refused(tmp_path: Path) -> None:
    path = save(tmp_path / "eslf.png", eslf_picture(20, 20))
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    assert "damaged or cut off" in refusal(path)


def test_views_that_do_not_make_a_grid(tmp_path: Path) -> None:
    views = random_views(3, 3)
    folder = save_views(tmp_path / "gap", views, plain)
    (folder / "view_01_02.png").unlink()
    assert "lacks the view in row 1, column 2" in refusal(folder)
    (folder / "view_01_00.png").unlink()
    (folder / "view_01_01.png").unlink()
    np.testing.assert_array_equal(open_light_field(folder).views, views[::2])

    uneven = save_views(tmp_path / "uneven", views, lambda row, column: f"view_{row}_{(0, 1, 3)[column]}.png")
    assert "lacks column 2" in refusal(uneven)
    row_only = save_views(tmp_path / "row", views[:1], plain)
    assert "single row or column" in refusal(row_only)
    frames = save_views(tmp_path / "frames", views, lambda row, column: f"frame{row * 3 + column:03}.png")
    assert "do not give a row and a column" in refusal(frames)
    lonely = save_views(tmp_path / "one", views[:1, :1], plain)
    assert "one view only" in refusal(lonely)
    twice = save_views(tmp_path / "twice", views, plain)
    save(twice / "view_1_1.png", views[1, 1])
    assert "twice" in refusal(twice)
    two_sets = save_views(tmp_path / "two", views, lambda row, column: f"left_{row}_{column}.png")
    save_views(two_sets, views, lambda row, column: f"right_{row}_{column}.png")
    assert "two sets" in refusal(two_sets)


def test_views_of_another_size_or_depth_are_named(tmp_path: Path) -> None:
    views = random_views(2, 2)
    folder = save_views(tmp_path, views, plain)
    save(folder / "view_01_01.png", views[0, 0, :-1])
    message = refusal(folder)
    assert "view_01_01.png" in message
    assert "30 x 19" in message
    save(folder / "view_01_01.png", views[0, 0].astype(np.uint16))
    assert "16 bit" in refusal(folder)


def huge_png(path: Path, width: int, height: int) -> Path:
    """A valid header of a huge picture; padding keeps OpenImageIO itself from calling it malicious."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0))
    path.write_bytes(head + chunk(b"IDAT", bytes(2_000_000)) + chunk(b"IEND", b""))
    return path


def test_huge_headers_are_refused_before_memory_is_taken(tmp_path: Path) -> None:
    for size in ((60000, 60000), (14 * 4300, 14 * 4300)):
        assert "claims" in refusal(huge_png(tmp_path / "huge.png", *size))
    folder = tmp_path / "views"
    folder.mkdir()
    for row, column in itertools.product(range(5), range(5)):
        huge_png(folder / plain(row, column), 9000, 9000)
    message = refusal(folder)
    assert "25 views of 9000 x 9000 px" in message
    assert f"at most {images.MAX_BYTES >> 30} GiB" in message


def test_values_of_an_unusual_depth_are_refused(tmp_path: Path) -> None:
    views = random_views(2, 2)
    folder = save_views(tmp_path, views.astype(np.uint32), lambda row, column: f"v_{row}_{column}.tif")
    assert "uint" in refusal(folder)
