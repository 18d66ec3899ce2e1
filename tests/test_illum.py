"""What is known of an Illum's ESLF: told by the readers; colours are taken off and given back, places of views kept."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from scenes import plane

from lfcore.export import write_picture
from lfcore.formats import open_light_field
from lfcore.illum import aperture_of_part, aperture_of_views, displacement, mixing, outwardness, with_true_colours
from lfcore.illum_correction import IllumCorrection
from lfcore.lightfield import CORNERS, FloatArray, LightField
from lfcore.nearest_inputs import Cell
from lfcore.protocols import PROTOCOLS
from lfcore.synthesizer import make_synthesizer
from lfcore.training.loop import prepare_scene

ESLF_SIZE = (376, 541)  # of views, H x W


def colourful(x: FloatArray, y: FloatArray) -> FloatArray:
    """Smooth and of strong colours, far enough from 0 and 1 that nothing is cut off."""
    waves = [np.sin(0.31 * x + 0.5 * k) * np.cos(0.23 * y - 0.9 * k) for k in range(3)]
    picture: FloatArray = (0.45 + 0.3 * np.stack(waves, -1)).astype(np.float32)
    return picture


def pale(light_field: LightField, aperture: float) -> LightField:
    """Its views in the colours that such a camera stores, by the definition: each mixed by as much as it lies outward."""
    views = np.empty(light_field.views.shape, np.float32)
    for row, column in np.ndindex(light_field.rows, light_field.columns):
        matrix = mixing(aperture**2 * float(outwardness(*light_field.position(row, column))))
        views[row, column] = light_field.view(row, column) @ matrix.T
    return replace(light_field, views=views, aperture=aperture)


def displaced(disparity: float, aperture: float) -> LightField:
    """A plane whose views are shifted as those of such a camera, by the definition."""
    y, x = np.mgrid[:96, :104].astype(np.float32)
    views = np.empty((5, 5, 96, 104, 3), np.float32)
    for row, column in np.ndindex(5, 5):
        u, v = column / 4, row / 4
        more_x, more_y = displacement(aperture, u, v)
        views[row, column] = colourful(x - disparity * u - more_x, y - disparity * v - more_y)
    return LightField(views, "displaced", "", "")


def test_a_corner_view_is_as_pale_as_it_gets_and_white_stays_nearly_white() -> None:
    assert np.array_equal(mixing(0.0), np.eye(3, dtype=np.float32))
    assert [float(outwardness(u, v)) for u, v in CORNERS] == [1, 1, 1, 1] and outwardness(0.5, 0.5) == 0
    assert mixing(1.0).sum(1) == pytest.approx([1, 1, 1], abs=0.02)
    red = mixing(1.0) @ np.array([0.6, 0.2, 0.2], np.float32)
    assert red.max() - red.min() < 0.95 * 0.4


def test_views_between_the_middle_and_the_corners_are_shifted() -> None:
    for u, v in (*CORNERS, (0.5, 0.5), (1.2, -0.1)):
        assert displacement(1.0, u, v) == pytest.approx((0, 0))
    x, y = displacement(1.0, 0.8, 0.3)
    assert x < 0 < y and x == pytest.approx(-1.5 * y) and abs(x) < 0.1
    assert displacement(0.5, 0.8, 0.3) == pytest.approx((x / 8, y / 8))
    assert displacement(1.0, 0.2, 0.7) == pytest.approx((-x, -y))


def corners(size: tuple[int, int] = ESLF_SIZE, level: float = 0.1) -> FloatArray:
    return np.full((2, 2, *size, 3), level, np.float32)


def test_the_part_of_the_aperture_is_that_of_the_views_taken() -> None:
    found = [aperture_of_views(corners(), (k, k)) for k in range(1, 10)]
    assert found == pytest.approx([0, 0, 0, 4 / 7, 5 / 7, 6 / 7, 1, 0, 0])
    whole = replace(plane(1.0, (8, 8)), aperture=1.0)
    assert aperture_of_part(whole, 3) == pytest.approx(3 / 7)
    assert PROTOCOLS["7x7-y"].grid(whole).aperture == pytest.approx(6 / 7)
    assert PROTOCOLS["k16"].grid(whole).aperture == Cell.whole(whole).of(whole).aperture == 1
    assert Cell(2, 3, 1, 1).of(whole).aperture == pytest.approx(1 / 7)


def test_views_of_an_eslf_are_told_by_size_number_and_light() -> None:
    assert aperture_of_views(corners(), (7, 7)) == 1
    assert aperture_of_views(corners(ESLF_SIZE[::-1]), (7, 7)) == 1  # the camera was turned
    assert aperture_of_views((corners() * 255).astype(np.uint8), (6, 6)) == pytest.approx(6 / 7)
    assert aperture_of_views(corners(level=0.35), (7, 7)) == 0  # with a display's tone
    assert aperture_of_views(corners((434, 625)), (7, 7)) == 0  # a toolbox's
    assert aperture_of_views(corners(), (7, 6)) == 0


@pytest.mark.parametrize(("numbers", "aperture"), [((0, 7), 1), ((0, 3), 0), ((0, 1), 0)])
def test_corner_views_are_told_by_the_numbers_in_their_names(tmp_path: Path, numbers: tuple[int, int], aperture: float) -> None:
    for row in numbers:
        for column in numbers:
            write_picture(tmp_path / f"view_{row:02}_{column:02}.png", np.full((*ESLF_SIZE, 3), 20, np.uint8))
    assert open_light_field(tmp_path).aperture == aperture


def test_what_is_taken_off_a_corner_is_given_back_there() -> None:
    stored = np.random.default_rng(1).uniform(0.2, 0.8, (4, 5, 6, 3)).astype(np.float32)
    correction = IllumCorrection(0.9)
    true = correction.true(torch.from_numpy(stored).permute(0, 3, 1, 2)).permute(0, 2, 3, 1).contiguous().numpy()
    assert np.abs(true - stored).max() > 0.01
    np.testing.assert_allclose(correction.stored_of_corners(true), stored, atol=1e-6)
    for (u, v), seen, expected in zip(CORNERS, true, stored, strict=True):
        np.testing.assert_allclose(correction.stored(seen, u, v), expected, atol=1e-6)
    np.testing.assert_allclose(correction.stored(true[3], 1.25, 1.2), stored[3], atol=1e-6)  # beyond a corner as at it
    assert np.array_equal(correction.stored(true[0], 0.5, 0.5), true[0])


def test_what_is_burnt_out_stays_white() -> None:
    correction, white = IllumCorrection(1.0), np.ones((2, 3, 3), np.float32)
    true = correction.true(torch.ones(4, 3, 2, 3)).clamp(max=1).permute(0, 2, 3, 1).contiguous().numpy()
    for u, v in (*CORNERS, (0.3, 0.9), (0.5, 0.5)):
        np.testing.assert_allclose(correction.stored(true[0], u, v), white, atol=1e-6)
    np.testing.assert_allclose(correction.stored_of_corners(true), np.ones((4, 2, 3, 3)), atol=1e-6)
    yellow = np.full((1, 1, 3), (1, 1, 0.3), np.float32)
    assert correction.stored(yellow, 0, 0)[0, 0, 2] > 0.35  # not burnt out: it is paler there


def test_of_other_light_fields_nothing_is_touched() -> None:
    pictures, image = torch.rand(4, 3, 5, 6), np.ones((5, 6, 3), np.float32)
    assert IllumCorrection().true(pictures) is pictures
    assert IllumCorrection().stored(image, 0.1, 0.9) is image
    assert IllumCorrection().moves(0.3, 0.7) == (0, 0)
    field = plane(1.0)
    assert field.aperture == 0 and with_true_colours(field) is field


def test_between_pale_corners_are_the_colours_that_the_camera_stores_there() -> None:
    """A plane, whose views the classical way finds without error but for their colours."""
    field = pale(plane(3.0, (5, 5), (96, 104), colourful), 1.0)
    inner = (slice(24, -24), slice(24, -24))
    synthesizer, error = make_synthesizer("planesweep"), {}
    for told in (True, False):
        synthesizer.set_light_field(field if told else replace(field, aperture=0.0))
        for place in ((2, 2), (0, 0)):
            image = synthesizer.synthesize(*field.position(*place)).image
            error[told, place] = float(np.abs(image - field.view(*place))[inner].mean())
    assert max(error[True, place] for place in ((2, 2), (0, 0))) < 1e-4
    assert error[False, (2, 2)] > 5e-3 > error[False, (0, 0)]


@pytest.mark.parametrize("model", ["full", "realtime", "planesweep"])
def test_views_are_synthesized_where_an_illum_shows_them(model: str) -> None:
    shifted = displaced(2.0, 1.0)
    synthesizer, error = make_synthesizer(model), {}
    for told, field in ((True, pale(shifted, 1.0)), (False, shifted)):
        synthesizer.set_light_field(field)
        for place in ((2, 3), (1, 1), (0, 2)):
            image = synthesizer.synthesize(*field.position(*place)).image
            error[told, place] = float(np.abs(image - field.view(*place))[24:-24, 24:-24].mean())
    assert all(error[True, place] < (0.2 if model == "planesweep" else 1) * error[False, place] for told, place in error), error


@pytest.mark.parametrize("model", ["full", "realtime", "single", "planesweep"])
def test_a_model_sees_true_colours_and_shows_stored_ones(model: str) -> None:
    truth, corner = plane(3.0, (5, 5), (96, 104), colourful), (0.0, 1.0)
    field, correction = pale(truth, 0.9), IllumCorrection(0.9)
    synthesizer = make_synthesizer(model)
    synthesizer.set_light_field(truth)
    of_truth = synthesizer.synthesize(*corner)  # where no view is displaced
    warped_of_truth = of_truth.warped
    synthesizer.set_light_field(field)
    found = synthesizer.synthesize(*corner)
    assert np.abs(found.image - correction.stored(of_truth.image, *corner)).mean() < 2e-3  # bfloat16, on some machines
    assert np.abs(found.image - of_truth.image).mean() > 8e-3
    assert (found.warped is None) == (warped_of_truth is None) == (model == "single")
    if found.warped is not None and warped_of_truth is not None:
        expected = correction.stored_of_corners(warped_of_truth)
        assert np.median(np.abs(found.warped - expected)) < 2e-3 < np.median(np.abs(found.warped - warped_of_truth))


def test_networks_are_trained_on_true_colours() -> None:
    truth = plane(2.0, (5, 5), (96, 104), colourful)
    field = pale(truth, 0.8)
    np.testing.assert_allclose(with_true_colours(field).views, truth.views, atol=1e-6)
    prepared = prepare_scene(field).light_field
    assert prepared.aperture == 0
    np.testing.assert_allclose(prepared.views, truth.views, atol=1e-6)


def test_two_light_fields_of_other_apertures_are_not_taken_for_each_other() -> None:
    field = plane(1.0)
    assert field.content_key == plane(1.0).content_key != replace(field, aperture=0.5).content_key
