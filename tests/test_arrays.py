"""Light fields stored as arrays in files of MATLAB and HDF5, written by other libraries and by hand."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import scipy.io

from lfcore.errors import Cancelled, InputError
from lfcore.formats import open_light_field
from lfcore.formats.array_files import stored_arrays
from lfcore.formats.arrays import layout_of
from lfcore.formats.collection import members
from lfcore.formats.glance import glance
from lfcore.lightfield import LightField
from tests.test_disparity_sign import two_planes

SHAPE = (5, 6, 40, 52)


def known_views(dtype: Any = np.uint8, channels: int = 3) -> np.ndarray:
    """Views of noise from 0 to 250, whose order pictures cannot tell: (*SHAPE, C)."""
    return np.random.default_rng(1).integers(0, 251, (*SHAPE, channels)).astype(dtype)


def write_matlab_73(path: Path, **arrays: np.ndarray) -> None:
    """As MATLAB does from 7.3 on: HDF5 behind a text of 512 bytes, the first axis densest."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in arrays.items():
            file.create_dataset(name, data=values.transpose(), chunks=True, compression="gzip")
    with path.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")


def write_hdf5(path: Path, **arrays: np.ndarray) -> None:
    with h5py.File(path, "w") as file:
        for name, values in arrays.items():
            file[name] = values


WRITERS = {
    "MATLAB 5": ("LF.mat", lambda path, **arrays: scipy.io.savemat(path, arrays)),
    "MATLAB 7, compressed": ("LF.mat", lambda path, **arrays: scipy.io.savemat(path, arrays, do_compression=True)),
    "MATLAB 7.3": ("LF.mat", write_matlab_73),
    "HDF5": ("lf.h5", write_hdf5),
}


@pytest.fixture(params=WRITERS)
def write(request: pytest.FixtureRequest, tmp_path: Path) -> Any:
    name, writer = WRITERS[request.param]

    def written(**arrays: np.ndarray) -> Path:
        writer(tmp_path / name, **arrays)
        return tmp_path / name

    return written


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
def test_views_come_as_they_are_stored(write: Any, dtype: Any) -> None:
    views = known_views(dtype)
    if dtype is np.float32:
        views = views / np.float32(250)
    light_field = open_light_field(write(LF=views, other=np.eye(3)))
    assert light_field.views.dtype == dtype
    np.testing.assert_array_equal(light_field.views, views)
    assert light_field.facts["Variable"] == "LF"


def test_the_toolboxs_weights_are_left_out(write: Any) -> None:
    views = known_views(np.uint16, channels=4)
    np.testing.assert_array_equal(open_light_field(write(LF=views)).views, views[..., :3])


def test_grey_views_are_repeated_and_the_only_array_needs_no_name(write: Any) -> None:
    views = known_views(channels=1)[..., 0]
    light_field = open_light_field(write(lightfield=views))
    np.testing.assert_array_equal(light_field.views, np.repeat(views[..., None], 3, axis=-1))
    assert "grey" in light_field.facts["Colour"]


@pytest.mark.parametrize("order", [(2, 3, 4, 0, 1), (2, 3, 0, 1, 4), (4, 0, 1, 2, 3)])
def test_axes_are_told_by_their_sizes(write: Any, order: tuple[int, ...]) -> None:
    views = known_views()
    np.testing.assert_array_equal(open_light_field(write(LF=np.ascontiguousarray(views.transpose(order)))).views, views)


@pytest.mark.parametrize(
    ("shape", "views"),
    [
        ((9, 9, 512, 512, 3), (0, 1)),
        ((15, 15, 434, 625, 4), (0, 1)),
        ((3, 3, 100, 90, 3), (0, 1)),
        ((376, 541, 3, 8, 8), (3, 4)),
    ],
)
def test_layouts_of_known_data_sets(shape: tuple[int, ...], views: tuple[int, int]) -> None:
    layout = layout_of(shape)
    assert layout is not None
    assert layout.views == views
    assert layout.channels == (4 if views == (0, 1) else 2)


@pytest.mark.parametrize("shape", [(512, 512, 3), (1, 9, 512, 512, 3), (5, 5, 6, 6, 3), (9, 9, 512, 512, 5), (2,) * 6])
def test_other_arrays_are_no_light_fields(shape: tuple[int, ...]) -> None:
    assert layout_of(shape) is None


@pytest.mark.parametrize(("kind", "factor", "dtype"), [(np.float64, 1, np.uint8), (np.int32, 200, np.uint16)])
def test_whole_numbers_become_8_or_16_bit(write: Any, kind: Any, factor: int, dtype: Any) -> None:
    views = known_views(kind) * factor
    light_field = open_light_field(write(LF=views))
    assert light_field.views.dtype == dtype
    np.testing.assert_array_equal(light_field.views, views)


def test_numbers_out_of_range_are_refused(write: Any) -> None:
    with pytest.raises(InputError, match="whole numbers from -5 to"):
        open_light_field(write(LF=known_views(np.int32) - 5))


