"""Textures, passes and read-back: the only place that knows moderngl.

Every way of looking is a shader over the same textures: the four corner views, the newest synthesis with its disparity
map, and the captured view. Nothing shown is computed on the CPU. Pictures lie in textures with their first row first.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import moderngl
import numpy as np
import numpy.typing as npt

from app import glsl
from app.state import Look, Placement, Point, Rect, Size
from lfcore import colormaps
from lfcore.errors import InputError, LfviewError
from lfcore.lightfield import CORNERS, FloatArray

GL_VERSION = 330
BACKGROUND = (0.055, 0.058, 0.063)
_TEXTURE_TYPES = {"uint8": "f1", "uint16": "nu2", "float32": "f4"}  # numpy type to moderngl's normalised texture type

_TONES = {False: "tone_stored.glsl", True: "tone_bright.glsl"}  # by Frame.display_tone
# Corner (index into CORNERS) to its place (column, row) on the sheet of all four.
_SHEET_PLACES = tuple((int(u), int(v)) for u, v in CORNERS)

_AnyTexture = moderngl.Texture | moderngl.TextureArray
Uniform = float | int | bool | tuple[float, ...] | tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Frame:
    """What the canvas is to draw, by value."""

    look: Look
    viewpoint: Point
    full_share: float = 0.0  # how far the synthesis has been faded in over the instant picture
    captured: bool = False  # the camera's own view in place of a synthesis
    display_tone: bool = False
    gain: float = 1.0
    disparity_range: tuple[float, float] = (0.0, 1.0)
    dim: float = 1.0


@dataclass(frozen=True)
class Target:
    """What is drawn into: a framebuffer and its (width, height). A window's framebuffer does not know its own size."""

    framebuffer: moderngl.Framebuffer
    size: Size


