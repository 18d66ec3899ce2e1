"""Colours of views from the mosaic under a microlens: exact where they must be, near the truth elsewhere."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch

from lfcore.decode.demosaic import LensProfile, ViewPlaces, estimate, weights

PITCH = 14.2857
IDENTITY = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
BRIGHT = LensProfile((0.0, 2.0), (1.0, 1.0))
FADING = LensProfile((0.0, 0.5, 1.0, 1.2), (1.0, 0.9, 0.5, 0.1))


def _mosaic(light, cfa: str, size: int = 60):  # type: ignore[no-untyped-def]
    """The mosaic of light(x, y) -> (..., 3) seen through the colour filters."""
    y, x = np.mgrid[:size, :size]
    colours = np.array(["RGB".index(colour) for colour in cfa])[2 * (y % 2) + x % 2]
    return torch.from_numpy(np.take_along_axis(light(x, y), colours[..., None], axis=2)[..., 0].astype(np.float32))


@pytest.mark.parametrize("cfa", ["GRBG", "BGGR"])
def test_plain_colours_are_exact_wherever_the_centre_lies(cfa: str) -> None:
    colour = np.array([0.7, 0.2, 0.05])
    kernel = weights(PITCH, ViewPlaces(4, PITCH / 14, 0.01), cfa, BRIGHT, IDENTITY, False)
    centres = np.random.default_rng(0).uniform(15, 45, (300, 2))
    views = estimate(_mosaic(lambda x, y: np.broadcast_to(colour, (*x.shape, 3)), cfa), centres, kernel).numpy()
    # The free level has a finite variance, so that a thousandth is drawn to the mean of the colours.
    np.testing.assert_allclose(views.reshape(-1, 3), np.broadcast_to(colour, (300 * 16, 3)), atol=1e-3)


def test_slow_changes_under_a_microlens_are_followed_at_the_place_of_each_view() -> None:
    def light(x, y):  # type: ignore[no-untyped-def]
        wave = 0.5 + 0.3 * np.cos(2 * math.pi * (x / 22 + y / 31))
        return np.stack([wave, 0.8 * wave, 0.5 * wave], axis=-1)

    rotation = 0.03
    places = ViewPlaces(8, PITCH / 14, rotation)
    centres = np.random.default_rng(1).uniform(15, 45, (200, 2))
    kernel = weights(PITCH, places, "GRBG", BRIGHT, IDENTITY, False)
    views = estimate(_mosaic(light, "GRBG"), centres, kernel).numpy().reshape(200, 8, 8, 3)
    truth = light(*np.moveaxis(centres[:, None, None] + places.offsets, -1, 0))
    assert np.abs(views - truth).max() < 0.04  # of a swing of 0.6; a pixel's shift would make 0.09
    assert np.sqrt(((views - truth) ** 2).mean()) < 0.01


def test_light_of_neighbouring_microlenses_is_not_mixed_in() -> None:
    centre = np.array([[30.2, 29.7]])
    kernel = weights(PITCH, ViewPlaces(8, PITCH / 14, 0.0), "GRBG", BRIGHT, IDENTITY, False)

    def light(x, y):  # type: ignore[no-untyped-def]
        beyond = np.abs(x - centre[0, 0]) > PITCH / 2
        return np.where(beyond[..., None], 50.0, [0.3, 0.4, 0.5])

    views = estimate(_mosaic(light, "GRBG"), centre, kernel).numpy().reshape(-1, 3)
    np.testing.assert_allclose(views, np.broadcast_to([0.3, 0.4, 0.5], views.shape), atol=0.01)


def test_the_profile_is_divided_out_where_no_white_image_did_it() -> None:
    centre = np.array([[30.0, 30.0]])

    def light(x, y):  # type: ignore[no-untyped-def]
        radius = 2 * np.hypot(x - 30, y - 30) / PITCH
        return np.broadcast_to((0.6 * FADING.at(radius))[..., None], (*x.shape, 3))

    kernel = weights(PITCH, ViewPlaces(8, PITCH / 14, 0.0), "GRBG", FADING, IDENTITY, True)
    views = estimate(_mosaic(light, "GRBG"), centre, kernel).numpy()
    np.testing.assert_allclose(views, 0.6, atol=0.02)


def test_views_beyond_the_aperture_stay_black_and_the_matrix_is_applied() -> None:
    swap = ((0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 2.0))
    kernel = weights(PITCH, ViewPlaces(14, PITCH / 14, 0.0), "GRBG", FADING, swap, False)
    mosaic = _mosaic(lambda x, y: np.broadcast_to([0.1, 0.2, 0.3], (*x.shape, 3)), "GRBG")
    views = estimate(mosaic, np.array([[30.4, 30.3]]), kernel).numpy().reshape(14, 14, 3)
    assert (views[0, 0] == 0).all()
    assert (views[13, 13] == 0).all()
    np.testing.assert_allclose(views[6, 7], [0.2, 0.1, 0.6], atol=2e-3)
