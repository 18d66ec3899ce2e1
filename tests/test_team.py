"""Training in two processes, started as users start it: by torchrun."""

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
import torch
from safetensors import safe_open
from scenes import plane

from app.__main__ import main
from lfcore import tuning
from lfcore.export import write_picture
from lfcore.lightfield import LightField
from lfcore.metrics import to_uint8
from lfcore.networks import SingleModel, initialise
from lfcore.training.architectures import architecture
from lfcore.training.loop import TrainConfig
from lfcore.tuned_stack import Tuning
from lfcore.weights import load_weights, save_weights

ROOT = Path(__file__).parents[1]


def write_views(light_field: LightField, folder: Path) -> Path:
    folder.mkdir()
    for row in range(light_field.rows):
        for column in range(light_field.columns):
            write_picture(folder / f"view_{row:02}_{column:02}.png", to_uint8(light_field.view(row, column)))
    return folder


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_views(plane(3.0, (3, 3), (120, 124)), tmp_path_factory.mktemp("data") / "plane")


@pytest.fixture
def exact(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Here as in each process of a team: one thread, so that sums are taken in the same order, and float32."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    monkeypatch.setenv("LFVIEW_CACHE", str(tmp_path / "cache"))
    tuning.machine_tuning.cache_clear()
    tuning._remember(Tuning())
    yield
    torch.set_num_threads(threads)
    tuning.machine_tuning.cache_clear()


def arguments(scene: Path, out: Path, steps: int = 3, batch: int = 8, model: str = "realtime", more: str = "") -> list[str]:
    options = f"--model {model} --steps {steps} --batch {batch} --patch 32 --device cpu --threads 1 --lr 1e-3 {more}"
    return ["train", "--data", str(scene), "--val", str(scene), "--out", str(out), *options.split()]


def train_by_two(command: list[str]) -> subprocess.CompletedProcess[str]:
    launcher = [sys.executable, "-m", "torch.distributed.run", "--standalone", "--nproc-per-node=2", "-m", "app"]
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    return subprocess.run([*launcher, *command], cwd=ROOT, env=environment, capture_output=True, text=True, timeout=240)


def trained(out: Path) -> tuple[int, dict[str, torch.Tensor]]:
    """Steps and tensors of the checkpoint."""
    with safe_open(out.with_suffix("") / "checkpoint.safetensors", framework="pt") as file:
        names = [name for name in file.keys() if name.startswith("model/")]  # noqa: SIM118, not a dict
        tensors = {name.removeprefix("model/"): file.get_tensor(name) for name in names}
        return json.loads(file.metadata()["run"])["step"], tensors


def test_two_processes_learn_what_one_learns(
    scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], exact: None
) -> None:
    """The same patches a step, shared by two: the gradients' mean, and so the weights, are the same up to rounding. Planes
    are matched on the one group that one process takes, whichever of the two has it."""
    alone, both = tmp_path / "1.safetensors", tmp_path / "2.safetensors"
    assert main(arguments(scene, alone)) == 0
    assert capsys.readouterr().out.count("step 3:") == 1
    done = train_by_two(arguments(scene, both))
    assert done.returncode == 0, done.stderr[-2000:]
    assert done.stdout.count("step 3:") == 1  # one of them reports
    start = architecture("realtime").start(TrainConfig.seed).state_dict()
    (steps, expected), (steps_of_both, found) = trained(alone), trained(both)
    assert steps == steps_of_both == 3
    for name, value in expected.items():
        torch.testing.assert_close(found[name], value, atol=1e-6, rtol=0, msg=lambda m, n=name: f"{n}: {m}")
    assert max(float((value - start[name]).abs().max()) for name, value in expected.items()) > 5e-5
    written = [load_weights(out).model.state_dict() for out in (alone, both)]
    assert all(torch.allclose(written[1][name], value, atol=1e-6, rtol=0) for name, value in written[0].items())


def test_two_processes_give_dead_channels_the_same_new_weights(
    scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], exact: None
) -> None:
    initial = tmp_path / "initial.safetensors"
    model = SingleModel()
    initialise(model, 1)
    save_weights(initial, model, {})
    alone, both = tmp_path / "1.safetensors", tmp_path / "2.safetensors"
    more = f"--init {initial} --decay 0"
    assert main(arguments(scene, alone, steps=1, model="single", more=more)) == 0
    done = train_by_two(arguments(scene, both, steps=1, model="single", more=more))
    assert done.returncode == 0, done.stderr[-2000:]
    for output in (capsys.readouterr().out, done.stdout):
        assert output.count("dead channels given new weights") == 1
    # Not the weights that are written: what has not learnt anything yet is idle, and set to 0 there.
    (_, expected), (_, found) = trained(alone), trained(both)
    changed = [name for name, value in model.state_dict().items() if (expected[name] - value).abs().max() > 0.05]
    assert len(changed) >= 2
    for name, value in expected.items():
        torch.testing.assert_close(found[name], value, atol=1e-6, rtol=0, msg=lambda m, n=name: f"{n}: {m}")


def test_a_batch_that_cannot_be_shared_is_refused_in_words(scene: Path, tmp_path: Path) -> None:
    done = train_by_two(arguments(scene, tmp_path / "w.safetensors", batch=4))
    assert done.returncode != 0
    assert "1 groups of patches a step cannot be shared by 2 processes" in done.stderr
