"""Synthesis from the four captured views around the viewpoint: which they are, and what becomes of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from math import hypot
from pathlib import Path

import numpy as np
import pytest
from moving_scene import light_field as moving
from remote_models import Blender, Weigher, make
from scenes import plane, smooth_texture
from test_comparing import Program

from app.__main__ import main
from app.controller import Controller
from app.engine import Engine, ModelChoice
from app.readout import Compared, Readout
from app.sidebar import score_map
from app.state import Grid, Tab
from assets import sample_path
from lfcore.coarse_colours import BLOCK, CoarseColours
from lfcore.errors import InputError
from lfcore.formats import open_light_field
from lfcore.lightfield import CORNERS, EXTRAPOLATION_LIMIT, LightField
from lfcore.metrics import k16
from lfcore.nearest_inputs import NEIGHBOURS, Cell, NearestInputs, cell_around
from lfcore.remote import RemoteSynthesizer, SynthesisProcess
from lfcore.synthesis import Synthesis, WeighingSynthesizer, never, weighs
from lfcore.synthesizer import make_synthesizer
from tests.measure_neighbours import without_middle

SIZE = (40, 50)


def numbered(rows: int, columns: int, dark: frozenset[tuple[int, int]] = frozenset()) -> LightField:
    """Flat views, whose red is their column and whose green is their row, both of 20."""
    views = np.zeros((rows, columns, *SIZE, 3), np.float32)
    views[..., 0] = np.arange(columns)[:, None, None] / 20
    views[..., 1] = np.arange(rows)[:, None, None, None] / 20
    return LightField(views, "numbered", "", "", dark=dark)


def viewpoints(count: int, low: float = 0.0, high: float = 1.0) -> Iterator[tuple[float, float]]:
    for u, v in np.random.default_rng(1).uniform(low, high, (count, 2)):
        yield float(u), float(v)


@pytest.mark.parametrize(
    ("grid", "steps"), [((8, 8), (1, 1)), ((3, 3), (1, 1)), ((5, 9), (1, 2)), ((2, 2), (1, 1)), ((4, 6), (3, 5))]
)
def test_between_the_corners_inputs_are_the_next_views_along_both_axes(grid: tuple[int, int], steps: tuple[int, int]) -> None:
    """Their distances are equal parts of both baselines: one disparity serves both."""
    field = numbered(*grid)
    for u, v in viewpoints(200):
        cell = cell_around(field, u, v)
        assert (cell.rows, cell.columns) == steps
        assert cell.rows / (grid[0] - 1) == pytest.approx(cell.columns / (grid[1] - 1)) == cell.share(field)
        at = cell.within(field, u, v)
        assert all(0 <= place <= 1 for place in at)
        first, last = field.position(cell.row, cell.column), field.position(cell.row + cell.rows, cell.column + cell.columns)
        assert at == pytest.approx([(q - a) / (b - a) for q, a, b in zip((u, v), first, last, strict=True)])


def test_at_a_captured_view_it_is_one_of_the_inputs() -> None:
    field = numbered(8, 8)
    for row in range(8):
        for column in range(8):
            place = cell_around(field, *field.position(row, column)).within(field, *field.position(row, column))
            assert place in CORNERS or min(hypot(place[0] - p, place[1] - q) for p, q in CORNERS) < 1e-12


def test_beyond_the_corners_inputs_lie_far_enough_apart() -> None:
    field = numbered(8, 8)
    for u, v in viewpoints(300, -EXTRAPOLATION_LIMIT, 1 + EXTRAPOLATION_LIMIT):
        cell = cell_around(field, u, v)
        beyond = 7 * max(-u, u - 1, -v, v - 1, 0.0)  # in views
        assert all(-0.25 <= place <= 1.25 for place in cell.within(field, u, v))
        smallest = max(1, int(np.ceil(beyond / 0.25)))
        assert cell.rows == cell.columns == smallest
    assert cell_around(field, -0.25, 0.5) == Cell(0, 0, 7, 7)
    for u, v in ((1.3, 0.5), (0.5, float("nan"))):
        with pytest.raises(InputError, match="The viewpoint's"):
            cell_around(field, u, v)


def test_dark_views_are_no_inputs() -> None:
    """As the outermost ones of an Illum's 14 x 14 views are, and here one within."""
    dark = frozenset({(0, 0), (0, 1), (1, 0), (3, 3)})
    field = numbered(7, 7, dark)
    for u, v in viewpoints(300):
        cell = cell_around(field, u, v)
        lines, places = (cell.row, cell.row + cell.rows), (cell.column, cell.column + cell.columns)
        taken = {(line, place) for line in lines for place in places}
        if (cell.rows, cell.columns) != (6, 6):
            assert not taken & dark
            assert all(0 <= place <= 1 for place in cell.within(field, u, v))
    around_the_dark_one = cell_around(field, 0.5, 0.5)
    assert around_the_dark_one.rows == 2  # the cells of neighbours all have it as a corner
    assert cell_around(field, 0.01, 0.01) == Cell(0, 0, 6, 6)  # nothing else is around this


