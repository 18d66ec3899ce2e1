"""From hexagonal to square: ramps stay ramps, waves stay waves, and no row is softer than its neighbour."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch

from lfcore.decode.grid import regular_grid
from lfcore.decode.resample import (
    HALF_ROW,
    PictureGrid,
    centres_inside,
    lens_columns,
    lens_rows,
    picture_grid,
    resample,
)

SENSOR = (520, 640)


def _picture(step: float, rotation: float = 0.0) -> PictureGrid:
    return picture_grid(regular_grid((321.3, 255.8), 14.3, rotation), SENSOR, step)


def _resampled(picture: PictureGrid, light) -> np.ndarray:  # type: ignore[no-untyped-def]
    """Values of light(x, y), a function of the sensor's px, at the microlenses, resampled to the pixels."""
    rows, columns = lens_rows(picture, 0, picture.height), lens_columns(picture)
    j, i = np.meshgrid(np.arange(*rows), np.arange(*columns), indexing="ij")
    x, y = np.moveaxis(picture.grid.centres(j, i), -1, 0)
    lenses = torch.from_numpy(np.asarray(light(x, y), np.float32)[..., None])
    return resample(lenses, rows, columns, picture, 0, picture.height)[..., 0].numpy()


@pytest.mark.parametrize(("sensor", "pitch", "size"), [((5368, 7728), 14.2857, (376, 541)), ((3280, 3280), 10.0, (328, 328))])
def test_views_have_the_size_that_the_eslf_has(sensor, pitch, size) -> None:  # type: ignore[no-untyped-def]
    picture = picture_grid(regular_grid((sensor[1] / 2, sensor[0] / 2), pitch), sensor, 1.0)
    assert (picture.height, picture.width) == size


def test_every_row_of_microlenses_can_be_kept() -> None:
    picture = picture_grid(regular_grid((3864.0, 2684.0), 14.2857), (5368, 7728), HALF_ROW)
    assert (picture.height, picture.width) == (434, 625)
    assert picture.first_row == int(picture.first_row)


@pytest.mark.parametrize("step", [1.0, HALF_ROW])
@pytest.mark.parametrize("rotation", [0.0, 0.05])
def test_ramps_stay_ramps(step: float, rotation: float) -> None:
    picture = _picture(step, rotation)
    x, y = np.moveaxis(picture.positions, -1, 0)
    np.testing.assert_allclose(
        _resampled(picture, lambda x, y: 0.2 + 0.01 * x - 0.02 * y), 0.2 + 0.01 * x - 0.02 * y, atol=0.02
    )


@pytest.mark.parametrize("step", [1.0, HALF_ROW])
def test_waves_stay_waves_in_every_row(step: float) -> None:
    picture = _picture(step)
    frequency = 0.25 / 14.3  # cycles per px: half of what the pixels can hold

    def light(x, y):  # type: ignore[no-untyped-def]
        return np.cos(2 * math.pi * frequency * x)

    x, _ = np.moveaxis(picture.positions, -1, 0)
    error = _resampled(picture, light) - light(x, 0)
    by_row = np.sqrt((error[4:-4, 4:-4] ** 2).mean(axis=1))
    assert by_row.max() < 0.03
    assert by_row.max() < 1.2 * by_row.min() + 2e-3  # the comb would make every other row worse


def test_pieces_make_the_same_picture_as_the_whole() -> None:
    picture = _picture(1.0)
    draw = torch.Generator().manual_seed(0)
    columns, rows = lens_columns(picture), lens_rows(picture, 0, picture.height)
    lenses = torch.rand(rows[1] - rows[0], columns[1] - columns[0], 2, generator=draw)
    whole = resample(lenses, rows, columns, picture, 0, picture.height)
    begin, end = 11, 17
    part = lens_rows(picture, begin, end)
    piece = resample(lenses[part[0] - rows[0] : part[1] - rows[0]], part, columns, picture, begin, end)
    torch.testing.assert_close(piece, whole[begin:end])


@pytest.mark.parametrize("rotation", [0.0, 0.1])
def test_microlenses_beyond_the_edge_are_replaced_by_ones_inside(rotation: float) -> None:
    picture = _picture(1.0, rotation)
    rows, columns = lens_rows(picture, 0, picture.height), lens_columns(picture)
    centres = centres_inside(picture, rows, columns, SENSOR, 9.0)
    x, y = np.moveaxis(centres, -1, 0)
    assert x.min() >= 9
    assert y.min() >= 9
    assert x.max() <= SENSOR[1] - 10
    assert y.max() <= SENSOR[0] - 10
    j, i = np.meshgrid(np.arange(*rows), np.arange(*columns), indexing="ij")
    own = picture.grid.centres(j, i)
    inside = (own >= 9).all(axis=-1) & (own[..., 0] <= SENSOR[1] - 10) & (own[..., 1] <= SENSOR[0] - 10)
    np.testing.assert_array_equal(centres[inside], own[inside])
