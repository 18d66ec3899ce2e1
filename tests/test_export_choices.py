"""What is chosen in the tab Export becomes a plan, and a plan becomes choices again."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

import pytest
from privileges import without_privileges

from app.export_choices import KEY_FRAMES, ExportChoices, Format, Product, drawn_path
from app.export_jobs import Source, chosen_job
from app.exports import plan_file, take_plan
from lfcore.errors import InputError
from lfcore.key_frames import Stop
from lfcore.sweep_plan import KeyFramePath, Layer, ShapePath, SweepPlan, save_plan
from lfcore.sweep_target import Kind
from tests.moving_scene import TruthSynthesizer, light_field

PLANS = [
    SweepPlan(ShapePath("spiral", 0.25), 7, 12, Layer.DISPARITY, True, 0.5, True, 3.0, 0.5, 2),
    SweepPlan(ShapePath("lawnmower", 0.25, (-1.0, 2.0)), 7),
    SweepPlan(KeyFramePath((Stop(0, 0), Stop(1, 1)), closed=True)),
    SweepPlan(KeyFramePath((Stop(0, 0, -1.5), Stop(1, 1, 2)))),
]


@pytest.mark.parametrize("plan", PLANS)
def test_a_plan_that_was_taken_is_the_plan(plan: SweepPlan, tmp_path: Path) -> None:
    choices = ExportChoices(product=Product.QUILT, key_frames=(Stop(0.5, 0.5),), playing=True)
    save_plan(tmp_path / "my way.json", plan)
    take_plan(tmp_path / "my way.json", choices)
    assert choices.plan() == plan
    assert (choices.product, choices.name, choices.playing) == (Product.SWEEP, "my way", False)


def test_key_frames_are_added_and_removed() -> None:
    choices = ExportChoices()
    choices.remove_last_key_frame()
    choices.add_key_frame(0.25, 0.5, 0.0)
    choices.add_key_frame(0.75, 0.5, 3.0)
    assert choices.shape == KEY_FRAMES
    assert choices.path() == KeyFramePath((Stop(0.25, 0.5), Stop(0.75, 0.5)), closed=True)
    choices.refocus = True
    assert choices.path() == KeyFramePath((Stop(0.25, 0.5, 0.0), Stop(0.75, 0.5, 3.0)), closed=True)
    choices.add_or_remove_key_frame(0.5, 0.9, 0.0)
    choices.add_or_remove_key_frame(0.76, 0.49, 0.0)  # near the second
    assert [key.u for key in choices.key_frames] == [0.25, 0.5]
    choices.remove_last_key_frame()
    assert [key.u for key in choices.key_frames] == [0.25]


def test_a_path_without_key_frames_is_a_fault_that_is_told() -> None:
    choices = ExportChoices(shape=KEY_FRAMES)
    assert "press K" in choices.fault
    assert drawn_path(choices) == ()
    with pytest.raises(InputError):
        choices.plan()
    for name in (" ", "a/b", "a\0b", ".", ".."):
        assert "name" in ExportChoices(name=name, folder="/tmp").fault
    for folder in ("", "  ", "/tmp\0"):
        assert "Give the folder" in ExportChoices(folder=folder).fault
    assert "unknown here" in ExportChoices(folder="~nobody of this name/x").fault
    assert "leave out labels" in ExportChoices(format=Format.EXR, labels=True).fault
    assert ExportChoices(format=Format.PNG, labels=True, folder="/tmp").fault == ""
    assert ExportChoices(folder="/tmp").fault == ""
    assert ExportChoices(folder="~").fault == ""


@pytest.mark.parametrize(
    ("product", "form", "is_folder"),
    [
        (Product.SWEEP, Format.MP4, False),
        (Product.SWEEP, Format.EXR, True),
        (Product.VIEWS, Format.MP4, True),
        (Product.ESLF, Format.PNG, False),
    ],
)
def test_a_dot_in_a_name_makes_no_file_of_a_folder(product: Product, form: Format, is_folder: bool) -> None:
    assert ExportChoices(product=product, format=form, name="IMG_1.5 sweep", folder="/tmp").is_folder == is_folder


def test_a_place_whose_name_is_no_text_is_not_suggested(tmp_path: Path) -> None:
    folder = Path(os.fsdecode(os.fsencode(tmp_path) + b"/caf\xe9"))
    folder.mkdir()
    choices = ExportChoices()
    choices.suggest(str(folder / "capture.lfp"), "caf\udce9")
    assert choices.folder == str(Path.home()) and choices.name == "caf? sweep"


def test_a_closed_path_is_drawn_back_to_its_beginning() -> None:
    line = drawn_path(ExportChoices())
    assert line[0] == line[-1]
    assert len({(stop.u, stop.v) for stop in line}) == len(line) - 1
    assert drawn_path(ExportChoices(shape="lawnmower"))[0] != drawn_path(ExportChoices(shape="lawnmower"))[-1]


def test_the_preview_keeps_the_rate() -> None:
    choices = ExportChoices(frames=4, fps=10)
    stops = choices.plan().stops()
    assert choices.stop_at(5.0) is None
    choices.play()
    assert choices.next_stop_in(5.0) is None
    assert [choices.stop_at(5.0 + t) for t in (0, 0.05, 0.15, 0.25, 0.35, 0.45)] == [stops[k] for k in (0, 0, 1, 2, 3, 0)]
    assert choices.next_stop_in(5.03) == pytest.approx(0.07)
    choices.play()
    assert choices.stop_at(5.5) is None
    empty = ExportChoices(shape=KEY_FRAMES)
    empty.play()
    assert empty.stop_at(1.0) is None
    assert not empty.playing


@pytest.mark.parametrize(
    ("product", "format", "name", "total"),
    [
        (Product.SWEEP, Format.GIF, "a.b.gif", 120),
        (Product.SWEEP, Format.EXR, "a.b", 120),
        (Product.VIEWS, Format.GIF, "a.b", 25),
        (Product.ESLF, Format.GIF, "a.b.png", 25),
        (Product.QUILT, Format.GIF, "a.b_qs8x6a1.333.png", 48),
    ],
)
def test_products_become_jobs_with_their_targets(product: Product, format: Format, name: str, total: int) -> None:
    choices = ExportChoices(product=product, format=format, folder="~/out", name="a.b", side=5)
    asked = chosen_job(choices, Source(light_field(), "truth", TruthSynthesizer, lambda: False))
    assert (asked.target, asked.total) == (Path.home() / "out" / name, total)
    assert plan_file(choices) == Path.home() / "out" / "a.b.json"


def test_formats_know_their_kind() -> None:
    assert {each.extension for each in Format if each.kind is Kind.VIDEO} == {".mp4", ".webm", ".webp", ".gif"}
    assert [Format.PNG.kind, Format.EXR.kind] == [Kind.PNG, Kind.EXR]


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="Windows has no such permissions")
def test_exports_go_home_where_the_folder_is_read_only() -> None:
    choices = ExportChoices()
    with tempfile.TemporaryDirectory() as folder:  # tmp_path lies in a folder that others may not enter at all
        capture = str(Path(folder) / "rock.png")
        Path(folder).chmod(0o777)
        with without_privileges():
            choices.suggest(capture, "rock")
        assert choices.folder == folder
        Path(folder).chmod(0o555)
        with without_privileges():
            choices.suggest(capture, "rock")
        assert choices.folder == str(Path.home())
        Path(folder).chmod(0o700)


def test_exports_go_beside_the_light_field(tmp_path: Path) -> None:
    choices = ExportChoices()
    choices.suggest(str(tmp_path / "rock.png"), "rock")
    assert (choices.folder, choices.name) == (str(tmp_path), "rock sweep")
