import json
from pathlib import Path

import pytest
import torch
from safetensors import safe_open
from safetensors.torch import save_file

from lfcore.errors import WeightsError
from lfcore.networks import FullModel, ModelConfig, initialise
from lfcore.planesweep import Levels
from lfcore.weights import load_weights, save_weights


def write(path: Path, seed: int = 1) -> FullModel:
    model = FullModel(ModelConfig(levels=Levels(4, -3, 3)))
    initialise(model, seed)
    save_weights(path, model, {"steps": 12, "k16_psnr": {"scene": 30.5}})
    return model


def test_weights_come_back_with_their_config_and_training(tmp_path: Path) -> None:
    model = write(tmp_path / "a.safetensors")
    found = load_weights(tmp_path / "a.safetensors")
    assert found.model.config == model.config
    assert found.training["k16_psnr"] == {"scene": 30.5}
    for a, b in zip(model.parameters(), found.model.parameters(), strict=True):
        assert torch.equal(a, b)


def test_the_digest_names_the_weights(tmp_path: Path) -> None:
    write(tmp_path / "a.safetensors", 1)
    write(tmp_path / "b.safetensors", 1)
    write(tmp_path / "c.safetensors", 2)
    a, b, c = (load_weights(tmp_path / f"{name}.safetensors").digest for name in "abc")
    assert a == b != c


@pytest.mark.parametrize("place", [0.5, 0.9, 0.999])
def test_a_flipped_byte_is_noticed(tmp_path: Path, place: float) -> None:
    path = tmp_path / "a.safetensors"
    write(path)
    data = bytearray(path.read_bytes())
    data[int(len(data) * place)] ^= 0x10
    path.write_bytes(data)
    with pytest.raises(WeightsError, match="damaged"):
        load_weights(path)


def test_truncated_foreign_and_missing_files_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.safetensors"
    write(path)
    whole = path.read_bytes()
    for length in (0, 5, 100, len(whole) // 2, len(whole) - 1):
        path.write_bytes(whole[:length])
        with pytest.raises(WeightsError):
            load_weights(path)
    path.write_bytes(b"\xff" * 4096)  # a header that claims 2^64 bytes
    with pytest.raises(WeightsError):
        load_weights(path)
    save_file({"weight": torch.zeros(3)}, path)
    with pytest.raises(WeightsError, match="no weights of lfview"):
        load_weights(path)
    with pytest.raises(WeightsError, match="No weights found"):
        load_weights(tmp_path / "none.safetensors")


def test_weights_of_another_model_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.safetensors"
    metadata = {"format": "lfview weights 1", "training": "{}", "digest": ""}
    config = {"name": "full", "levels": {"count": 4, "low": -3, "high": 3}}
    for wrong in ({**config, "name": "other"}, {"name": "full"}, {**config, "levels": {"count": 10**9, "low": -3, "high": 3}}):
        save_file({"weight": torch.zeros(3)}, path, {**metadata, "config": json.dumps(wrong)})
        with pytest.raises(WeightsError):
            load_weights(path)
    save_file({"weight": torch.zeros(3)}, path, {**metadata, "config": json.dumps(config)})
    with pytest.raises(WeightsError, match="another shape"):
        load_weights(path)


def test_weights_of_another_type_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.safetensors"
    write(path)
    with safe_open(path, framework="pt") as file:
        metadata, names = file.metadata(), list(file.keys())
        tensors = {name: file.get_tensor(name) for name in names}
    save_file({**tensors, names[0]: tensors[names[0]].bfloat16()}, path, metadata)
    with pytest.raises(WeightsError, match=r"type torch\.bfloat16, expected torch\.float32"):
        load_weights(path)


@pytest.mark.parametrize("key", ["config", "training"])
def test_brackets_without_end_are_refused(tmp_path: Path, key: str) -> None:
    path = tmp_path / "a.safetensors"
    write(path)
    with safe_open(path, framework="pt") as file:
        metadata, tensors = file.metadata(), {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118, not a dict
    save_file(tensors, path, {**metadata, key: "[" * 200_000})
    with pytest.raises(WeightsError, match=f"its {key} is not readable"):
        load_weights(path)
    if key == "training":  # what older versions wrote of equal pictures
        save_file(tensors, path, {**metadata, key: '{"k16_psnr": {"black": Infinity}}'})
        assert load_weights(path).training == {"k16_psnr": {"black": None}}
