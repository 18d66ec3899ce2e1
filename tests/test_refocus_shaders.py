"""Refocusing in shaders, against lfcore.refocus (numpy) and against planes whose truth is known."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from app.canvas.gathered import Captured, kept, spread_order
from app.canvas.passes import Passes
from app.canvas.refocus import Refocused, Wanted, coarse_views
from app.canvas.textures import Textures
from app.painting import in_bytes
from app.tone import Tone
from lfcore.lightfield import CORNERS, FloatArray, LightField
from lfcore.refocus import aperture_weights, refocus
from tests.scenes import plane, smooth_texture

INSIDE = (slice(8, -8), slice(8, -8))


def in_8_bits(scene: LightField) -> LightField:
    return LightField(np.round(scene.views * 255).astype(np.uint8), "x", "x", "x")


def corners(scene: LightField) -> np.ndarray:
    return np.stack([scene.views[-int(v), -int(u)] for u, v in CORNERS])


class Bench:
    """The makers of one light field, and how they are used frame by frame."""

    def __init__(self, gl: Any, scene: LightField) -> None:
        self.scene = scene
        passes = Passes(gl)
        self.textures = Textures(gl, corners(scene), "f4")
        self.refocused = Refocused(gl, passes, self.textures)
        self.refocused.set_views(scene.views, scene.dark)

    def give(self, image: FloatArray, disparity: FloatArray, viewpoint: tuple[float, float]) -> None:
        """A synthesis, as the canvas takes it."""
        textures = self.textures
        width, height = textures.size
        textures.syntheses.write(in_bytes(image), viewport=(0, 0, textures.newest, width, height, 1))
        textures.disparity_map.write(disparity)
        textures.disparity_range = float(disparity.min()), float(disparity.max())
        textures.made_at = textures.newest_at = viewpoint
        textures.current.clear()

    def frames(self, wanted: Wanted) -> Iterator[FloatArray]:
        """What is shown frame by frame until it is finished."""
        for _ in range(1000):
            more = self.refocused.advance(wanted)
            texture = self.refocused.picture(wanted, Tone())
            assert texture is not None
            width, height = self.textures.size
            yield np.frombuffer(texture.read(), np.float32).reshape(height, width, -1)[..., :3]
            if not more:
                return
        raise AssertionError("it is never finished")

    def finished(self, wanted: Wanted) -> FloatArray:
        *_, last = self.frames(wanted)
        return last

    def release(self) -> None:
        self.refocused.release()
        self.textures.release()


@pytest.fixture
def bench(gl: Any) -> Iterator[Any]:
    made: list[Bench] = []

    def make(scene: LightField) -> Bench:
        made.append(Bench(gl, scene))
        return made[-1]

    yield make
    gl.simple_framebuffer((1, 1)).use()
    for each in made:
        each.release()
    assert gl.error == "GL_NO_ERROR"


@pytest.mark.parametrize("grid", [(4, 4), (3, 5)])
@pytest.mark.parametrize(
    ("viewpoint", "focus", "aperture"),
    [((0.5, 0.5), 0.0, 1.0), ((0.31, 0.77), -5.3, 0.6), ((0.5, 0.5), 3.7, 0.0), ((1.2, -0.1), 2.0, 1.5)],
)
def test_the_finished_picture_is_that_of_the_library(
    bench: Any, grid: tuple[int, int], viewpoint: tuple[float, float], focus: float, aperture: float
) -> None:
    chance = np.random.default_rng(0)
    views = chance.integers(0, 256, (*grid, 30, 37, 3), dtype=np.uint8)
    scene = LightField(views, "x", "x", "x", dark=frozenset({(0, 0)}))
    found = bench(scene).finished(Wanted(viewpoint, focus, aperture, True))
    places = [(r, c) for r in range(grid[0]) for c in range(grid[1]) if (r, c) != (0, 0)]
    positions = np.array([scene.position(r, c) for r, c in places])
    weights = aperture_weights(positions, viewpoint, aperture, 1 / (min(grid) - 1))
    expected = refocus(
        ((scene.position(r, c), scene.view(r, c), w) for (r, c), w in zip(places, weights, strict=True)), viewpoint, focus
    )
    np.testing.assert_allclose(found, np.clip(expected, 0, 1), atol=2e-5)


def test_where_all_views_are_dark_they_are_summed_up_all_the_same(bench: Any) -> None:
    views = np.random.default_rng(0).integers(0, 9, (2, 2, 30, 37, 3), dtype=np.uint8)
    dark, usual = (LightField(views, "x", "x", "x", dark=each) for each in (frozenset(np.ndindex(2, 2)), frozenset()))
    wanted = Wanted((0.5, 0.5), 1.0, 2.0, True)
    np.testing.assert_array_equal(bench(dark).finished(wanted), bench(usual).finished(wanted))


@pytest.mark.parametrize("dtype", ["uint16", "float32"])
def test_views_of_other_types_are_taken_in_8_bits(bench: Any, dtype: str) -> None:
    values = np.random.default_rng(1).random((3, 3, 20, 24, 3)).astype(np.float32)
    stored = values if dtype == "float32" else np.round(values * 65535).astype(np.uint16)
    found = bench(LightField(stored, "x", "x", "x")).finished(Wanted((0.5, 0.5), 0.0, 0.0, True))
    np.testing.assert_allclose(found, values[1, 1], atol=0.51 / 255)


@pytest.mark.parametrize("disparity", [-6.0, 4.3])
def test_a_plane_is_sharp_at_its_own_disparity_and_not_at_another(bench: Any, disparity: float) -> None:
    scene = in_8_bits(plane(disparity, (5, 5)))
    viewpoint = (0.4, 0.6)
    y, x = np.mgrid[: scene.height, : scene.width].astype(np.float32)
    truth = smooth_texture(x - disparity * viewpoint[0], y - disparity * viewpoint[1])
    made = bench(scene)
    sharp = made.finished(Wanted(viewpoint, disparity, 1.0, True))
    assert np.abs(sharp - truth)[INSIDE].max() < 0.006
    blurred = made.finished(Wanted(viewpoint, disparity + 8, 1.0, True))
    assert np.abs(blurred - truth)[INSIDE].max() > 0.2


def test_the_first_picture_is_there_at_once_and_near_the_finished_one(bench: Any) -> None:
    scene = in_8_bits(plane(-6.0, (8, 8), (376, 541)))
    made = bench(scene)
    made.finished(Wanted((0.5, 0.5), -6.0, 1.0, True))
    found = []
    # By now all views have been handed over. Another focus begins with a coarse picture at once: of a few views, shifted by
    # whole pixels, but nearer to what it will be than to the other focus.
    for focus in (0.0, -6.0):
        coarse, *between, finished = made.frames(Wanted((0.5, 0.5), focus, 1.0, True))
        assert between
        found.append((coarse, finished))
    apart = np.abs(found[0][1] - found[1][1])[INSIDE].mean()
    for coarse, finished in found:
        assert np.abs(coarse - finished)[INSIDE].mean() < apart / 3
    # What has been finished stays.
    assert len(list(made.frames(Wanted((0.5, 0.5), -6.0, 1.0, True)))) == 1


@pytest.mark.parametrize("made_at", [(0.5, 0.5), (0.1, 0.2)])
def test_of_two_by_two_views_those_in_between_are_drawn(bench: Any, made_at: tuple[float, float]) -> None:
    disparity = -6.0
    scene = in_8_bits(plane(disparity, (2, 2)))
    made = bench(scene)
    y, x = np.mgrid[: scene.height, : scene.width].astype(np.float32)
    made.give(
        smooth_texture(x - disparity * made_at[0], y - disparity * made_at[1]),
        np.full((scene.height, scene.width), disparity, np.float32),
        made_at,
    )
    truth = smooth_texture(x - disparity * 0.5, y - disparity * 0.5)
    sharp = made.finished(Wanted((0.5, 0.5), disparity, 1.0, False))
    assert np.abs(sharp - truth)[INSIDE].max() < 0.02
    # Out of focus by 8 px over the baseline: the mean of the plane under 9 x 9 shifts, which four corners do not make.
    shifts = np.linspace(-4, 4, 9)
    positions = np.array([(u, v) for v in np.linspace(0, 1, 9) for u in np.linspace(0, 1, 9)])
    weights = aperture_weights(positions, (0.5, 0.5), 1.0, 1 / 8).reshape(9, 9)
    expected = (
        sum(
            weights[j, i] * smooth_texture(x + shifts[i] - disparity * 0.5, y + shifts[j] - disparity * 0.5)
            for j in range(9)
            for i in range(9)
        )
        / weights.sum()
    )
    blurred = made.finished(Wanted((0.5, 0.5), disparity + 8, 1.0, False))
    assert np.abs(blurred - expected)[INSIDE].max() < 0.02


def test_a_nearer_synthesis_makes_views_in_between_anew(bench: Any) -> None:
    scene = in_8_bits(plane(0.0, (2, 2)))
    made = bench(scene)
    flat = np.zeros((scene.height, scene.width), np.float32)
    wanted = Wanted((0.0, 0.0), 0.0, 0.0, False)
    made.give(np.full((scene.height, scene.width, 3), 0.2, np.float32), flat, (0.2, 0.0))
    assert made.finished(wanted) == pytest.approx(0.2, abs=0.01)
    made.give(np.full((scene.height, scene.width, 3), 0.6, np.float32), flat, (0.0, 0.0))
    assert made.finished(wanted) == pytest.approx(0.6, abs=0.01)
    made.give(np.full((scene.height, scene.width, 3), 0.9, np.float32), flat, (0.1, 0.0))  # not nearer
    assert made.finished(wanted) == pytest.approx(0.6, abs=0.01)
    made.refocused.redraw_between()  # by another model
    assert made.finished(wanted) == pytest.approx(0.9, abs=0.01)


def test_of_a_large_light_field_fewer_views_are_taken(gl: Any) -> None:
    columns, rows = kept((17, 17), (1024, 1024), 16384, 256 * 2**20)
    assert len(columns) * len(rows) * 1024 * 1024 * 4 <= 256 * 2**20
    assert len(columns) == len(rows) == 8
    assert columns[0] == rows[0] == 0
    assert columns[-1] == rows[-1] == 16
    columns, rows = kept((5, 9), (1000, 100), 4096, 2**30)
    assert (len(columns), len(rows)) == (4, 2) or len(columns) * 1000 <= 4096
    scene = in_8_bits(plane(0.0, (6, 6), (20, 20)))
    made = Captured(gl, scene.views, scene.dark, most_bytes=9 * 20 * 20 * 4)
    while not made.complete:
        made.fill()
    pixels = np.frombuffer(made.texture.read(), np.uint8).reshape(60, 60, 4)
    np.testing.assert_array_equal(pixels[20:40, 40:, :3], scene.views[made.kept[5]])
    assert made.positions[5] == pytest.approx([1.0, made.kept[5][0] / 5])
    made.release()


def test_the_order_spreads(gl: Any) -> None:
    positions = np.array([(u, v) for v in range(5) for u in range(5)]) / 4.0
    order = spread_order(positions)
    assert sorted(order) == list(range(25))
    assert order[0] == 12
    assert set(order[1:5]) == {0, 4, 20, 24}


def test_the_coarse_views_lie_inside_and_are_spread() -> None:
    positions = np.array([(u, v) for v in np.linspace(0, 1, 9) for u in np.linspace(0, 1, 9)])
    wanted = Wanted((0.5, 0.5), 0.0, 1.0, True)
    chosen = coarse_views(aperture_weights(positions, (0.5, 0.5), 1.0, 1 / 8), positions, wanted)
    assert len(set(chosen.tolist())) == len(chosen) == 10
    assert np.hypot(*(positions[chosen] - 0.5).T).max() <= 0.5 + 1 / 8
    assert np.abs(positions[chosen].mean(0) - 0.5).max() < 0.05
    weights = np.zeros(81)
    weights[7] = 1
    assert coarse_views(weights, positions, wanted).tolist() == [7] * 10
