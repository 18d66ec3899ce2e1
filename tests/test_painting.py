"""What the processor paints, against the shaders it stands in for, against plain numpy, and against known truth."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from app import painting
from app.canvas import BACKGROUND, Canvas, Frame, Target, WindowCopy, standalone_functions
from app.geometry import Placement, Rect
from app.painting import Box, Moved, Places, Spread, in_bytes
from app.repainting import Repainting, paint
from app.state import CARRIED_IN_SOFTWARE, Look
from app.tone import Curve, Tone
from lfcore.lightfield import FloatArray
from lfcore.metrics import to_uint8
from lfcore.synthesis import ByteArray

SIZE = (67, 141)  # neither is a whole number of strips
WINDOW = (300, 200)
AREA = Rect(20, 10, 250, 170)
MADE_AT = (0.4, 0.6)


@pytest.fixture(autouse=True)
def compiled(compiled_painting: None) -> None:
    """All of these need it."""


def some_pixels(seed: int = 0) -> ByteArray:
    return np.random.default_rng(seed).integers(0, 256, (*SIZE, 4), dtype=np.uint8)


def some_image(seed: int = 0) -> FloatArray:
    """Smooth enough that a rounding of the place changes no pixel by more than a level or two."""
    y, x = np.mgrid[: SIZE[0], : SIZE[1]]
    waves = [np.sin(x / (9 + c + seed) + c) * np.cos(y / (7 + c)) for c in range(3)]
    return (0.5 + 0.45 * np.stack(waves, 2)).astype(np.float32)


def two_planes() -> npt.NDArray[np.float32]:
    """A near square before a slanted ground."""
    y, x = np.mgrid[: SIZE[0], : SIZE[1]]
    ground = 3 + x / 40 + y / 90
    return np.where((abs(x - 70) < 20) & (abs(y - 30) < 15), -6.0, ground).astype(np.float32)


def carried(by: tuple[float, float], disparity: npt.NDArray[np.float32], steps: int, pixels: ByteArray) -> ByteArray:
    out = np.empty_like(pixels)
    spread = Spread(SIZE)
    spread.take(pixels)
    moved = Moved(spread, by)
    painting.carried(moved, moved, 1.0, disparity, float(disparity.min()), steps, out)
    return out


# By itself.


@pytest.mark.parametrize("steps", [0, 1, 3])
@pytest.mark.parametrize("way", [(3, -2), (-5, 0), (0, 4)])
def test_a_plane_at_a_known_disparity_moves_by_whole_pixels(way: tuple[int, int], steps: int) -> None:
    pixels = some_pixels()
    out = carried((way[0] / 2, way[1] / 2), np.full(SIZE, 2, np.float32), steps, pixels)
    rows = np.clip(np.arange(SIZE[0]) + way[1], 0, SIZE[0] - 1)
    columns = np.clip(np.arange(SIZE[1]) + way[0], 0, SIZE[1] - 1)  # beyond an edge that edge
    np.testing.assert_array_equal(out[..., :3], pixels[rows][:, columns, :3])


@pytest.mark.parametrize("way", [(-500, -500), (-1, -1), (1, 1), (500, 500)])
def test_nothing_beside_a_spread_picture_counts(way: tuple[int, int]) -> None:
    """It lies among what is not a number, of which even a weight of 0 would be seen."""
    pixels, spread = some_pixels(), Spread(SIZE)
    beside = spread.values.shape[1] * 4 * 4
    memory = np.full(spread.values.size + 2 * beside, np.nan, np.float32)
    spread.values = memory[beside:-beside].reshape(spread.values.shape)
    spread.take(pixels)
    out = np.empty_like(pixels)
    painting.carried(Moved(spread, way), Moved(spread, way), 1.0, np.ones(SIZE, np.float32), 1.0, 0, out)
    rows, columns = (np.clip(np.arange(size) + by, 0, size - 1) for size, by in zip(SIZE, way[::-1], strict=True))
    np.testing.assert_array_equal(out[..., :3], pixels[rows][:, columns, :3])


@pytest.mark.parametrize(("disparity", "column"), [(1e30, -1), (-1e30, 0)])
def test_what_moves_far_beyond_the_picture_is_its_edge(disparity: float, column: int) -> None:
    pixels = some_pixels()
    out = carried((1.0, 1e-38), np.full(SIZE, disparity, np.float32), 1, pixels)
    np.testing.assert_array_equal(out[..., :3], np.broadcast_to(pixels[:, column, None, :3], out[..., :3].shape))


def test_a_disparity_that_is_no_number_leads_to_some_pixel() -> None:
    pixels = some_pixels()
    out = carried((1.0, 1.0), np.full(SIZE, np.nan, np.float32), 3, pixels)
    np.testing.assert_array_equal(out[..., :3], np.broadcast_to(pixels[0, 0, :3], out[..., :3].shape))


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_two_pictures_are_mixed(share: float) -> None:
    before, after = some_pixels(1), some_pixels(2)
    out = np.empty_like(before)
    painting.mixed(before, after, share, out)
    np.testing.assert_allclose(out, before + share * (after.astype(float) - before), atol=1.0)
    if share in (0.0, 1.0):
        np.testing.assert_array_equal(out, after if share else before)


def test_8_bits_are_those_of_the_library(monkeypatch: pytest.MonkeyPatch) -> None:
    image = np.random.default_rng(0).uniform(-0.2, 1.2, (*SIZE, 3)).astype(np.float32)
    pixels = in_bytes(image)
    np.testing.assert_array_equal(pixels[..., :3], to_uint8(image))
    assert (pixels[..., 3] == 255).all()
    monkeypatch.setattr(painting, "_PAINTING", None)
    np.testing.assert_array_equal(in_bytes(image), pixels)


@pytest.mark.parametrize("scale", [0.8, 1.7, 3.3])
def test_an_enlarged_picture_lies_between_its_pixels(scale: float) -> None:
    pixels = some_pixels()
    along = [(np.arange(int(size * scale)) + 0.5) / scale for size in SIZE]
    rows, columns = (Places.between(points, size) for points, size in zip(along, SIZE, strict=True))
    out = np.empty((len(along[0]), len(along[1]), 4), np.uint8)
    painting.enlarged(pixels, rows, columns, out)
    expected = pixels[..., :3].astype(float)
    for axis, points in enumerate(along):
        centres = np.arange(SIZE[axis]) + 0.5
        expected = np.apply_along_axis(lambda line, at=points, centres=centres: np.interp(at, centres, line), axis, expected)
    np.testing.assert_allclose(out[..., 2::-1], expected, atol=2.0)  # blue first; shares are multiples of 1/128


def test_single_pixels_are_kept_whole() -> None:
    pixels = some_pixels()
    rows, columns = (Places.at((np.arange(size * 5) + 0.5) / 5, size) for size in SIZE)
    out = np.empty((SIZE[0] * 5, SIZE[1] * 5, 4), np.uint8)
    painting.enlarged(pixels, rows, columns, out)
    np.testing.assert_array_equal(out[..., 2::-1], pixels.repeat(5, 0).repeat(5, 1)[..., :3])


def test_buffers_of_other_sizes_and_places_beyond_the_picture_are_refused() -> None:
    pixels, out = some_pixels(), np.empty((*SIZE, 4), np.uint8)
    rows, columns = (Places.at(np.arange(size) + 0.5, size) for size in SIZE)
    with pytest.raises(ValueError, match="in place of"):
        painting.enlarged(pixels, rows, columns, out[1:])
    beyond = Places(columns.first + 1, columns.share)
    with pytest.raises(ValueError, match="beyond the picture"):
        painting.enlarged(pixels, rows, beyond, out)
    with pytest.raises(ValueError, match="in place of"):
        painting.mixed(pixels, pixels[1:], 0.5, out)
    spread = Spread(SIZE)
    with pytest.raises(ValueError, match="in place of"):
        painting.carried(Moved(spread, (0, 0)), Moved(spread, (0, 0)), 1.0, two_planes()[1:], 0.0, 0, out)


# In place of shaders.


@pytest.fixture
def canvases(gl: Any) -> Iterator[tuple[Canvas, Canvas]]:
    """One whose pictures the processor paints and copies, one whose pictures shaders make, with the same light field."""
    load = standalone_functions()
    assert load is not None
    copy = WindowCopy(load)
    made = (Canvas(gl, reach=CARRIED_IN_SOFTWARE, paints=True, copy=copy), Canvas(gl, reach=CARRIED_IN_SOFTWARE))
    for canvas in made:
        canvas.set_light_field(np.stack([in_bytes(some_image(seed))[..., :3] for seed in range(4)]))
    yield made
    for canvas in made:
        canvas.clear()
    assert gl.error == "GL_NO_ERROR"


def give_both(canvases: tuple[Canvas, Canvas], seed: int, viewpoint: tuple[float, float], disparity: Any) -> None:
    image = some_image(seed)
    for canvas in canvases:
        canvas.set_synthesis(image, in_bytes(image), disparity, viewpoint)


def window_of(canvas: Canvas, gl: Any, frame: Frame, placement: Placement) -> npt.NDArray[np.int64]:
    """(H, W, 3), first row first."""
    texture = gl.texture(WINDOW, 4)
    framebuffer = gl.framebuffer([texture])
    target = Target(framebuffer, WINDOW)
    framebuffer.use()
    framebuffer.clear(1.0, 0.0, 1.0, 1.0)
    canvas.prepare(frame)
    copied = canvas.copied(frame, AREA, placement)
    if copied is None:
        canvas.begin(target)
    canvas.draw(frame, target, AREA, placement)
    if copied is not None:
        canvas.begin(target, around=copied)
    shown = np.frombuffer(framebuffer.read(components=3, alignment=1), np.uint8).reshape(WINDOW[1], WINDOW[0], 3)[::-1]
    canvas._resting_place.use()
    framebuffer.release()
    texture.release()
    return shown.astype(np.int64)


VIEWPOINTS = (MADE_AT, (0.41, 0.6), (0.5, 0.5), (0.2, 0.75), (0.75, 0.25))


@pytest.mark.parametrize("viewpoint", VIEWPOINTS)
@pytest.mark.parametrize("share", [0.35, 1.0])
def test_shaders_make_the_same_picture(canvases: tuple[Canvas, Canvas], viewpoint: tuple[float, float], share: float) -> None:
    give_both(canvases, 1, (0.3, 0.6), two_planes())
    give_both(canvases, 2, MADE_AT, two_planes())
    frame = Frame(Look.SYNTHESIS, viewpoint, share=share)
    painted, drawn = (np.rint(255 * canvas.read(frame)) for canvas in canvases)
    assert canvases[0].painted and not canvases[1].painted
    apart = abs(painted - drawn)
    # At an edge of depth a rounding of the place decides which side of it is seen.
    assert np.quantile(apart, 0.995) <= 1 and apart.mean() < 0.15, (apart.max(), apart.mean())


def test_at_rest_two_syntheses_of_one_viewpoint_are_mixed(canvases: tuple[Canvas, Canvas]) -> None:
    for seed in (1, 2):
        give_both(canvases, seed, MADE_AT, two_planes())
    for share in (0.0, 0.5, 1.0):
        painted, drawn = (255 * canvas.read(Frame(Look.SYNTHESIS, MADE_AT, share=share)) for canvas in canvases)
        assert canvases[0].painted
        np.testing.assert_allclose(painted, drawn, atol=1.5)


def test_what_the_processor_does_not_paint_is_made_of_what_it_does(canvases: tuple[Canvas, Canvas]) -> None:
    """In a tone, faded in over the corners, far from the newest synthesis, and as an error."""
    give_both(canvases, 1, MADE_AT, two_planes())
    for canvas in canvases:
        canvas.set_captured(in_bytes(some_image(3))[..., :3])
    for frame in (
        Frame(Look.SYNTHESIS, MADE_AT, share=0.5),
        Frame(Look.SYNTHESIS, (0.5, 0.5), share=0.5),
        Frame(Look.SYNTHESIS, (0.5, 0.5), tone=Tone(Curve.SRGB)),
        Frame(Look.SYNTHESIS, MADE_AT, tone=Tone(stops=1.0)),
        Frame(Look.SYNTHESIS, (0.9, 0.05)),
        Frame(Look.ERROR, (0.5, 0.5), gain=4.0),
    ):
        painted, drawn = (255 * canvas.read(frame) for canvas in canvases)
        apart = abs(painted - drawn)
        assert not canvases[0].painted
        assert np.quantile(apart, 0.99) <= 4 and apart.mean() < 0.5, frame


@pytest.mark.parametrize(
    "placement",
    [
        Placement(1.0, (40.0, 30.0)),
        Placement(1.63, (25.0, 33.0)),
        Placement(2.4, (-77.0, 40.0)),  # reaches beyond the area on three sides
        Placement(5.0, (-120.0, -60.0)),
        Placement(0.76, (200.0, 150.0)),
    ],
)
def test_a_copied_picture_lies_where_a_drawn_one_does(canvases: tuple[Canvas, Canvas], gl: Any, placement: Placement) -> None:
    give_both(canvases, 1, MADE_AT, two_planes())
    frame = Frame(Look.SYNTHESIS, MADE_AT)
    copied, drawn = (window_of(canvas, gl, frame, placement) for canvas in canvases)
    assert canvases[0].copied(frame, AREA, placement) is not None and canvases[1].copied(frame, AREA, placement) is None
    assert abs(copied - drawn).max() <= 3
    ground = np.round(np.array(BACKGROUND) * 255)
    np.testing.assert_allclose(copied[:10], np.broadcast_to(ground, (10, WINDOW[0], 3)), atol=1)
    assert (abs(drawn - ground).max(2) > 8).sum() > 1000  # the picture is there


def test_nothing_is_copied_that_must_be_drawn(canvases: tuple[Canvas, Canvas], gl: Any) -> None:
    give_both(canvases, 1, MADE_AT, two_planes())
    small, usual = Placement(0.3, (40.0, 30.0)), Placement(1.5, (30.0, 20.0))
    for frame, placement in (
        (Frame(Look.SYNTHESIS, MADE_AT), small),
        (Frame(Look.SYNTHESIS, MADE_AT, dim=0.4), usual),
        (Frame(Look.DISPARITY, MADE_AT, disparity_range=(-6.0, 6.0)), usual),
    ):
        assert canvases[0].copied(frame, AREA, placement) is None
        copied, drawn = (window_of(canvas, gl, frame, placement) for canvas in canvases)
        assert abs(copied - drawn).max() <= 2


def test_a_picture_beside_the_area_is_not_to_be_seen(canvases: tuple[Canvas, Canvas], gl: Any) -> None:
    give_both(canvases, 1, MADE_AT, two_planes())
    shown = window_of(canvases[0], gl, Frame(Look.SYNTHESIS, MADE_AT), Placement(1.0, (280.0, 0.0)))
    np.testing.assert_allclose(shown, np.broadcast_to(np.round(np.array(BACKGROUND) * 255), shown.shape), atol=1)


def test_a_window_painted_where_it_has_changed_keeps_no_earlier_picture(canvases: tuple[Canvas, Canvas]) -> None:
    """Faded in, at rest, carried, and back again."""
    canvas, placement = canvases[0], Placement(1.5, (30.0, 20.0))
    random = np.random.default_rng(3)
    repainting, sheet = Repainting(), np.zeros((WINDOW[1], WINDOW[0], 4), np.uint8)
    whole, looked_at = Box(0, 0, *WINDOW), 0
    for turn in range(100):
        if turn < 2 or random.random() < 0.15:
            give_both(canvases, int(random.integers(6)), VIEWPOINTS[int(random.integers(2))], two_planes())
        share = float(random.choice((0.3, 0.9, 1.0, 1.0)))
        frame = Frame(Look.SYNTHESIS, VIEWPOINTS[int(random.integers(3))], share=share)
        canvas.prepare(frame)
        if canvas.copied(frame, AREA, placement) is None:  # one that is faded in over the corner views is drawn
            repainting.forget()
            continue
        layers = canvas.beneath(frame, WINDOW, [], BACKGROUND, AREA, placement)
        paint(sheet, repainting.outdated(WINDOW, layers, []), layers, [])
        expected = np.zeros_like(sheet)
        paint(expected, [whole], layers, [])
        np.testing.assert_array_equal(sheet, expected)
        looked_at += 1
    assert looked_at > 60
