"""The shaders on a software rasteriser, against slow computations in numpy and against known truth."""

from __future__ import annotations

from collections.abc import Iterator
from importlib import resources
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from moving_scene import DISPARITY, SIZE, truth

from app import glsl
from app.canvas import BACKGROUND, Canvas, Frame, Target
from app.canvas.passes import Pass
from app.comparison import Source
from app.geometry import Rect, Zoom, place
from app.painting import in_bytes
from app.state import CARRIED, CARRIED_IN_SOFTWARE, Look, Reach
from app.tone import Curve, Tone
from lfcore import colormaps
from lfcore.errors import InputError, LfviewError
from lfcore.lightfield import CORNERS, FloatArray, as_float

HEIGHT, WIDTH = SIZE
VIEWPOINTS = ((0.3, 0.4), (0.0, 1.0), (-0.2, 1.1))


@pytest.fixture
def canvas(gl: Any) -> Iterator[Canvas]:
    made = Canvas(gl, "f4")  # pictures in float32, to be compared exactly
    yield made
    made.clear()
    assert gl.error == "GL_NO_ERROR"


def random_corners(dtype: str, seed: int = 0) -> npt.NDArray[np.generic]:
    values = np.random.default_rng(seed).random((4, HEIGHT, WIDTH, 3))
    if dtype == "float32":
        return values.astype(np.float32)
    return (values * np.iinfo(dtype).max).astype(dtype)


def give(canvas: Canvas, image: FloatArray, disparity: FloatArray | None, viewpoint: tuple[float, float]) -> None:
    """Hand a synthesis to the canvas, as the interface does."""
    canvas.set_synthesis(image, in_bytes(image), disparity, viewpoint)


def moving_corners() -> FloatArray:
    return np.stack([truth(u, v) for u, v in CORNERS])


def cubic(t: float) -> float:
    """Keys' kernel with a = -0.5, from its definition."""
    t = abs(t)
    if t < 1:
        return 1.5 * t**3 - 2.5 * t**2 + 1
    return -0.5 * t**3 + 2.5 * t**2 - 4 * t + 2 if t < 2 else 0.0


def warped_slowly(picture: FloatArray, offset: tuple[float, float], disparity: FloatArray, x: int, y: int) -> FloatArray:
    """One pixel of the backward warp, written out in double precision."""
    sx, sy = x + offset[0] * float(disparity[y, x]), y + offset[1] * float(disparity[y, x])
    if not (0 <= sx <= WIDTH - 1 and 0 <= sy <= HEIGHT - 1):
        return np.zeros(3, np.float32)
    total = np.zeros(3)
    for j in range(int(np.floor(sy)) - 1, int(np.floor(sy)) + 3):
        for i in range(int(np.floor(sx)) - 1, int(np.floor(sx)) + 3):
            pixel = picture[min(max(j, 0), HEIGHT - 1), min(max(i, 0), WIDTH - 1)]
            total += cubic(sx - i) * cubic(sy - j) * pixel
    return total.astype(np.float32)


@pytest.mark.parametrize("dtype", ["uint8", "uint16", "float32"])
def test_warped_inputs_are_the_backward_warp(canvas: Canvas, dtype: str) -> None:
    corners = random_corners(dtype)
    canvas.set_light_field(corners)
    chance = np.random.default_rng(1)
    disparity = chance.uniform(-5, 5, SIZE).astype(np.float32)
    for viewpoint in VIEWPOINTS:
        give(canvas, truth(*viewpoint), disparity, viewpoint)
        sheet = canvas.read(Frame(Look.WARPED_ALL, viewpoint))
        for look in Look:
            if look.corner is None:
                continue
            shown = canvas.read(Frame(look, viewpoint))
            u, v = CORNERS[look.corner]
            picture = as_float(corners[look.corner])
            for x, y in [(0, 0), (WIDTH - 1, HEIGHT - 1)] + [
                (int(chance.integers(WIDTH)), int(chance.integers(HEIGHT))) for _ in range(40)
            ]:
                expected = warped_slowly(picture, (u - viewpoint[0], v - viewpoint[1]), disparity, x, y)
                # Positions are float32 in the shader: at the very edge it may find a sample inside that is outside.
                np.testing.assert_allclose(shown[y, x], expected, atol=2e-5)
            row, column = int(v) * HEIGHT, int(u) * WIDTH
            np.testing.assert_array_equal(sheet[row : row + HEIGHT, column : column + WIDTH], shown)


