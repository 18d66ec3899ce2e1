"""While a raw capture is decoded, its coarse picture stands on screen."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from moving_scene import TruthSynthesizer, light_field

from app.controller import Controller
from app.desk import Folder
from app.engine import Engine
from app.opening import preview
from app.state import Step
from lfcore.camera_model import illum
from lfcore.errors import Cancelled, InputError
from lfcore.formats import coarse_light_field, open_light_field
from lfcore.lightfield import LightField
from tests.camera_truth import small, write_model_capture
from tests.plane_scenes import slanted_scene


def _until(controller: Controller, condition: Callable[[], bool]) -> None:
    deadline, now = time.monotonic() + 60, 0.0
    while not condition():
        assert time.monotonic() < deadline
        now += 0.01
        controller.tick(now)
        time.sleep(0.002)


def _controller(synthesizer: TruthSynthesizer, opened: Callable[..., LightField]) -> Controller:
    return Controller(Engine(lambda: synthesizer, 2**20), opened, lambda: None, "truth", lambda path: light_field(2, 2))


def test_the_coarse_picture_gives_way_to_the_light_field() -> None:
    synthesizer, go = TruthSynthesizer(), threading.Event()

    def opened(*_: object) -> LightField:
        go.wait(60)
        return light_field(3, 3)

    controller = _controller(synthesizer, opened)
    controller.open(Path("capture"))
    _until(controller, lambda: controller.light_field is not None)
    assert controller.light_field is not None
    assert controller.light_field.rows == 2
    assert controller.readout(None).loading is not None
    for tick in range(50):
        controller.tick(100 + tick)
    assert controller.step is Step.BLEND  # nothing is synthesized from it
    go.set()
    _until(controller, lambda: controller.light_field is not None and controller.light_field.rows == 3)
    _until(controller, lambda: controller.step is Step.FULL)
    controller.stop()


def test_the_coarse_picture_goes_where_decoding_fails() -> None:
    def opened(*_: object) -> LightField:
        raise InputError("The capture is damaged.")

    controller = _controller(TruthSynthesizer(), opened)
    controller.open(Path("capture"))
    _until(controller, lambda: bool(controller.messages))
    assert controller.light_field is None
    controller.stop()


def test_only_captures_that_are_not_kept_have_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    monkeypatch.setenv("LFVIEW_CACHE", str(tmp_path / "cache"))
    camera = small(illum(), 360, 300)
    capture = write_model_capture(tmp_path, camera, slanted_scene(camera.size_in_pitches, 3), samples=2, white=False)
    coarse = coarse_light_field(capture)
    assert coarse is not None
    decoded = open_light_field(capture)
    assert coarse.view(0, 0).shape == decoded.view(0, 0).shape
    inner = np.s_[3:-3, 3:-3]
    assert np.abs(coarse.view(1, 0)[inner] - decoded.view(3, 4)[inner]).mean() < 0.03
    assert coarse_light_field(capture) is None  # opened at once from now on
    assert preview(tmp_path) is None
    assert preview(tmp_path / "missing.LFR") is None


def test_the_coarse_picture_goes_where_a_folder_is_opened_in_its_place(tmp_path: Path) -> None:
    def opened(path: Path, _: object, cancelled: Callable[[], bool]) -> LightField | Folder:
        if path == tmp_path:
            return Folder(tmp_path, (tmp_path / "one",))
        while not cancelled():
            time.sleep(0.002)
        raise Cancelled

    synthesizer = TruthSynthesizer()
    found = {Path("capture"): light_field(2, 2)}
    controller = Controller(Engine(lambda: synthesizer, 2**20), opened, lambda: None, "truth", found.get)
    controller.open(Path("capture"))
    _until(controller, lambda: controller.previewing)
    controller.open(tmp_path)
    _until(controller, lambda: controller.folder is not None)
    assert not controller.previewing and controller.light_field is None
    controller.stop()
