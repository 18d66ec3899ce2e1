"""The sample light field in assets: its files, and its pictures against the true disparities kept beside them."""

from __future__ import annotations

import json
import math
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt
import OpenImageIO as oiio
import pytest

from assets import sample_path
from lfcore.formats import open_light_field

Array = npt.NDArray[np.float32]

HEIGHT, WIDTH, GRID = 376, 541, 8
LIMIT_BYTES = 8_000_000
CORNERS = ((0, 0), (0, 7), (7, 0), (7, 7))
NOVEL = (4, 4)
BORDER = 12  # px that may leave the picture when warped


def read(name: str) -> Array:
    picture = oiio.ImageBuf(str(sample_path() / name))
    values = picture.get_pixels(oiio.FLOAT)
    assert values is not None, picture.geterror()
    return np.asarray(values, np.float32)


@cache
def view(row: int, column: int) -> Array:
    return read(f"view_{row:02d}_{column:02d}.webp")


@cache
def disparity(row: int, column: int) -> Array:
    return read(f"truth/disparity_{row:02d}_{column:02d}.exr")[..., 0]


@cache
def facts() -> dict[str, Any]:
    return json.loads((sample_path() / "sample.json").read_text())


def bilinear(picture: Array, x: Array, y: Array) -> Array:
    """Sample (H, W, C) at pixel positions inside it; slow and plain, independent of the program's own warp."""
    left = np.clip(np.floor(x).astype(int), 0, picture.shape[1] - 2)
    top = np.clip(np.floor(y).astype(int), 0, picture.shape[0] - 2)
    fx, fy = (x - left)[..., None], (y - top)[..., None]
    upper = picture[top, left] * (1 - fx) + picture[top, left + 1] * fx
    lower = picture[top + 1, left] * (1 - fx) + picture[top + 1, left + 1] * fx
    return upper * (1 - fy) + lower * fy


def where_in(corner: tuple[int, int], shift: Array) -> tuple[Array, Array]:
    """Where the content of each pixel of the novel view lies in a corner view: s + (p_i - q) * D(s)."""
    y, x = np.mgrid[:HEIGHT, :WIDTH].astype(np.float32)
    last = GRID - 1
    return x + (corner[1] - NOVEL[1]) / last * shift, y + (corner[0] - NOVEL[0]) / last * shift


