"""The outer views of an Illum's ESLF are paler than its inner ones: told by the readers, taken off, and given back."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from scenes import plane

from lfcore.camera_colours import CameraColours
from lfcore.export import write_picture
from lfcore.formats import open_light_field
from lfcore.lightfield import CORNERS, FloatArray, LightField
from lfcore.nearest_inputs import Cell
from lfcore.paleness import mixing, outwardness, paleness_of_part, paleness_of_views, with_true_colours
from lfcore.protocols import PROTOCOLS
from lfcore.synthesizer import make_synthesizer
from lfcore.training.loop import prepare_scene

ESLF_SIZE = (376, 541)  # of views, H x W


def colourful(x: FloatArray, y: FloatArray) -> FloatArray:
    """Smooth and of strong colours, far enough from 0 and 1 that nothing is cut off."""
    waves = [np.sin(0.31 * x + 0.5 * k) * np.cos(0.23 * y - 0.9 * k) for k in range(3)]
    picture: FloatArray = (0.45 + 0.3 * np.stack(waves, -1)).astype(np.float32)
    return picture


def seen_by_an_illum(light_field: LightField, paleness: float) -> LightField:
    """Its views as such a camera stores them, by the definition: each mixed by as much as it lies outward."""
    views = np.empty(light_field.views.shape, np.float32)
    for row, column in np.ndindex(light_field.rows, light_field.columns):
        matrix = mixing(paleness * float(outwardness(*light_field.position(row, column))))
        views[row, column] = light_field.view(row, column) @ matrix.T
    return replace(light_field, views=views, paleness=paleness)


def test_a_corner_view_is_as_pale_as_it_gets_and_white_stays_nearly_white() -> None:
    assert np.array_equal(mixing(0.0), np.eye(3, dtype=np.float32))
    assert [float(outwardness(u, v)) for u, v in CORNERS] == [1, 1, 1, 1] and outwardness(0.5, 0.5) == 0
    assert mixing(1.0).sum(1) == pytest.approx([1, 1, 1], abs=0.02)
    red = mixing(1.0) @ np.array([0.6, 0.2, 0.2], np.float32)
    assert red.max() - red.min() < 0.95 * 0.4


def test_of_an_eslf_it_grows_with_the_square_of_the_part_that_is_taken() -> None:
    assert [paleness_of_views(corners(), (k, k)) for k in range(1, 10)] == [0] * 3 + [(k / 7) ** 2 for k in range(4, 8)] + [
        0
    ] * 2
    whole = replace(plane(1.0, (8, 8)), paleness=1.0)
    assert paleness_of_part(whole, 3) == pytest.approx((3 / 7) ** 2)
    assert PROTOCOLS["7x7-y"].grid(whole).paleness == pytest.approx((6 / 7) ** 2)
    assert PROTOCOLS["k16"].grid(whole).paleness == Cell.whole(whole).of(whole).paleness == 1
    assert Cell(2, 3, 1, 1).of(whole).paleness == pytest.approx((1 / 7) ** 2)


def corners(size: tuple[int, int] = ESLF_SIZE, level: float = 0.1) -> FloatArray:
    return np.full((4, *size, 3), level, np.float32)


def test_views_of_an_eslf_are_told_by_size_number_and_light() -> None:
    assert paleness_of_views(corners(), (7, 7)) == 1
    assert paleness_of_views(corners(ESLF_SIZE[::-1]), (7, 7)) == 1  # the camera was turned
    assert paleness_of_views((corners() * 255).astype(np.uint8), (6, 6)) == pytest.approx((6 / 7) ** 2)
    assert paleness_of_views(corners(level=0.35), (7, 7)) == 0  # with a display's tone
    assert paleness_of_views(corners((434, 625)), (7, 7)) == 0  # a toolbox's
    assert paleness_of_views(corners(), (7, 6)) == 0


@pytest.mark.parametrize(("numbers", "paleness"), [((0, 7), 1), ((0, 3), 0), ((0, 1), 0)])
def test_corner_views_are_told_by_the_numbers_in_their_names(tmp_path: Path, numbers: tuple[int, int], paleness: float) -> None:
    for row in numbers:
        for column in numbers:
            write_picture(tmp_path / f"view_{row:02}_{column:02}.png", np.full((*ESLF_SIZE, 3), 20, np.uint8))
    assert open_light_field(tmp_path).paleness == paleness


def test_what_is_taken_off_a_corner_is_given_back_there() -> None:
    stored = np.random.default_rng(1).uniform(0.2, 0.8, (4, 5, 6, 3)).astype(np.float32)
    colours = CameraColours(0.8)
    true = colours.true(torch.from_numpy(stored).permute(0, 3, 1, 2)).permute(0, 2, 3, 1).contiguous().numpy()
    assert np.abs(true - stored).max() > 0.01
    np.testing.assert_allclose(colours.stored_of_corners(true), stored, atol=1e-6)
    for (u, v), seen, expected in zip(CORNERS, true, stored, strict=True):
        np.testing.assert_allclose(colours.stored(seen, u, v), expected, atol=1e-6)
    np.testing.assert_allclose(colours.stored(true[3], 1.25, 1.2), stored[3], atol=1e-6)  # beyond a corner as at it
    assert np.array_equal(colours.stored(true[0], 0.5, 0.5), true[0])


def test_where_there_is_none_nothing_is_touched() -> None:
    pictures, image = torch.rand(4, 3, 5, 6), np.ones((5, 6, 3), np.float32)
    assert CameraColours().true(pictures) is pictures
    assert CameraColours().stored(image, 0.1, 0.9) is image
    field = plane(1.0)
    assert with_true_colours(field) is field


def test_between_pale_corners_are_the_colours_that_the_camera_stores_there() -> None:
    """A plane, whose views the classical way finds without error but for their colours."""
    pale = seen_by_an_illum(plane(3.0, (5, 5), (96, 104), colourful), 1.0)
    inner = (slice(24, -24), slice(24, -24))
    synthesizer, error = make_synthesizer("planesweep"), {}
    for told in (True, False):
        synthesizer.set_light_field(pale if told else replace(pale, paleness=0.0))
        for place in ((2, 2), (1, 3), (0, 0)):
            image = synthesizer.synthesize(*pale.position(*place)).image
            error[told, place] = float(np.abs(image - pale.view(*place))[inner].mean())
    assert max(error[True, place] for place in ((2, 2), (1, 3), (0, 0))) < 1e-4
    assert error[False, (2, 2)] > error[False, (1, 3)] > 5e-3 > error[False, (0, 0)]


@pytest.mark.parametrize("model", ["full", "realtime", "single", "planesweep"])
def test_a_model_sees_true_colours_and_shows_stored_ones(model: str) -> None:
    truth = plane(3.0, (5, 5), (96, 104), colourful)
    pale, colours, (u, v) = seen_by_an_illum(truth, 0.8), CameraColours(0.8), (0.1, 0.9)
    synthesizer = make_synthesizer(model)
    synthesizer.set_light_field(truth)
    of_truth = synthesizer.synthesize(u, v)
    warped_of_truth = of_truth.warped
    synthesizer.set_light_field(pale)
    found = synthesizer.synthesize(u, v)
    np.testing.assert_allclose(found.image, colours.stored(of_truth.image, u, v), atol=2e-3)
    assert np.abs(found.image - of_truth.image).max() > 1e-2
    assert (found.warped is None) == (warped_of_truth is None) == (model == "single")
    if found.warped is not None and warped_of_truth is not None:
        expected = colours.stored_of_corners(warped_of_truth)
        assert np.median(np.abs(found.warped - expected)) < 2e-3 < np.median(np.abs(found.warped - warped_of_truth))


def test_networks_are_trained_on_true_colours() -> None:
    truth = plane(2.0, (5, 5), (96, 104), colourful)
    pale = seen_by_an_illum(truth, 0.7)
    np.testing.assert_allclose(with_true_colours(pale).views, truth.views, atol=1e-6)
    prepared = prepare_scene(pale).light_field
    assert prepared.paleness == 0
    np.testing.assert_allclose(prepared.views, truth.views, atol=1e-6)


def test_two_light_fields_of_other_paleness_are_not_taken_for_each_other() -> None:
    field = plane(1.0)
    assert field.content_key == plane(1.0).content_key != replace(field, paleness=0.5).content_key