def test_the_model_gets_the_views_around_the_viewpoint_and_its_place_between_them() -> None:
    """Of flat views that grow evenly from view to view, the bilinear blend of any four is known everywhere."""
    field = numbered(8, 5)
    square = replace(field, views=field.views[:5])
    found = NearestInputs(Blender("blender"))
    found.set_light_field(square)
    for u, v in viewpoints(40):
        synthesis = found.synthesize(u, v)
        expected = np.broadcast_to(np.float32([u * 4 / 20, v * 4 / 20, 0]), (*SIZE, 3))
        np.testing.assert_allclose(synthesis.image, expected, atol=1e-5)
        assert (synthesis.u, synthesis.v, synthesis.model) == (u, v, NEIGHBOURS)


def test_disparities_are_of_the_whole_baseline() -> None:
    field = numbered(8, 8)
    found = NearestInputs(Blender("blender"))  # whose disparity is u - v, as it is asked
    found.set_light_field(field)
    disparity = found.synthesize(0.6, 0.48).disparity
    assert disparity is not None and disparity.dtype == np.float32
    np.testing.assert_allclose(disparity, 7 * ((0.6 * 7 - 4) - (0.48 * 7 - 3)), rtol=1e-5)
    flat = NearestInputs(Blender("flat"))
    flat.set_light_field(field)
    assert flat.synthesize(0.5, 0.5).disparity is None


def test_with_the_four_corners_alone_it_is_the_model_itself() -> None:
    field = plane(3.0, (2, 2), (96, 128))
    model, found = make_synthesizer("realtime"), make_synthesizer(NEIGHBOURS)
    for synthesizer in (model, found):
        synthesizer.set_light_field(field)
    expected, synthesis = model.synthesize(0.3, 0.8), found.synthesize(0.3, 0.8)
    np.testing.assert_array_equal(synthesis.image, expected.image)
    np.testing.assert_array_equal(synthesis.disparity, expected.disparity)
    assert expected.warped is not None
    np.testing.assert_array_equal(synthesis.warped, expected.warped)
    assert found.key != model.key and found.key == make_synthesizer(NEIGHBOURS).key


def test_a_plane_is_seen_where_it_is() -> None:
    """A plane of known disparity, larger than the networks could find from corner to corner."""
    disparity, size = 40.0, (96, 128)
    field = plane(disparity, (5, 5), size)
    found = make_synthesizer(NEIGHBOURS)
    found.set_light_field(field)
    synthesis = found.synthesize(0.4, 0.65)
    inside = (slice(24, -24), slice(24, -24))
    assert synthesis.disparity is not None
    assert float(np.median(synthesis.disparity[inside])) == pytest.approx(disparity, abs=1.0)
    y, x = np.mgrid[: size[0], : size[1]].astype(np.float32)
    truth = smooth_texture(x - disparity * np.float32(0.4), y - disparity * np.float32(0.65))
    assert float(np.abs(synthesis.image - truth)[inside].mean()) < 0.01


