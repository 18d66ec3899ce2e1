"""The picture in the window.

Every way of looking is a shader over the same textures: the four corner views, the newest synthesis with its disparity
map, the synthesis before it, and the captured view. What is shown is made at the light field's own size in 8 bits, as the
screen has, and only when it has changed; the window then magnifies it. Only where there is no GPU, and the processor does the
graphics' work anyway, does it make the most common pictures by code of its own (app.painting), which is faster than shaders
are there.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import moderngl
import numpy as np
import numpy.typing as npt

from app.canvas.beneath import Enlarged, Fill
from app.canvas.compared import Compared
from app.canvas.copying import Sheets, WindowCopy
from app.canvas.frame import BACKGROUND, Frame, Target
from app.canvas.inside import Inside
from app.canvas.magnifier import Colours, Magnifier
from app.canvas.painted import Painted, PaintedSynthesized
from app.canvas.passes import Passes
from app.canvas.placing import Pixels, shown_size, visible
from app.canvas.refocus import Refocused, Wanted
from app.canvas.slices import Slices, Slicing
from app.canvas.stereo import Stereo
from app.canvas.synthesized import Synthesized
from app.canvas.textures import TEXTURE_TYPES, Textures, make_texture
from app.comparison import Source
from app.geometry import Placement, Point, Rect, Size
from app.layout import Strips
from app.painting import Box
from app.state import CARRIED, Look, Reach
from app.tone import Tone
from lfcore.errors import InputError
from lfcore.lightfield import FloatArray
from lfcore.synthesis import ByteArray

Colour = tuple[float, float, float]  # red, green, blue, 0 to 1
Ground = tuple[Rect, Colour]  # a rectangle in pixels of the target, y downwards, and what it is filled with


@dataclass(frozen=True)
class _Makers:
    """What there is of one light field, and what makes pictures of it."""

    textures: Textures
    synthesized: Synthesized
    inside: Inside
    compared: Compared
    refocused: Refocused
    slices: Slices
    stereo: Stereo

    @staticmethod
    def of(context: moderngl.Context, passes: Passes, textures: Textures, synthesized: Synthesized) -> _Makers:
        refocused = Refocused(context, passes, textures)
        return _Makers(
            textures,
            synthesized,
            Inside(passes, textures, synthesized),
            Compared(passes, textures, synthesized),
            refocused,
            Slices(passes, textures, refocused),
            Stereo(context, passes, textures),
        )


class Canvas:
    """The picture in the window. All methods need the GL context to be current, on the thread that made the canvas.

    `picture_type`: moderngl's type of the pictures that are shown; "f1" is 8 bits, "f4" float32 to read them back exactly.
    `reach`: how far a synthesis is carried, see app.state. `paints`: the processor makes pictures by app.painting, which must
    be compiled; `copy`: and those are copied into the window.
    """

    def __init__(
        self,
        context: moderngl.Context,
        picture_type: str = "f1",
        reach: Reach = CARRIED,
        paints: bool = False,
        copy: WindowCopy | None = None,
    ) -> None:
        self.context = context
        self.passes = Passes(context)
        self._picture_type = picture_type
        self._reach = reach
        self._synthesizes = PaintedSynthesized if paints else Synthesized
        self._copy = copy
        for fragment in ("blend.frag", "instant.frag", "exact.frag", "fade.frag"):
            self.passes.get(fragment)  # compiled now, so that the hand's first movement does not wait for them
        for fade in ("fade_none.glsl", "fade_older.glsl"):
            self.passes.get("carried.frag", fade=fade)
        self._magnifier = Magnifier(context, self.passes)
        # Bound before framebuffers are released: moderngl would otherwise go on binding one that is gone.
        self._resting_place = context.simple_framebuffer((1, 1))
        self._makers: _Makers | None = None
        self._light_fields = 0  # that have been taken
        self.unfinished = False  # the frame prepared last becomes better with the next ones
        self.painted = False  # it has been made by the processor's own code
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
        self._light_fields += 1
        textures = Textures(self.context, corners, self._picture_type)
        synthesized = self._synthesizes(self.passes, textures, self._reach)
        self._makers = _Makers.of(self.context, self.passes, textures, synthesized)

    def warm_up(self, target: Target) -> None:
        """Run every pass of the moving picture once on a made-up light field, into the target; there must be no other.

        Software rasterisers compile a shader when it is first run on certain kinds of texture, which can take half a second:
        the hand would feel it in its first movement. Sides that are powers of two are a kind of their own.
        """
        size = (3, 5)
        self.set_light_field(np.zeros((4, *size, 3), np.uint8))
        image, pixels, disparity = np.zeros((*size, 3), np.float32), np.zeros((*size, 4), np.uint8), np.zeros(size, np.float32)
        here, near = (0.0, 0.0), (0.05, 0.0)
        between, far = ((self._reach.near + self._reach.far) / 2, 0.0), (1.0, 1.0)  # carried in part, and not at all
        self.prepare(Frame(Look.SYNTHESIS, here))
        for share in (0.5, 1.0):  # fading in over nothing, then over the one before
            self.set_synthesis(image, pixels, disparity, here)
            for viewpoint in (here, near, between, far):
                self.prepare(Frame(Look.SYNTHESIS, viewpoint, share=share))
        self.prepare(Frame(Look.SYNTHESIS, near, share=0.5))
        for scale in (0.5, 1.0, 2.0):  # dimmed, since other pictures are copied where that can be
            self.draw(Frame(Look.SYNTHESIS, here, dim=0.5), target, Rect(0, 0, *size), Placement(scale, (0.0, 0.0)))
        self.clear()

    def check_memory(self) -> None:
        """Raise InputError where the graphics had no room for what they were last given."""
        if self.context.error == "GL_OUT_OF_MEMORY":
            raise InputError("The graphics have not enough memory for this light field; open one with smaller or fewer views.")

    def clear(self) -> None:
        """Forget the light field and everything that belongs to it."""
        self._resting_place.use()
        if self._makers is not None:
            self._makers.synthesized.release()
            self._makers.compared.release()
            self._makers.refocused.release()
            self._makers.stereo.release()
            self._makers.textures.release()
            self._makers = None
        self.unfinished = self.painted = False

    def set_synthesis(
        self,
        image: FloatArray,
        pixels: ByteArray,
        disparity: FloatArray | None,
        viewpoint: Point,
        weights: ByteArray | None = None,
    ) -> None:
        """Take the newest synthesis: image (H, W, 3), the same as uint8 (H, W, 4), disparity (H, W) in px over the baseline
        or None, its (u, v), and where they are known the weights (4, H, W) of the inputs in it, 255 = whole.

        The one before is kept for the cross-fade. Both are carried in 8 bits, which costs a software rasteriser half the time.
        None of it may be changed afterwards: it is handed to the graphics when they need it.
        """
        self._at_hand.textures.take_synthesis(image, pixels, disparity, viewpoint, weights)

    def set_captured(self, view: npt.NDArray[np.generic]) -> None:
        """Take the captured view (H, W, 3), as stored, to be compared with or looked at."""
        self._at_hand.textures.captured.write(np.ascontiguousarray(view))
        self._at_hand.textures.current.clear()

    def set_views(self, views: npt.NDArray[np.generic], dark: frozenset[tuple[int, int]]) -> None:
        """Take all captured views (V, U, H, W, 3), as stored, of which `dark` ones, by row and column, are not to be used.

        They are handed to the graphics when they are first needed, a few in each frame.
        """
        self._at_hand.refocused.set_views(views, dark)

    def set_eyes(self, eyes: Mapping[Point, ByteArray]) -> None:
        """Take the syntheses (H, W, 4) for the viewpoints of a stereo pair's eyes, as far as they are there."""
        self._at_hand.stereo.set_eyes(eyes)

    def redraw_between(self) -> None:
        """Draw the views in between that refocusing sums up anew, from what is now at hand: another model has come."""
        self._at_hand.refocused.redraw_between()

    def set_partner(self, image: FloatArray) -> None:
        """Take the synthesis of the viewpoint by another model (H, W, 3), to be compared with or looked at."""
        self._at_hand.compared.set_partner(image)

    def set_map(self, values: FloatArray) -> None:
        """Take a map (H, W) of how far the picture and its partner are apart; nan where it has no value."""
        self._at_hand.compared.set_map(values)

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
        self._exhibit = make_texture(self.context, (width, height), components, TEXTURE_TYPES[pixels.dtype.name])
        self._exhibit.write(np.ascontiguousarray(pixels))

    def clear_exhibit(self) -> None:
        """Forget that picture or map."""
        if self._exhibit is not None:
            self._exhibit.release()
            self._exhibit = None

    @property
    def has_light_field(self) -> bool:
        """Whether there is a picture to draw."""
        return self._makers is not None

    @property
    def has_disparity(self) -> bool:
        """Whether a disparity map has been taken for this light field."""
        return self._makers is not None and self._makers.textures.made_at is not None

    def picture_size(self, look: Look) -> Size:
        """(width, height) in pixels of what this look shows."""
        return shown_size(self._at_hand.textures.size, look)

    # Drawing.

    def begin(
        self,
        target: Target,
        rectangles: Sequence[Ground] = (),
        background: Colour = BACKGROUND,
        around: Pixels | None = None,
    ) -> None:
        """Start a frame: all of the target in the background colour, and rectangles (in its pixels, y downwards) in others.
        around: where there is a picture already, on which none of the rectangles lies.

        Clearing is the cheapest way of filling that there is, which counts where the processor draws.
        """
        framebuffer, (width, height) = target.framebuffer, target.size
        framebuffer.viewport = framebuffer.scissor = (0, 0, width, height)
        framebuffer.use()
        if around is None:
            framebuffer.clear(*background, 1.0)
        for area, colour in _grounds(rectangles, background, around, target.size):
            left, top, right, bottom = _rounded(area)
            framebuffer.clear(*colour, 1.0, viewport=(left, height - bottom, right - left, bottom - top))

    def prepare(self, frame: Frame) -> bool:
        """Make the picture at the light field's own size that the frame shows; whether it was not up to date."""
        made = self._at_hand.textures.made
        refocused = frame.look is Look.REFOCUS
        self.unfinished = self._at_hand.refocused.advance(_wanted(frame)) if refocused else False
        self.painted = isinstance(self._made(frame), Painted)
        return self._at_hand.textures.made != made

    def copied(self, frame: Frame, area: Rect, placement: Placement) -> Pixels | None:
        """Which pixels of a target `draw` sets by copying, for which a target need not be cleared before; None: it draws.

        To copy it has to wait for everything that has been drawn, be it only the clearing.
        """
        copies = isinstance(self._made(frame), Painted) and self._copy_for(frame, placement) is not None
        return visible(self._at_hand.textures.size, area, placement) if copies else None

    def draw(self, frame: Frame, target: Target, area: Rect, placement: Placement) -> None:
        """Draw the frame's picture into the target, inside the area (in its pixels, y downwards), at the placement."""
        made, colours = self._made(frame), _colours(frame)
        if isinstance(made, Painted):
            copy = self._copy_for(frame, placement)
            if copy is not None:
                copy.image(made.pixels, target, area, placement)
                return
            made = made.texture
        if colours is not None:
            self._magnifier.map(made, colours, target, area, placement)
        else:
            self._magnifier.image(made, frame.dim, target, area, placement)

    def beneath(
        self, frame: Frame, size: Size, rectangles: Sequence[Ground], background: Colour, area: Rect, placement: Placement
    ) -> list[Fill | Enlarged]:
        """What `begin` and `draw` would fill a window of this (width, height) with, one after the other. Only for what is
        `copied`."""
        made, copied = self._made(frame), self.copied(frame, area, placement)
        assert isinstance(made, Painted) and copied is not None
        layers: list[Fill | Enlarged] = [
            Fill(Box(*_rounded(ground)), colour) for ground, colour in _grounds(rectangles, background, copied, size)
        ]
        seen = Box(copied.x, copied.y, copied.x + copied.width, copied.y + copied.height)
        number = self._light_fields, made.number
        return [*layers, Enlarged(seen, made.pixels, placement, number)]

    def sheets(self, target: Target) -> Sheets:
        """Of the target, which is a window. Only where something is `copied`."""
        assert self._copy is not None
        return self._copy.into(target)

    def _copy_for(self, frame: Frame, placement: Placement) -> WindowCopy | None:
        """What copies the frame's picture, if it has been painted; None where it has to be drawn."""
        copy = self._copy
        return copy if copy is not None and frame.dim == 1.0 and copy.suits(placement) else None

    def draw_slices(
        self, slicing: Slicing, tone: Tone, target: Target, strips: Strips, area: Rect, placement: Placement
    ) -> None:
        """Draw epipolar slices into the strips beside the picture that lies in the area at the placement."""
        more = self._at_hand.slices.draw(slicing, tone, target, strips, area, placement)
        self.unfinished = self.unfinished or more

    def draw_exhibit(self, target: Target, area: Rect, placement: Placement, colours: Colours | None) -> None:
        """Draw the exhibit into the target as `draw` does; a map in these colours."""
        assert self._exhibit is not None
        if colours is None:
            self._magnifier.image(self._exhibit, 1.0, target, area, placement)
        else:
            self._magnifier.map(self._exhibit, colours, target, area, placement)

    def read(self, frame: Frame) -> FloatArray:
        """What `draw` would show of this frame at one window pixel per picture pixel: float32 (H, W, 3)."""
        width, height = self.picture_size(frame.look)
        self.prepare(frame)
        while self.unfinished:
            self.prepare(frame)
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

    @property
    def summed(self) -> str:
        """Which views the refocused picture is made of, in words."""
        return self._makers.refocused.words if self._makers is not None else ""

    def timer(self) -> moderngl.Query:
        """A timer of what is drawn within it, by the graphics' own clock; read it one frame later, so that nothing waits."""
        return self.context.query(time=True)

    def _made(self, frame: Frame) -> moderngl.Texture | Painted:
        """The picture, or the map, at the light field's own size."""
        makers, tone = self._at_hand, frame.tone
        if frame.look is Look.DISPARITY:
            return makers.synthesized.carry_disparity(frame.viewpoint)
        if frame.look is Look.WARPED_ALL:
            return makers.inside.sheet(frame.viewpoint, tone)
        if frame.look.corner is not None:
            return makers.inside.warped(frame.look.corner, frame.viewpoint, tone)
        if frame.look is Look.LEAN:
            return makers.inside.lean(frame.viewpoint, frame.share, frame.gain)
        if frame.look is Look.DISAGREEMENT:
            return makers.inside.disagreement(frame.viewpoint)
        if frame.look is Look.SWEEP_MEAN:
            return makers.inside.sweep_mean(frame.viewpoint, frame.level, tone)
        if frame.look is Look.SWEEP_DEVIATION:
            return makers.inside.sweep_deviation(frame.viewpoint, frame.level)
        if frame.look is Look.ERROR:
            return makers.compared.difference(frame.viewpoint, frame.share, frame.partner, frame.difference, frame.gain)
        if frame.look is Look.ANAGLYPH:
            return makers.stereo.anaglyph(frame.viewpoint, frame.focusing, tone)
        if frame.look.is_stereo:
            return makers.stereo.pair(frame.viewpoint, frame.focusing, frame.look is Look.STEREO_CROSSED, tone)
        refocused = makers.refocused.picture(_wanted(frame), tone) if frame.look is Look.REFOCUS else None
        if refocused is not None:
            return refocused
        if frame.source is not Source.SYNTHESIS:
            return makers.compared.partner(frame.source, frame.viewpoint, tone).texture
        made = makers.synthesized.picture(frame.viewpoint, frame.share, tone)
        return made if isinstance(made, Painted) else made.texture

    @property
    def _at_hand(self) -> _Makers:
        if self._makers is None:
            raise RuntimeError("the canvas has no light field")
        return self._makers


def _grounds(rectangles: Sequence[Ground], background: Colour, around: Pixels | None, size: Size) -> Sequence[Ground]:
    """Rectangles, and before them what lies around a picture and not in one of them."""
    strips = around.surroundings(size) if around is not None else []
    seen = [strip for strip in strips if not any(area.holds(strip) for area, _ in rectangles)]
    return (*((strip, background) for strip in seen), *rectangles)


def _rounded(area: Rect) -> tuple[int, int, int, int]:
    """(left, top, right, bottom) in whole pixels; the last two lie outside."""
    return round(area.x), round(area.y), round(area.x + area.width), round(area.y + area.height)


def _wanted(frame: Frame) -> Wanted:
    return Wanted(frame.viewpoint, frame.focusing.focus, frame.focusing.aperture, frame.captured_summed)


def _colours(frame: Frame) -> Colours | None:
    """In which colours the frame's map is shown; None where it is a picture."""
    if frame.look is Look.DISPARITY:
        return Colours(frame.colour_map, frame.disparity_range)
    return Colours(frame.colour_map, (0.0, 1 / frame.gain)) if frame.look.is_deviation else None