@pytest.mark.parametrize("dtype", ["uint8", "uint16", "float32"])
def test_error_is_the_absolute_difference_times_gain(canvas: Canvas, dtype: str) -> None:
    canvas.set_light_field(random_corners(dtype))
    captured = random_corners(dtype, seed=2)[0]
    canvas.set_captured(captured)
    image = truth(0.5, 0.5)
    give(canvas, image, None, (0.5, 0.5))
    shown = canvas.read(Frame(Look.ERROR, (0.5, 0.5), gain=4.0))
    np.testing.assert_allclose(shown, 4 * np.abs(image - as_float(captured)), atol=2e-6)


def test_captured_view_and_synthesis_are_shown_as_they_are(canvas: Canvas) -> None:
    canvas.set_light_field(random_corners("uint8"))
    captured = random_corners("uint8", seed=3)[1]
    canvas.set_captured(captured)
    give(canvas, truth(0.5, 0.5), None, (0.5, 0.5))
    shown = canvas.read(Frame(Look.SYNTHESIS, (0.5, 0.5), source=Source.CAPTURED))
    np.testing.assert_allclose(shown, as_float(captured), atol=1e-6)
    shown = canvas.read(Frame(Look.SYNTHESIS, (0.5, 0.5)))
    np.testing.assert_allclose(shown, truth(0.5, 0.5), atol=1e-6)


def test_blend_is_the_bilinear_mean_of_the_corners(canvas: Canvas) -> None:
    corners = random_corners("float32")
    canvas.set_light_field(corners)
    for (u, v), (near_u, near_v) in (((0.3, 0.4), (0.3, 0.4)), ((1.2, -0.1), (1.0, 0.0))):
        weights = [(near_u if p else 1 - near_u) * (near_v if q else 1 - near_v) for p, q in CORNERS]
        expected = np.tensordot(np.array(weights, np.float32), corners, axes=1)
        np.testing.assert_allclose(canvas.read(Frame(Look.SYNTHESIS, (u, v))), expected, atol=1e-5)


def test_instant_with_the_true_disparity_is_the_true_view(canvas: Canvas) -> None:
    canvas.set_light_field(moving_corners())
    give(canvas, truth(0.5, 0.5), np.full(SIZE, DISPARITY, np.float32), (0.5, 0.5))
    margin = 9  # content that some corner does not see
    inside = (slice(margin, -margin), slice(margin, -margin))
    for u, v in ((0.5, 0.5), (0.2, 0.9), (0.0, 0.0), (1.1, -0.2)):
        shown = canvas.read(Frame(Look.SYNTHESIS, (u, v)))
        np.testing.assert_allclose(shown[inside], truth(u, v)[inside], atol=2e-3)


def test_instant_at_a_corner_is_that_corner_whatever_the_disparity(canvas: Canvas) -> None:
    corners = random_corners("float32")
    canvas.set_light_field(corners)
    give(canvas, truth(0.5, 0.5), np.full(SIZE, 3.0, np.float32), (0.5, 0.5))
    for corner, viewpoint in enumerate(CORNERS):
        np.testing.assert_allclose(canvas.read(Frame(Look.SYNTHESIS, viewpoint)), corners[corner], atol=1e-5)


def test_instant_believes_the_views_that_agree(canvas: Canvas) -> None:
    corners = np.full((4, HEIGHT, WIDTH, 3), 0.2, np.float32)
    corners[3] = 0.9  # one view sees something else
    canvas.set_light_field(corners)
    give(canvas, truth(0.1, 0.5), np.zeros(SIZE, np.float32), (0.1, 0.5))
    np.testing.assert_allclose(canvas.read(Frame(Look.SYNTHESIS, (0.5, 0.5))), 0.2, atol=0.01)


EIGHT_BITS = 0.51 / 255
INSIDE = (slice(3, -3), slice(3, -3))  # what the edge, repeated by the bicubic taps, has no part in


def test_a_synthesis_is_carried_to_viewpoints_nearby(canvas: Canvas) -> None:
    canvas.set_light_field(random_corners("uint8"))  # of no use: nothing of them may be seen
    give(canvas, truth(0.5, 0.5), np.full(SIZE, DISPARITY, np.float32), (0.5, 0.5))
    for viewpoint in ((0.5, 0.5), (0.46, 0.53), (0.5 + CARRIED.near, 0.5)):
        shown = canvas.read(Frame(Look.SYNTHESIS, viewpoint))
        np.testing.assert_allclose(shown[INSIDE], truth(*viewpoint)[INSIDE], atol=2e-3 + EIGHT_BITS)


