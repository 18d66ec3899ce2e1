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
from lfcore.compact import CompactConfig, CompactModel
from lfcore.errors import OutputError
from lfcore.export import check_folder, write_picture
from lfcore.models import Config, build_model
from lfcore.networks import BORDER, FullModel, ModelConfig, SingleConfig
from lfcore.operations import network_operations
from lfcore.planesweep import Levels

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


CONFIGS = [ModelConfig(levels=Levels(8)), SingleConfig(), CompactConfig(levels=Levels(8))]


@pytest.mark.parametrize("config", CONFIGS)
def test_operations_are_those_that_torch_counts_in_the_convolutions(config: Config, monkeypatch: pytest.MonkeyPatch) -> None:
    # This mean is computed as a convolution, but no layer of a network.
    monkeypatch.setattr("lfcore.compact.mean_around", lambda values, reach: values)
    model, wide = build_model(config), SIDE + 2 * BORDER
    with torch.inference_mode(), FlopCounterMode(display=False) as counter:
        if isinstance(model, CompactModel):
            model.disparity(torch.zeros(1, 8, SIDE // 2, SIDE // 2))
            model.colour(torch.zeros(1, 12, SIDE, SIDE), torch.zeros(1, 1, SIDE, SIDE), torch.zeros(1, 2))
        elif isinstance(model, FullModel):
            model.disparity(torch.zeros(1, 16, wide, wide))
            model.colour(torch.zeros(1, 15, wide, wide))
        else:
            model.colour(torch.zeros(1, 14, wide, wide))
    counted = counter.get_flop_counts()["Global"][torch.ops.aten.convolution]
    assert sum(network_operations(config, (SIDE, SIDE)).values()) == counted


@pytest.mark.parametrize(("seconds", "sizes"), [(10.0, {1024}), (0.1, {1024, 2048})])
def test_what_a_machine_is_slow_at_is_measured_by_small_products_alone(
    monkeypatch: pytest.MonkeyPatch, seconds: float, sizes: set[int]
) -> None:
    """Without instructions for bfloat16 one large product of it takes a minute."""
    asked, clock = [], [0.0]

    def product(a: torch.Tensor, b: torch.Tensor) -> None:
        asked.append(a.shape[0])
        clock[0] += seconds

    monkeypatch.setattr(torch, "mm", product)
    monkeypatch.setattr(bench.time, "perf_counter", lambda: clock[0])
    ceiling = bench.measure_ceiling()
    assert set(asked) == sizes
    assert (ceiling.bf16, ceiling.fp32) == pytest.approx((2 * max(sizes) ** 3 / seconds / 1e12,) * 2)


def test_the_paper_s_networks_ask_for_a_third_of_a_billion_products() -> None:
    """The paper's size: 334 billion multiply-adds a view, and a few more for the border."""
    assert sum(network_operations(ModelConfig(), (376, 541)).values()) / 2 == pytest.approx(334e9, rel=0.03)


def test_higher_ceilings_count_by_type() -> None:
    assert bench.Ceiling(2.0, 0.5).or_higher(bench.Ceiling(1.0, 0.7)) == bench.Ceiling(2.0, 0.7)


def test_bench_writes_the_promised_json(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(bench, "in_fresh_process", lambda function, *arguments: function(*arguments))
    monkeypatch.setattr(bench, "_MATRICES", (128,))
    monkeypatch.setattr(bench, "_CEILING_SECONDS", 0.05)
    out = tmp_path / "bench.json"
    assert main(["bench", str(scene), "--model", "mean", "--count", "3", "--json", str(out)]) == 0
    found = json.loads(out.read_text())
    assert set(found) == {"machine", "ceiling_tflops", "models"}
    assert set(found["ceiling_tflops"]) == {"bf16", "fp32"}
    assert all(value > 0 for value in found["ceiling_tflops"].values())
    speed = found["models"]["mean"]
    assert set(speed) == {"seconds_per_view", "stages", "tflops", "share_of_ceiling", "peak_mib", "networks"}
    assert speed["networks"] == {}
    assert (speed["tflops"], speed["share_of_ceiling"]) == (None, None)
    assert 50 < speed["peak_mib"] < 10_000
    assert "mean: 0.0" in capsys.readouterr().out


def test_the_share_is_that_of_the_networks_in_the_type_computed_in() -> None:
    stages = {"features": 0.5, "disparity": 1.0, "warp": 0.25, "colour": 0.25}
    measured = bench.Measurement(2.0, stages, {"disparity": 5e11, "colour": 5e11}, "fp32", 700.0)
    speed = measured.speed(bench.Ceiling(bf16=3.0, fp32=1.6))
    assert speed.tflops == pytest.approx(0.8) and speed.share_of_ceiling == pytest.approx(0.5)
    assert speed.networks["colour"] == bench.NetworkSpeed(2.0, 1.25)
    text = bench.as_text({**bench.as_json("a machine", bench.Ceiling(3.0, 1.6), {"full": speed}),
                          "viewer": {"frame_ms_p50": 4.0, "frame_ms_p95": 9.0, "frames": 60, "views_per_second": 5.5,
                                     "where": "window"}})  # fmt: skip
    assert "full: 2.000 s a view" in text
    assert "disparity 1.000 s, 0.500 TFLOP/s, 31% of the ceiling" in text
    assert "networks together: 0.800 TFLOP/s, 50% of the ceiling" in text
    assert "95 of 100 within 9.0 ms; 5.5 syntheses a second on screen" in text
