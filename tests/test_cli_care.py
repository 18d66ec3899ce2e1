"""The command line takes care: of what it reads, of other results, of memory, of closed streams and of huge numbers."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest
import torch
from privileges import without_privileges
from scenes import plane

from app.__main__ import main
from app.cli import decode
from app.cli.common import scenes_in
from lfcore.errors import InputError, OutputError, is_out_of_memory
from lfcore.export import check_apart, write_picture
from lfcore.formats import files_of
from lfcore.metrics import to_uint8
from lfcore.networks import SingleModel
from lfcore.weights import save_weights

ROOT = Path(__file__).parents[1]


def write_views(folder: Path, rows: int = 3, columns: int = 3, size: tuple[int, int] = (50, 54)) -> Path:
    folder.mkdir()
    field = plane(1.0, (rows, columns), size)
    for row in range(rows):
        for column in range(columns):
            write_picture(folder / f"view_{row:02}_{column:02}.png", to_uint8(field.view(row, column)))
    return folder


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    return write_views(tmp_path / "scene")


def refused(arguments: list[str | Path], capsys: pytest.CaptureFixture[str]) -> str:
    """The one sentence on standard error."""
    assert main([str(argument) for argument in arguments]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "bug" not in said
    return said


# What is read, and other results


def test_targets_are_told_from_what_is_read_and_from_each_other_whatever_they_are_called(tmp_path: Path) -> None:
    there = tmp_path / "there.png"
    there.write_bytes(b"")
    (tmp_path / "linked.png").symlink_to(there)
    (tmp_path / "hard.png").hardlink_to(there)
    (tmp_path / "loop").symlink_to("loop")
    for same in (there, tmp_path / "no" / ".." / "there.png", tmp_path / "linked.png", tmp_path / "hard.png"):
        with pytest.raises(OutputError, match="it is read for this"):
            check_apart([same], [there])
        with pytest.raises(OutputError, match="something else is to be written there"):
            check_apart([there, same])
    check_apart([there, tmp_path / "new.png", tmp_path / "loop"], [tmp_path / "other.png", tmp_path])


def test_the_files_of_a_light_field(scene: Path) -> None:
    views = sorted(scene.iterdir())
    assert sorted(files_of(scene)) == views
    assert set(files_of(views[0])) == set(views)
    (scene / "notes.txt").write_text("no view")
    assert files_of(scene / "notes.txt") == [scene / "notes.txt"]
    assert files_of(scene / "none") == []


def test_synth_and_sweep_overwrite_neither_their_light_field_nor_another_result(
    scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    one, model = ["synth", scene, "--uv", "0.5,0.5"], ["--model", "mean"]
    eslf = tmp_path / "eslf.png"
    write_picture(eslf, np.zeros((28, 28, 3), np.uint8))
    before = {path: path.read_bytes() for path in (eslf, *scene.iterdir())}
    assert "it is read" in refused(["synth", eslf, "--uv", "0,0", "--out", eslf, *model], capsys)
    assert "it is read" in refused(["synth", eslf, "--grid", "2", "--out", eslf, *model], capsys)
    assert "it is read" in refused([*one, "--out", scene / "view_01_01.png", *model], capsys)
    assert "it is read" in refused([*one, "--out", tmp_path / "a.png", "--warped", scene], capsys)
    assert "it is read" in refused(["sweep", scene, "--as", "png", "--out", scene, *model], capsys)
    exr, warped = tmp_path / "a.exr", tmp_path / "warped_u0_v0.png"
    assert "something else" in refused([*one, "--out", exr, "--disparity", exr], capsys)
    assert "something else" in refused([*one, "--out", warped, "--warped", tmp_path], capsys)
    assert before == {path: path.read_bytes() for path in before}
    assert not exr.exists() and not warped.exists()


def test_train_overwrites_neither_what_it_begins_with_nor_its_own_checkpoint(
    scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    given, run = tmp_path / "w.safetensors", tmp_path / "run"
    run.mkdir()
    save_weights(given, SingleModel(), {})
    before = given.read_bytes()
    train = ["train", "--data", scene, "--model", "single", "--out"]
    assert "something else" in refused([*train, run / "checkpoint.safetensors", "--run-dir", run], capsys)
    assert "something else" in refused([*train, run / "w.safetensors", "--run-dir", run / "w.safetensors"], capsys)
    assert "it is read" in refused([*train, given, "--init", given], capsys)
    assert "it is read" in refused([*train, given, "--teacher", given], capsys)
    assert "it is read" in refused([*train, f"{scene}.safetensors"], capsys)  # its run folder would be the scene's
    assert given.read_bytes() == before and list(run.iterdir()) == []


def test_decode_does_not_overwrite_a_capture(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capture = tmp_path / "capture.json"  # where the facts of capture.png would go
    capture.write_bytes(b"raw")
    assert "it is read" in refused(["decode", capture, "--out", tmp_path / "capture.png"], capsys)
    assert capture.read_bytes() == b"raw"


# Several scenes


def test_eval_names_scenes_that_cannot_be_scored_and_goes_on_where_one_takes_too_much_memory(
    scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    write_views(tmp_path / "tiny", size=(40, 40))
    write_views(tmp_path / "odd", 2, 3)
    large = write_views(tmp_path / "large")
    from app.cli import evaluate

    opened = evaluate.open_and_warn

    def want_of_memory(path: Path, *rest: int) -> object:
        if path == large:
            torch.empty(2**60)
        return opened(path, *rest)

    monkeypatch.setattr(evaluate, "open_and_warn", want_of_memory)
    assert main(["eval", "--model", "mean", *(str(tmp_path / name) for name in ("large", "odd", "scene", "tiny"))]) == 2
    output = capsys.readouterr()
    assert "scene" in output.out and "dB" in output.out
    first, second, third = output.err.splitlines()
    assert f"{large}: there is not enough memory" in first
    assert "odd: found 2 x 3 views" in second
    assert "tiny: the views are 40 x 40 px" in third


def test_sentences_of_eval_say_which_light_field_they_are_about() -> None:
    from app.cli.evaluate import _named

    assert _named(Path("a/b.png"), "The window is too small.") == "a/b.png: The window is too small."
    assert _named(Path("a/b.png"), "b: found none.") == "b: found none."
    assert _named(Path("a/b.png"), "a/b.png is truncated.") == "a/b.png is truncated."


def test_a_folder_that_cannot_be_read_is_left_to_whoever_opens_it() -> None:
    with tempfile.TemporaryDirectory() as place:  # below pytest's folders root alone may look
        Path(place).chmod(0o755)
        scene, locked = write_views(Path(place) / "scene"), Path(place) / "locked"
        locked.mkdir(mode=0o000)
        with without_privileges():
            assert scenes_in([locked, locked / "inside", scene]) == [locked, locked / "inside", scene]


def test_want_of_memory_fails_one_capture_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    captures = [tmp_path / "a.lfr", tmp_path / "b.lfr"]

    def decoded(path: Path, *_: object) -> None:
        if path.stem == "a":
            torch.empty(2**60)

    monkeypatch.setattr("lfcore.decode.output.captures_in", lambda paths: captures)
    monkeypatch.setattr("lfcore.decode.pipeline.decode_capture", decoded)
    monkeypatch.setattr("lfcore.decode.output.write_eslf", lambda target, field: [target])
    monkeypatch.setattr(decode, "keep", lambda calibration: None)
    threads = torch.get_num_threads()
    assert main(["decode", str(tmp_path), "--out", str(tmp_path / "out"), "--jobs", "1"]) == 2
    torch.set_num_threads(threads)
    output = capsys.readouterr()
    assert output.out == f"{tmp_path / 'out' / 'b.png'}\n"
    assert output.err == f"lfview: {captures[0]}: there is not enough memory to decode it; close other programs.\n"


def test_want_of_memory_is_known_from_other_errors() -> None:
    assert is_out_of_memory(MemoryError()) and is_out_of_memory(RuntimeError("CUDA out of memory. Tried to allocate 2 GiB"))
    assert not is_out_of_memory(RuntimeError("sizes do not match"))


# Streams and numbers


@pytest.mark.skipif(sys.platform == "win32", reason="a shell of POSIX closes the streams")
@pytest.mark.parametrize(("closed", "verb", "status"), [(">&-", "cache", 0), ("2>&-", "info none", 2)])
def test_closed_streams_are_no_bug(tmp_path: Path, closed: str, verb: str, status: int) -> None:
    command = f"LFVIEW_CACHE={tmp_path} exec {sys.executable} -m app {verb} {closed}"
    assert subprocess.run(["sh", "-c", command], cwd=ROOT, check=False, timeout=60).returncode == status


HUGE = "9" * 400


@pytest.mark.parametrize(
    "arguments",
    [["sweep", "s", "--out", "a.gif", "--plays", HUGE], ["sweep", "s", "--out", "a.gif", "--frames", HUGE],
     ["synth", "s", "--uv", "0,0", "--out", "a.png", "--views", HUGE], ["generate", "--out", "g", "--count", "1000000000"],
     ["generate", "--out", "g", "--seed", f"-{HUGE}"], ["generate", "--out", "g", "--workers", "100000"],
     ["train", "--data", "s", "--out", "w.safetensors", "--seed", "99999999999999999999"],
     ["train", "--data", "s", "--out", "w.safetensors", "--lr", "1e300"],
     ["train", "--data", "s", "--out", "w.safetensors", "--generated", "1000000000"],
     ["train", "--data", "s", "--out", "w.safetensors", "--batch", "1000000000"],
     ["train", "--data", "s", "--out", "w.safetensors", "--steps", "1" + "0" * 5000]],
)  # fmt: skip
def test_huge_numbers_are_refused_in_one_sentence(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    said = refused([*arguments], capsys)
    assert "is too large; give at most" in said and len(said) < 200


def test_scenes_that_are_there_are_found_without_looking_for_each(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "generated_00007").mkdir()
    said = refused(["generate", "--count", "100000", "--seed", "5", "--out", tmp_path], capsys)
    assert "generated_00007 is there already" in said


def test_a_large_number_in_a_saved_sweep_is_refused_in_words() -> None:
    from lfcore.sweep_plan import from_json

    with pytest.raises(InputError, match='"plays" is too large a number'):
        from_json({"lfview_sweep": 1, "path": {"shape": "circle"}, "plays": 10**400})