class Tinted(Blender):
    """The blend, all of it too bright, and with a pattern of stripes, finer than a block, that is its own."""

    def __init__(self, excess: float) -> None:
        super().__init__("tinted")
        self.excess = excess

    def synthesize(self, u: float, v: float, cancelled: Callable[[], bool] = never) -> Synthesis:
        made = super().synthesize(u, v, cancelled)
        stripes = np.where(np.arange(made.image.shape[1]) % 2, 0.05, -0.05).astype(np.float32)[:, None]
        return replace(made, image=made.image + np.float32(self.excess) + stripes)


def test_colours_in_the_coarse_are_those_of_the_inputs() -> None:
    field = replace(numbered(3, 3), views=numbered(3, 3).views + np.float32(0.3))
    found = NearestInputs(Tinted(0.02))
    found.set_light_field(field)
    image = found.synthesize(0.5, 0.25).image
    expected = np.float32([0.3 + 1 / 20, 0.3 + 0.5 / 20, 0.3])
    np.testing.assert_allclose(image.mean((0, 1)), expected, atol=1e-3)
    np.testing.assert_allclose(image[:, 21] - image[:, 20], 0.1, atol=2e-3)  # what is finer stays
    beyond = found.synthesize(0.75, -0.05).image  # as at the edge
    np.testing.assert_allclose(beyond.mean((0, 1)), np.float32([0.3 + 1.5 / 20, 0.3, 0.3]), atol=1e-3)
    corners = replace(field, views=field.views[::2, ::2])
    found.set_light_field(corners)
    alone = found.synthesize(0.5, 0.5).image
    np.testing.assert_allclose(alone.mean((0, 1)), np.float32([0.37, 0.37, 0.32]), atol=1e-3)  # the model knows better there


@pytest.mark.parametrize("size", [(16, 16), (7, 200), (376, 541), (100, 33)])
def test_coarse_colours_keep_what_changes_slowly_and_lose_what_is_fine(size: tuple[int, int]) -> None:
    colours = CoarseColours(*size)
    y, x = np.mgrid[: size[0], : size[1]].astype(np.float32)
    flat = np.full((*size, 3), 0.4, np.float32)
    np.testing.assert_allclose(colours.spread(colours.of(flat)), flat, atol=1e-6)
    ramp = np.stack([0.1 + 0.002 * x, 0.2 + 0.001 * y, 0.3 + 0.001 * (x + y)], -1)
    inside = tuple(slice(2 * BLOCK, max(length - 2 * BLOCK, 0)) for length in size)
    np.testing.assert_allclose(colours.spread(colours.of(ramp))[inside], ramp[inside], atol=1e-3)
    board = np.repeat(((x + y) % 2 - 0.5)[..., None], 3, -1)
    assert float(np.abs(colours.spread(colours.of(board))).max()) < 0.04


class Failing(Blender):
    """Cannot take a light field the first time."""

    taken = 0

    def set_light_field(self, light_field: LightField) -> None:
        self.taken += 1
        if self.taken == 1:
            raise InputError("No room.")
        super().set_light_field(light_field)


def test_what_could_not_be_taken_is_taken_again_and_what_was_is_not() -> None:
    model = Failing("failing")
    found = NearestInputs(model)
    with pytest.raises(InputError, match="No light field is set"):
        found.synthesize(0.5, 0.5)
    found.set_light_field(numbered(8, 8))
    assert model.taken == 0  # with the first query only
    with pytest.raises(InputError, match="No room"):
        found.synthesize(0.5, 0.5)
    found.synthesize(0.5, 0.5)
    found.synthesize(0.51, 0.52)
    assert model.taken == 2
    found.synthesize(0.6, 0.52)
    assert model.taken == 3


def test_weights_are_told_where_the_model_can() -> None:
    field, weigher = numbered(8, 8), NearestInputs(Weigher("weigher"))
    weigher.set_light_field(field)
    assert isinstance(weigher, WeighingSynthesizer) and weighs(weigher)
    weights = weigher.synthesize_weighed(0.5, 0.5).weights
    assert weights is not None and set(np.unique(weights)) == {63}  # a quarter of 255 each: in the middle of four views
    assert weigher.synthesize(0.5, 0.5).weights is None
    plain = NearestInputs(Blender("blender"))
    plain.set_light_field(field)
    assert not weighs(plain) and plain.synthesize_weighed(0.5, 0.5).weights is None


