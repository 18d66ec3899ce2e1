"""Textures, passes and read-back: the only place that knows moderngl.

Every way of looking is a shader over the same textures: the four corner views, the newest synthesis with its disparity
map, the synthesis before it, and the captured view. Nothing shown is computed on the CPU. What is shown is made at the
light field's own size in 8 bits, as the screen has, and only when it has changed; the window then magnifies it. Pictures
lie in textures with their first row first.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import moderngl
import numpy as np
import numpy.typing as npt

from app import glsl
from app.geometry import Placement, Point, Rect, Size
from app.state import Look, carried_share
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
Pixels = npt.NDArray[np.uint8]
Uniform = float | int | bool | tuple[float, ...] | tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Frame:
    """What the canvas is to draw, by value."""

    look: Look
    viewpoint: Point
    share: float = 1.0  # how far the newest synthesis has been faded in over what was there before
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
    """The picture in the window. All methods need the GL context to be current, on the thread that made the canvas.

    `picture_type`: moderngl's type of the pictures that are shown; "f1" is 8 bits, "f4" float32 to read them back exactly.
    """

    def __init__(self, context: moderngl.Context, picture_type: str = "f1") -> None:
        self.context = context
        self._picture_type = picture_type
        self._passes: dict[tuple[str, ...], _Pass] = {}  # by fragment shader and what it includes, made when first used
        for fragment in ("blend.frag", "instant.frag", "exact.frag", "fade.frag"):
            self._pass(fragment)  # compiled now, so that the hand's first movement does not wait for them
        for fade in ("fade_none.glsl", "fade_older.glsl"):
            self._pass("carried.frag", fade=fade)
        colours = colormaps.disparity_colours()  # (256, 3)
        self._colours = context.texture((len(colours), 1), 3, colours.tobytes(), alignment=1)
        self._colours.repeat_x = self._colours.repeat_y = False
        # Bound before framebuffers are released: moderngl would otherwise go on binding one that is gone.
        self._resting_place = context.simple_framebuffer((1, 1))
        self._pictures: _Pictures | None = None
        self._exhibit: moderngl.Texture | None = None  # what is shown in place of a light field

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
        self._pictures = _Pictures(self.context, corners, self._picture_type)

    def warm_up(self) -> None:
        """Run every pass of the moving picture once on a made-up light field; there must be no other.

        Software rasterisers compile a shader when it is first run on certain kinds of texture, which can take half a second:
        the hand would feel it in its first movement.
        """
        self.set_light_field(np.zeros((4, 2, 2, 3), np.uint8))
        image, pixels, disparity = np.zeros((2, 2, 3), np.float32), np.zeros((2, 2, 4), np.uint8), np.zeros((2, 2), np.float32)
        here, near, far = (0.5, 0.5), (0.5, 0.45), (0.5, 0.1)
        self.prepare(Frame(Look.SYNTHESIS, here))
        for share in (0.5, 1.0):  # fading in over nothing, then over the one before
            self.set_synthesis(image, pixels, disparity, here)
            for viewpoint in (here, near, far):
                self.prepare(Frame(Look.SYNTHESIS, viewpoint, share=share))
        self.prepare(Frame(Look.SYNTHESIS, near, share=0.5))
        self.clear()

    def clear(self) -> None:
        """Forget the light field and everything that belongs to it."""
        self._resting_place.use()
        if self._pictures is not None:
            self._pictures.release()
            self._pictures = None

    def set_synthesis(self, image: FloatArray, pixels: Pixels, disparity: FloatArray | None, viewpoint: Point) -> None:
        """Take the newest synthesis: image (H, W, 3), the same as uint8 (H, W, 4), disparity (H, W) in px over the baseline
        or None, and its (u, v).

        The one before is kept for the cross-fade. Both are carried in 8 bits, which costs a software rasteriser half the time.
        """
        pictures = self._at_hand
        pictures.older_at, pictures.newest_at = pictures.newest_at, viewpoint
        pictures.newest = 1 - pictures.newest
        width, height = pictures.size
        pictures.syntheses.write(pixels, viewport=(0, 0, pictures.newest, width, height, 1))
        pictures.exact.write(np.ascontiguousarray(image, np.float32))
        if disparity is not None:
            pictures.disparity_map.write(np.ascontiguousarray(disparity, np.float32))
            pictures.nearest_disparity = float(disparity.min())
            pictures.made_at = viewpoint
        pictures.current.clear()

    def set_captured(self, view: npt.NDArray[np.generic]) -> None:
        """Take the captured view (H, W, 3), as stored, to be compared with or looked at."""
        self._at_hand.captured.write(np.ascontiguousarray(view))
        self._at_hand.current.clear()

    def set_exhibit(self, pixels: npt.NDArray[np.generic]) -> None:
        """Take a picture (H, W, 3), uint8, or a map (H, W), float32, that is shown as it is in place of a light field."""
        height, width = pixels.shape[:2]
        largest = int(self.context.info["GL_MAX_TEXTURE_SIZE"])
        if max(height, width) > largest:
            raise InputError(
                f"The picture is {width} x {height} px, but this computer's graphics show at most {largest} px a side; "
                f"write it out with `lfview info FILE --extract DIR` and look at it elsewhere."
            )
        self.clear_exhibit()
        components = pixels.shape[2] if pixels.ndim == 3 else 1
        self._exhibit = _texture(self.context, (width, height), components, _TEXTURE_TYPES[pixels.dtype.name])
        self._exhibit.write(np.ascontiguousarray(pixels))

    def clear_exhibit(self) -> None:
        """Forget that picture or map."""
        if self._exhibit is not None:
            self._exhibit.release()
            self._exhibit = None

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

    def begin(self, target: Target, rectangles: Sequence[tuple[Rect, tuple[float, float, float]]] = ()) -> None:
        """Start a frame: all of the target in the background colour, and rectangles (in its pixels, y downwards) in others.

        Clearing is the cheapest way of filling that there is, which counts where the processor draws.
        """
        framebuffer, (width, height) = target.framebuffer, target.size
        framebuffer.viewport = framebuffer.scissor = (0, 0, width, height)
        framebuffer.use()
        framebuffer.clear(*BACKGROUND, 1.0)
        for area, colour in rectangles:
            left, right = round(area.x), round(area.x + area.width)
            top, bottom = round(area.y), round(area.y + area.height)
            framebuffer.clear(*colour, 1.0, viewport=(left, height - bottom, right - left, bottom - top))

    def prepare(self, frame: Frame) -> bool:
        """Make the picture at the light field's own size that the frame shows; whether it was not up to date."""
        made = self._at_hand.made
        self._texture_of(frame)
        return self._at_hand.made != made

    def draw(self, frame: Frame, target: Target, area: Rect, placement: Placement) -> None:
        """Draw the frame's picture into the target, inside the area (in its pixels, y downwards), at the placement."""
        texture = self._texture_of(frame)
        values = frame.disparity_range if frame.look is Look.DISPARITY else None
        self._show(texture, values, frame.dim, target, area, placement)

    def draw_exhibit(self, target: Target, area: Rect, placement: Placement, values: tuple[float, float] | None) -> None:
        """Draw the exhibit into the target as `draw` does; of a map, `values` are those of the first and the last colour."""
        assert self._exhibit is not None
        self._show(self._exhibit, values, 1.0, target, area, placement)

    def _show(
        self,
        texture: moderngl.Texture,
        values: tuple[float, float] | None,
        dim: float,
        target: Target,
        area: Rect,
        placement: Placement,
    ) -> None:
        """A picture, or where `values` are given a map in colours, magnified into the target."""
        framebuffer, (width, height) = target.framebuffer, target.size
        visible = _visible(texture.size, area, placement)
        framebuffer.viewport = (0, 0, width, height)
        framebuffer.scissor = (visible.x, height - visible.y - visible.height, visible.width, visible.height)
        framebuffer.use()
        sampling = _sampling(placement.scale)
        placed: dict[str, Uniform] = {"origin": placement.origin, "scale": placement.scale, "window_height": float(height)}
        if values is not None:
            show = self._pass("show_disparity.frag", sampled=sampling)
            textures = {"disparity": texture, "colours": self._colours}
            show.render(textures, {**placed, "range": values})
        else:
            show = self._pass("show_image.frag", sampled=sampling)
            show.render({"picture": texture}, {**placed, "dim": dim})
        framebuffer.scissor = (0, 0, width, height)

    def read(self, frame: Frame) -> FloatArray:
        """What `draw` would show of this frame at one window pixel per picture pixel: float32 (H, W, 3)."""
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

    def timer(self) -> moderngl.Query:
        """A timer of what is drawn within it, by the graphics' own clock; read it one frame later, so that nothing waits."""
        return self.context.query(time=True)

    def _pass(self, fragment: str, **included: str) -> _Pass:
        """The fragment shader with these files in place of the includes NAME.glsl; the tone is as stored if not told."""
        instead = {"tone": _TONES[False], **included}
        key = (fragment, *(f"{name}:{file}" for name, file in sorted(instead.items())))
        if key not in self._passes:
            self._passes[key] = _Pass(self.context, fragment, {f"{name}.glsl": file for name, file in instead.items()})
        return self._passes[key]

    # Pictures at the light field's own size. Each is made anew only if what it shows has changed.

    def _texture_of(self, frame: Frame) -> moderngl.Texture:
        pictures, tone = self._at_hand, _TONES[frame.display_tone]
        if frame.look is Look.DISPARITY:
            self._carry_disparity(frame.viewpoint)
            return pictures.disparity
        if frame.look is Look.WARPED_ALL:
            self._make_sheet(frame.viewpoint, tone)
            return pictures.sheet.texture
        if frame.look.corner is not None:
            if pictures.picture.outdated("warped", frame.viewpoint, frame.look.corner, tone):
                self._warp_into(pictures.picture.target, frame.look.corner, (0, 0), frame.viewpoint, tone)
            return pictures.picture.texture
        if frame.look is Look.ERROR:
            return self._error(frame)
        if frame.captured:
            return self._copied(pictures.picture, pictures.captured, 0, tone).texture
        return self._synthesis(frame.viewpoint, frame.share, tone).texture

    def _error(self, frame: Frame) -> moderngl.Texture:
        pictures = self._at_hand
        result = pictures.picture
        if not result.outdated("error", frame.viewpoint, frame.share, frame.gain):
            return result.texture
        if pictures.newest_at == frame.viewpoint and frame.share >= 1.0:
            # In float32, since the steps of 8 bits would be seen when they are multiplied by the gain.
            shown = self._copied(pictures.precise, pictures.exact, 0, _TONES[False])
        else:
            shown = self._synthesis(frame.viewpoint, frame.share, _TONES[False])
        result.target.use()
        textures: Mapping[str, _AnyTexture] = {"picture": shown.texture, "captured": pictures.captured}
        self._pass("error.frag").render(textures, {"gain": frame.gain})
        return result.texture

    def _synthesis(self, viewpoint: Point, share: float, tone: str) -> _Picture:
        """The best picture of this viewpoint that can be made of the newest synthesis, the one before it and the corners."""
        pictures = self._at_hand
        newest, older = pictures.newest_at, pictures.older_at if share < 1.0 else None
        if newest is None:
            return self._corners(viewpoint, False, tone)
        if newest == viewpoint and older in (viewpoint, None):
            after = self._copied(pictures.after, pictures.exact, 0, tone)
            if share >= 1.0:
                return after
            if older is not None:
                before = self._copied(pictures.before, pictures.syntheses, 1 - pictures.newest, tone)
                return self._mixed(before, after, share)
            return self._mixed(self._corners(viewpoint, False, tone), after, share)
        if pictures.made_at != newest:  # it has come without a disparity map, and so cannot be carried
            return self._corners(viewpoint, pictures.made_at is not None, tone)
        near = carried_share(math.dist(newest, viewpoint))
        if near <= 0.0:
            return self._corners(viewpoint, True, tone)
        after = self._carried(viewpoint, older, share, tone)
        if share < 1.0 and older is None:
            return self._mixed(self._corners(viewpoint, False, tone), after, share * near)
        return after if near >= 1.0 else self._mixed(self._corners(viewpoint, True, tone), after, near)

    def _copied(self, result: _Picture, source: moderngl.TextureArray, layer: int, tone: str) -> _Picture:
        """A layer of these pictures, pixel by pixel."""
        if result.outdated("copy of", source, layer, tone):
            result.target.use()
            self._pass("exact.frag", tone=tone).render({"pictures": source}, {"layer": layer})
        return result

    def _carried(self, viewpoint: Point, older: Point | None, share: float, tone: str) -> _Picture:
        """The newest synthesis, and where `older` is given also that one, carried to the viewpoint."""
        pictures = self._at_hand
        result = pictures.after
        if not result.outdated("carried", viewpoint, older, share, tone):
            return result
        uniforms: dict[str, Uniform] = {**self._carrying(viewpoint), "newest": pictures.newest}
        fade = "fade_none.glsl"
        if older is not None:
            fade = "fade_older.glsl"
            uniforms |= {"older_at": older, "share": share}
        result.target.use()
        textures: Mapping[str, _AnyTexture] = {"syntheses": pictures.syntheses, "disparity_map": pictures.disparity_map}
        self._pass("carried.frag", fade=fade, tone=tone).render(textures, uniforms)
        return result

    def _corners(self, viewpoint: Point, warped: bool, tone: str) -> _Picture:
        """The four corner views, blended as they are or warped by the newest disparity."""
        pictures = self._at_hand
        result = pictures.before
        if not result.outdated("corners", viewpoint, warped, tone):
            return result
        result.target.use()
        if warped:
            textures: Mapping[str, _AnyTexture] = {
                "corner_views": pictures.corner_views,
                "disparity_map": pictures.disparity_map,
            }
            self._pass("instant.frag", tone=tone).render(textures, self._carrying(viewpoint))
        else:
            self._pass("blend.frag", tone=tone).render({"corner_views": pictures.corner_views}, {"viewpoint": viewpoint})
        return result

    def _mixed(self, before: _Picture, after: _Picture, share: float) -> _Picture:
        result = self._at_hand.picture
        if result.outdated("mixed", before.made_for, after.made_for, share):
            result.target.use()
            self._pass("fade.frag").render({"before": before.texture, "after": after.texture}, {"share": share})
        return result

    def _carrying(self, viewpoint: Point) -> dict[str, Uniform]:
        """The uniforms of carry.glsl and the viewpoint."""
        pictures = self._at_hand
        made_at = pictures.made_at
        assert made_at is not None
        return {"made_at": made_at, "nearest_disparity": pictures.nearest_disparity, "viewpoint": viewpoint}

    def _carry_disparity(self, viewpoint: Point) -> None:
        pictures = self._at_hand
        if pictures.made_at is None or not pictures.outdated("disparity", viewpoint):
            return
        pictures.disparity_target.use()
        self._pass("carry.frag").render({"disparity_map": pictures.disparity_map}, self._carrying(viewpoint))

    def _make_sheet(self, viewpoint: Point, tone: str) -> None:
        pictures = self._at_hand
        if not pictures.sheet.outdated("sheet", viewpoint, tone):
            return
        width, height = pictures.size
        for corner, (column, row) in enumerate(_SHEET_PLACES):
            self._warp_into(pictures.sheet.target, corner, (column * width, row * height), viewpoint, tone)

    def _warp_into(
        self, target: moderngl.Framebuffer, corner: int, tile: tuple[int, int], viewpoint: Point, tone: str
    ) -> None:
        pictures = self._at_hand
        self._carry_disparity(viewpoint)
        target.viewport = (*tile, *pictures.size)
        target.use()
        self._pass("warped.frag", tone=tone).render(
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


class _Picture:
    """A texture that a pass draws into, and what it was last drawn for."""

    def __init__(self, context: moderngl.Context, size: Size, dtype: str, owner: _Pictures) -> None:
        self.texture = _texture(context, size, 4, dtype)
        self.target = context.framebuffer([self.texture])
        self._owner = owner

    def outdated(self, *made_for: object) -> bool:
        """Whether the picture was last made for something else; it counts as made for this from now on."""
        return self._owner.outdated(self, *made_for)

    @property
    def made_for(self) -> tuple[object, ...]:
        """What it was last made for."""
        return self._owner.current.get(self, ())

    def release(self) -> None:
        """Give the memory of the graphics back."""
        self.target.release()
        self.texture.release()


class _Pictures:
    """The textures of one light field, and the framebuffers of the passes at its size."""

    def __init__(self, context: moderngl.Context, corners: npt.NDArray[np.generic], picture_type: str) -> None:
        height, width = corners.shape[1:3]
        stored = _TEXTURE_TYPES[corners.dtype.name]
        self.size: Size = (width, height)
        self.corner_views = context.texture_array(
            (width, height, len(CORNERS)), 3, np.ascontiguousarray(corners).tobytes(), alignment=1, dtype=stored
        )
        self.captured = context.texture_array((width, height, 1), 3, alignment=1, dtype=stored)
        self.exact = context.texture_array((width, height, 1), 3, alignment=1, dtype="f4")  # the newest synthesis
        self.syntheses = context.texture_array((width, height, 2), 4)  # the newest one and the one before, in 8 bits
        self.newest = 0  # layer of `syntheses`
        self.newest_at: Point | None = None  # viewpoint of the newest synthesis
        self.older_at: Point | None = None
        self.disparity_map = _texture(context, self.size, 1, "f4")
        self.made_at: Point | None = None  # viewpoint of disparity_map
        self.nearest_disparity = 0.0
        self.disparity = _texture(context, self.size, 1, "f4")
        self.disparity_target = context.framebuffer([self.disparity])
        self.before = _Picture(context, self.size, picture_type, self)
        self.after = _Picture(context, self.size, picture_type, self)
        self.picture = _Picture(context, self.size, picture_type, self)
        self.sheet = _Picture(context, (2 * width, 2 * height), picture_type, self)
        self.precise = _Picture(context, self.size, "f4", self)
        self.made = 0  # how often a target was made
        self.current: dict[object, tuple[object, ...]] = {}  # what each target was last made for

    def outdated(self, target: object, *made_for: object) -> bool:
        """Whether the target was last made for something else; it counts as made for this from now on."""
        if self.current.get(target) == made_for:
            return False
        self.current[target] = made_for
        self.made += 1
        return True

    def release(self) -> None:
        """Give the memory of the graphics back."""
        for value in vars(self).values():
            if isinstance(value, moderngl.Framebuffer | moderngl.Texture | moderngl.TextureArray | _Picture):
                value.release()


def _texture(context: moderngl.Context, size: Size, components: int, dtype: str) -> moderngl.Texture:
    texture = context.texture(size, components, alignment=1, dtype=dtype)
    texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
    texture.repeat_x = texture.repeat_y = False
    return texture
