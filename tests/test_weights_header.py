"""What a weight file states of itself is what loading it finds, without torch; anything else states nothing."""

from __future__ import annotations

import json
import struct
import subprocess
import sys
from pathlib import Path

import pytest

from assets import weights_path
from lfcore.weights import load_weights
from lfcore.weights_header import FORMAT, read_stated


@pytest.mark.parametrize("model", ["full", "realtime", "single"])
def test_a_shipped_file_states_what_loading_finds(model: str) -> None:
    stated, loaded = read_stated(weights_path(model)), load_weights(weights_path(model))
    assert stated is not None
    assert (stated.name, stated.key) == (loaded.model.config.name, loaded.digest)


def test_torch_is_not_loaded_for_it() -> None:
    code = (
        "import sys, assets, lfcore.weights_header as h; "
        "assert h.read_stated(assets.weights_path('full')); assert 'torch' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)


def _file(path: Path, header: object, length: int | None = None) -> Path:
    text = json.dumps(header).encode()
    path.write_bytes(struct.pack("<Q", len(text) if length is None else length) + text)
    return path


@pytest.mark.parametrize(
    "header",
    [
        [],
        {},
        {"__metadata__": []},
        {"__metadata__": {"format": "another", "config": '{"name": "full"}', "digest": "0"}},
        {"__metadata__": {"format": FORMAT, "config": "{", "digest": "0"}},
        {"__metadata__": {"format": FORMAT, "config": "[]", "digest": "0"}},
        {"__metadata__": {"format": FORMAT, "config": '{"name": 3}', "digest": "0"}},
        {"__metadata__": {"format": FORMAT, "config": '{"name": "full"}'}},
    ],
)
def test_a_foreign_header_states_nothing(tmp_path: Path, header: object) -> None:
    assert read_stated(_file(tmp_path / "w.safetensors", header)) is None


def test_a_file_that_is_missing_cut_off_or_claims_a_huge_header_states_nothing(tmp_path: Path) -> None:
    good = {"__metadata__": {"format": FORMAT, "config": '{"name": "full"}', "digest": "0"}}
    assert read_stated(_file(tmp_path / "good.safetensors", good)) is not None
    assert read_stated(tmp_path / "none.safetensors") is None
    assert read_stated(tmp_path) is None
    assert read_stated(_file(tmp_path / "huge.safetensors", good, 2**62)) is None
    assert read_stated(_file(tmp_path / "cut.safetensors", good, 20)) is None
    (tmp_path / "empty.safetensors").write_bytes(b"")
    assert read_stated(tmp_path / "empty.safetensors") is None
