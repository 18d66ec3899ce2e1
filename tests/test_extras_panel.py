"""Lytro files without raw in the viewer: what is listed, the panel by fed events, the controller, the pixels on screen."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from moving_scene import TruthSynthesizer, light_field

from app import offscreen
from app.controller import Controller
from app.engine import Engine
from app.exhibits import Exhibit, Exhibition, exhibition, open_exhibition
from app.geometry import Zoom, place
from app.layout import lay_out
from app.looking import Looking
from app.opening import open_by_content
from app.readout import Caption, Readout
from app.state import Grid
from app.worker import Cancel
from lfcore import colormaps
from lfcore.errors import InputError
from lfcore.formats.lytro.container import write_container
from lfcore.formats.lytro.extras import DepthMap, Extras, FocusStack
from lfcore.lightfield import LightField
from tests.lytro_files import SHARED, write_f01
from tests.test_lytro_contents import write_stack
from tests.test_panels import Screen

PATIENCE = 60.0
FOCUS = (-8.0, -3.0, 1.0, 6.0)
STACK = tuple(Caption("Refocus stack", 640, 480, focus) for focus in FOCUS)
MAP = Caption("Depth", 88, 60, span=(-8.0, 6.0), unit="lambda")
FILE = Readout(model="full", name="IMG_1-stk", kind="It is a refocus stack.", captions=(*STACK, MAP))

real_files = pytest.mark.skipif(not SHARED.is_dir(), reason="needs the real Lytro files of ../shared/data/lfp")


def made_up() -> Extras:
    """Four pictures of the grey levels 0 to 3, a ramp of depth with a hole, and a thumbnail."""
    levels = np.arange(4, dtype=np.uint8)[:, None, None, None]
    depth = np.linspace(-2, 3, 48, dtype=np.float32).reshape(6, 8)
    depth[0, 1] = np.nan
    stack = FocusStack(np.broadcast_to(levels, (4, 6, 8, 3)), np.array(FOCUS, np.float32))
    return Extras("made up", "It is made up.", (("thumbnail", np.zeros((2, 3, 3), np.uint8)),), stack, DepthMap(depth, None))


# What is shown


def test_the_stack_comes_first_then_maps_then_pictures_and_it_begins_at_the_lens_focus() -> None:
    shown = exhibition(made_up(), "/tmp/a.lfp")
    assert shown is not None
    captions = [each.caption for each in shown.exhibits]
    assert [each.label for each in captions] == ["Refocus stack"] * 4 + ["Depth", "Thumbnail"]
    assert [each.focus for each in captions] == [*FOCUS, None, None]
    assert captions[4].span == (-2, 3)  # the hole has no value
    assert [(each.width, each.height) for each in captions[3:]] == [(8, 6), (8, 6), (3, 2)]
    assert shown.first == 2  # 1.0 is nearest to 0


def test_files_without_anything_to_see_and_raw_captures_are_left_to_others(tmp_path: Path) -> None:
    write_container(tmp_path / "b.lfp", {"novelty": 1}, [b""])
    (tmp_path / "text.lfp").write_text("no container")
    for path in (write_f01(tmp_path / "a.lfp"), tmp_path / "b.lfp", tmp_path / "text.lfp", tmp_path, tmp_path / "missing"):
        assert open_exhibition(path) is None


def test_a_stack_is_opened_by_its_content_and_a_cut_one_is_refused(tmp_path: Path) -> None:
    path = write_stack(tmp_path / "stack.bin", tmp_path, {40: -2.5, 200: 0.5})
    opened = open_by_content(path, lambda _: None, lambda: False)
    assert isinstance(opened, Exhibition)
    assert [each.caption.focus for each in opened.exhibits] == [-2.5, 0.5]
    assert [int(each.pixels[..., 2].mean().round()) for each in opened.exhibits] == pytest.approx([40, 200], abs=2)
    path.write_bytes(path.read_bytes()[:-200])
    with pytest.raises(InputError, match=r"stack\.bin"):
        open_by_content(path, lambda _: None, lambda: False)


@real_files
def test_real_files() -> None:
    shown = open_by_content(SHARED / "illum_preview.LFP", lambda _: None, lambda: False)
    assert isinstance(shown, Exhibition)
    assert [each.caption.label for each in shown.exhibits] == ["Refocus stack"] * 10 + ["Depth"]
    with pytest.raises(InputError, match="metadata only"):
        open_by_content(SHARED / "f01_metadata_only.lfp", lambda _: None, lambda: False)


# The panel


@pytest.fixture
def screen(imgui_context: Any) -> Screen:
    made = Screen(imgui_context)
    made.readout = FILE
    made.frame(3)
    return made


def test_keys_go_through_all_pictures_and_round(screen: Screen) -> None:
    state, seen = screen.state, []
    for _ in range(5):
        screen.press("N")
        seen.append(state.exhibit)
    assert seen == [1, 2, 3, 4, 0]
    screen.press("P")
    assert state.exhibit == 4


def test_keys_of_a_light_field_do_nothing_and_the_file_can_be_closed(screen: Screen) -> None:
    before = (screen.state.u, screen.state.v, screen.state.look, screen.state.exhibit)
    for key in ("Left", "Up", "S", "2", "3", "C", "T"):
        screen.press(key)
    assert (screen.state.u, screen.state.v, screen.state.look, screen.state.exhibit) == before
    assert not screen.state.captured
    assert screen.state.looking == Looking()
    screen.press("Ctrl+W")
    assert [request.value for request in screen.requests] == ["close"]  # type: ignore[union-attr]


def test_the_slider_goes_to_the_pictures_of_the_stack_only(screen: Screen) -> None:
    state, panel = screen.state, screen.layout.panel
    assert panel is not None
    state.exhibit = 4
    _, y = screen.find_in_panel(lambda: state.exhibit == 0, "left")  # near the slider's left end
    x = np.linspace(panel.x + 0.3 * panel.width, panel.x + 0.725 * panel.width, 60)
    seen = []
    for place_ in x:
        screen.click(float(place_), y)
        seen.append(state.exhibit)
    assert seen == sorted(seen)
    assert set(seen) == {0, 1, 2, 3}
    # Each has the part of the way that is nearest to its focus: 0 to -5.5, -1 and 3.5 of the 14 lambda.
    shares = [seen.count(number) / len(seen) for number in range(4)]
    assert shares == pytest.approx([2.5 / 14, 4.5 / 14, 4.5 / 14, 2.5 / 14], abs=0.06)


def test_rows_of_the_list_choose_the_map_and_the_stack(screen: Screen) -> None:
    state = screen.state
    _, y = screen.find_in_panel(lambda: state.exhibit == 4, "left")
    state.exhibit = 4
    panel = screen.layout.panel
    assert panel is not None
    screen.click(panel.x + 0.3 * panel.width, y - 20)
    assert state.exhibit == 2


def test_a_drag_moves_the_picture_and_not_the_viewpoint(screen: Screen) -> None:
    screen.press("Z")
    before = screen.state.zoom.centre
    screen.drag((400, 300), (64, 48))
    assert (screen.state.u, screen.state.v) == (0.5, 0.5)
    assert screen.state.zoom.centre == pytest.approx((before[0] - 64 / 640, before[1] - 48 / 480))


@pytest.mark.parametrize("size", [(1280.0, 800.0), (700.0, 300.0), (200.0, 150.0)])
def test_it_fits_windows_of_any_size(screen: Screen, size: tuple[float, float]) -> None:
    screen.size = size
    drawn = set()
    for index in range(5):
        screen.state.exhibit = index
        screen.frame(3)
        drawn.add(screen.drawn())
    assert len(drawn) == 5


# The controller


def exhibits(count: int = 3) -> Exhibition:
    depth = np.array([[1.5, 2.5]], np.float32)
    pictures = [Exhibit(Caption("Refocus stack", 2, 1, float(focus)), np.zeros((1, 2, 3), np.uint8)) for focus in range(count)]
    return Exhibition("IMG_1", "/tmp/IMG_1", "It is one.", (*pictures, Exhibit(Caption("Depth", 2, 1, span=(1.5, 2.5)), depth)))


def opened(path: Path, progress: Callable[[float], None], cancelled: Cancel) -> LightField | Exhibition:
    return light_field(3, 3) if path.name == "field" else exhibits()


def open_and_wait(controller: Controller, name: str) -> None:
    controller.open(Path(name))
    deadline = time.monotonic() + PATIENCE
    while controller.readout(None).loading is not None:
        assert time.monotonic() < deadline
        controller.tick(time.monotonic())
        time.sleep(0.002)


def test_a_file_takes_the_place_of_a_light_field_and_the_other_way_round() -> None:
    synthesizer = TruthSynthesizer()
    controller = Controller(Engine(lambda: synthesizer, 2**20), opened, lambda: None, "truth")
    try:
        open_and_wait(controller, "field")
        open_and_wait(controller, "file")
        readout = controller.readout(None)
        assert controller.light_field is None
        assert readout.grid is None
        assert [caption.label for caption in readout.captions] == ["Refocus stack"] * 3 + ["Depth"]
        assert (readout.name, readout.kind) == ("IMG_1", "It is one.")
        controller.state.exhibit, controller.state.cursor = 3, (1.7, 0.2)
        assert controller.readout(None).value_under_cursor == 2.5
        controller.state.exhibit = 0
        assert controller.readout(None).value_under_cursor is None
        controller.tick(time.monotonic())
        assert controller.next_frame_in is None  # nothing moves by itself

        controller.state.exhibit = 3
        open_and_wait(controller, "field")
        readout = controller.readout(None)
        assert readout.grid == Grid(3, 3, readout.grid.width, readout.grid.height) if readout.grid else False
        assert readout.captions == ()
        assert controller.exhibit is None

        open_and_wait(controller, "file")
        controller.close()
        assert controller.exhibit is None
        assert controller.name == ""
    finally:
        controller.stop()


# The screen


def test_pictures_and_maps_come_to_the_screen_pixel_by_pixel(gl: Any) -> None:
    window, rng = (900, 600), np.random.default_rng(1)
    picture = rng.integers(0, 256, (6, 8, 3), np.uint8)
    ramp = np.linspace(-2, 3, 48, dtype=np.float32).reshape(6, 8)
    file = Exhibition(
        "a",
        "/tmp/a",
        "It is one.",
        (Exhibit(Caption("Picture", 8, 6), picture), Exhibit(Caption("Depth", 8, 6, span=(-2.0, 3.0)), ramp)),
    )
    controller = Controller(Engine(TruthSynthesizer, 2**20), lambda *_: file, lambda: None, "truth")
    viewer = offscreen.Offscreen(controller, gl, window, 1.0)
    try:
        controller.open(Path("a"))
        offscreen._wait_for_synthesis(viewer)
        placement = place(Zoom(), (8, 6), lay_out(*window, 1.0, panel_wanted=True).picture)
        corners = [placement.to_window((x + 0.5, y + 0.5)) for y in range(4) for x in range(8)]  # the scale lies below
        rows, columns = np.array([int(y) for _, y in corners]), np.array([int(x) for x, _ in corners])
        np.testing.assert_allclose(viewer.settled()[rows, columns], picture[:4].reshape(-1, 3), atol=1)
        controller.state.exhibit = 1
        colours = colormaps.disparity_colours()  # (256, 3)
        expected = colours[np.round((ramp[:4].ravel() + 2) / 5 * 255).astype(int)]
        np.testing.assert_allclose(viewer.settled()[rows, columns].astype(int), expected.astype(int), atol=3)
        controller.close()
        assert (np.abs(viewer.settled()[rows, columns].astype(int) - expected) > 3).any()  # the start picture
    finally:
        viewer.close()
        controller.stop()