class Canvas:
    """The picture in the window. All methods need the GL context to be current, on the thread that made the canvas."""

    def __init__(self, context: moderngl.Context) -> None:
        self.context = context
        self._blend = _Pass(context, "blend.frag")
        self._carry = _Pass(context, "carry.frag")
        self._instant = _Pass(context, "instant.frag")
        self._warped = _Pass(context, "warped.frag")
        self._fade = _Pass(context, "fade.frag")
        self._shows: dict[tuple[str, str, str], _Pass] = {}  # by fragment shader, sampling and tone, made when first used
        colours = colormaps.disparity_colours()  # (256, 3)
        self._colours = context.texture((len(colours), 1), 3, colours.tobytes(), alignment=1)
        self._colours.repeat_x = self._colours.repeat_y = False
        # Bound before framebuffers are released: moderngl would otherwise go on binding one that is gone.
        self._resting_place = context.simple_framebuffer((1, 1))
        self._pictures: _Pictures | None = None

    # What there is to draw.

    def set_light_field(self, corners: npt.NDArray[np.generic]) -> None:
        """Take the corner views (4, H, W, 3) in the order of CORNERS, uint8, uint16 or float32 as stored."""
        height, width = corners.shape[1:3]
        largest = int(self.context.info["GL_MAX_TEXTURE_SIZE"]) // 2  # the sheet of all four is twice as large
        if max(height, width) > largest:
            raise InputError(
                f"The views are {width} x {height} px, but this computer's graphics show at most {largest} px a side; "
                f"open a light field with smaller views."
            )
        self.clear()
        self._pictures = _Pictures(self.context, corners)

    def clear(self) -> None:
        """Forget the light field and everything that belongs to it."""
        self._resting_place.use()
        if self._pictures is not None:
            self._pictures.release()
            self._pictures = None

    def set_synthesis(self, image: FloatArray, disparity: FloatArray | None, viewpoint: Point) -> None:
        """Take the newest synthesis: image (H, W, 3), disparity (H, W) in px over the baseline or None, and its (u, v)."""
        pictures = self._at_hand
        pictures.image.write(np.ascontiguousarray(image, np.float32))
        if disparity is not None:
            pictures.disparity_map.write(np.ascontiguousarray(disparity, np.float32))
            pictures.nearest_disparity = float(disparity.min())
            pictures.made_at = viewpoint
            pictures.current.clear()

    def set_captured(self, view: npt.NDArray[np.generic]) -> None:
        """Take the captured view (H, W, 3), as stored, to be compared with or looked at."""
        self._at_hand.captured.write(np.ascontiguousarray(view))

    @property
    def has_light_field(self) -> bool:
        """Whether there is a picture to draw."""
        return self._pictures is not None

    @property
    def has_disparity(self) -> bool:
        """Whether a disparity map has been taken for this light field."""
        return self._pictures is not None and self._pictures.made_at is not None

    def picture_size(self, look: Look) -> Size:
        """(width, height) in pixels of what this look shows."""
        return _shown_size(self._at_hand.size, look)

    # Drawing.

    def begin(self, target: Target) -> None:
        """Start a frame: all of the target in the background colour."""
        framebuffer = target.framebuffer
        framebuffer.viewport = framebuffer.scissor = (0, 0, *target.size)
        framebuffer.use()
        framebuffer.clear(*BACKGROUND, 1.0)

    def prepare(self, frame: Frame) -> bool:
        """Make the pictures at the light field's own size that the frame shows; whether any was not up to date."""
        made = self._at_hand.made
        if frame.look is Look.WARPED_ALL:
            self._make_sheet(frame.viewpoint)
        elif frame.look.corner is not None:
            self._make_warped(frame.look.corner, frame.viewpoint)
        elif frame.look is Look.DISPARITY:
            self._carry_disparity(frame.viewpoint)
        elif frame.full_share < 1.0 and not _shows_captured(frame):
            self._make_instant(frame.viewpoint)
            if frame.full_share > 0.0:
                self._make_faded(frame.full_share)
        return self._at_hand.made != made

    def draw(self, frame: Frame, target: Target, area: Rect, placement: Placement) -> None:
        """Draw the frame's picture into the target, inside the area (in its pixels, y downwards), at the placement."""
        self.prepare(frame)
        framebuffer, (width, height) = target.framebuffer, target.size
        visible = _visible(self.picture_size(frame.look), area, placement)
        framebuffer.viewport = (0, 0, width, height)
        framebuffer.scissor = (visible.x, height - visible.y - visible.height, visible.width, visible.height)
        framebuffer.use()
        self._show(
            frame,
            _sampling(placement.scale),
            {"origin": placement.origin, "scale": placement.scale, "window_height": float(height)},
        )
        framebuffer.scissor = (0, 0, width, height)

    def read(self, frame: Frame) -> FloatArray:
        """What `draw` would show of this frame at one window pixel per picture pixel: float32 (H, W, 3), not clipped."""
        width, height = self.picture_size(frame.look)
        texture = self.context.texture((width, height), 4, dtype="f4")
        framebuffer = self.context.framebuffer([texture])
        try:
            target = Target(framebuffer, (width, height))
            self.draw(frame, target, Rect(0, 0, width, height), Placement(1.0, (0.0, 0.0)))
            values = np.frombuffer(framebuffer.read(components=3, dtype="f4"), np.float32)
        finally:
            self._resting_place.use()
            framebuffer.release()
            texture.release()
        return values.reshape(height, width, 3)[::-1].copy()  # GL's first row is the lowest

    def finish(self) -> None:
        """Wait until the graphics have done everything asked so far."""
        self.context.finish()

    def _show(self, frame: Frame, sampling: str, placed: Mapping[str, Uniform]) -> None:
        pictures = self._at_hand
        if frame.look is Look.DISPARITY:
            textures: Mapping[str, _AnyTexture] = {"disparity": pictures.disparity, "colours": self._colours}
            show = self._show_pass("show_disparity.frag", sampling)
            show.render(textures, {**placed, "range": frame.disparity_range})
        elif frame.look is Look.ERROR:
            textures = {"picture": self._picture_of(frame), "captured": pictures.captured}
            show = self._show_pass("show_error.frag", sampling)
            show.render(textures, {**placed, "gain": frame.gain})
        else:
            show = self._show_pass("show_image.frag", sampling, _TONES[frame.display_tone])
            show.render({"picture": self._picture_of(frame)}, {**placed, "dim": frame.dim})

    def _show_pass(self, fragment: str, sampling: str, tone: str = "") -> _Pass:
        key = (fragment, sampling, tone)
        if key not in self._shows:
            self._shows[key] = _Pass(self.context, fragment, {"sampled.glsl": sampling, "tone.glsl": tone})
        return self._shows[key]

    def _picture_of(self, frame: Frame) -> moderngl.Texture:
        pictures = self._at_hand
        if frame.look is Look.WARPED_ALL:
            return pictures.sheet
        if frame.look.corner is not None:
            return pictures.warped
        if _shows_captured(frame):
            return pictures.captured
        if frame.full_share <= 0.0:
            return pictures.instant
        return pictures.image if frame.full_share >= 1.0 else pictures.faded

    # Passes at the light field's own size.

    def _make_instant(self, viewpoint: Point) -> None:
        pictures = self._at_hand
        if not pictures.outdated("instant", viewpoint):
            return
        if pictures.made_at is None:
            pictures.instant_target.use()
            self._blend.render({"corner_views": pictures.corner_views}, {"viewpoint": viewpoint})
            return
        self._carry_disparity(viewpoint)
        pictures.instant_target.use()
        textures: Mapping[str, _AnyTexture] = {"corner_views": pictures.corner_views, "disparity": pictures.disparity}
        self._instant.render(textures, {"viewpoint": viewpoint})

    def _carry_disparity(self, viewpoint: Point) -> None:
        pictures = self._at_hand
        if pictures.made_at is None or not pictures.outdated("disparity", viewpoint):
            return
        pictures.disparity_target.use()
        self._carry.render(
            {"disparity_map": pictures.disparity_map},
            {
                "made_at": pictures.made_at,
                "viewpoint": viewpoint,
                "nearest_disparity": pictures.nearest_disparity,
            },
        )

    def _make_faded(self, share: float) -> None:
        pictures = self._at_hand
        pictures.faded_target.use()
        self._fade.render({"before": pictures.instant, "after": pictures.image}, {"share": share})

    def _make_warped(self, corner: int, viewpoint: Point) -> None:
        pictures = self._at_hand
        if pictures.outdated("warped", viewpoint, corner):
            self._carry_disparity(viewpoint)
            self._warp_into(pictures.warped_target, corner, (0, 0), viewpoint)

    def _make_sheet(self, viewpoint: Point) -> None:
        pictures = self._at_hand
        if not pictures.outdated("sheet", viewpoint):
            return
        self._carry_disparity(viewpoint)
        width, height = pictures.size
        for corner, (column, row) in enumerate(_SHEET_PLACES):
            self._warp_into(pictures.sheet_target, corner, (column * width, row * height), viewpoint)

    def _warp_into(self, target: moderngl.Framebuffer, corner: int, tile: tuple[int, int], viewpoint: Point) -> None:
        pictures = self._at_hand
        target.viewport = (*tile, *pictures.size)
        target.use()
        self._warped.render(
            {"corner_views": pictures.corner_views, "disparity": pictures.disparity},
            {"viewpoint": viewpoint, "corner": corner, "tile": tile},
        )

    @property
    def _at_hand(self) -> _Pictures:
        if self._pictures is None:
            raise RuntimeError("the canvas has no light field")
        return self._pictures


