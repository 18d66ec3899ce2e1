"""The command line: every verb on a small light field, its files read back; bad input in one sentence with exit code 2."""

from __future__ import annotations

import io
import json
import re
import signal
import struct
import subprocess
import sys
import time
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import av
import numpy as np
import numpy.typing as npt
import OpenImageIO as oiio
import pytest
import torch

from app.__main__ import VERBS, main
from app.cli.common import labelled, scenes_in
from app.cli.sweep import PATH_NAMES
from app.progress import Progress, bar, clock
from lfcore.errors import InputError
from lfcore.export import write_picture
from lfcore.lightfield import LightField
from lfcore.metrics import k16, to_uint8
from lfcore.networks import FullModel, ModelConfig, initialise
from lfcore.planesweep import Levels
from lfcore.sweep import PATHS
from lfcore.synthesizer import Synthesis
from lfcore.training.curve import CurvePoint
from lfcore.training.patches import TrainingScene
from lfcore.training.team import Team
from lfcore.weights import save_weights

ROOT = Path(__file__).parents[1]
HEIGHT, WIDTH = 61, 73


def make_views(rows: int, columns: int, seed: int = 0) -> npt.NDArray[np.uint8]:
    """A smooth texture that moves by one pixel per view: (rows, columns, HEIGHT, WIDTH, 3)."""
    random = np.random.default_rng(seed)
    coarse = random.random((20, 24, 3))
    texture = np.repeat(np.repeat(coarse, 4, 0), 4, 1)
    for _ in range(4):
        texture = (texture + np.roll(texture, 1, 0) + np.roll(texture, 1, 1) + np.roll(texture, (1, 1), (0, 1))) / 4
    picture = (255 * texture).astype(np.uint8)
    return np.stack(
        [np.stack([picture[8 - r : 8 - r + HEIGHT, 8 - c : 8 - c + WIDTH] for c in range(columns)]) for r in range(rows)]
    )


def write_views(folder: Path, views: npt.NDArray[np.uint8]) -> Path:
    folder.mkdir(parents=True)
    for r, row in enumerate(views):
        for c, view in enumerate(row):
            write_picture(folder / f"view_{r:02}_{c:02}.png", view)
    return folder


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_views(tmp_path_factory.mktemp("scenes") / "a scene é", make_views(3, 3))