def inside(picture: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """The picture without its border."""
    return picture[BORDER:-BORDER, BORDER:-BORDER]


@cache
def disparity_of_corner_there(corner: tuple[int, int]) -> tuple[Array, Array]:
    """The corner's own disparity where the novel view's content should be: the least and the greatest of the 2 x 2 around.

    No interpolation: between two surfaces there is no surface.
    """
    x, y = where_in(corner, disparity(*NOVEL))
    truth = disparity(*corner)
    left = np.clip(np.floor(x).astype(int), 0, WIDTH - 2)
    top = np.clip(np.floor(y).astype(int), 0, HEIGHT - 2)
    around = np.stack([truth[top + j, left + i] for j in (0, 1) for i in (0, 1)])
    return around.min(axis=0), around.max(axis=0)


@cache
def visible_in(corner: tuple[int, int]) -> npt.NDArray[np.bool_]:
    """Pixels of the novel view whose surface the corner view sees too, away from edges of depth."""
    low, high = disparity_of_corner_there(corner)
    here = disparity(*NOVEL)
    return (np.abs(low - here) < 0.15) & (np.abs(high - here) < 0.15)


def colour_errors(sign_x: float, sign_y: float) -> Array:
    """Absolute errors of the four corners warped to the novel view, at the pixels that they see."""
    errors = []
    for corner in CORNERS:
        x, y = where_in(corner, disparity(*NOVEL))
        rows, columns = np.mgrid[:HEIGHT, :WIDTH].astype(np.float32)
        warped = bilinear(view(*corner), columns + sign_x * (x - columns), rows + sign_y * (y - rows))
        difference = np.abs(warped - view(*NOVEL)).mean(axis=-1)
        errors.append(inside(difference)[inside(visible_in(corner))])
    return np.concatenate(errors)


def test_there_are_64_views_of_one_size_in_8_bits() -> None:
    names = sorted(path.name for path in sample_path().glob("*.webp"))
    assert names == [f"view_{row:02d}_{column:02d}.webp" for row in range(GRID) for column in range(GRID)]
    for name in names:
        spec = oiio.ImageBuf(str(sample_path() / name)).spec()
        assert (spec.height, spec.width, spec.nchannels, str(spec.format)) == (HEIGHT, WIDTH, 3, "uint8")


def test_everything_together_is_within_the_size_limit() -> None:
    files = [path for path in sample_path().rglob("*") if path.is_file()]
    assert sum(path.stat().st_size for path in files) <= LIMIT_BYTES


def test_it_opens_without_a_warning() -> None:
    light_field = open_light_field(sample_path())
    assert light_field.views.shape == (GRID, GRID, HEIGHT, WIDTH, 3)
    assert not light_field.warnings
    assert not light_field.dark


def test_the_exposure_uses_the_whole_range() -> None:
    low, middle, high = np.percentile(view(*NOVEL), [1, 50, 99])
    assert low < 0.1
    assert 0.3 < middle < 0.7
    assert 0.85 < high < 1


@pytest.mark.parametrize("position", [*CORNERS, NOVEL])
def test_true_disparities_have_the_stated_range(position: tuple[int, int]) -> None:
    truth = disparity(*position)
    assert truth.shape == (HEIGHT, WIDTH)
    assert np.isfinite(truth).all()
    low, high = facts()["disparity"]["range_px"]
    assert -9.5 < low - 0.01 <= truth.min() < -7
    assert 7 < truth.max() <= high + 0.01 < 9


@pytest.mark.parametrize("position", [*CORNERS, NOVEL])
def test_the_table_lies_where_geometry_puts_it(position: tuple[int, int]) -> None:
    """The table's top is the plane z = 0: its depth follows from the camera's height and pitch alone."""
    rig = facts()["rig"]
    focal, zero, baseline = rig["focal_px"], rig["zero_plane_m"], rig["baseline_m"]
    pitch = math.radians(rig["pitch_degrees"])
    down = baseline * (position[0] / (GRID - 1) - 0.5)
    rows = np.arange(345, 370)
    slope = (rows + 0.5 - HEIGHT / 2) / focal - down / zero  # of the ray through the row, downwards
    depth = (rig["centre"][2] - down * math.cos(pitch)) / (math.sin(pitch) + slope * math.cos(pitch))
    expected = focal * baseline * (1 / zero - 1 / depth)
    bare_wood = disparity(*position)[rows, 8]
    # Planks lie up to 0.6 mm higher or lower than one another.
    np.testing.assert_allclose(bare_wood, expected, atol=0.02)


def test_the_disparities_of_the_views_agree_where_both_see_a_surface() -> None:
    for corner in CORNERS:
        assert inside(visible_in(corner)).mean() > 0.7


def test_what_hides_a_surface_is_nearer_than_it() -> None:
    """Near things have the lower disparity, and they hide the farther ones."""
    for corner in CORNERS:
        low, high = disparity_of_corner_there(corner)
        here = disparity(*NOVEL)
        hidden = inside(high < here - 0.5)
        impossible = inside(low > here + 0.5)
        assert hidden.mean() > 0.01
        assert impossible.mean() < 0.05 * hidden.mean()


def test_corners_warped_by_the_true_disparity_agree_with_the_view_between() -> None:
    errors = colour_errors(1, 1)
    assert np.median(errors) < 0.02
    assert (errors < 0.06).mean() > 0.85


@pytest.mark.parametrize("signs", [(-1, -1), (-1, 1), (1, -1)])
def test_a_disparity_of_the_wrong_sign_is_much_worse(signs: tuple[int, int]) -> None:
    assert np.mean(colour_errors(*signs)) > 1.8 * np.mean(colour_errors(1, 1))


def test_swapped_rows_and_columns_are_much_worse() -> None:
    """The corner at the top right taken for the one at the bottom left, and the reverse."""
    swapped = []
    for corner in ((0, 7), (7, 0)):
        x, y = where_in((corner[1], corner[0]), disparity(*NOVEL))
        difference = np.abs(bilinear(view(*corner), x, y) - view(*NOVEL)).mean(axis=-1)
        swapped.append(inside(difference)[inside(visible_in(corner))])
    assert np.mean(np.concatenate(swapped)) > 1.8 * np.mean(colour_errors(1, 1))