def windowed_context(load_function: object) -> moderngl.Context:
    """The GL context that is current on this thread; `load_function` has a method load_opengl_function(name) -> address."""
    moderngl.init_context(load_function)
    return moderngl.get_context()


def standalone_context() -> moderngl.Context:
    """A GL context without any window, through EGL; raises LfviewError where there is none."""
    try:
        return moderngl.create_standalone_context(require=GL_VERSION, backend="egl")  # type: ignore[arg-type]  # its stub is wrong
    except Exception as error:  # moderngl and glcontext raise bare Exceptions here
        raise LfviewError(
            f"Found no OpenGL 3.3 for drawing off screen ({error}); install EGL and a driver "
            f"(on Debian: libegl1 and libgl1-mesa-dri)."
        ) from error


def _shown_size(size: Size, look: Look) -> Size:
    return (2 * size[0], 2 * size[1]) if look is Look.WARPED_ALL else size


def _shows_captured(frame: Frame) -> bool:
    return frame.captured and frame.look is Look.SYNTHESIS


def _sampling(scale: float) -> str:
    """The shader file with the way of sampling that suits a scale; one program each, since software runs every branch."""
    if scale == 1.0 or scale >= 4.0:
        return "sample_pixels.glsl"
    return "sample_linear.glsl" if scale >= 0.75 else "sample_area.glsl"