def test_the_views_around_go_to_another_process() -> None:
    field = moving(4, 4, SIZE)
    with SynthesisProcess(make) as process:
        there, here = NearestInputs(RemoteSynthesizer(process, "blender")), NearestInputs(Blender("blender"))
        for synthesizer in (there, here):
            synthesizer.set_light_field(field)
        for u, v in [*viewpoints(5), (0.5, 0.5), (1.1, -0.1)]:
            expected, found = here.synthesize(u, v), there.synthesize(u, v)
            np.testing.assert_array_equal(found.image, expected.image)
            np.testing.assert_array_equal(found.disparity, expected.disparity)


def test_nearer_inputs_make_a_better_picture() -> None:
    """Of the sample, from views two apart, without the one that is compared with."""
    field, viewpoint, truth = without_middle(open_light_field(sample_path()))
    assert (field.rows, field.columns) == (4, 4) and viewpoint == (0.5, 0.5)
    scores = {}
    for name in ("realtime", NEIGHBOURS):
        synthesizer = make_synthesizer(name)
        synthesizer.set_light_field(field)
        scores[name] = k16(synthesizer.synthesize(*viewpoint).image, truth).psnr
    assert scores[NEIGHBOURS] > scores["realtime"] + 2


def test_no_protocol_scores_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    report = tmp_path / "report.html"
    assert main(["eval", str(sample_path()), "--model", "mean", "--model", NEIGHBOURS, "--report", str(report)]) == 2
    output = capsys.readouterr()
    assert output.out == "" and not report.exists()
    assert "score realtime, whose networks it uses" in output.err and "Traceback" not in output.err


@pytest.fixture
def window() -> Iterator[Program]:
    made = Program(never_scored=frozenset({"second"}))
    made.state.foresight = False
    made.open()
    yield made
    made.controller.stop()


def test_the_window_scores_no_model_that_sees_captured_views(window: Program) -> None:
    controller, second = window.controller, window.models["second"]
    window.state.tab = Tab.COMPARE
    window.until(lambda: dict(controller.readout(None).compared.table)["first"] is not None)
    window.idle()
    compared = controller.readout(None).compared
    assert compared.never_scored == {"second"} and dict(compared.table)["second"] is None
    assert second.asked == []  # nor is it asked for a picture that nobody looks at
    window.state.model = "second"
    window.state.score_all = True
    window.until(lambda: controller.picture is not None and controller.picture.synthesis.model == "second")
    window.idle()
    readout = controller.readout(None)
    assert second.asked == [(0.5, 0.5)]  # once, though there is no score
    assert readout.compared.score is None and not any(readout.compared.views)
    assert controller.picture is not None and controller.picture.final and not controller.synthesizing
    window.state.model = "first"
    window.until(lambda: controller.readout(None).compared.score is not None)


def test_the_map_of_scores_says_why_there_are_none() -> None:
    grid = Grid(3, 3, 100, 80)
    readout = Readout(model=NEIGHBOURS, grid=grid, compared=Compared(never_scored=frozenset({NEIGHBOURS})))
    assert "an input, not scored" in score_map._words(readout, grid, 1)
    assert "not scored yet" in score_map._words(replace(readout, model="full"), grid, 1)


def test_the_window_tells_which_views_are_the_inputs(window: Program) -> None:
    controller = window.controller
    assert controller.readout(None).inputs == {(0, 0), (0, 2), (2, 0), (2, 2)}
    choice = ModelChoice(lambda: NearestInputs(Blender("blender")), False, scored=False)
    named = Controller(
        Engine(choice.make, 2**20, name=NEIGHBOURS, scored=choice.scored), lambda *_: moving(), lambda: None, NEIGHBOURS
    )
    assert not named.readout(None).inputs  # nothing is open
    named.show_light_field(moving())
    named.state.move_to(0.6, 0.3)
    assert named.readout(None).inputs == {(0, 1), (0, 2), (1, 1), (1, 2)}
    named.stop()
