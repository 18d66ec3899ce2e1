"""The plane sweep without networks: true disparities come back, occlusions are kept, bands and tones change nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from lfcore import classical
from lfcore.classical import PlaneSweepSynthesizer
from lfcore.errors import Cancelled, InputError
from lfcore.lightfield import FloatArray, LightField
from lfcore.metrics import psnr
from lfcore.planesweep import Levels
from lfcore.synthesizer import MeanSynthesizer, make_synthesizer
from tests.scenes import plane, smooth_texture


def textured(x: FloatArray, y: FloatArray) -> FloatArray:
    """The smooth texture with finer waves, so that disparity is well defined everywhere."""
    fine = 0.08 * np.sin(1.3 * x + 0.4 * y)[..., None] * np.sin(1.1 * y - 0.3 * x)[..., None]
    return (smooth_texture(x, y) + fine).astype(np.float32)


def occluding(disparities: tuple[float, float] = (-5.0, 4.0), size: tuple[int, int] = (120, 128)) -> LightField:
    """A square of the first disparity before a background of the second, views drawn with true occlusion."""
    rows = columns = 3
    y, x = np.mgrid[: size[0], : size[1]].astype(np.float32)
    near, far = disparities
    views = np.empty((rows, columns, *size, 3), np.float32)
    for r in range(rows):
        for c in range(columns):
            u, v = c / (columns - 1), r / (rows - 1)
            views[r, c] = textured(x - far * u, y - far * v)
            xs, ys = x - near * u, y - near * v
            inside = (xs > 45) & (xs < 95) & (ys > 40) & (ys < 85)
            views[r, c][inside] = 1 - textured(xs + 31, ys + 17)[inside]
    return LightField(views, "occluding", "generated", "generated")


@pytest.mark.parametrize("disparity", [-7.3, 0.0, 3.6])
def test_the_disparity_of_a_plane_comes_back(disparity: float) -> None:
    field = plane(disparity, size=(80, 90), texture=textured)
    synthesizer = PlaneSweepSynthesizer()
    synthesizer.set_light_field(field)
    assert synthesizer.levels.low < disparity < synthesizer.levels.high
    result = synthesizer.synthesize(0.5, 0.5)
    assert result.disparity is not None
    inner = (slice(12, -12), slice(12, -12))
    assert np.abs(result.disparity[inner] - disparity).max() < 0.25
    assert psnr(result.image[inner], field.view(1, 1)[inner]) > 45


def test_a_view_with_occlusion_is_far_better_than_the_mean() -> None:
    field = occluding()
    scores = []
    for synthesizer in (PlaneSweepSynthesizer(), MeanSynthesizer()):
        synthesizer.set_light_field(field)
        image = synthesizer.synthesize(0.5, 0.5).image
        scores.append(psnr(image[12:-12, 12:-12], field.view(1, 1)[12:-12, 12:-12]))
    assert scores[0] > scores[1] + 6


def test_at_a_corner_the_captured_view_comes_back() -> None:
    field = occluding()
    synthesizer = PlaneSweepSynthesizer()
    synthesizer.set_light_field(field)
    image = synthesizer.synthesize(1.0, 0.0).image
    assert psnr(image, field.view(0, 2)) > 35  # near inputs count most


def test_the_range_of_disparities_is_found() -> None:
    synthesizer = PlaneSweepSynthesizer()
    synthesizer.set_light_field(occluding((-5.0, 4.0)))
    assert synthesizer.levels.low == pytest.approx(-6.5, abs=1.5)
    assert synthesizer.levels.high == pytest.approx(5.5, abs=1.5)


def test_a_light_field_without_texture_is_swept_over_the_widest_range() -> None:
    grey = LightField(np.full((2, 2, 60, 64, 3), 0.4, np.float32), "grey", "", "test")
    synthesizer = PlaneSweepSynthesizer()
    synthesizer.set_light_field(grey)
    result = synthesizer.synthesize(0.3, 0.6)
    assert np.abs(result.image - 0.4).max() < 1e-5


def test_bands_give_what_the_whole_gives(monkeypatch: pytest.MonkeyPatch) -> None:
    field = occluding(size=(220, 64))
    whole, banded = PlaneSweepSynthesizer(), PlaneSweepSynthesizer()
    for synthesizer in (whole, banded):
        synthesizer.set_light_field(field)
    expected = whole.synthesize(0.4, 0.7)
    monkeypatch.setattr(classical, "_BAND_PIXELS", 64)
    rows = [rows for rows, _ in classical._bands(220, 64, banded._context)]
    assert len(rows) > 1
    found = banded.synthesize(0.4, 0.7)
    assert found.disparity is not None
    assert expected.disparity is not None
    assert np.abs(found.disparity - expected.disparity).max() < 1e-3
    assert np.abs(found.image - expected.image).max() < 1e-4


def test_exposure_does_not_change_the_disparity() -> None:
    field = occluding(size=(96, 104))
    darker = replace(field, views=field.views * np.float32(0.1))
    maps = []
    for each in (field, darker):
        synthesizer = PlaneSweepSynthesizer()
        synthesizer.set_light_field(each)
        maps.append(synthesizer.synthesize(0.5, 0.5).disparity)
    assert np.abs(maps[0] - maps[1]).max() < 0.01


def test_the_winner_is_the_least_cost_with_its_parabola() -> None:
    levels = Levels(5, -2.0, 2.0)
    costs = torch.tensor([[5.0, 0.0, 9.0], [3.0, 1.0, 4.0], [1.0, 4.0, 1.0], [2.0, 6.0, 0.0], [6.0, 9.0, 0.1]])
    winner = classical._Winner(levels)
    for cost in costs:
        winner.take(cost.view(1, 3))
    # Between 3, 1, 2: half the difference over the bend, 0.5 (3 - 2) / (3 - 2 + 2) = 1/6. First and last have no parabola.
    expected = [0 + 1 / 6, -2.0, 1 + 0.5 * (1 - 0.1) / (1 + 0.1)]
    assert winner.disparity()[0].tolist() == pytest.approx(expected, abs=1e-5)
    assert winner.confidence()[0].tolist() == pytest.approx([2.4 / 3.405, 4 / 4.005, 2.82 / 2.825], abs=1e-4)


def test_it_is_a_model_like_the_others() -> None:
    synthesizer = make_synthesizer("planesweep")
    with pytest.raises(InputError, match="No light field"):
        synthesizer.synthesize(0.5, 0.5)
    field = plane(1.0, size=(64, 70), texture=textured)
    synthesizer.set_light_field(field)
    with pytest.raises(InputError, match=r"u is 1\.3"):
        synthesizer.synthesize(1.3, 0)
    result = synthesizer.synthesize(1.2, -0.1)  # extrapolated
    assert result.image.shape == (64, 70, 3)
    assert result.warped is not None
    assert result.warped.shape == (4, 64, 70, 3)
    assert np.isfinite(result.image).all()
    assert set(result.timings) == {"features", "disparity", "warp", "colour", "total"}
    calls = iter([False, False, True])
    with pytest.raises(Cancelled):
        synthesizer.synthesize(0.5, 0.5, lambda: next(calls))


@pytest.mark.parametrize("size", [(1, 1), (1, 2), (40, 1)])
def test_views_of_a_single_row_or_column_have_a_synthesis(size: tuple[int, int]) -> None:
    synthesizer = PlaneSweepSynthesizer()
    synthesizer.set_light_field(LightField(np.full((2, 2, *size, 3), 128, np.uint8), "thin", "", ""))
    np.testing.assert_allclose(synthesizer.synthesize(0.3, 0.6).image, 128 / 255, atol=1e-3)
