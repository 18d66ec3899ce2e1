"""Scoring light fields: the right view, the right numbers, JSON that any reader takes, tables that line up."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from lfcore.errors import InputError
from lfcore.evaluation import Evaluation, SceneScore, evaluate_scene, scene_figure, scene_noise, score_table
from lfcore.lightfield import LightField
from lfcore.metrics import k16, luma_score, to_uint8
from lfcore.protocols import K16, SEVEN_Y, novel_views
from lfcore.synthesizer import MeanSynthesizer, Synthesis


def light_field(rows: int, columns: int) -> LightField:
    views = np.random.default_rng(3).integers(0, 256, (rows, columns, 60, 70, 3), dtype=np.uint8)
    return LightField(views, "scene", "", "test")


class Oracle:
    """A synthesizer that knows the captured views, so that a score is perfect only for the view and place of the protocol."""

    name = key = "oracle"

    def set_light_field(self, light_field: LightField) -> None:
        self._light_field = light_field

    def synthesize(self, u: float, v: float, cancelled: object = None) -> Synthesis:
        view = self._light_field.at(u, v)
        assert view is not None
        image = self._light_field.view(*view)
        return Synthesis(u, v, self.name, image, np.zeros(image.shape[:2], np.float32), None, {"total": 0.0})


@pytest.mark.parametrize(("grid", "view"), [((8, 8), (4, 4)), ((7, 7), (3, 3)), ((3, 8), (1, 4))])
def test_the_view_of_the_protocol_is_asked_for_and_compared(grid: tuple[int, int], view: tuple[int, int]) -> None:
    field = light_field(*grid)
    result = evaluate_scene(field, Oracle())
    assert result.view == view
    assert result.score.psnr == math.inf
    assert result.score.ssim == pytest.approx(1)
    assert np.array_equal(result.truth, field.view(*view))
    assert (result.synthesis.u, result.synthesis.v) == field.position(*view)


def test_the_mean_of_the_corners_scores_as_computed_by_hand() -> None:
    field = light_field(3, 3)
    score = evaluate_scene(field, MeanSynthesizer()).score
    corners = field.views[::2, ::2].astype(float).mean((0, 1))
    difference = np.floor(corners + 0.5)[22:-22, 22:-22] - field.views[1, 1].astype(float)[22:-22, 22:-22]
    assert score.psnr == pytest.approx(10 * math.log10(255**2 / (difference**2).mean()), abs=0.01)
    assert 0 < score.seconds < 10


def test_corners_alone_are_refused() -> None:
    with pytest.raises(InputError, match="corner views"):
        evaluate_scene(light_field(2, 2), MeanSynthesizer())


SCORES = (SceneScore("a", 30.0, 0.9, 1.25), SceneScore("a longer name", 40.0, 0.8, 0.75))


def test_json_has_the_fields_and_the_means() -> None:
    assert Evaluation("full", "a machine", SCORES).as_json() == {
        "protocol": "K16",
        "model": "full",
        "machine": "a machine",
        "scenes": [
            {"name": "a", "psnr": 30.0, "ssim": 0.9, "seconds": 1.25},
            {"name": "a longer name", "psnr": 40.0, "ssim": 0.8, "seconds": 0.75},
        ],
        "mean": {"psnr": 35.0, "ssim": 0.85},
    }


def test_equal_pictures_leave_valid_json() -> None:
    found = Evaluation("full", "a machine", (replace(SCORES[0], psnr=math.inf),)).as_json()
    assert json.loads(json.dumps(found, allow_nan=False))["scenes"][0]["psnr"] is None
    assert found["mean"]["psnr"] is None


def test_the_table_lines_up() -> None:
    lines = score_table([Evaluation("full", "a machine", SCORES), Evaluation("mean", "a machine", SCORES)]).splitlines()
    assert lines[0] == "K16 on a machine"
    assert lines[1].split() == ["full", "mean"]
    assert lines[2].split() == ["scene", "dB", "SSIM", "seconds", "dB", "SSIM", "seconds"]
    assert lines[4].split() == ["a", "longer", "name", "40.00", "0.8000", "0.75", "40.00", "0.8000", "0.75"]
    assert lines[5].split() == ["mean", "35.00", "0.8500", "35.00", "0.8500"]
    ends = [lines[2].index("dB") + 2, lines[2].rindex("seconds") + 7]
    for line in lines[3:5]:
        assert line[ends[0] - 1].isdigit()
        assert line[ends[0]] == " "
        assert len(line) == ends[1]


def test_the_figure_shows_truth_and_synthesis_as_they_are() -> None:
    field = light_field(3, 3)
    result = evaluate_scene(field, Oracle())
    page = scene_figure(result)
    truth = to_uint8(result.truth)
    # Both pictures are the captured view here, side by side in the first row.
    rows, columns = np.where((page == truth[0, 0]).all(axis=2))
    places = [(y, x) for y, x in zip(rows, columns, strict=True) if np.array_equal(page[y : y + 60, x : x + 70], truth)]
    assert len(places) == 2
    assert places[0][0] == places[1][0]
    # The error cell below is black, as there is none.
    left, below = places[0][1], places[0][0] + 60
    dark = (page[below:, left : left + 70] == 0).all(axis=2).all(axis=1)
    assert dark.sum() >= 60


def test_the_whole_grid_is_scored_view_by_view_and_the_score_stays_that_of_the_protocol() -> None:
    field = light_field(3, 4)
    seen: list[int] = []
    alone = evaluate_scene(field, MeanSynthesizer())
    result = evaluate_scene(field, MeanSynthesizer(), whole_grid=True, on_view=lambda: seen.append(1))
    assert (result.score.psnr, result.score.ssim) == (alone.score.psnr, alone.score.ssim)
    assert len(seen) == len(result.score.views) == 3 * 4 - 4
    mean = field.corners().mean(0)
    for view in result.score.views:
        assert view.psnr == k16(mean, field.view(view.row, view.column)).psnr
    found = Evaluation("mean", "a machine", (result.score,)).as_json()["scenes"][0]
    assert found["grid"] == [3, 4]
    assert {(view["row"], view["column"]) for view in found["views"]} == set(novel_views(field))


def test_seven_y_is_the_mean_over_the_views_of_the_first_seven_of_eight() -> None:
    field = light_field(8, 8)
    result = evaluate_scene(field, MeanSynthesizer(), SEVEN_Y)
    corners = [field.view(row, column) for row in (0, 6) for column in (0, 6)]
    mean = np.mean(corners, axis=0, dtype=np.float32)
    places = [(r, c) for r in range(7) for c in range(7) if (r, c) not in ((0, 0), (0, 6), (6, 0), (6, 6))]
    scores = [luma_score(mean, field.view(*place)) for place in places]
    assert len(scores) == 45
    assert result.score.psnr == pytest.approx(sum(score.psnr for score in scores) / 45, abs=1e-3)
    assert result.score.ssim == pytest.approx(sum(score.ssim for score in scores) / 45, abs=1e-5)
    assert Evaluation("mean", "a machine", (result.score,), SEVEN_Y).as_json()["protocol"] == "7x7-Y"


def test_noise_is_measured_at_the_view_that_is_shown() -> None:
    random = np.random.default_rng(1)
    views = (0.4 + random.normal(0, 2 / 255, (3, 3, 120, 120, 3))).astype(np.float32)
    field = LightField(views, "flat", "", "test")
    noise = scene_noise(field, K16, {"mean": evaluate_scene(field, MeanSynthesizer())})
    assert noise is not None
    assert noise.captured[0] == pytest.approx(2, rel=0.05)
    assert noise.ratio("mean")[0] == pytest.approx(0.5, rel=0.07)
    textured = light_field(3, 3)
    assert scene_noise(textured, K16, {"mean": evaluate_scene(textured, MeanSynthesizer())}) is None
