"""Plans of sweeps: they come back from JSON as they were, and whatever is not a plan is refused in one sentence."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import pytest

from lfcore.errors import InputError, OutputError
from lfcore.key_frames import Stop
from lfcore.sweep import PATHS
from lfcore.sweep_plan import (
    MAX_KEY_FRAMES,
    KeyFramePath,
    Layer,
    ShapePath,
    SweepPlan,
    ViewPath,
    as_json,
    from_json,
    is_plan_file,
    load_plan,
    save_plan,
)

KEYS = KeyFramePath((Stop(0, 0, 1.5), Stop(1, 0.25, -2)), closed=True)
PLANS = [
    SweepPlan(ShapePath("circle", 0.3)),
    SweepPlan(ShapePath("spiral", 0.5, (-3.0, 4.0)), 7, 12.5, Layer.DISPARITY, True, 0.5, False, 2.0, 0.5, 3),
    SweepPlan(KEYS, 5, layer=Layer.BESIDE_CAPTURED, brighten=True),
]


@pytest.mark.parametrize("plan", PLANS)
def test_a_plan_comes_back_from_its_file(plan: SweepPlan, tmp_path: Path) -> None:
    path = tmp_path / "sweep é.json"
    save_plan(path, plan)
    assert load_plan(path) == plan
    assert is_plan_file(path)
    assert list(tmp_path.iterdir()) == [path]


def test_what_is_left_out_takes_its_usual_value() -> None:
    short = {"lfview_sweep": 1, "path": {"key_frames": [{"u": 0, "v": 1}]}}
    assert from_json(short) == SweepPlan(KeyFramePath((Stop(0, 1),)))


@pytest.mark.parametrize("name", PATHS)
def test_shapes_have_the_viewpoints_of_the_library_and_focus_goes_there_and_back(name: str) -> None:
    path = ShapePath(name, 0.4, (-2.0, 6.0))
    stops = path.stops(9)
    assert [(stop.u, stop.v) for stop in stops] == PATHS[name](9, 0.4)
    focus = [stop.focus for stop in stops]
    assert focus[0] == -2
    if path.closed:
        assert focus[1:] == pytest.approx(focus[:0:-1])
        assert max(stop.focus or 0 for stop in path.stops(8)) == pytest.approx(6)
    else:
        assert focus == pytest.approx(list(range(-2, 7)))
    assert all(stop.focus is None for stop in ShapePath(name, 0.4).stops(3))


def changed(**changes: Any) -> dict[str, Any]:
    return {**as_json(SweepPlan(KEYS)), **changes}


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ([], "no sweep"),
        ({"frames": 3}, "no sweep"),
        (changed(lfview_sweep=2), "version 2"),
        ({"lfview_sweep": 1}, 'no "path"'),
        (changed(path="circle"), "shape"),
        (changed(path={}), "shape"),
        (changed(path={"shape": "zigzag"}), "zigzag"),
        (changed(path={"shape": ["circle"]}), "one of circle"),
        (changed(path={"shape": "circle", "radius": 0.6}), "radius"),
        (changed(path={"shape": "circle", "focus": [1]}), "two numbers"),
        (changed(path={"shape": "circle", "focus": [1, 1e6]}), "focus"),
        (changed(path={"shape": "circle", "turns": 3}), 'unknown "turns"'),
        (changed(path={"key_frames": []}), "1 to"),
        (changed(path={"key_frames": [{"u": 0, "v": 0}] * (MAX_KEY_FRAMES + 1)}), "1 to"),
        (changed(path={"key_frames": [{"u": 0}]}), "key frame 1"),
        (changed(path={"key_frames": [{"u": 0, "v": True}]}), '"v" must be a number'),
        (changed(path={"key_frames": [{"u": 0, "v": 2}]}), "must lie from"),
        (changed(path={"key_frames": [{"u": 0, "v": 10**400}]}), "too large"),
        (changed(path={"key_frames": [{"u": 0, "v": 0}], "closed": 1}), "true or false"),
        (changed(frames=0), "number of frames"),
        (changed(frames=10**9), "number of frames"),
        (changed(frames=2.5), "whole number"),
        (changed(fps=0), "frames per second"),
        (changed(layer="depth"), "one of image"),
        (changed(scale=100), "scale"),
        (changed(gain=0), "gain"),
        (changed(aperture=-1), "aperture"),
        (changed(plays=-1), "play"),
        (changed(labels="yes"), "true or false"),
        (changed(colour="red"), 'unknown "colour"'),
    ],
)
def test_whatever_is_no_plan_is_refused(value: object, words: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=words):
        from_json(value)
    path = tmp_path / "plan.json"
    path.write_text(json.dumps(value))
    with pytest.raises(InputError, match=r"plan\.json"):
        load_plan(path)


@pytest.mark.parametrize("text", ["", "{", '{"lfview_sweep": 1, "fps": NaN}', '{"fps": Infinity}', "[" * 100_000, "\x00"])
def test_broken_json_is_refused(text: str, tmp_path: Path) -> None:
    path = tmp_path / "plan.json"
    path.write_text(text)
    with pytest.raises(InputError, match="no JSON"):
        load_plan(path)


def test_files_that_cannot_be_plans_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be read"):
        load_plan(tmp_path / "none.json")
    with pytest.raises(InputError, match="cannot be read"):
        load_plan(tmp_path)
    (tmp_path / "large.json").write_bytes(b" " * (2**20 + 1))
    with pytest.raises(InputError, match="at most"):
        load_plan(tmp_path / "large.json")
    (tmp_path / "picture.json").write_bytes(b"\x89PNG\xff")
    with pytest.raises(InputError, match="no text"):
        load_plan(tmp_path / "picture.json")
    assert not is_plan_file(tmp_path / "picture.json")
    assert not is_plan_file(tmp_path / "none.json")
    assert not is_plan_file(tmp_path)
    os.mkfifo(tmp_path / "pipe.json")
    assert not is_plan_file(tmp_path / "pipe.json")  # which would be waited for
    with pytest.raises(OutputError):
        save_plan(tmp_path / "missing" / "plan.json", PLANS[0])


@pytest.mark.parametrize("path", [ShapePath("circle", float("nan")), KeyFramePath(()), ShapePath("line", 0.3)])
def test_a_plan_cannot_be_made_with_an_impossible_path(path: ViewPath) -> None:
    with pytest.raises(InputError):
        SweepPlan(path)
