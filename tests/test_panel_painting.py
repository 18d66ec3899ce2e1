"""Triangles by the processor: by themselves, against OpenGL's, and whole windows of panels against those that it draws."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from imgui_bundle import ImVec2, imgui

from app import panel_painting, repainting
from app.canvas import Canvas
from app.geometry import Size, Zoom
from app.interface import Interface
from app.offscreen import Offscreen
from app.painting import CORNER_BYTES, Box, Texture, triangles
from app.state import Look
from lfcore.synthesis import ByteArray

SIZE = (48, 64)  # height, width
ALL = Box(0, 0, SIZE[1], SIZE[0])
WHITE = Texture(np.full((2, 2, 4), 255, np.uint8), white=True)
Points = npt.NDArray[np.float32]


@pytest.fixture(autouse=True)
def compiled(compiled_painting: None) -> None:
    """All of these need it."""


def grey(value: int = 100) -> ByteArray:
    return np.full((*SIZE, 4), value, np.uint8)


def corners_of(places: Any, colours: Any = (255, 255, 255, 255), of_texture: Any = (0.5, 0.5)) -> npt.NDArray[np.uint8]:
    """Corners as imgui lays them out: places (N, 2) px; colours (N, 4), red first; places in the texture (N, 2)."""
    places = np.asarray(places, np.float32)
    corners = np.empty((len(places), CORNER_BYTES), np.uint8)
    corners[:, :8] = places.view(np.uint8).reshape(len(places), 8)
    corners[:, 8:16] = np.broadcast_to(np.asarray(of_texture, np.float32), places.shape).copy().view(np.uint8)
    corners[:, 16:] = np.broadcast_to(np.asarray(colours, np.uint8), (len(places), 4))
    return corners


def indices_of(*names: int) -> npt.NDArray[np.uint32]:
    return np.array(names, np.uint32)


RECTANGLE = indices_of(0, 1, 2, 0, 2, 3)


def corners_of_rectangle(left: float, top: float, right: float, bottom: float) -> Points:
    return np.array([(left, top), (right, top), (right, bottom), (left, bottom)], np.float32)


# By itself.


@pytest.mark.parametrize("order", [(0, 1, 2, 0, 2, 3), (0, 1, 2, 3, 0, 2), (2, 1, 0, 3, 2, 0)])  # the first is taken as one
def test_a_rectangle_covers_the_pixels_whose_centres_lie_in_it(order: tuple[int, ...]) -> None:
    sheet = grey()
    places = corners_of_rectangle(10.5, 7.4, 30.5, 20.6)
    triangles(sheet, [ALL], WHITE, corners_of(places, (200, 10, 30, 255)), indices_of(*order))
    expected = grey()
    expected[7:21, 10:30] = (30, 10, 200, 255)  # of those on its edges the ones on the left
    np.testing.assert_array_equal(sheet[..., :3], expected[..., :3])


@pytest.mark.parametrize("cover", [0, 1, 77, 128, 254, 255])
def test_a_colour_covers_as_much_as_it_says(cover: int) -> None:
    sheet = grey()
    triangles(sheet, [ALL], WHITE, corners_of(corners_of_rectangle(0, 0, 64, 48), (250, 130, 0, cover)), RECTANGLE)
    expected = np.rint(100 + (np.array([0, 130, 250]) - 100.0) * cover / 255)
    np.testing.assert_allclose(sheet[..., :3], np.broadcast_to(expected, (*SIZE, 3)), atol=1)


@pytest.mark.parametrize("scale", [0.05, 0.3, 1.0, 40.0])  # narrow triangles, wide ones, and such as reach far beyond the sheet
def test_a_fan_covers_no_pixel_twice_and_leaves_none_out(scale: float) -> None:
    """All pixels of a convex polygon have the same colour, whatever triangles it is cut into, and no others."""
    random = np.random.default_rng(int(100 * scale))
    for _ in range(20):
        count = int(random.integers(3, 14))
        angles = np.sort(random.uniform(0, 2 * np.pi, count))
        middle = random.uniform((20, 15), (44, 33))
        places = middle + scale * 20 * np.stack((np.cos(angles), np.sin(angles)), 1)
        places = np.round(places * 256) / 256  # so that places are exact
        fan = [name for i in range(1, count - 1) for name in (0, i, i + 1)]
        sheet = grey()
        triangles(sheet, [ALL], WHITE, corners_of(places, (255, 255, 255, 128)), indices_of(*fan))
        y, x = np.mgrid[: SIZE[0], : SIZE[1]] + 0.5
        sides = [
            (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0]) for a, b in zip(places, np.roll(places, -1, 0), strict=True)
        ]
        least = np.min(sides, 0)
        once = 100 + round((255 - 100) * 128 / 255)
        assert set(np.unique(sheet[..., 0][least > 0])) <= {once, once + 1, once - 1}
        assert (sheet[..., 0][least < 0] == 100).all()


def test_colours_run_evenly_between_corners() -> None:
    sheet = grey(0)
    colours = [(0, 0, 0, 255), (255, 0, 0, 255), (255, 255, 0, 255), (0, 255, 0, 255)]
    triangles(sheet, [ALL], WHITE, corners_of(corners_of_rectangle(0, 0, 64, 48), colours), RECTANGLE)
    red = 255 * (np.arange(64) + 0.5) / 64
    green = 255 * (np.arange(48) + 0.5) / 48
    np.testing.assert_allclose(sheet[..., 2], np.broadcast_to(red, SIZE), atol=1)
    np.testing.assert_allclose(sheet[..., 1], np.broadcast_to(green[:, None], SIZE), atol=1)


@pytest.mark.parametrize("white", [False, True])
def test_a_texture_of_the_same_size_is_copied(white: bool) -> None:
    pixels = np.random.default_rng(1).integers(0, 256, (12, 20, 4), dtype=np.uint8)
    pixels[..., 3 if not white else slice(0, 3)] = 255
    sheet = grey(0)
    of_texture = [(0, 0), (1, 0), (1, 1), (0, 1)]
    corners = corners_of(corners_of_rectangle(5, 6, 25, 18), of_texture=of_texture)
    triangles(sheet, [ALL], Texture(pixels, white), corners, RECTANGLE)
    expected = pixels[..., 2::-1] if not white else np.broadcast_to(pixels[..., 3:], (12, 20, 3))
    np.testing.assert_array_equal(sheet[6:18, 5:25, :3], expected)


def test_nothing_outside_the_box_is_painted() -> None:
    for box in (Box(10, 5, 20, 9), Box(-5, -5, 3, 4), Box(60, 40, 100, 100), Box(9, 9, 9, 20), Box(20, 20, 10, 10)):
        sheet, expected = grey(), grey()
        triangles(sheet, [box], WHITE, corners_of(corners_of_rectangle(-1e9, -1e9, 1e9, 1e9)), RECTANGLE)
        expected[max(box.top, 0) : max(box.bottom, 0), max(box.left, 0) : max(box.right, 0)] = 255
        np.testing.assert_array_equal(sheet[..., :3], expected[..., :3])


@pytest.mark.parametrize("place", [np.nan, np.inf, -np.inf, 3e38])
def test_places_that_are_no_numbers_harm_nothing_else(place: float) -> None:
    sheet = grey()
    places = np.array([(5, 5), (20, 5), (place, 20), (40, 10), (50, 10), (50, 20)], np.float32)
    triangles(sheet, [ALL], WHITE, corners_of(places, of_texture=(place, place)), indices_of(0, 1, 2, 3, 4, 5))
    assert (sheet[15, 49, :3] == 255).all() and (sheet[40, 60, :3] == 100).all()


def test_a_corner_that_is_not_there_is_refused() -> None:
    sheet = grey()
    with pytest.raises(ValueError, match="not there"):
        triangles(sheet, [ALL], WHITE, corners_of(corners_of_rectangle(0, 0, 9, 9)), indices_of(0, 1, 4))
    with pytest.raises(ValueError, match="without pixels"):
        triangles(sheet, [ALL], Texture(np.empty((0, 4, 4), np.uint8), True), corners_of(np.zeros((3, 2))), indices_of(0, 1, 2))
    assert (sheet == 100).all()


# Against OpenGL.

VERTEX = """#version 330 core
in vec2 place; in vec2 of_texture; in vec4 colour; out vec2 at; out vec4 mixed;
void main() { at = of_texture; mixed = colour; gl_Position = vec4(place / vec2(32.0, -24.0) + vec2(-1.0, 1.0), 0.0, 1.0); }
"""
FRAGMENT = """#version 330 core
uniform sampler2D filling; in vec2 at; in vec4 mixed; out vec4 seen;
void main() { seen = mixed * texture(filling, at); }
"""


def drawn(
    gl: Any, texture: ByteArray, corners: npt.NDArray[np.uint8], indices: npt.NDArray[np.uint32]
) -> npt.NDArray[np.int64]:
    program = gl.program(vertex_shader=VERTEX, fragment_shader=FRAGMENT)
    filling = gl.texture((texture.shape[1], texture.shape[0]), 4, texture.tobytes())
    filling.repeat_x = filling.repeat_y = False
    vertices, names = gl.buffer(corners.tobytes()), gl.buffer(indices.tobytes())
    array = gl.vertex_array(program, [(vertices, "2f 2f 4f1", "place", "of_texture", "colour")], names)
    room = gl.texture((SIZE[1], SIZE[0]), 4)
    framebuffer = gl.framebuffer([room])
    framebuffer.use()
    framebuffer.clear(100 / 255, 100 / 255, 100 / 255, 1.0)
    gl.enable(gl.BLEND)
    gl.blend_func = gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA
    filling.use(0)
    array.render()
    gl.disable(gl.BLEND)
    values = np.frombuffer(framebuffer.read(components=3, alignment=1), np.uint8).reshape(*SIZE, 3)[::-1].astype(np.int64)
    for part in (array, vertices, names, framebuffer, room, filling, program):
        part.release()
    return values


@pytest.mark.parametrize("white", [False, True])
def test_triangles_are_those_of_opengl(gl: Any, white: bool) -> None:
    random = np.random.default_rng(5)
    for turn in range(12):
        texture = random.integers(0, 256, (16, 16, 4), dtype=np.uint8)
        if white:
            texture[..., :3] = 255
        count = 9
        places = random.uniform(-10, 70, (count, 2)) if turn % 2 else random.uniform(20, 30, (count, 2))
        corners = corners_of(places, random.integers(0, 256, (count, 4)), random.uniform(0.1, 0.9, (count, 2)))
        if turn % 3 == 0:  # in one colour
            corners[:, 16:] = (200, 150, 30, 180)
        indices = np.arange(count, dtype=np.uint32)
        sheet = grey()
        triangles(sheet, [ALL], Texture(texture, white), corners, indices)
        apart = abs(sheet[..., 2::-1].astype(np.int64) - drawn(gl, texture, corners, indices))
        # A centre that lies on a side up to rounding, or a texture that is sampled much smaller.
        assert np.quantile(apart, 0.99) <= 2 and (apart > 3).mean() < 0.004, (turn, apart.max())


# Whole windows.


@pytest.fixture
def painted(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How many pieces each frame that was painted consisted of."""
    counts: list[int] = []
    paint = repainting.paint

    def counted(sheet: ByteArray, boxes: Any, layers: Any, pieces: Any) -> None:
        counts.append(len(pieces))
        paint(sheet, boxes, layers, pieces)

    monkeypatch.setattr(repainting, "paint", counted)
    return counts