def test_values_that_are_no_numbers_are_set_to_0(write: Any) -> None:
    views = known_views(np.float64) / 250
    views[1, 2, 3, 4] = np.nan, np.inf, -np.inf
    light_field = open_light_field(write(LF=views))
    assert light_field.views.dtype == np.float32
    assert not light_field.views[1, 2, 3, 4].any()
    assert light_field.warnings == ("3 values that are no finite numbers were set to 0.",)


def test_of_a_grid_with_dark_corners_the_middle_is_taken(write: Any) -> None:
    views = np.full((12, 13, 20, 24, 3), 200, np.uint8)
    views[:, :, 0, 0, 0] = np.arange(12)[:, None]
    views[:, :, 0, 0, 1] = np.arange(13)
    for corner in ((0, 0), (0, -1), (-1, 0), (-1, -1)):
        views[corner] //= 10
    path = write(LF=views)
    light_field = open_light_field(path)
    np.testing.assert_array_equal(light_field.views, views[2:10, 2:10])
    assert "middle 8 x 8 of 12 x 13" in light_field.facts["Views taken"]
    assert not light_field.dark
    assert open_light_field(path, views=14).views.shape[:2] == (12, 13)


def test_rows_that_run_against_the_pictures_are_reversed(write: Any) -> None:
    views = two_planes(near=6.0, far=-3.0)
    light_field = open_light_field(write(LF=np.ascontiguousarray(views[:, ::-1])))
    np.testing.assert_array_equal(light_field.views, views[::-1, ::-1])
    assert "Row order" in light_field.facts
    assert not light_field.warnings


def test_progress_rises_to_its_end_and_reading_is_cancelled(write: Any) -> None:
    path = write(LF=known_views())
    seen: list[float] = []
    open_light_field(path, progress=seen.append)
    assert seen == sorted(seen)
    assert seen[-1] == 1.0
    with pytest.raises(Cancelled):
        open_light_field(path, cancelled=lambda: True)


def test_what_the_file_holds_is_said_where_it_is_no_light_field(write: Any) -> None:
    with pytest.raises(InputError, match=r"holds depth \(30 x 40\); expected an array of views"):
        open_light_field(write(depth=np.zeros((30, 40))))
    with pytest.raises(InputError, match=r"2 arrays that may be light fields \(one, two\); name one of them LF"):
        open_light_field(write(one=known_views(), two=known_views()))


def test_damaged_and_cut_off_files_are_told(write: Any) -> None:
    path = write(LF=known_views())
    whole = path.read_bytes()
    for kept in (600, len(whole) // 2, len(whole) - 50):
        path.write_bytes(whole[:kept])
        with pytest.raises(InputError, match=r"damaged|no array|holds"):
            open_light_field(path)


def test_bytes_changed_at_random_give_views_or_a_sentence(write: Any) -> None:
    path = write(LF=known_views())
    whole = path.read_bytes()
    generator = np.random.default_rng(3)
    opened = 0
    for _ in range(60):
        changed = bytearray(whole)
        for place in generator.integers(0, min(len(whole), 4096), 3):
            changed[place] = generator.integers(256)
        path.write_bytes(changed)
        try:
            opened += isinstance(open_light_field(path), LightField)
        except InputError as error:
            assert "\n" not in str(error)
    assert opened < 60


def test_arrays_larger_than_memory_are_refused_before_it_is_taken(tmp_path: Path) -> None:
    path = tmp_path / "huge.h5"
    with h5py.File(path, "w") as file:
        file.create_dataset("LF", (20, 20, 4000, 4000, 3), np.uint8, chunks=(1, 1, 100, 100, 3))
    assert path.stat().st_size < 2**20
    for ask in (open_light_field, glance):
        with pytest.raises(InputError, match=r"takes 17\.9 GiB; at most 4 GiB"):
            ask(path)


def test_links_to_other_files_are_not_followed(tmp_path: Path) -> None:
    write_hdf5(tmp_path / "inner.h5", LF=known_views())
    (tmp_path / "values.bin").write_bytes(known_views().tobytes())
    path = tmp_path / "outer.h5"
    with h5py.File(path, "w") as file:
        file["LF"] = h5py.ExternalLink("inner.h5", "LF")
        file.create_dataset("raw", (*SHAPE, 3), np.uint8, external=[(str(tmp_path / "values.bin"), 0, h5py.h5f.UNLIMITED)])
        layout = h5py.VirtualLayout((*SHAPE, 3), np.uint8)
        layout[...] = h5py.VirtualSource(tmp_path / "inner.h5", "LF", (*SHAPE, 3))
        file.create_virtual_dataset("virtual", layout)
    assert stored_arrays(path) == []


def test_a_glance_shows_the_middle_view_and_folders_list_such_files(write: Any) -> None:
    views = known_views()
    path = write(LF=views)
    seen = glance(path)
    assert seen.caption == "6 × 5 views of 52 × 40 px"
    assert seen.picture is not None
    np.testing.assert_array_equal(seen.picture, views[2, 3])
    assert members(path.parent) == (path,)
