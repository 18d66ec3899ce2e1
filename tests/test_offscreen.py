"""The viewer without a window: the picture file, its faults, and the paths that people type."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
import pytest
from moving_scene import SIZE, TruthSynthesizer, light_field, truth

from app import offscreen
from app.engine import Engine
from app.geometry import Zoom, place
from app.layout import lay_out
from app.offscreen import Offscreen
from app.opening import open_by_content
from app.state import Look
from app.typed_paths import path_from_text
from lfcore.errors import InputError
from lfcore.export import write_image
from lfcore.lightfield import FloatArray

WINDOW = (900, 600)


@pytest.fixture
def made_up(gl: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Off screen on the run's one GL context, on a made-up light field and a model that knows the truth."""
    monkeypatch.setattr(offscreen, "standalone_context", lambda: gl)
    monkeypatch.setattr(offscreen, "open_by_content", lambda *_: light_field())
    monkeypatch.setattr(offscreen, "make_engine", lambda _, cache_bytes, process: Engine(TruthSynthesizer, cache_bytes))


def read(path: Path) -> FloatArray:
    picture = oiio.ImageBuf(str(path)).get_pixels(oiio.FLOAT)
    assert isinstance(picture, np.ndarray)
    return picture


@pytest.mark.usefixtures("made_up")
def test_the_screenshot_shows_the_synthesis_fitted_into_its_area(tmp_path: Path) -> None:
    out = tmp_path / "viewer.png"
    offscreen.screenshot(Path("any"), out, size=WINDOW)
    picture = read(out)
    assert picture.shape == (WINDOW[1], WINDOW[0], 3)
    placement = place(Zoom(), (SIZE[1], SIZE[0]), lay_out(*WINDOW, 1.0, panel_wanted=True).picture)
    expected = truth(0.5, 0.5)
    for x, y in ((20, 20), (64, 48), (100, 80)):
        window_x, window_y = placement.to_window((x + 0.5, y + 0.5))
        np.testing.assert_allclose(picture[int(window_y), int(window_x)], expected[y, x], atol=0.02)
    assert list(tmp_path.iterdir()) == [out]


@pytest.mark.usefixtures("made_up")
def test_two_screenshots_in_one_process(tmp_path: Path) -> None:
    offscreen.screenshot(Path("any"), tmp_path / "a.png", size=WINDOW)
    offscreen.screenshot(Path("any"), tmp_path / "b.png", size=WINDOW, scale=2.0)
    assert read(tmp_path / "b.png").shape == (WINDOW[1], WINDOW[0], 3)


@pytest.mark.usefixtures("made_up")
def test_a_light_field_that_does_not_open_ends_in_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def refuse(*_: object) -> None:
        raise InputError("It is empty; choose another.")

    monkeypatch.setattr(offscreen, "open_by_content", refuse)
    assert offscreen.main([str(tmp_path / "no"), "--out", str(tmp_path / "viewer.png")]) == 2
    assert capsys.readouterr().err == "lfview: It is empty; choose another.\n"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.usefixtures("made_up")
def test_frame_times_are_measured_while_the_synthesis_runs() -> None:
    times = offscreen.measure_frames_offscreen(Path("any"), 1.0, "full")
    assert times.frames > 3
    assert times.views_per_second > 0
    assert 0 < times.p50_ms <= times.p95_ms
    assert times.where == "off screen"


@pytest.mark.parametrize(
    ("text", "path"),
    [
        ("  /tmp/a b ", "/tmp/a b"),
        ("'/tmp/a b'", "/tmp/a b"),
        ('"/tmp/ä"', "/tmp/ä"),
        ("file:///tmp/a%20b", "/tmp/a b"),
        ("~/x", str(Path.home() / "x")),
    ],
)
def test_typed_paths(text: str, path: str) -> None:
    assert path_from_text(text) == Path(path)


@pytest.mark.usefixtures("made_up")
def test_the_screenshot_of_a_folder_shows_what_is_in_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in (("one", 0.3), ("two", 0.9)):
        for row in range(2):
            for column in range(2):
                (tmp_path / "scenes" / name).mkdir(parents=True, exist_ok=True)
                view = np.full((64, 96, 3), value, np.float32)
                write_image(tmp_path / "scenes" / name / f"view_{row}_{column}.png", view)
    monkeypatch.setattr(offscreen, "open_by_content", open_by_content)
    offscreen.screenshot(tmp_path / "scenes", tmp_path / "viewer.png", size=WINDOW)
    picture = read(tmp_path / "viewer.png")
    for value in (0.3, 0.9):
        assert (np.abs(picture - value).max(axis=2) < 0.01).sum() > 2000


def test_an_export_that_runs_is_given_up_when_asked_twice(viewer: Offscreen, monkeypatch: pytest.MonkeyPatch) -> None:
    interface = viewer.interface
    with monkeypatch.context() as exporting:
        exporting.setattr("app.exports.Exports.busy", property(lambda _: True))
        interface.quit()
        assert not interface.closing and "given up" in interface.controller.messages[-1]
        interface.controller.dismiss()
        interface.quit()
        assert not interface.closing  # it had been put away
        interface.quit()
        assert interface.closing
    interface.closing = False
    interface.quit()
    assert interface.closing


def test_a_map_of_another_model_is_not_shown(viewer: Offscreen) -> None:
    """Whose synthesis has none itself: the picture is dimmed, as the panels say."""
    controller, state = viewer.interface.controller, viewer.interface.controller.state
    state.look = Look.DISPARITY
    mapped = viewer.settled()
    assert controller.has_disparity
    newest = controller.newest
    assert newest is not None
    flat = replace(newest, synthesis=replace(newest.synthesis, disparity=None), percentiles=None)
    controller._screen.clear()
    controller._screen.accept(flat, controller.viewpoint)
    assert not controller.has_disparity
    frame = viewer.interface._frame()
    assert frame.look is Look.SYNTHESIS and frame.dim < 1
    assert mapped.shape == viewer.frame().shape