def both_ways(viewer: Offscreen, painted: list[int], monkeypatch: pytest.MonkeyPatch) -> float:
    """The same settled frame painted and drawn: the share of pixels that differ by more than three levels."""
    first = viewer.settled().astype(np.int64)
    count = len(painted)
    viewer.frame()
    assert len(painted) == count + 1 and painted[-1] > 0
    with monkeypatch.context() as patched:
        patched.setattr(Interface, "_paint", lambda *_: False)
        second = viewer.frame().astype(np.int64)
        assert len(painted) == count + 1
    apart = abs(first - second).max(-1)
    status = apart.shape[0] - 40  # below: times, which differ from frame to frame
    return float((apart[:status] > 3).mean())


@pytest.mark.parametrize("scale", [1.0, 1.5])
def test_a_painted_window_is_the_one_that_is_drawn(
    viewer: Offscreen, painted: list[int], monkeypatch: pytest.MonkeyPatch, scale: float
) -> None:
    viewer.interface.set_scale(scale)
    assert both_ways(viewer, painted, monkeypatch) < 0.0005


def test_so_it_is_where_a_window_unit_is_two_pixels(
    viewer: Offscreen, painted: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    io = imgui.get_io()
    io.display_size, io.display_framebuffer_scale = ImVec2(500, 350), ImVec2(2, 2)
    assert both_ways(viewer, painted, monkeypatch) < 0.0005


def test_so_it_is_with_more_over_the_picture(viewer: Offscreen, painted: list[int], monkeypatch: pytest.MonkeyPatch) -> None:
    controller = viewer.interface.controller
    controller.say("Something went wrong; this is said over the picture.")
    controller.state.help = True
    assert both_ways(viewer, painted, monkeypatch) < 0.0005


def test_a_window_is_drawn_where_not_all_of_it_can_be_painted(
    viewer: Offscreen, painted: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    viewer.settled()
    monkeypatch.setattr(panel_painting, "pieces_of", lambda *_: None)
    shown: list[object] = []
    draw = Canvas.draw
    monkeypatch.setattr(Canvas, "draw", lambda canvas, *where: (shown.append(where), draw(canvas, *where)))
    count = len(painted)
    viewer.frame()
    assert len(painted) == count and len(shown) == 1


def test_where_there_is_no_memory_to_share_the_window_is_copied(viewer: Offscreen, monkeypatch: pytest.MonkeyPatch) -> None:
    class NoRoom:
        def keeps(self, size: Size) -> bool:
            return True

        def sheet(self, size: Size) -> ByteArray:
            raise OSError("no room")

    before = viewer.settled()
    monkeypatch.setattr(viewer.interface, "_shared", NoRoom())
    after = viewer.frame()
    assert viewer.interface._shared is None and not viewer.interface.controller.messages
    np.testing.assert_array_equal(after[:-40], before[:-40])  # below: times


def test_in_a_window_that_goes_on_each_frame_is_as_if_all_of_it_had_been_painted(
    viewer: Offscreen, monkeypatch: pytest.MonkeyPatch
) -> None:
    state = viewer.interface.controller.state
    sheets: list[ByteArray] = []
    shares: list[float] = []
    paint = repainting.paint

    def checked(sheet: ByteArray, boxes: Sequence[Box], layers: Any, pieces: Any) -> None:
        paint(sheet, boxes, layers, pieces)
        anew = np.zeros_like(sheet)
        paint(anew, [Box(0, 0, sheet.shape[1], sheet.shape[0])], layers, pieces)
        np.testing.assert_array_equal(sheet, anew)
        sheets.append(anew)
        shares.append(sum((box.right - box.left) * (box.bottom - box.top) for box in boxes) / (sheet.shape[0] * sheet.shape[1]))

    monkeypatch.setattr(repainting, "paint", checked)
    steps: list[Callable[[], object]] = [
        *(lambda u=u: state.move_to(u, 0.4) for u in (0.5, 0.52, 0.55, 0.7)),
        *(lambda scale=scale: setattr(state, "zoom", Zoom(scale)) for scale in (1.0, 2.5, 5.0)),
        lambda: setattr(state, "panel", False),
        lambda: setattr(state, "look", Look.DISPARITY),  # which is drawn
        lambda: state.move_to(0.6, 0.6),
        lambda: setattr(state, "look", Look.SYNTHESIS),
        lambda: setattr(state, "panel", True),
        lambda: setattr(state, "help", True),
        lambda: setattr(state, "help", False),
    ]
    for step in steps:
        step()
        for _ in range(4):
            count = len(sheets)
            frame = viewer.frame()
            assert state.look is Look.SYNTHESIS or len(sheets) == count
            if len(sheets) > count:
                np.testing.assert_array_equal(frame, sheets[-1][..., 2::-1])  # all of it has come to the window
    assert len(sheets) > 30
    assert min(shares) < 0.05 < 0.9 < max(shares)  # times in the status bar, and all of it after a frame that was drawn
