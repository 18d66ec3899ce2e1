"""`lfview eval` from outside: protocols, the whole grid, noise, the report, and what one bad file does to the rest."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from app.__main__ import main
from app.cli.evaluate import PROTOCOL_NAMES
from lfcore.export import write_picture
from lfcore.protocols import PROTOCOLS


def write_scene(folder: Path, side: int, seed: int = 0) -> Path:
    """A scene of side x side noisy grey views of 64 x 72 px."""
    folder.mkdir(parents=True)
    values = 120 + np.random.default_rng(seed).normal(0, 3, (side, side, 64, 72, 3))
    for row in range(side):
        for column in range(side):
            write_picture(folder / f"view_{row:02}_{column:02}.png", values[row, column].astype(np.uint8))
    return folder


@pytest.fixture(scope="module")
def scenes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("scenes")
    write_scene(folder / "eight", 8)
    write_scene(folder / "three", 3)
    return folder


def test_the_protocols_offered_are_those_of_the_library() -> None:
    assert {name.lower(): name for name in PROTOCOL_NAMES} == {name: p.name for name, p in PROTOCOLS.items()}


def test_one_bad_file_does_not_lose_the_others(scenes: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    broken = tmp_path / "broken"
    broken.mkdir()
    for name in ("view_00_00.png", "view_00_01.png", "view_01_00.png", "view_01_01.png"):
        (broken / name).write_bytes(b"\x89PNG no picture")
    target, report = tmp_path / "scores.json", tmp_path / "report.html"
    arguments = ["eval", str(broken), str(scenes), "--model", "mean", "--json", str(target), "--report", str(report)]
    assert main(arguments) == 2
    output = capsys.readouterr()
    assert len(output.err.strip().splitlines()) == 1 and "broken" in output.err
    assert [scene["name"] for scene in json.loads(target.read_text())["scenes"]] == ["eight", "three"]
    text = report.read_text(encoding="utf-8")
    assert "Not scored" in text and "broken" in text and "eight" in text


def test_the_protocol_is_named_and_refuses_grids_that_do_not_fit(
    scenes: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    target = tmp_path / "scores.json"
    assert main(["eval", str(scenes), "--model", "mean", "--protocol", "7X7-y", "--json", str(target)]) == 2
    output = capsys.readouterr()
    assert output.out.startswith("7x7-Y on ")
    assert "found 3 x 3 views, but the protocol 7x7-Y is about 7 x 7" in output.err
    found = json.loads(target.read_text())
    assert found["protocol"] == "7x7-Y"
    (scene,) = found["scenes"]
    assert len(scene["views"]) == 45
    assert scene["psnr"] == pytest.approx(sum(view["psnr"] for view in scene["views"]) / 45, abs=1e-3)
    assert main(["eval", str(scenes / "eight"), "--model", "mean", "--protocol", "8x8-BGR", "--json", "-"]) == 0
    assert len(json.loads(capsys.readouterr().out)["scenes"][0]["views"]) == 60


def test_grid_and_noise_are_added_where_they_are_asked_for(
    scenes: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    report = tmp_path / "report.html"
    common = ["eval", str(scenes / "three"), "--model", "mean", "--json", "-"]
    assert main(common) == 0
    plain = json.loads(capsys.readouterr().out)["scenes"][0]
    assert set(plain) == {"name", "psnr", "ssim", "seconds"}
    assert main([*common, "--grid", "--noise", "--report", str(report)]) == 0
    full = json.loads(capsys.readouterr().out)["scenes"][0]
    assert (full["psnr"], full["ssim"]) == (plain["psnr"], plain["ssim"])
    assert len(full["views"]) == 5
    assert full["noise"]["captured"][0] == pytest.approx(3, rel=0.1)
    assert full["noise"]["ratio"][0] == pytest.approx(0.5, rel=0.1)
    text = report.read_text(encoding="utf-8")
    assert "PSNR over the grid" in text and "Noise" in text


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["--protocol", "K17"], "choose K16, 7x7-Y or 8x8-BGR"),
        (["--report", "DIR/report.pdf"], ".html"),
        (["--report", "DIR/none/report.html"], "does not exist"),
        (["--curve", "DIR/none.csv"], "No training curve"),
    ],
)
def test_bad_options_are_named_before_the_work(
    scenes: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], expected: str
) -> None:
    filled = [argument.replace("DIR", str(tmp_path)) for argument in arguments]
    assert main(["eval", str(scenes / "three"), "--model", "mean", *filled]) == 2
    output = capsys.readouterr()
    assert output.out == "" and expected in output.err


def test_ctrl_c_leaves_no_file_behind(scenes: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("lfcore.synthesizer.MeanSynthesizer.synthesize", interrupted)
    report = tmp_path / "report.html"
    assert main(["eval", str(scenes / "three"), "--model", "mean", "--report", str(report)]) == 130
    assert list(tmp_path.iterdir()) == []


def test_scenes_of_one_name_keep_their_own_noise(tmp_path: Path) -> None:
    paths = []
    for folder, spread in (("a", 2), ("b", 5)):
        (tmp_path / folder / "scene").mkdir(parents=True)
        values = 120 + np.random.default_rng(1).normal(0, spread, (3, 3, 64, 72, 3))
        for row in range(3):
            for column in range(3):
                write_picture(tmp_path / folder / "scene" / f"view_{row}_{column}.png", values[row, column].astype(np.uint8))
        paths.append(str(tmp_path / folder / "scene"))
    target = tmp_path / "scores.json"
    assert main(["eval", *paths, "--model", "mean", "--noise", "--json", str(target)]) == 0
    noises = [scene["noise"]["captured"][0] for scene in json.loads(target.read_text())["scenes"]]
    assert noises == [pytest.approx(2, rel=0.1), pytest.approx(5, rel=0.1)]