@pytest.fixture(scope="module")
def weights(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Untrained networks: their colour network starts as the average of the warped inputs."""
    path = tmp_path_factory.mktemp("weights") / "untrained.safetensors"
    model = FullModel(ModelConfig(levels=Levels(count=8)))
    initialise(model, 1)
    save_weights(path, model, {})
    return path


def read(path: Path) -> npt.NDArray[np.float32]:
    return np.asarray(oiio.ImageBuf(str(path)).get_pixels(oiio.FLOAT))


RUN = "from app.__main__ import main; import sys; sys.exit(main())"


def run_lfview(*arguments: object, code: str = RUN) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", code, *map(str, arguments)],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


# Help, version, imports


def test_help_names_every_verb_with_an_example(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--help"]) == 0
    text = capsys.readouterr().out
    for verb in VERBS:
        assert re.search(rf"^    {verb}\s", text, re.MULTILINE)
        assert main([verb, "--help"]) == 0
        assert f"usage: lfview {verb}" in (own := capsys.readouterr().out)
        assert "example: lfview" in own


def test_help_imports_nothing_heavy() -> None:
    code = (
        "import sys; from app.__main__ import main; main(['synth', '--help'])\n"
        "heavy = {'torch', 'numpy', 'OpenImageIO', 'av', 'glfw', 'moderngl', 'imgui_bundle'} & set(sys.modules)\n"
        "sys.exit(f'imported {heavy}' if heavy else 0)"
    )
    process = run_lfview(code=code)
    assert process.communicate()[1] == ""
    assert process.returncode == 0


def test_info_imports_neither_torch_nor_the_window(scene: Path) -> None:
    code = (
        "import sys; from app.__main__ import main; main(['info', sys.argv[1]])\n"
        "heavy = {'torch', 'glfw', 'moderngl', 'imgui_bundle'} & set(sys.modules)\n"
        "sys.exit(f'imported {heavy}' if heavy else 0)"
    )
    process = run_lfview(scene, code=code)
    assert process.communicate()[1] == ""
    assert process.returncode == 0


def test_python_m_app_is_the_same_program() -> None:
    done = subprocess.run([sys.executable, "-m", "app", "--version"], cwd=ROOT, capture_output=True, text=True)
    assert (done.returncode, done.stdout[:7], done.stderr) == (0, "lfview ", "")


# Verbs


def test_info_as_text_and_json(scene: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info", str(scene), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    size = {key: found[key] for key in ("rows", "columns", "height", "width", "type", "name")}
    assert size == {"rows": 3, "columns": 3, "height": HEIGHT, "width": WIDTH, "type": "uint8", "name": "a scene é"}
    assert main(["info", str(scene)]) == 0
    text = capsys.readouterr().out
    assert "3 rows x 3 columns" in text
    assert f"{WIDTH} x {HEIGHT} px" in text


@pytest.mark.parametrize(("extension", "error"), [(".png", 0.5 / 255), (".tif", 0.5 / 65535), (".exr", 2**-11)])
def test_synth_writes_the_picture(scene: Path, tmp_path: Path, extension: str, error: float) -> None:
    out = tmp_path / f"view{extension}"
    assert main(["synth", str(scene), "--uv", "0.5,0.5", "--out", str(out), "--model", "mean"]) == 0
    views = make_views(3, 3)
    mean = (views[0, 0] / 255 + views[0, 2] / 255 + views[2, 0] / 255 + views[2, 2] / 255) / 4
    assert np.abs(read(out) - mean).max() < error * 1.01
    assert list(tmp_path.iterdir()) == [out]


class Ramp:
    """A synthesizer whose results are known: grey, a disparity that grows by 0.5 px a column, four levels of warped inputs."""

    name = key = "ramp"

    def set_light_field(self, light_field: LightField) -> None:
        self._size = light_field.height, light_field.width

    def synthesize(self, u: float, v: float, cancelled: object = None) -> Synthesis:
        height, width = self._size
        disparity = np.tile(np.arange(width, dtype=np.float32) / 2, (height, 1))
        warped = np.ones((4, height, width, 3), np.float32) * (np.arange(4, dtype=np.float32) / 4)[:, None, None, None]
        return Synthesis(u, v, self.name, np.full((height, width, 3), 0.5, np.float32), disparity, warped, {"total": 0.0})


def test_synth_writes_disparity_and_warped_inputs(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("lfcore.synthesizer.make_synthesizer", lambda name: Ramp())
    common = ["synth", str(scene), "--uv", "-0.1,0.5"]
    numbers, colours, warped = tmp_path / "d.exr", tmp_path / "d.png", tmp_path / "deep" / "warped"
    assert main([*common, "--out", str(tmp_path / "a.png"), "--disparity", str(numbers), "--warped", str(warped)]) == 0
    assert "extrapolated" in capsys.readouterr().err
    disparity = oiio.ImageBuf(str(numbers))
    assert (disparity.spec().width, disparity.spec().height, disparity.spec().nchannels) == (WIDTH, HEIGHT, 1)
    assert str(disparity.spec().format) == "float"
    assert "corner-to-corner" in disparity.spec().get_string_attribute("ImageDescription")
    names = sorted(path.name for path in warped.iterdir())
    assert names == [f"warped_u{u}_v{v}.png" for u in (0, 1) for v in (0, 1)]
    means = [float(read(warped / name).mean()) for name in names]
    assert means == pytest.approx([0, 0.25, 0.5, 0.75], abs=0.51 / 255)
    assert np.array_equal(read(numbers)[7, :, 0], np.arange(WIDTH) / 2)
    assert main([*common, "--out", str(tmp_path / "a.png"), "--disparity", str(colours)]) == 0
    assert read(colours).shape[0] > HEIGHT  # with caption and legend


@pytest.mark.parametrize("name", PATH_NAMES)
def test_sweep_writes_every_path(scene: Path, tmp_path: Path, name: str) -> None:
    out = tmp_path / "sweep.mp4"
    options = ["--path", name, "--frames", "5", "--fps", "10", "--radius", "0.4", "--out", str(out), "--model", "mean"]
    assert main(["sweep", str(scene), *options]) == 0
    with av.open(str(out)) as container:
        frames = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
    assert len(frames) == 5
    assert frames[0].shape == (HEIGHT + 1, WIDTH + 1, 3)


def test_the_paths_offered_are_those_of_the_library() -> None:
    assert set(PATH_NAMES) == set(PATHS)


def test_eval_scores_by_k16_and_writes_the_json_and_the_figures(
    scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = write_views(tmp_path / "more" / "second", make_views(3, 3, seed=5))
    scores, figures = tmp_path / "scores.json", tmp_path / "figures"
    arguments = ["--model", "mean", "--json", str(scores), "--out", str(figures)]
    assert main(["eval", str(scene), str(other.parent), *arguments]) == 0
    found = json.loads(scores.read_text())
    assert set(found) == {"protocol", "model", "machine", "scenes", "mean"}
    assert (found["protocol"], found["model"]) == ("K16", "mean")
    assert [entry["name"] for entry in found["scenes"]] == ["a scene é", "second"]
    expected = []
    for seed in (0, 5):
        views = make_views(3, 3, seed).astype(np.float32) / 255
        expected.append(k16((views[0, 0] + views[0, 2] + views[2, 0] + views[2, 2]) / 4, views[1, 1]))
    for entry, score in zip(found["scenes"], expected, strict=True):
        assert set(entry) == {"name", "psnr", "ssim", "seconds"}
        assert (entry["psnr"], entry["ssim"]) == (pytest.approx(score.psnr, abs=0.01), pytest.approx(score.ssim, abs=1e-4))
    assert found["mean"]["psnr"] == pytest.approx(sum(score.psnr for score in expected) / 2, abs=0.01)
    table = capsys.readouterr().out.splitlines()
    assert table[0].startswith("K16 on ")
    assert [line.split()[0] for line in table[3:]] == ["a", "second", "mean"]
    assert sorted(path.name for path in figures.iterdir()) == ["a scene é.png", "second.png"]
    # The figure holds the captured view, pixel for pixel.
    assert contains(read(figures / "second.png"), make_views(3, 3, 5)[1, 1])


def contains(page: npt.NDArray[np.float32], picture: npt.NDArray[np.uint8]) -> bool:
    stored = to_uint8(page[..., :3])
    height, width = picture.shape[:2]
    return any(
        np.array_equal(stored[y : y + height, x : x + width], picture)
        for y in range(stored.shape[0] - height + 1)
        for x in range(stored.shape[1] - width + 1)
    )


def test_eval_of_several_models_stands_side_by_side(
    scene: Path, weights: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["eval", str(scene), "--model", "mean", "--model", str(weights), "--json", "-"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert [entry["model"] for entry in found] == ["mean", "untrained"]
    assert main(["eval", str(scene), "--model", "mean", "--model", str(weights), "--out", str(tmp_path)]) == 0
    assert capsys.readouterr().out.splitlines()[1].split() == ["mean", "untrained"]
    assert len(list(tmp_path.iterdir())) == 2


def test_eval_names_what_cannot_be_scored_and_scores_the_rest(
    scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    corners = write_views(tmp_path / "corners", make_views(3, 3)[::2, ::2])
    scores = tmp_path / "scores.json"
    assert main(["eval", str(corners), str(scene), "--model", "mean", "--json", str(scores)]) == 2
    output = capsys.readouterr()
    assert "only the four corner views" in output.err
    assert [entry["name"] for entry in json.loads(scores.read_text())["scenes"]] == ["a scene é"]
    assert main(["eval", str(tmp_path / "none"), str(scene), "--model", "mean", "--json", str(scores)]) == 2
    assert "none does not exist" in capsys.readouterr().err
    assert [entry["name"] for entry in json.loads(scores.read_text())["scenes"]] == ["a scene é"]


def test_what_is_to_be_minded_about_a_light_field_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for row in range(2):
        for column in range(2):
            view = oiio.ImageBuf(oiio.ImageSpec(40, 30, 3, oiio.FLOAT))
            view.set_pixels(oiio.ROI(), np.full((30, 40, 3), (np.nan, 0.5, 7.0), np.float32))
            assert view.write(str(tmp_path / f"view_{row}_{column}.exr"))
    assert main(["synth", str(tmp_path), "--uv", "0.5,0.5", "--model", "mean", "--out", str(tmp_path / "out.exr")]) == 0
    said = capsys.readouterr().err
    assert "4800 values that are no finite numbers were set to 0" in said
    assert "33.3% of the values lie above 1, up to 7" in said
    np.testing.assert_array_equal(read(tmp_path / "out.exr")[5, 5], (0, 0.5, 1))


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no /dev/full")
def test_want_of_room_on_standard_output_is_no_bug(scene: Path) -> None:
    command = [sys.executable, "-m", "app", "info", str(scene)]
    with Path("/dev/full").open("w") as full:
        ended = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, cwd=Path(__file__).parents[1])
    assert ended.returncode == 2
    assert "no room" in one_sentence(ended.stderr)


def test_scenes_of_a_folder_and_labels_of_models(scene: Path, tmp_path: Path) -> None:
    for name in ("b", "a"):
        write_views(tmp_path / name, make_views(2, 2))
    (tmp_path / "README.md").write_text("scenes")
    (tmp_path / "self").symlink_to("self")
    assert scenes_in([tmp_path, scene]) == [tmp_path / "a", tmp_path / "b", scene]
    (tmp_path / "overview.png").write_bytes(b"a picture beside them")
    assert scenes_in([tmp_path]) == [tmp_path / "a", tmp_path / "b", tmp_path / "overview.png"]
    assert labelled(["full", "x/w.safetensors", "full"]) == {"full": "full", "w": "x/w.safetensors"}
    with pytest.raises(InputError, match="rename"):
        labelled(["x/w.safetensors", "y/w.safetensors"])


def test_train_hands_its_options_to_the_loop(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from lfcore.training import generated, loop
    from lfcore.training.generated import GeneratedScene, SceneConfig, Textures

    seen: dict[str, object] = {}

    def train(
        config: loop.TrainConfig,
        runtime: loop.Runtime,
        scenes: list[LightField],
        validation: list[LightField],
        out: Path,
        run_dir: Path,
        report: Callable[[loop.Progress], None],
        stopped: Callable[[], bool],
        initial: object,
        team: Team,
        generated: list[TrainingScene],
        teacher: object,
    ) -> None:
        assert initial is None and teacher is None and team.leads
        assert [scene.light_field.kind for scene in generated] == ["generated"]
        seen.update(config=config, runtime=runtime, out=out, run_dir=run_dir)
        assert [light_field.name for light_field in scenes] == ["a scene é"]
        assert validation == []
        assert run_dir.is_dir()
        report(loop.Progress(1, 5, 0.25, 2.0, None, 0))
        assert not stopped()
        signal.raise_signal(signal.SIGINT)
        assert stopped()
        report(loop.Progress(2, 5, 0.125, 2.0, CurvePoint(2, 1.0, 1e-4, 0.125, {"held": 30.5}), 3))

    make = generated.generate_pool

    def small_pool(count: int, seed: int, textures: Textures, config: SceneConfig, *more: Any) -> Iterator[GeneratedScene]:
        assert config == SceneConfig()
        return make(count, seed, textures, SceneConfig(height=64, width=64), *more)

    monkeypatch.setattr(loop, "train", train)
    monkeypatch.setattr(generated, "generate_pool", small_pool)
    out = tmp_path / "w.safetensors"
    options = [
        "--steps",
        "5",
        "--patch",
        "40",
        "--batch",
        "6",
        "--group",
        "3",
        "--lr",
        "0.002",
        "--seed",
        "3",
        "--minutes",
        "1.5",
        "--revival",
        "7",
    ]
    options += ["--generated", "1"]
    before = signal.getsignal(signal.SIGINT)
    assert main(["train", "--data", str(scene), "--out", str(out), "--device", "cpu", *options]) == 130
    assert signal.getsignal(signal.SIGINT) is before
    config, runtime = seen["config"], seen["runtime"]
    assert isinstance(config, loop.TrainConfig)
    assert (config.steps, config.learning_rate, config.seed, config.revival_steps) == (5, 0.002, 3, 7)
    assert (config.patches.size, config.patches.batch, config.patches.group) == (40, 6, 3)
    assert isinstance(runtime, loop.Runtime)
    assert (runtime.device, runtime.stop_after_minutes) == ("cpu", 1.5)
    assert (seen["out"], seen["run_dir"]) == (out, tmp_path / "w")
    output = capsys.readouterr()
    assert output.out.splitlines() == [
        "step 1 of 5: loss 0.250000, 0:02 left",
        "before step 2: 3 dead channels given new weights",
        "step 2: loss 0.125000, held 30.50 dB",
    ]
    assert "goes on from" in output.err


# Bad input: one sentence, exit code 2, nothing written


def one_sentence(output: str) -> str:
    lines = output.strip().splitlines()
    assert len(lines) == 1, output
    assert lines[0].endswith(".") or lines[0].endswith("?")
    assert "Traceback" not in output
    return lines[0]


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["synth", "SCENE", "--uv", "nan,0", "--out", "DIR/a.png"], "u is nan"),
        (["synth", "SCENE", "--uv", "0,1.3", "--out", "DIR/a.png"], "v is 1.3"),
        (["synth", "SCENE", "--uv", "0.5", "--out", "DIR/a.png"], "not a viewpoint"),
        (["synth", "SCENE", "--uv", "0,0", "--out", "DIR/a.jpg"], ".png, .tif, .tiff, .exr"),
        (["synth", "SCENE", "--uv", "0,0", "--out", "DIR/no/a.png"], "does not exist"),
        (["synth", "SCENE", "--uv", "0,0", "--out", "DIR"], "no extension"),
        (["synth", "SCENE", "--uv", "0,0", "--out", "DIR/a.png", "--model", "mean", "--warped", "DIR/w"], "no disparity"),
        (["synth", "SCENE", "--uv", "0,0", "--out", "DIR/a.png", "--disparity", "DIR/d.txt"], "ends in .txt"),
        (["synth", "SCENE", "--uv", "0,0", "--out", "DIR/a.png", "--model", "best"], "Unknown model"),
        (["synth", "SCENE", "--uv", "0,0", "--out", "DIR/a.png", "--model", "DIR/none.safetensors"], "No weights"),
        (["synth", "SCENE", "--uv", "0,0"], "--out"),
        (["synth", "DIR/none", "--uv", "0,0", "--out", "DIR/a.png", "--model", "mean"], "does not exist"),
        (["sweep", "SCENE", "--out", "DIR/a.avi"], ".mp4, .webm, .webp, .gif"),
        (["sweep", "SCENE", "--out", "DIR/a.mp4", "--frames", "0"], "from 1 to"),
        (["sweep", "SCENE", "--out", "DIR/a.mp4", "--fps", "nan"], "frames per second"),
        (["sweep", "SCENE", "--out", "DIR/a.mp4", "--radius", "0.6"], "radius"),
        (["sweep", "SCENE", "--out", "DIR/a.mp4", "--path", "zigzag"], "zigzag"),
        (["sweep", "SCENE", "--out", "DIR/a.mp4", "--fps", "0.0004"], "frames per second"),
        (["synth", "SCENE", "--quilt", "2x1", "--focus", "nan", "--model", "mean", "--out", "DIR/a.png"], "The focus is nan"),
        (["synth", "SCENE", "--quilt", "2x1", "--focus", "1e9", "--model", "mean", "--out", "DIR/a.png"], "The focus is 1e+09"),
        (["info", f"DIR/{'x' * 300}"], "File name too long"),
        (["synth", "SCENE", "--uv", "0,0", "--model", "mean", "--out", f"DIR/{'x' * 300}.png"], "File name too long"),
        (["synth", "DIR/two\nlines", "--uv", "0,0", "--out", "DIR/a.png", "--model", "mean"], "two lines does not exist"),
        (["train", "--data", "SCENE", "--out", "DIR/w.safetensors", "--seed", "-1"], "'-1'"),
        (["train", "--data", "SCENE", "--out", "DIR/w.safetensors", "--generated", "-1"], "'-1'"),
        (["train", "--data", "SCENE", "--out", "DIR/w.safetensors", "--threads", "100000"], "100000 threads"),
        (["eval", "DIR/none", "--model", "mean"], "does not exist"),
        (["eval", "SCENE", "--model", "mean", "--json", "DIR/scores.txt"], ".json"),
        (["eval", "SCENE", "--model", "mean", "--protocol", "other"], "K16"),
        (["bench", "SCENE", "--count", "0"], "1 or more"),
        (["train", "--data", "SCENE", "--out", "DIR/w.pt"], ".safetensors"),
        (["train", "--data", "DIR/none", "--out", "DIR/w.safetensors"], "does not exist"),
        (["train", "--data", "SCENE", "--out", "DIR/w.safetensors", "--batch", "5"], "--batch 5"),
        (["train", "--data", "SCENE", "--out", "DIR/w.safetensors", "--minutes", "nan"], "above 0"),
        (["view", "--screenshot", "DIR/a.jpg"], ".png"),
        (["info", "DIR/none"], "does not exist"),
        (["info"], "PATH"),
        (["sweeep", "SCENE"], "did you mean 'sweep'"),
        (["synth", "SCENE", "--sideways"], "synth --help"),
    ],
)  # fmt: skip
def test_bad_input(
    scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], expected: str
) -> None:
    filled = [argument.replace("SCENE", str(scene)).replace("DIR", str(tmp_path)) for argument in arguments]
    assert main(filled) == 2
    output = capsys.readouterr()
    assert output.out == ""
    assert expected in one_sentence(output.err)
    assert list(tmp_path.iterdir()) == []


def test_a_picture_too_large_for_memory(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def chunk(name: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    header = chunk(b"IHDR", struct.pack(">IIBBBBB", 60000, 60000, 16, 6, 0, 0, 0))
    path = tmp_path / "huge.png"
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + header + chunk(b"IDAT", zlib.compress(b"\0" * 100)) + chunk(b"IEND", b""))
    assert main(["info", str(path)]) == 2
    assert "huge.png" in one_sentence(capsys.readouterr().err)


def test_weights_of_another_model_and_damaged_weights(
    scene: Path, weights: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    data = bytearray(weights.read_bytes())
    data[-1000] ^= 1
    flipped = tmp_path / "flipped.safetensors"
    flipped.write_bytes(data)
    out = tmp_path / "a.png"
    for path in (flipped, write_foreign_weights(tmp_path / "foreign.safetensors")):
        assert main(["synth", str(scene), "--uv", "0,0", "--out", str(out), "--model", str(path)]) == 2
        assert path.name in one_sentence(capsys.readouterr().err)
        assert not out.exists()


def write_foreign_weights(path: Path) -> Path:
    header = json.dumps({"weight": {"dtype": "F32", "shape": [1], "data_offsets": [0, 4]}}).encode()
    path.write_bytes(struct.pack("<Q", len(header)) + header + bytes(4))
    return path


def test_a_read_only_target_is_noticed_before_the_work(scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "sweep.mp4"
    out.write_bytes(b"old")
    out.chmod(0o444)
    # Neither the light field nor the model exist: only a check that comes first can name the target.
    assert main(["sweep", str(tmp_path / "none"), "--out", str(out), "--model", "none"]) == 2
    assert "read-only" in one_sentence(capsys.readouterr().err)
    assert out.read_bytes() == b"old"


@pytest.mark.skipif(sys.platform != "linux", reason="/proc takes no new files, not even from root, on Linux only")
def test_a_folder_that_takes_no_files(scene: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["synth", str(scene), "--uv", "0,0", "--out", "/proc/a.png", "--model", "none"]) == 2
    assert "/proc" in one_sentence(capsys.readouterr().err)


def test_a_bug_says_so_and_exits_with_1(
    scene: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def broken(*_: object, **__: object) -> LightField:
        raise ZeroDivisionError("by zero")

    monkeypatch.setattr("app.cli.info.open_with_progress", broken)
    assert main(["info", str(scene)]) == 1
    assert "this is a bug (ZeroDivisionError: by zero)" in one_sentence(capsys.readouterr().err)
    assert main(["info", str(scene), "--debug"]) == 1
    assert "Traceback" in capsys.readouterr().err


def test_want_of_memory_is_no_bug(scene: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def too_large(*_: object, **__: object) -> LightField:
        torch.empty(2**60)
        raise AssertionError

    monkeypatch.setattr("app.cli.info.open_with_progress", too_large)
    assert main(["info", str(scene)]) == 2
    assert "not enough memory" in one_sentence(capsys.readouterr().err)


# Signals and pipes


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGINT for another process")
@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_stopped_sweep_leaves_no_half_file(scene: Path, tmp_path: Path, number: int, status: int) -> None:
    process = run_lfview("sweep", scene, "--frames", "100000", "--out", tmp_path / "s.mp4", "--model", "mean")
    deadline = time.monotonic() + 60
    while not list(tmp_path.iterdir()):  # the temporary file shows that the work has begun
        assert time.monotonic() < deadline
        assert process.poll() is None
        time.sleep(0.02)
    time.sleep(0.2)
    process.send_signal(number)
    out, err = process.communicate(timeout=30)
    assert process.returncode == status
    assert (out, err) == ("", "")
    assert list(tmp_path.iterdir()) == []


def test_output_into_a_pipe_that_closes(scene: Path) -> None:
    process = run_lfview("info", scene)
    assert process.stdout is not None
    process.stdout.close()
    assert process.stderr is not None
    assert process.stderr.read() == ""
    process.stderr.close()
    assert process.wait(timeout=30) == 141


# Progress


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_the_bar_tells_share_rate_and_time_left() -> None:
    assert bar("synthesizing", 15, 60, "frames", 30) == (
        "synthesizing [######..................] 15/60 frames, 2.0 s each, 1:30 left"
    )
    assert bar("reading", 0.5, 1, "", 2) == "reading [############............] 50%, 0:02 left"
    assert bar("reading", 0, 1, "", 2) == "reading [........................] 0%"
    assert bar("x", 30, 60, "frames", 3).endswith("30/60 frames, 10.0/s, 0:03 left")
    assert [clock(0.4), clock(59.6), clock(750), clock(3725)] == ["0:00", "1:00", "12:30", "1:02:05"]


def test_progress_is_drawn_on_a_terminal_and_wiped_and_silent_elsewhere() -> None:
    terminal, pipe = Terminal(), io.StringIO()
    for stream in (terminal, pipe):
        with Progress("work", 4, "parts", stream) as progress:
            for _ in range(4):
                progress.step()
    assert "work [" in terminal.getvalue()
    assert terminal.getvalue().endswith("\r\x1b[K")
    assert pipe.getvalue() == ""


def test_no_progress_reaches_a_pipe(scene: Path, tmp_path: Path) -> None:
    process = run_lfview("sweep", scene, "--frames", "3", "--out", tmp_path / "s.gif", "--model", "mean")
    out, err = process.communicate(timeout=60)
    assert (process.returncode, err) == (0, "")
    assert len(out.splitlines()) == 1
    assert "\x1b" not in out
    assert (tmp_path / "s.gif").stat().st_size > 0
