"""The benchmark: counted operations, medians, a process of its own, and JSON of the promised form."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest
import torch
from torch.utils.flop_counter import FlopCounterMode

from app.__main__ import main
from lfcore import bench
from lfcore.errors import OutputError
from lfcore.export import check_folder, write_picture
from lfcore.lightfield import LightField
from lfcore.networks import FullModel, ModelConfig, initialise
from lfcore.planesweep import Levels
from lfcore.synthesizer import NetworkSynthesizer

SIDE = 32


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("bench") / "scene"
    folder.mkdir()
    random = np.random.default_rng(1)
    for r in range(2):
        for c in range(2):
            write_picture(folder / f"view_{r}_{c}.png", random.integers(0, 256, (SIDE, SIDE, 3), dtype=np.uint8))
    return folder


def test_a_fresh_process_hands_back_results_and_errors() -> None:
    assert bench.in_fresh_process(os.getpid) != os.getpid()
    with pytest.raises(OutputError, match="nowhere"):
        bench.in_fresh_process(check_folder, Path("nowhere"))


def test_operations_are_those_of_the_convolutions() -> None:
    """One tile, float32: each layer's weights once per pixel it puts out, which the padding makes larger than the picture."""
    model = FullModel(ModelConfig(levels=Levels(count=8)))
    initialise(model, 1)
    synthesizer = NetworkSynthesizer(model, "key", dtype=torch.float32)
    synthesizer.set_light_field(LightField(np.zeros((2, 2, SIDE, SIDE, 3), np.uint8), "test", "", "test"))
    with FlopCounterMode(display=False) as counter:
        synthesizer.synthesize(0.5, 0.5)
    expected = 0
    for inputs, outputs in ((2 * 8, 1), (15, 3)):
        first, second, third, last = SIDE + 12 - 6, SIDE + 12 - 10, SIDE, SIDE  # what 7x7, 5x5, 3x3, 1x1 put out
        expected += first**2 * 49 * inputs * 100 + second**2 * 25 * 100 * 100
        expected += third**2 * 9 * 100 * 50 + last**2 * 50 * outputs
    counted = counter.get_flop_counts()["Global"]
    assert counted[torch.ops.aten.convolution] == 2 * expected


def test_bench_writes_the_promised_json(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(bench, "in_fresh_process", lambda function, *arguments: function(*arguments))
    monkeypatch.setattr(bench, "_MATRIX", 128)
    out = tmp_path / "bench.json"
    assert main(["bench", str(scene), "--model", "mean", "--count", "3", "--json", str(out)]) == 0
    found = json.loads(out.read_text())
    assert set(found) == {"machine", "ceiling_tflops", "models"}
    assert set(found["ceiling_tflops"]) == {"bf16", "fp32"}
    assert all(value > 0 for value in found["ceiling_tflops"].values())
    speed = found["models"]["mean"]
    assert set(speed) == {"seconds_per_view", "stages", "tflops", "share_of_ceiling", "peak_mib"}
    assert (speed["tflops"], speed["share_of_ceiling"]) == (None, None)
    assert 50 < speed["peak_mib"] < 10_000
    assert "mean: 0.0" in capsys.readouterr().out


def test_the_share_is_that_of_the_type_computed_in() -> None:
    speed = bench.ModelSpeed(2.0, {"features": 1.5, "warp": 0.5}, 0.3, 0.1, 700.0)
    text = bench.as_text({**bench.as_json("a machine", bench.Ceiling(3.0, 1.0), {"full": speed}),
                          "viewer": {"frame_ms_p50": 4.0, "frame_ms_p95": 9.0, "frames": 60, "where": "window"}})  # fmt: skip
    assert "full: 2.000 s a view (features 1.500, warp 0.500)" in text
    assert "10% of the ceiling" in text
    assert "95 of 100 within 9.0 ms" in text