def test_farther_away_the_warped_corners_take_its_place_little_by_little(canvas: Canvas) -> None:
    canvas.set_light_field(np.zeros((4, *SIZE, 3), np.uint8))
    give(canvas, np.ones((*SIZE, 3), np.float32), np.zeros(SIZE, np.float32), (0.5, 0.5))
    for distance in (0.05, 0.22, 0.25, 0.29, 0.35):
        shown = canvas.read(Frame(Look.SYNTHESIS, (0.5, 0.5 + distance)))
        np.testing.assert_allclose(shown, np.interp(distance, (CARRIED.near, CARRIED.far), (1, 0)), atol=1e-5)


def test_a_moving_picture_fades_from_one_synthesis_to_the_next_both_carried(canvas: Canvas) -> None:
    canvas.set_light_field(random_corners("uint8"))
    disparity = np.full(SIZE, DISPARITY, np.float32)
    give(canvas, 0.5 * truth(0.45, 0.5), disparity, (0.45, 0.5))  # half as bright, so that its share is seen
    give(canvas, truth(0.47, 0.52), disparity, (0.47, 0.52))
    viewpoint = (0.5, 0.52)
    for share in (0.0, 0.25, 0.9, 1.0):
        shown = canvas.read(Frame(Look.SYNTHESIS, viewpoint, share=share))
        expected = (0.5 * (1 - share) + share) * truth(*viewpoint)
        np.testing.assert_allclose(shown[INSIDE], expected[INSIDE], atol=2e-3 + EIGHT_BITS)


def disparity_shown(canvas: Canvas, viewpoint: tuple[float, float], low: float, high: float) -> FloatArray:
    """The disparity on screen, found again from its colours to within a step of the map."""
    shown = canvas.read(Frame(Look.DISPARITY, viewpoint, disparity_range=(low, high)))
    table = colormaps.disparity_colours().astype(np.float32) / 255  # (256, 3)
    distance = np.abs(shown[:, :, None, :] - table).sum(-1)  # (H, W, 256)
    return (low + (high - low) * distance.argmin(-1) / 255).astype(np.float32)


def test_disparity_is_shown_by_the_colour_map_within_its_range(canvas: Canvas) -> None:
    canvas.set_light_field(moving_corners())
    disparity = np.tile(np.linspace(-4, 4, WIDTH, dtype=np.float32), (HEIGHT, 1))
    give(canvas, truth(0.5, 0.5), disparity, (0.5, 0.5))
    shown = disparity_shown(canvas, (0.5, 0.5), -3, 2)
    np.testing.assert_allclose(shown, np.clip(disparity, -3, 2), atol=5 / 255 * 1.5)


def test_disparity_is_carried_to_another_viewpoint_and_near_hides_far(canvas: Canvas) -> None:
    # A near square (-8) before a far wall (0). From q0 to q it moves by -8 (q - q0): to the right by 4 px as u falls by 0.5.
    canvas.set_light_field(moving_corners())
    disparity = np.zeros(SIZE, np.float32)
    disparity[30:60, 40:80] = -8
    give(canvas, truth(0.5, 0.5), disparity, (0.5, 0.5))
    expected = np.zeros(SIZE, np.float32)
    expected[30:60, 44:84] = -8
    shown = disparity_shown(canvas, (0.0, 0.5), -8, 0)
    assert (np.abs(shown - expected) > 0.1)[:, 44:].sum() == 0  # the square, and what it now hides
    assert (np.abs(shown - expected) > 0.1).mean() < 0.011  # the strip uncovered at its left, 30 x 4 px, is anyone's guess


def test_at_rest_one_synthesis_fades_into_the_other(canvas: Canvas) -> None:
    canvas.set_light_field(random_corners("uint8"))
    first, second = (as_float(random_corners("uint8", seed)[0]) for seed in (7, 8))
    for image in (first, second):
        give(canvas, image, np.full(SIZE, DISPARITY, np.float32), (0.4, 0.4))
    for share in (0.0, 0.25, 1.0):
        shown = canvas.read(Frame(Look.SYNTHESIS, (0.4, 0.4), share=share))
        np.testing.assert_allclose(shown, (1 - share) * first + share * second, atol=1e-5)


