"""Light on the pixels and colours on the screen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from lfcore.camera_files import public_metadata
from lfcore.camera_model import CameraModel, _transmission, expose, f01, illum, white_image
from lfcore.decode.colour import camera_to_screen, gains, stored_values, upright
from lfcore.decode.shading import lens_profile, light_on_pixels, mend_hot_pixels, relative_light
from lfcore.formats.lytro.fields import Fields
from lfcore.formats.lytro.metadata import Capture, capture_of
from tests.camera_truth import small, srgb
from tests.plane_scenes import slanted_scene

CAMERA = small(illum(), 480, 400, hot_pixels=0.0)


def _capture(camera: CameraModel) -> Capture:
    return capture_of(Fields(public_metadata(camera), "test"), Fields({}, ""), Fields({}, ""))


def test_hot_pixels_are_mended_and_nothing_else_changes() -> None:
    clean = expose(CAMERA, slanted_scene(CAMERA.size_in_pitches, 2), samples=3)
    broken = clean.copy()
    draw = np.random.default_rng(4)
    y, x = draw.integers(0, 400, 30), draw.integers(0, 480, 30)
    broken[y, x] = 1023
    mended = broken.copy()
    count = mend_hot_pixels(mended, _capture(CAMERA).raw)
    changed = np.nonzero(mended != broken)
    assert count == len(changed[0])
    assert set(zip(*changed, strict=True)) <= set(zip(y, x, strict=True))
    visible = clean[y, x].astype(int) < 400  # the others do not stand out
    assert np.abs(mended[y, x].astype(int) - clean[y, x])[visible].max() < 250
    assert (np.abs(mended[y, x].astype(int) - clean[y, x])[visible] < 100).mean() > 0.8


def test_profile_of_a_white_image_and_of_a_capture_is_the_apertures() -> None:
    camera = replace(CAMERA, crosstalk=0.0)
    raw = _capture(camera).raw
    radii = np.array([0.2, 0.4, 0.6, 0.8])
    truth = _transmission(camera, torch.from_numpy(radii / 2), torch.zeros(4)).numpy()
    from_white = lens_profile(white_image(camera, samples=4), raw, camera.grid)
    np.testing.assert_allclose(from_white.at(radii), truth, atol=0.04)
    from_capture = lens_profile(expose(camera, slanted_scene(camera.size_in_pitches, 2), samples=4), raw, camera.grid)
    np.testing.assert_allclose(from_capture.at(radii), truth, atol=0.06)
    assert 0.85 < from_white.edge < 1.05


def test_a_white_wall_divided_by_the_white_image_is_even_and_grey() -> None:
    camera = replace(CAMERA, full_well=50_000.0)
    capture = _capture(camera)
    white = white_image(camera, seed=1, samples=4)
    wall = white_image(replace(camera, lamp=tuple(0.5 / gain for gain in camera.gains)), seed=2, level=0.9, samples=4)  # type: ignore[arg-type]
    divided = relative_light(white, capture.raw, camera.grid)
    light = light_on_pixels(wall, capture.raw, gains(capture.facts, capture.raw), divided).numpy()
    lit = divided.numpy() > 0.4
    assert light[lit].mean() == pytest.approx(0.45, rel=0.01)
    assert light[lit].std() < 0.03
    planes = [light[y::2, x::2][lit[y::2, x::2]].mean() for y in (0, 1) for x in (0, 1)]
    np.testing.assert_allclose(planes, planes[0], rtol=0.02)


def test_what_burnt_out_is_white_in_all_colours() -> None:
    capture = _capture(CAMERA)
    burnt = np.full((8, 8), 1023, np.uint16)
    light = light_on_pixels(burnt, capture.raw, gains(capture.facts, capture.raw), None)
    np.testing.assert_array_equal(light.numpy(), 1.0)
    colour = torch.ones(1, 3) @ torch.tensor(camera_to_screen(capture.facts)).T
    np.testing.assert_array_equal(stored_values(colour, False, 8), 255)


def test_white_balance_follows_the_mosaic() -> None:
    for camera in (illum(gains=(1.5, 1.0, 1.2)), f01(gains=(2.0, 1.0, 3.0))):
        capture = _capture(camera)
        by_colour = dict(zip("RGB", camera.gains, strict=True))
        assert gains(capture.facts, capture.raw) == tuple(by_colour[colour] for colour in camera.cfa)


def test_stored_values_follow_the_srgb_curve() -> None:
    light = torch.linspace(0, 0.95, 4000).reshape(-1, 1)
    expected = 255 * srgb(light.numpy())
    assert np.abs(stored_values(light.clone(), False, 8).astype(float) - expected).max() <= 0.56  # the table's steps add 0.05
    assert np.abs(stored_values(light.clone(), False, 16) / 257.0 - expected).max() < 0.01
    linear = stored_values(light.clone(), True, 16)
    assert np.abs(linear / 65535 - light.numpy()).max() < 1e-5


def test_highlights_bend_towards_white_without_steps_back() -> None:
    light = torch.linspace(0.9, 3, 500).reshape(-1, 1)
    values = stored_values(light, True, 16).astype(int).ravel()
    assert (np.diff(values) >= 0).all()
    assert np.diff(values).max() < 400
    assert values[-1] == 65535


# Where the pixel that is stored first, at the top left, and the one right of it belong on screen, by EXIF.
_CORNERS = {
    1: ("top left", "top right"),
    2: ("top right", "top left"),
    3: ("bottom right", "bottom left"),
    4: ("bottom left", "bottom right"),
    5: ("top left", "bottom left"),
    6: ("top right", "bottom right"),
    7: ("bottom right", "top right"),
    8: ("bottom left", "top left"),
}
_PLACES = {"top left": (0, 0), "top right": (0, -1), "bottom left": (-1, 0), "bottom right": (-1, -1)}


@pytest.mark.parametrize("orientation", range(1, 9))
def test_orientation_turns_pictures_and_grid_together(orientation: int) -> None:
    stored = np.zeros((3, 2, 5, 4, 3), np.uint8)
    stored[0, 0, 0, 0] = 1  # top left view, top left pixel
    stored[0, -1, 0, -1] = 2  # top right view, top right pixel
    turned = upright(stored, orientation)
    first, second = (_PLACES[corner] for corner in _CORNERS[orientation])
    assert (turned[first[0], first[1], first[0], first[1]] == 1).all()
    assert (turned[second[0], second[1], second[0], second[1]] == 2).all()
    assert turned.shape[:4] == ((2, 3, 4, 5) if orientation > 4 else (3, 2, 5, 4))
