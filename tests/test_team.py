"""Training in two processes, started as users start it: by torchrun."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors import safe_open
from scenes import plane

from lfcore.export import write_picture
from lfcore.lightfield import LightField
from lfcore.metrics import to_uint8
from lfcore.networks import SingleModel, initialise
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


def train(
    scene: Path, out: Path, processes: int, steps: int = 3, batch: int = 8, model: str = "realtime", more: str = ""
) -> subprocess.CompletedProcess[str]:
    launcher = [sys.executable]
    if processes > 1:
        launcher += ["-m", "torch.distributed.run", "--standalone", f"--nproc-per-node={processes}"]
    options = (
        f"--model {model} --steps {steps} --batch {batch} --patch 32 --matching 0 --device cpu --threads 1 --lr 1e-3 {more}"
    )
    command = [*launcher, "-m", "app", "train", "--data", str(scene), "--val", str(scene), "--out", str(out), *options.split()]
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    return subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=240)


def test_two_processes_learn_what_one_learns(scene: Path, tmp_path: Path) -> None:
    """The same patches a step, shared by two: the gradients' mean, and so the weights, are the same up to rounding."""
    results = {}
    for processes in (1, 2):
        out = tmp_path / f"{processes}.safetensors"
        done = train(scene, out, processes)
        assert done.returncode == 0, done.stderr[-2000:]
        assert done.stdout.count("step 3:") == 1  # one of them reports
        results[processes] = load_weights(out).model.state_dict()
        with safe_open(out.with_suffix("") / "checkpoint.safetensors", framework="pt") as file:
            assert json.loads(file.metadata()["run"])["step"] == 3
    moved = max(float(v.abs().max()) for v in results[1].values())
    assert np.isfinite(moved)
    for name, value in results[1].items():
        torch.testing.assert_close(results[2][name], value, atol=2e-3, rtol=1e-3, msg=lambda m, n=name: f"{n}: {m}")


def test_two_processes_give_dead_channels_the_same_new_weights(scene: Path, tmp_path: Path) -> None:
    initial = tmp_path / "initial.safetensors"
    model = SingleModel()
    initialise(model, 1)
    save_weights(initial, model, {})
    results, more = {}, f"--init {initial} --decay 0"
    for processes in (1, 2):
        out = tmp_path / f"{processes}.safetensors"
        done = train(scene, out, processes, steps=1, model="single", more=more)
        assert done.returncode == 0, done.stderr[-2000:]
        assert done.stdout.count("dead channels given new weights") == 1
        # Not the weights that are written: what has not learnt anything yet is idle, and set to 0 there.
        with safe_open(out.with_suffix("") / "checkpoint.safetensors", framework="pt") as file:
            results[processes] = {name: file.get_tensor(f"model/{name}") for name in model.state_dict()}
    changed = [name for name, value in model.state_dict().items() if (results[1][name] - value).abs().max() > 0.05]
    assert len(changed) >= 2
    for name, value in results[1].items():
        torch.testing.assert_close(results[2][name], value, atol=2e-3, rtol=1e-3, msg=lambda m, n=name: f"{n}: {m}")


def test_a_batch_that_cannot_be_shared_is_refused_in_words(scene: Path, tmp_path: Path) -> None:
    done = train(scene, tmp_path / "w.safetensors", 2, batch=4)
    assert done.returncode != 0
    assert "1 groups of patches a step cannot be shared by 2 processes" in done.stderr