def test_the_first_synthesis_fades_in_over_the_blend(canvas: Canvas) -> None:
    canvas.set_light_field(moving_corners())
    before = canvas.read(Frame(Look.SYNTHESIS, (0.4, 0.4)))
    give(canvas, np.ones((*SIZE, 3), np.float32), np.full(SIZE, DISPARITY, np.float32), (0.4, 0.4))
    shown = canvas.read(Frame(Look.SYNTHESIS, (0.4, 0.4), share=0.25))
    np.testing.assert_allclose(shown, 0.75 * before + 0.25, atol=1e-5)


def test_in_8_bits_the_picture_is_as_near_as_8_bits_can_be(gl: Any) -> None:
    canvas = Canvas(gl)
    canvas.set_light_field(random_corners("uint8"))
    image = np.random.default_rng(9).random((*SIZE, 3)).astype(np.float32)
    give(canvas, image, None, (0.5, 0.5))
    np.testing.assert_allclose(canvas.read(Frame(Look.SYNTHESIS, (0.5, 0.5))), image, atol=EIGHT_BITS)
    # but the error is that of the exact values, times the gain
    canvas.set_captured((image * 255).astype(np.uint8))
    shown = canvas.read(Frame(Look.ERROR, (0.5, 0.5), gain=64.0))
    expected = 64 * np.abs(image - (image * 255).astype(np.uint8) / np.float32(255))
    np.testing.assert_allclose(shown, expected, atol=EIGHT_BITS + 64 * 1e-6)
    canvas.clear()


def test_the_authors_tone_is_theirs(canvas: Canvas) -> None:
    import colorsys

    canvas.set_light_field(random_corners("float32"))
    image = np.random.default_rng(5).random((*SIZE, 3)).astype(np.float32)
    give(canvas, image, None, (0.5, 0.5))
    shown = canvas.read(Frame(Look.SYNTHESIS, (0.5, 0.5), tone=Tone(Curve.AUTHORS)))
    for y, x in ((0, 0), (5, 7), (50, 60), (95, 127)):
        hue, saturation, value = colorsys.rgb_to_hsv(*(float(c) ** (1 / 1.5) for c in image[y, x]))
        expected = colorsys.hsv_to_rgb(hue, min(1.5 * saturation, 1), value)
        np.testing.assert_allclose(shown[y, x], expected, atol=1e-4)


def test_targets_follow_the_viewpoint_and_the_newest_map(canvas: Canvas) -> None:
    """Passes are run again exactly when something they depend on has changed."""
    canvas.set_light_field(moving_corners())
    give(canvas, truth(0.5, 0.5), np.full(SIZE, DISPARITY, np.float32), (0.5, 0.5))
    frame = Frame(Look.SYNTHESIS, (0.3, 0.3))
    assert canvas.prepare(frame)
    assert not canvas.prepare(frame)
    first = canvas.read(frame)
    give(canvas, truth(0.5, 0.5), np.zeros(SIZE, np.float32), (0.5, 0.5))
    assert canvas.prepare(frame)
    assert np.abs(canvas.read(frame) - first).max() > 0.02
    assert canvas.prepare(Frame(Look.SYNTHESIS, (0.31, 0.3)))


@pytest.mark.parametrize("scale", [1.0, 5.0])
def test_a_pixel_lies_in_the_window_where_the_placement_says(canvas: Canvas, gl: Any, scale: float) -> None:
    canvas.set_light_field(np.zeros((4, HEIGHT, WIDTH, 3), np.uint8))
    image = np.zeros((*SIZE, 3), np.float32)
    image[70, 20] = 1
    give(canvas, image, None, (0.5, 0.5))
    texture = gl.texture((400, 300), 4)
    framebuffer = gl.framebuffer([texture])
    target = Target(framebuffer, (400, 300))
    area = Rect(0, 0, 300, 280)
    placement = place(Zoom(scale, (0.2, 0.7)), (WIDTH, HEIGHT), area)
    canvas.begin(target)
    canvas.draw(Frame(Look.SYNTHESIS, (0.5, 0.5)), target, area, placement)
    window = np.frombuffer(framebuffer.read(components=3, alignment=1), np.uint8).reshape(300, 400, 3)[::-1]
    rows, columns = np.nonzero(window.min(axis=2) > 200)
    left, top = placement.to_window((20, 70))
    assert (columns.min(), rows.min()) == (left, top)
    assert (columns.max() + 1, rows.max() + 1) == (left + scale, top + scale)
    background = np.round(np.array(BACKGROUND) * 255)
    np.testing.assert_allclose(window[:, 300:], np.broadcast_to(background, (300, 100, 3)), atol=1)  # beside the area
    np.testing.assert_allclose(window[280:], np.broadcast_to(background, (20, 400, 3)), atol=1)
    canvas._resting_place.use()
    framebuffer.release()
    texture.release()


