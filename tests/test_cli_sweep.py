"""`lfview sweep`: its options come to the frames; the same plan gives the same frames as the library; bad input."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

from app.__main__ import main
from app.cli.sweep import LAYER_NAMES, PATH_NAMES
from lfcore.export import write_picture
from lfcore.formats import open_light_field
from lfcore.key_frames import Stop
from lfcore.sweep import PATHS
from lfcore.sweep_frames import SweepFrames, remembering
from lfcore.sweep_plan import KeyFramePath, Layer, ShapePath, SweepPlan, load_plan, save_plan
from lfcore.synthesizer import MeanSynthesizer
from tests.moving_scene import light_field


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("a scene é")
    for row, views in enumerate(light_field(3, 3, (48, 64)).views):
        for column, view in enumerate(views):
            write_picture(folder / f"view_{row:02}_{column:02}.png", view)
    return folder


def sweep(scene: Path, *options: object) -> int:
    return main(["sweep", str(scene), "--model", "mean", *map(str, options)])


def frames(folder: Path) -> list[np.ndarray]:
    return [np.asarray(oiio.ImageBuf(str(file)).get_pixels(oiio.UINT8)) for file in sorted(folder.iterdir())]


def test_what_is_offered_is_what_the_library_has() -> None:
    assert set(PATH_NAMES) == set(PATHS)
    assert set(LAYER_NAMES) == {layer.value for layer in Layer}


@pytest.mark.parametrize(
    "plan",
    [
        SweepPlan(
            KeyFramePath((Stop(0, 0), Stop(1, 0.5), Stop(0.5, 1)), closed=True), 5, layer=Layer.BESIDE_CAPTURED, labels=True
        ),
        SweepPlan(ShapePath("circle", 0.4), 3, layer=Layer.ERROR, scale=0.5, gain=2),
    ],
)
def test_a_saved_plan_gives_the_frames_of_the_library(scene: Path, tmp_path: Path, plan: SweepPlan) -> None:
    save_plan(tmp_path / "plan.json", plan)
    assert sweep(scene, "--path", tmp_path / "plan.json", "--out", tmp_path / "f", "--as", "png") == 0
    opened = open_light_field(scene)
    expected = SweepFrames(plan, opened, remembering(opened, MeanSynthesizer()))
    found = frames(tmp_path / "f")
    assert len(found) == len(expected) == plan.frames
    assert all(np.array_equal(frame, expected.picture(index)) for index, frame in enumerate(found))


def test_options_make_a_plan_and_stand_over_that_of_a_file(scene: Path, tmp_path: Path) -> None:
    saved = tmp_path / "plan.json"
    line = ["--path", "line", "--from", "-0.1,0", "--to", "1,1", "--focus", "-2,3", "--aperture", 0.4]
    rest = ["--frames", 2, "--fps", 7, "--layer", "image+captured", "--labels", "--width", 32, "--brighten", "--plays", 2]
    assert sweep(scene, *line, *rest, "--out", tmp_path / "a.gif", "--save-path", saved) == 0
    path = KeyFramePath((Stop(-0.1, 0, -2), Stop(1, 1, 3)))
    assert load_plan(saved) == SweepPlan(path, 2, 7, Layer.BESIDE_CAPTURED, True, 0.5, True, 8, 0.4, 2)
    again = ["--path", saved, "--layer", "image", "--frames", 3]
    assert sweep(scene, *again, "--out", tmp_path / "f", "--as", "png", "--save-path", saved) == 0
    assert load_plan(saved) == SweepPlan(path, 3, 7, Layer.IMAGE, True, 0.5, True, 8, 0.4, 2)
    assert len(frames(tmp_path / "f")) == 3


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--path", "zigzag"], "no path 'zigzag'"),
        (["--path", "DIR/none.json"], "cannot be read"),
        (["--path", "line", "--radius", "0.2"], "no radius"),
        (["--from", "0,0"], "--path line"),
        (["--path", "line", "--to", "3,0"], "must lie from"),
        (["--focus", "near"], "no focus"),
        (["--focus", "nan"], "focus"),
        (["--layer", "depth"], "no layer 'depth'"),
        (["--scale", "2", "--width", "30"], "not allowed with"),
        (["--width", "1"], "--width is 1 px"),
        (["--plays", "2"], "--plays is for .webp and .gif"),
        (["--as", "exr", "--labels"], "leave out labels"),
        (["--layer", "disparity"], "mean has no disparity"),
        (["--save-path", "DIR/plan.txt"], ".json"),
    ],
)
def test_bad_input_is_one_sentence_and_leaves_nothing(
    scene: Path, tmp_path: Path, options: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    given = [option.replace("DIR", str(tmp_path)) for option in options]
    assert sweep(scene, "--out", tmp_path / ("f" if "--as" in given else "a.mp4"), *given) == 2
    said = capsys.readouterr().err
    assert words in said
    assert said.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_a_whole_path_in_a_file_takes_no_ends(scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    save_plan(tmp_path / "plan.json", SweepPlan(ShapePath("circle", 0.3)))
    assert sweep(scene, "--path", tmp_path / "plan.json", "--radius", 0.2, "--out", tmp_path / "a.mp4") == 2
    assert "holds a whole path" in capsys.readouterr().err