@dataclass(frozen=True)
class _Pixels:
    x: int
    y: int
    width: int
    height: int


def _visible(picture: Size, area: Rect, placement: Placement) -> _Pixels:
    """The whole window pixels that lie on the picture and inside the area."""
    left, top = placement.origin
    right, bottom = placement.to_window((float(picture[0]), float(picture[1])))
    x0, y0 = math.ceil(max(area.x, left)), math.ceil(max(area.y, top))
    x1, y1 = math.floor(min(area.x + area.width, right)), math.floor(min(area.y + area.height, bottom))
    return _Pixels(x0, y0, max(x1 - x0, 0), max(y1 - y0, 0))


class _Pass:
    """One fragment shader run over everything in the viewport."""

    def __init__(self, context: moderngl.Context, fragment: str, instead: Mapping[str, str] | None = None) -> None:
        source = glsl.load(fragment, instead)
        try:
            self._program = context.program(glsl.load("everywhere.vert").text, source.text)
        except moderngl.Error as error:
            raise LfviewError(f"A shader does not compile on this computer: {source.located(str(error))}") from error
        self._triangle = context.vertex_array(self._program, [])
        if "corner_positions" in self._program:
            self._set("corner_positions", CORNERS)

    def render(self, textures: Mapping[str, _AnyTexture], uniforms: Mapping[str, Uniform]) -> None:
        """Draw with these textures bound to the samplers of those names, and these values of uniforms."""
        for unit, (name, texture) in enumerate(textures.items()):
            texture.use(unit)
            self._set(name, unit)
        for name, value in uniforms.items():
            self._set(name, value)
        self._triangle.render(moderngl.TRIANGLES, vertices=3)

    def _set(self, name: str, value: Uniform) -> None:
        member = self._program[name]
        assert isinstance(member, moderngl.Uniform)
        member.value = value


class _Pictures:
    """The textures of one light field, and the framebuffers of the passes at its size."""

    def __init__(self, context: moderngl.Context, corners: npt.NDArray[np.generic]) -> None:
        height, width = corners.shape[1:3]
        stored = _TEXTURE_TYPES[corners.dtype.name]
        self.size: Size = (width, height)
        self.corner_views = context.texture_array(
            (width, height, len(CORNERS)), 3, np.ascontiguousarray(corners).tobytes(), alignment=1, dtype=stored
        )
        self.captured = _texture(context, self.size, 3, stored)
        self.image = _texture(context, self.size, 3, "f4")
        self.disparity_map = _texture(context, self.size, 1, "f4")
        self.disparity = _texture(context, self.size, 1, "f4")
        self.instant = _texture(context, self.size, 4, "f4")
        self.faded = _texture(context, self.size, 4, "f4")
        self.warped = _texture(context, self.size, 4, "f4")
        self.sheet = _texture(context, (2 * width, 2 * height), 4, "f4")
        self.disparity_target = context.framebuffer([self.disparity])
        self.instant_target = context.framebuffer([self.instant])
        self.faded_target = context.framebuffer([self.faded])
        self.warped_target = context.framebuffer([self.warped])
        self.sheet_target = context.framebuffer([self.sheet])
        self.made_at: Point | None = None  # viewpoint of disparity_map
        self.nearest_disparity = 0.0
        self.made = 0  # how often a target was made
        self.current: dict[str, tuple[object, ...]] = {}  # what each target was last made for

    def outdated(self, target: str, *made_for: object) -> bool:
        """Whether the target was last made for something else; it counts as made for this from now on."""
        if self.current.get(target) == made_for:
            return False
        self.current[target] = made_for
        self.made += 1
        return True

    def release(self) -> None:
        """Give the memory of the graphics back."""
        for value in vars(self).values():
            if isinstance(value, moderngl.Framebuffer | moderngl.Texture | moderngl.TextureArray):
                value.release()


def _texture(context: moderngl.Context, size: Size, components: int, dtype: str) -> moderngl.Texture:
    texture = context.texture(size, components, alignment=1, dtype=dtype)
    texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
    texture.repeat_x = texture.repeat_y = False
    return texture
