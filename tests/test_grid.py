"""The grid of microlenses: numbered, found in white images and captures of the model camera, held against the metadata."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from lfcore.camera_model import expose, f01, illum, white_image
from lfcore.decode.grid import LensGrid, regular_grid
from lfcore.decode.grid_check import check_metadata
from lfcore.decode.grid_fit import GridNotFound, grid_of_capture, grid_of_white_image
from lfcore.formats.lytro.metadata import LensletGeometry
from tests.camera_truth import grid_errors, small
from tests.plane_scenes import slanted_scene


def test_centres_form_a_regular_hexagonal_grid() -> None:
    grid = regular_grid((100.0, 50.0), 14.0, 0.1)
    rows, columns = np.meshgrid(np.arange(-3, 4), np.arange(-3, 4), indexing="ij")
    centres = grid.centres(rows, columns).reshape(-1, 2)
    middle = grid.centres(0, 0)
    away = np.sort(np.hypot(*(centres - middle).T))
    assert away[0] == 0
    np.testing.assert_allclose(away[1:7], 14.0)  # six neighbours at the pitch, the next ones at sqrt(3) pitches
    np.testing.assert_allclose(away[7], 14 * math.sqrt(3))
    assert grid.rotation == pytest.approx(0.1)
    assert grid.row_scale == pytest.approx(1.0)


def test_nearest_agrees_with_a_search_through_all_microlenses() -> None:
    grid = LensGrid((3.0, -2.0), (9.8, 1.1), (-0.9, 8.7))
    draw = np.random.default_rng(1)
    x, y = draw.uniform(-60, 60, (2, 500))
    rows, columns = np.meshgrid(np.arange(-14, 15), np.arange(-14, 15), indexing="ij")
    everywhere = grid.centres(rows, columns).reshape(-1, 2)
    distances = np.hypot(x[:, None] - everywhere[:, 0], y[:, None] - everywhere[:, 1])
    found = grid.centres(*grid.nearest(x, y))
    np.testing.assert_allclose(np.hypot(x - found[:, 0], y - found[:, 1]), distances.min(axis=1))


def test_renumbering_changes_no_centre() -> None:
    grid = regular_grid((0.3, 0.4), 10.0, -0.05)
    renumbered = grid.numbered_from(87.0, 75.0)  # an odd row of the old numbers
    x, y = np.random.default_rng(2).uniform(-50, 150, (2, 50))
    np.testing.assert_allclose(renumbered.centres(*renumbered.nearest(x, y)), grid.centres(*grid.nearest(x, y)), atol=1e-9)
    assert math.dist(renumbered.origin, (87.0, 75.0)) < 10.0 / math.sqrt(3) + 1e-9


@pytest.mark.parametrize(
    ("camera", "rotation", "offset", "stretch"),
    [
        (small(illum(), 560, 460), 0.0005, (0.0, 0.0), 1.0),
        (small(illum(), 560, 460), -0.19, (6.3, -2.2), 1.008),
        (small(f01(), 420, 380), 0.11, (-4.1, 3.9), 0.993),
        (small(f01(), 420, 380), -0.004, (2.0, 1.0), 1.001),
    ],
)
def test_grid_is_found_whatever_its_rotation_and_phase(camera, rotation, offset, stretch) -> None:  # type: ignore[no-untyped-def]
    camera = replace(camera, rotation=rotation, offset=offset, stretch=stretch, scale=(1.0, 1.002))
    pitch = camera.lens_pitch / camera.pixel_pitch
    white = grid_of_white_image(white_image(camera, samples=4), camera.black, pitch)
    assert grid_errors(white.grid, camera).max() < 0.05
    assert white.share == 1.0
    capture = expose(camera, slanted_scene(camera.size_in_pitches, 3), samples=4)
    found = grid_of_capture(capture, camera.black, pitch)
    # A whole sensor has sixty times as many tiles to average over: there 0.15 px are kept (docs/decoding.md).
    assert grid_errors(found.grid, camera).max() < 0.3


def test_a_picture_without_microlenses_is_not_given_a_grid() -> None:
    noise = np.random.default_rng(3).poisson(300, (500, 500)).astype(np.uint16)
    with pytest.raises(GridNotFound):
        grid_of_capture(noise, 64, 14.2857)
    with pytest.raises(GridNotFound):
        grid_of_white_image(np.full((500, 500), 400, np.uint16), 64, 14.2857)


def _told(camera, **changes):  # type: ignore[no-untyped-def]
    x, y = (shift * camera.pixel_pitch for shift in camera.offset)
    told = LensletGeometry(camera.lens_pitch, camera.pixel_pitch, camera.rotation, camera.scale, (x, y, 3e-5))
    return replace(told, **changes)


def test_wrong_metadata_is_noticed_and_named() -> None:
    camera = illum(rotation=0.002, offset=(5.0, -2.0), stretch=1.0)
    sensor = camera.height, camera.width
    assert check_metadata(camera.grid, _told(camera), sensor).agrees

    turned = check_metadata(camera.grid, _told(camera, rotation=-camera.rotation), sensor)
    assert not turned.agrees
    assert "rotation's sign" in turned.sentence

    x, y, z = _told(camera).offset
    swapped = check_metadata(camera.grid, _told(camera, offset=(y, x, z)), sensor)
    assert not swapped.agrees
    assert "swapped" in swapped.sentence

    other = check_metadata(camera.grid, _told(camera, lens_pitch=camera.lens_pitch * 1.01), sensor)
    assert not other.agrees
    assert "The picture's is used" in other.sentence
