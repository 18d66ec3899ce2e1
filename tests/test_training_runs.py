"""What runs of training refuse, keep, resume and write: damaged checkpoints, missing weights, scenes of one name."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from safetensors import safe_open
from safetensors.torch import load_file, save_file
from scenes import plane

from lfcore.compact import CompactConfig, CompactModel
from lfcore.errors import InputError
from lfcore.lightfield import LightField
from lfcore.models import Model
from lfcore.networks import FullModel, ModelConfig
from lfcore.planesweep import Levels
from lfcore.training import loop
from lfcore.training.architectures import Batch, architecture
from lfcore.training.curve import CurvePoint, column_names
from lfcore.training.loop import Progress, Runtime, TrainConfig, Trainer, check_patches, prepare_scene, train
from lfcore.training.loss import LossConfig, StepLoss
from lfcore.training.patches import PatchConfig, TrainingScene, sample_group
from lfcore.weights import Weights, load_weights

PATCHES = PatchConfig(size=32, batch=2, group=2)
CONFIG = TrainConfig(model="realtime", steps=1, decay_share=0, loss=LossConfig(matching_steps=0), patches=PATCHES)
CPU = torch.device("cpu")


@pytest.fixture(autouse=True)
def little_to_look_at(monkeypatch: pytest.MonkeyPatch) -> None:
    """Which channels are dead or idle is not asked here, and takes longer than a step."""
    monkeypatch.setattr(loop, "_LOOKED_AT", 1)


@pytest.fixture(scope="module")
def scene() -> LightField:
    return plane(2.0, (3, 3), (120, 120))


def run(
    folder: Path, scene: LightField, validation: list[LightField], out: str = "w", config: TrainConfig = CONFIG
) -> Progress:
    reports: list[Progress] = []
    target = folder / f"{out}.safetensors"
    train(config, Runtime("cpu"), [scene], validation, target, folder / "run", reports.append, lambda: False)
    return reports[-1]


def test_held_out_scenes_too_small_to_be_scored_are_refused_before_any_step(tmp_path: Path, scene: LightField) -> None:
    with pytest.raises(InputError, match=r"^plane: the views are 40 x 44 px, but the K16 protocol .* at least 45 x 45 px"):
        run(tmp_path, scene, [plane(1.0, (3, 3), (44, 40))])
    assert not (tmp_path / "run").exists()


def test_what_has_been_learnt_outlives_a_validation_that_fails(
    tmp_path: Path, scene: LightField, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as patched, pytest.raises(MemoryError):
        patched.setattr(Trainer, "validate", lambda *_: (_ for _ in ()).throw(MemoryError))
        run(tmp_path, scene, [])
    assert (tmp_path / "run" / "checkpoint.safetensors").exists() and not (tmp_path / "w.safetensors").exists()
    assert run(tmp_path, scene, []).validation is not None
    assert (tmp_path / "w.safetensors").exists()


def test_a_run_that_has_ended_writes_weights_that_are_missing(tmp_path: Path, scene: LightField) -> None:
    run(tmp_path, scene, [scene, scene])
    with pytest.raises(IndexError):
        run(tmp_path, scene, [scene, scene])  # nothing is left to do or to report
    assert run(tmp_path, scene, [scene, scene], "other").step == 1
    first, second = (load_weights(tmp_path / f"{name}.safetensors") for name in ("w", "other"))
    assert first.digest == second.digest
    assert list(first.training["k16_psnr"]) == ["plane", "plane (2)"]
    assert len((tmp_path / "run" / "curve.csv").read_text().splitlines()) == 2  # one validation of one step


def test_no_scene_is_taken_for_another_or_for_a_column_of_the_curve() -> None:
    assert column_names(["a", "loss", "a", "a (2)"]) == ["a", "loss (2)", "a (2)", "a (2) (2)"]


def test_equal_pictures_are_scored_in_numbers_that_json_has(
    tmp_path: Path, scene: LightField, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(loop, "k16", lambda *_: Perfect())
    run(tmp_path, scene, [scene])
    for file, key in (("w.safetensors", "training"), ("run/checkpoint.safetensors", "run")):
        with safe_open(tmp_path / file, framework="pt") as opened:
            json.loads(opened.metadata()[key], parse_constant=refuse)
    assert load_weights(tmp_path / "w.safetensors").training["k16_psnr"] == {"plane": None}
    trainer = Trainer(CONFIG, CPU, tmp_path / "run")
    assert trainer._curve[0].scores == {"plane": math.inf}


class Perfect:
    psnr = math.inf


def refuse(word: str) -> float:
    raise AssertionError(word)


def test_without_steps_of_matching_nothing_is_matched() -> None:
    pair, losses = architecture("realtime"), []
    drawn = TrainingScene(plane(3.0, (3, 3), (120, 120)), 3.0, 3.0)
    batch = Batch.of([sample_group([drawn], PATCHES, Levels(), np.random.default_rng(1))], CPU)
    for weight in (0.0, 1e6):
        with torch.no_grad():
            losses.append(float(StepLoss(pair.start(1), pair, LossConfig(0, weight), False)(batch, 0)[1]))
    assert losses[0] == losses[1]


@pytest.mark.parametrize("given", [FullModel(ModelConfig(tone="stored")), CompactModel(CompactConfig(width=32))])
def test_weights_to_go_on_from_keep_their_config(tmp_path: Path, given: Model) -> None:
    config = TrainConfig(model=given.config.name, patches=PATCHES)
    trainer = Trainer(config, CPU, tmp_path, given)
    plain = trainer._plain()
    assert plain.config == given.config
    for name, value in given.state_dict().items():
        torch.testing.assert_close(plain.state_dict()[name], value, atol=1e-5, rtol=1e-4)


def test_levels_are_those_of_the_weights_to_go_on_from(tmp_path: Path) -> None:
    given = CompactModel(CompactConfig(levels=Levels(32, -12, 12)))
    trainer = Trainer(TrainConfig(model="realtime", patches=PATCHES), CPU, tmp_path, given)
    assert trainer.levels == given.config.levels


@pytest.mark.parametrize("size", [61, 62, 66])
def test_patches_that_the_small_pair_cannot_take_are_refused(tmp_path: Path, scene: LightField, size: int) -> None:
    patches = PatchConfig(size=size, batch=2, group=2)
    below = size - size % 4
    with pytest.raises(InputError, match=f"Patches of {size} px .* multiples of 4 px; choose {below} or {below + 4}"):
        run(tmp_path, scene, [], config=TrainConfig(model="realtime", patches=patches))
    check_patches(TrainConfig(model="full", patches=patches), taught=False)
    with pytest.raises(InputError, match="but realtime takes"):
        check_patches(TrainConfig(model="full", patches=patches), taught=True)


Damage = Callable[[dict[str, torch.Tensor], dict[str, Any]], object]


def without(key: str) -> Damage:
    return lambda tensors, header: header.pop(key)


def with_value(key: str, value: object) -> Damage:
    return lambda tensors, header: header.update({key: value})


def other_shape(tensors: dict[str, torch.Tensor], header: dict[str, Any]) -> None:
    tensors["average/colour.stem.bias"] = torch.zeros(3)


def no_moment(tensors: dict[str, torch.Tensor], header: dict[str, Any]) -> None:
    del tensors[max(name for name in tensors if name.startswith("moments/") and name.endswith("mean"))]


def other_type(tensors: dict[str, torch.Tensor], header: dict[str, Any]) -> None:
    tensors["model/colour.stem.bias"] = tensors["model/colour.stem.bias"].half()


@pytest.fixture(scope="module")
def checkpoint(tmp_path_factory: pytest.TempPathFactory, scene: LightField) -> Path:
    folder = tmp_path_factory.mktemp("checkpoint")
    run(folder, scene, [])
    return folder / "run" / "checkpoint.safetensors"


@pytest.mark.parametrize(
    "damage",
    [*(without(key) for key in ("config", "step", "seconds", "curve", "moments")), with_value("config", [1]),
     with_value("step", "x"), with_value("step", -1), with_value("step", True), with_value("step", 10**300),
     with_value("seconds", math.inf), with_value("moments", 3), with_value("moments", 10**12), with_value("curve", [3]),
     with_value("curve", [{"step": 1}]), with_value("curve", {}), other_shape, no_moment, other_type],
)  # fmt: skip
def test_damaged_checkpoints_are_refused_in_words(checkpoint: Path, tmp_path: Path, damage: Damage) -> None:
    tensors = load_file(checkpoint)
    with safe_open(checkpoint, framework="pt") as file:
        header = json.loads(file.metadata()["run"])
    damage(tensors, header)
    save_file(tensors, tmp_path / checkpoint.name, {"run": json.dumps(header)})
    with pytest.raises(InputError, match=r"is not a readable checkpoint .*; remove it to start anew"):
        Trainer(CONFIG, CPU, tmp_path)


@pytest.mark.parametrize("text", ["", "3", "[" * 200_000, '{"step": 1e999}', "\x00", " " * 2**25])
def test_headers_that_are_none_are_refused_in_words(tmp_path: Path, text: str) -> None:
    save_file({"a": torch.zeros(1)}, tmp_path / "checkpoint.safetensors", {"run": text})
    with pytest.raises(InputError, match="is not a readable checkpoint"):
        Trainer(CONFIG, CPU, tmp_path)


def irregular(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """A texture that repeats nowhere, which a check of rows and columns needs."""
    rng = np.random.default_rng(5)
    waves = [np.sin(rng.uniform(-0.9, 0.9) * x + rng.uniform(-0.9, 0.9) * y + rng.uniform(0, 6.3)) for _ in range(30)]
    return np.repeat(0.5 + 0.05 * np.sum(waves, 0)[..., None], 3, -1).astype(np.float32)


def test_of_a_grid_that_is_not_square_the_evenly_spaced_views_are_taken() -> None:
    """One disparity along both sides: every second column. All equally far apart, as the pictures show: all of them."""
    wide = prepare_scene(plane(4.0, (3, 5), (120, 130), irregular))
    assert wide.light_field.views.shape[:2] == (3, 3)
    assert wide.low == pytest.approx(4.0, abs=0.5) == wide.high
    whole = plane(8.0, (5, 5), (120, 130), irregular)
    even = prepare_scene(LightField(whole.views[:3], "even", "", ""))
    assert even.light_field.views.shape[:2] == (3, 5) and even.spacing == 2
    assert even.low == pytest.approx(4.0, abs=0.5) == even.high
    with pytest.raises(InputError, match="3 x 4 views, of which 2 x 2 lie equally far apart"):
        prepare_scene(plane(4.0, (3, 4), (120, 130), irregular))


def test_patches_come_from_all_columns_of_an_evenly_spaced_grid() -> None:
    views = np.zeros((3, 5, 120, 120, 3), np.uint8) + np.arange(5, dtype=np.uint8)[:, None, None, None] * 10
    wide = TrainingScene(LightField(views, "wide", "", ""), 0, 0)
    alone = PatchConfig(size=32, batch=1, group=1, tone_share=0)
    groups = [sample_group([wide], alone, Levels(), np.random.default_rng(seed)) for seed in range(60)]
    found = {round(float(value) * 255) for group in groups for value in (group.inputs.min(), group.inputs.max())}
    assert found == {0, 10, 20, 30, 40}


def test_weights_are_given_as_weights(tmp_path: Path, scene: LightField) -> None:
    """A whole step from weights of another width, and their digest in what is written."""
    given = CompactModel(CompactConfig(width=32))
    out = tmp_path / "w.safetensors"
    train(
        CONFIG, Runtime("cpu"), [scene], [], out, tmp_path / "run", lambda _: None, lambda: False, Weights(given, "digest", {})
    )
    found = load_weights(out)
    assert found.model.config == given.config and found.training["config"]["initial"] == "digest"


def test_all_names_of_scenes_are_inside_the_picture_of_a_curve(monkeypatch: pytest.MonkeyPatch) -> None:
    from lfcore.training import plot as module

    written: dict[str, tuple[int, int]] = {}
    monkeypatch.setattr(module, "_text", lambda page, x, y, text, *colour: written.update({text: (x, y)}))
    for count in (1, 5, 8, 30):
        written.clear()
        names = [f"scene {k:02}" for k in range(count)]
        module.plot([CurvePoint(k, 0, 1e-4, 0.1, dict.fromkeys(names, 30.0 + k)) for k in (1, 2, 3)])
        shown = sorted(x for text, (x, y) in written.items() if y == 24)
        assert len(shown) == min(count, 8) and min(np.diff([*shown, 900])) >= 95
        assert ("+ 23" in written) == (count == 30)
        steps = sorted((x, text) for text, (x, y) in written.items() if text.isdecimal())
        assert [text for _, text in steps] == ["0", "1", "2", "3"]
        assert (np.diff([x for x, _ in steps]) > 200).all()  # evenly