def test_a_picture_made_much_smaller_keeps_its_mean(canvas: Canvas, gl: Any) -> None:
    image = np.zeros((*SIZE, 3), np.float32)
    image[::2] = 1  # stripes that single samples would miss or hit
    canvas.set_light_field(random_corners("uint8"))
    give(canvas, image, None, (0.5, 0.5))
    texture = gl.texture((32, 24), 4)
    framebuffer = gl.framebuffer([texture])
    area = Rect(0, 0, 32, 24)
    frame = Frame(Look.SYNTHESIS, (0.5, 0.5))
    canvas.draw(frame, Target(framebuffer, (32, 24)), area, place(Zoom(), (WIDTH, HEIGHT), area))
    small = np.frombuffer(framebuffer.read(components=3, alignment=1), np.uint8).reshape(24, 32, 3)
    np.testing.assert_allclose(small[2:-2, 2:-2], 127.5, atol=12)
    canvas._resting_place.use()
    framebuffer.release()
    texture.release()


@pytest.mark.parametrize(("reach", "paints"), [(CARRIED, False), (CARRIED_IN_SOFTWARE, False), (CARRIED_IN_SOFTWARE, True)])
def test_warming_up_runs_what_a_moving_picture_needs_and_leaves_nothing(
    gl: Any, reach: Reach, paints: bool, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest
) -> None:
    """Once compiled by OpenGL a shader is compiled by a software rasteriser still, when it is first run."""
    if paints:
        request.getfixturevalue("compiled_painting")
    run: set[Pass] = set()
    render = Pass.render

    def noted(self: Pass, *arguments: Any) -> None:
        run.add(self)
        render(self, *arguments)

    monkeypatch.setattr(Pass, "render", noted)
    canvas = Canvas(gl, reach=reach, paints=paints)
    canvas.warm_up(Target(gl.simple_framebuffer((8, 8)), (8, 8)))
    assert not canvas.has_light_field
    warm = frozenset(run)
    canvas.set_light_field(random_corners("uint8"))
    for distance in (0.0, 0.02, 0.15, 0.25, 0.4, 0.6, 1.0):
        give(canvas, truth(0.5, 0.5), np.zeros(SIZE, np.float32), (0.0, 0.5))
        for share in (0.3, 1.0):
            canvas.prepare(Frame(Look.SYNTHESIS, (distance, 0.5), share=share))
    assert run == warm
    canvas.clear()


def test_views_too_large_for_the_graphics_are_refused(canvas: Canvas, gl: Any) -> None:
    wide = int(gl.info["GL_MAX_TEXTURE_SIZE"]) // 2 + 1
    with pytest.raises(InputError, match="graphics show at most"):
        canvas.set_light_field(np.zeros((4, 1, wide, 3), np.uint8))
    assert not canvas.has_light_field


def test_a_fault_in_an_included_shader_is_named_with_file_and_line(gl: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    load = glsl.load
    line = "vec4 cubic_taps(float t) {"
    number = resources.files("shaders").joinpath("bicubic.glsl").read_text().splitlines().index(line) + 1

    def broken(name: str, *others: Any) -> glsl.Source:
        source = load(name, *others)
        return glsl.Source(source.text.replace(line, f"{line} oops;"), source.places)

    monkeypatch.setattr(glsl, "load", broken)
    with pytest.raises(LfviewError, match=rf"bicubic\.glsl:{number}\b"):
        Canvas(gl)


@pytest.mark.parametrize("message", ["0:5(2): error: x", "0(5) : error C0000: x", "ERROR: 0:5: 'x' : x"])
def test_places_are_found_in_the_messages_of_all_compilers(message: str) -> None:
    source = glsl.Source("", (("a.frag", 1), ("a.frag", 2), ("b.glsl", 1), ("b.glsl", 2), ("b.glsl", 3)))
    assert "b.glsl:3" in source.located(message)


def test_includes_are_resolved_once_and_may_be_exchanged() -> None:
    source = glsl.load("instant.frag", {"tone.glsl": "tone_stored.glsl"})
    assert "#include" not in source.text
    included = ("carry.glsl", "warped_corners.glsl", "warp.glsl", "bicubic.glsl", "tone_stored.glsl")
    assert source.files == ("instant.frag", *included)
    assert "sample_area.glsl" in glsl.load("show_image.frag", {"sampled.glsl": "sample_area.glsl"}).files
