"""One frame of the program: the picture by the canvas, the panels over it. The same in a window and off screen."""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import moderngl
import numpy as np
from imgui_bundle import ImVec4, imgui

from app import painting, panel_painting, panels, repainting, theme
from app.canvas import Canvas, Colours, Frame, Pixels, Sheets, Target, WindowCopy, draws_in_software, spread_rasteriser
from app.canvas.atlas import Atlas
from app.canvas.slices import Slicing
from app.commands import Action, OpenPath, OpenTyped, Request
from app.comparing import Comparing
from app.comparison import Source
from app.controller import Controller
from app.desk import Placed
from app.engine import Answer
from app.exhibits import Exhibit
from app.export_requests import CancelExport, ExportAction, ExportRequest
from app.faults import sentence
from app.gallery import Seen
from app.geometry import Placement, Point, Rect, Size, place, visible
from app.layout import Layout, Strips
from app.more_fonts import MoreFonts
from app.panel_painting import Piece
from app.panes import Pane, arrange
from app.repainting import Layer, Repainting
from app.settings import Theme
from app.shared_window import SharedWindow
from app.state import CARRIED, CARRIED_IN_SOFTWARE, Look, Step
from app.surroundings import Surroundings
from app.typed_paths import path_from_text
from assets import sample_path
from lfcore.errors import InputError, LfviewError
from lfcore.lightfield import CORNERS, FloatArray, LightField

GLSL_VERSION = "#version 330 core"
DIMMED = 0.35
_GIVEN_UP = "Something is still being exported and would be given up; Ctrl+Q, or closing the window, once more ends lfview."
FAULTS_TO_CLOSE, FAULTS_TO_END = 3, 30  # frames in a row that fail

_log = logging.getLogger(__name__)


class Interface:
    """Draws frames into a framebuffer. Belongs to the thread on which the GL context and the imgui context are current.

    load: of a window, the addresses of OpenGL's functions by name; shared: another way into it for what has been painted.
    """

    def __init__(
        self,
        controller: Controller,
        context: moderngl.Context,
        scale: float,
        surroundings: Surroundings | None = None,
        load: Callable[[str], int] | None = None,
        shared: SharedWindow | None = None,
    ) -> None:
        self.controller = controller
        self.surroundings = surroundings or Surroundings(controller, wake=lambda: None)
        self.surroundings.picture_of = self._picture_of
        self.closing = False
        self.in_software = draws_in_software(context)
        if self.in_software:
            spread_rasteriser()
        reach = CARRIED_IN_SOFTWARE if self.in_software else CARRIED
        paints = self.in_software and painting.compiled()
        copy = WindowCopy(load) if paints and load is not None else None
        self._canvas = Canvas(context, reach=reach, paints=paints, copy=copy)
        self._atlas = Atlas(context)
        self._fonts = theme.apply(scale)
        self._more_fonts = MoreFonts(self._fonts)
        self._theme = Theme.DARK
        self._scale = scale
        self._light_field: LightField | None = None  # what the canvas has taken
        self._answer: Answer | None = None
        self._model = ""  # of the newest picture for a hand at rest
        self._captured: int | None = None
        self._partner: Answer | None = None
        self._map: FloatArray | None = None
        self._exhibit: Exhibit | None = None  # likewise
        self._timer = self._canvas.timer()
        self._timed = False  # a picture was made in the last frame
        self._prepared: Frame | None = None  # what has been made in this one of what the canvas has taken
        self._cleared = False  # the window has its grounds in this one
        self._repainting = Repainting()
        self._shared = shared
        self._saving = False  # the picture of this frame is to be saved
        self._picture_ms: float | None = None
        self._faults = 0  # frames in a row that have failed
        _let_imgui_recover()
        imgui.backends.opengl3_init(GLSL_VERSION)

    @property
    def takes_from_networks(self) -> bool:
        """Whether drawing takes cores that a synthesis wants."""
        return self.in_software and self.controller.synthesizing

    @property
    def may_explain(self) -> bool:
        """Whether a tooltip may appear where the mouse is: over the picture there is none, and frames would take cores from
        the networks just when the hand has come to rest."""
        return self.controller.state.cursor is None

    def set_scale(self, scale: float) -> None:
        """Go to another content scale of text, unless the person has chosen one."""
        scale = self.controller.state.desk.scale or scale
        if scale != self._scale:
            self._scale = scale
            theme.change_scale(scale)

    def draw(self, target: Target, now: float) -> bool:
        """Draw one frame; whether it is in the target, and not on the screen already. imgui's display size and events must have
        been set (by its platform backend); `now` in seconds.

        A fault becomes a message, and the next frame is drawn as if it had not been; where frames go on failing, what is
        open is closed, and at last the fault is raised.
        """
        try:
            painted = self._draw(target, now)
            self._faults = 0
            return not painted or self._shared is None
        except Exception as error:  # a fault in one part of the window must not take everything else with it
            self._survive(error)
            return True

    def _survive(self, error: Exception) -> None:
        imgui.end_frame()  # where it was begun; imgui then closes the windows that were left open
        self._repainting.forget()
        self._faults += 1
        if self._faults >= FAULTS_TO_END:
            raise error
        _log.error("a frame failed", exc_info=error)
        if self._faults >= FAULTS_TO_CLOSE:
            self.controller.close()
        self.controller.say(_sentence(error))

    def _draw(self, target: Target, now: float) -> bool:
        """Draw one frame; whether it was painted."""
        self.controller.tick(now)
        self.surroundings.arrive()
        self._synchronise()
        self._change_theme()
        self._atlas.begin()
        self._more_fonts.follow()
        imgui.backends.opengl3_new_frame()
        imgui.new_frame()
        display = imgui.get_io().display_size
        state = self.controller.state
        readout = replace(self.controller.readout(self._picture_ms), shelf=self.surroundings.shelf())
        readout = replace(readout, focus=replace(readout.focus, summed=self._canvas.summed))
        pixels = target.size[0] / max(display.x, 1.0)
        begin = partial(self._begin, target, pixels)
        layout, requests = panels.draw(state, readout, (display.x, display.y), self._scale, self._fonts, begin)
        imgui.render()
        # What the panels changed is drawn in this very frame.
        for request in requests:
            self._fulfil(request)
        self.controller.follow(now)
        self.surroundings.tick(now, imgui.is_any_mouse_down() or state.swaying)
        self._synchronise()
        self._synchronise_exhibit()
        if self._paint(target, layout, pixels):
            return True
        self._repainting.forget()
        if self._light_field is not None:
            self._draw_picture(target, layout, pixels)
        else:
            self._clear(target, layout, pixels)
            if self._exhibit is not None:
                self._draw_exhibit(self._exhibit, target, layout, pixels)
        if self._saving:
            self._save_picture(target, layout, pixels)
        target.framebuffer.use()
        imgui.backends.opengl3_render_draw_data(imgui.get_draw_data())
        return False

    def _begin(self, target: Target, pixels: float, layout: Layout) -> None:
        """Have the picture made for what the hand has just done, and the window cleared.

        Software rasterisers make the picture in threads of their own, which begin when another target is drawn into: while the
        panels are laid out, and not after that.
        """
        self._prepared, self._cleared = None, False
        if self._light_field is not None:
            self._prepare()
            if self._copied(layout, pixels) is None:
                self._clear(target, layout, pixels)

    def _copied(self, layout: Layout, pixels: float) -> Pixels | None:
        """Where the window becomes the picture by copying; None where it is drawn, or there are several."""
        panes = arrange(self.controller.state, layout.picture)
        if len(panes) > 1 or panes[0].partner or self._prepared is None:
            return None
        return self._canvas.copied(self._prepared, *self._where(panes[0], self._prepared, pixels))

    def _where(self, pane: Pane, frame: Frame, pixels: float) -> tuple[Rect, Placement]:
        """The area in which a frame's picture is seen, and where it lies there, in framebuffer pixels."""
        placement = pane.placement(self.controller.state.zoom, self._canvas.picture_size(frame.look))
        return _scaled(pane.clip, pixels), _magnified(placement, pixels)

    def _clear(self, target: Target, layout: Layout, pixels: float, around: Pixels | None = None) -> None:
        """Give the window its grounds, once a frame."""
        if self._cleared:
            return
        self._cleared = True
        self._canvas.begin(target, _panel_grounds(layout, pixels), _rgb(theme.BACKGROUND), around)

    def _prepare(self) -> None:
        """Make the picture at the light field's own size, and time it."""
        if self._timed:  # asked one frame later, when the graphics have done it, so that nothing waits
            self._picture_ms = 1e-6 * self._timer.elapsed
            self._timed = False
        self._prepared = self._frame()
        if self._canvas.painted:  # as before this one: the graphics are not held up by asking them for the time
            begun = time.perf_counter()
            made = self._canvas.prepare(self._prepared)
            if made and self._canvas.painted:
                self._picture_ms = 1e3 * (time.perf_counter() - begun)
            return
        with self._timer:
            made = self._canvas.prepare(self._prepared)
        self._timed = made and not self._canvas.painted

    @property
    def next_frame_in(self) -> float | None:
        """As Controller.next_frame_in, but 0 also while each frame makes the picture better, or fonts are looked for."""
        return 0.0 if self._canvas.unfinished or self._more_fonts.looking else self.controller.next_frame_in

    def uncover(self) -> None:
        """The screen has lost something of the window."""
        self._repainting.forget()

    def warm_up(self, target: Target) -> None:
        """Make the graphics ready for the first light field, while it is being opened; the target is drawn over."""
        if self._light_field is None:
            self._canvas.warm_up(target)

    def shutdown(self) -> None:
        """Give imgui's GL objects back; the context must still be current."""
        self._canvas.clear()
        self._canvas.clear_exhibit()
        self._atlas.release()
        imgui.backends.opengl3_shutdown()

    def _fulfil(self, request: Request) -> None:
        controller = self.controller
        if isinstance(request, OpenPath):
            controller.open(request.path)
        elif isinstance(request, OpenTyped):
            self._open_typed(request.text)
        elif request is Action.OPEN_SAMPLE:
            controller.open(sample_path())
        elif request is Action.CLOSE:
            controller.close()
        elif request is Action.CANCEL_OPEN:
            controller.cancel_open()
        elif request is Action.DISMISS:
            controller.dismiss()
        elif request is Action.QUIT:
            self.quit()
        elif isinstance(request, (ExportAction, CancelExport)):
            self._export(request)
        else:
            self.surroundings.fulfil(request)

    def quit(self) -> None:
        """End the program after this frame; while something is exported, only when it is asked for once more."""
        controller = self.controller
        if controller.exports.busy and _GIVEN_UP not in controller.messages:
            controller.say(_GIVEN_UP)
        else:
            self.closing = True

    def _open_typed(self, text: str) -> None:
        try:
            self.controller.open(path_from_text(text))
        except InputError as error:
            self.controller.say(str(error))

    def _change_theme(self) -> None:
        chosen = self.controller.state.desk.theme
        if chosen is not self._theme:
            self._theme = chosen
            theme.change(chosen)

    def _picture_of(self, seen: Seen) -> Placed | None:
        """Where the thumbnail of a light field lies for imgui, once it has been handed to the graphics."""
        if seen.glance is None or seen.glance.picture is None:
            return None
        return self._atlas.place(seen.number, seen.glance.picture)

    def _export(self, request: ExportRequest) -> None:
        controller = self.controller
        if request is ExportAction.SAVE_PICTURE:
            self._saving = True
            return
        if request is ExportAction.EXPORT and controller.previewing:
            controller.say("The light field is still being opened; export it once it is there.")
            return
        model = controller.readout(None).model
        try:
            controller.exports.fulfil(request, controller.state.export, controller.light_field, model)
        except LfviewError as error:
            controller.say(str(error))

    def _save_picture(self, target: Target, layout: Layout, pixels: float) -> None:
        """Hand what is drawn of the picture, without what lies over it, to the export queue."""
        self._saving = False
        controller = self.controller
        state = controller.state
        size = panels.picture_size(controller.readout(None), state)
        seen = _scaled(visible(place(state.zoom, size, layout.picture), size, layout.picture), pixels)
        # Only whole pixels of the picture: at its edges the background shines through.
        left, top = math.ceil(seen.x), math.ceil(seen.y)
        width, height = math.floor(seen.x + seen.width) - left, math.floor(seen.y + seen.height) - top
        if min(width, height) < 1:
            return
        corner = (left, target.size[1] - top - height)
        shown = target.framebuffer.read((*corner, width, height), components=3, alignment=1)
        picture = np.frombuffer(shown, np.uint8).reshape(height, width, 3)[::-1]
        name = f"{controller.name} {state.look.value.lower()} u{state.u:.2f} v{state.v:.2f}".replace("/", " ")
        try:
            controller.exports.save_picture(picture, state.export, name)
        except LfviewError as error:
            controller.say(str(error))

    def _synchronise(self) -> None:
        """Hand to the canvas what it has not yet taken."""
        controller, canvas = self.controller, self._canvas
        light_field = controller.light_field
        if light_field is not self._light_field:
            self._light_field = None
            self._answer = self._captured = self._partner = self._map = None
            canvas.clear()
            if light_field is not None:
                corners = np.stack([light_field.views[-int(v), -int(u)] for u, v in CORNERS])  # (4, H, W, 3)
                try:
                    canvas.set_light_field(corners)
                    canvas.set_views(light_field.views, light_field.dark)
                    canvas.check_memory()
                except (LfviewError, moderngl.Error) as error:
                    canvas.clear()
                    controller.close()
                    controller.say(_sentence(error))
                    return
            self._light_field = light_field
            self._prepared = None
        if light_field is None:
            return
        answer = controller.newest
        if answer is not None and answer is not self._answer:
            synthesis = answer.synthesis
            at = synthesis.u, synthesis.v
            canvas.set_synthesis(synthesis.image, answer.pixels, synthesis.disparity, at, synthesis.weights)
            self._answer = answer
            self._prepared = None
            if answer.final and synthesis.model != self._model:
                self._model = synthesis.model
                canvas.redraw_between()
        canvas.set_eyes({eye: answer.pixels for eye, answer in controller.eyes.answers.items()})
        captured = controller.captured_here
        if captured is not None and captured != self._captured:
            canvas.set_captured(light_field.views[divmod(captured, light_field.columns)])
            self._captured = captured
        self._synchronise_partner(controller.comparing)

    def _synchronise_partner(self, comparing: Comparing) -> None:
        """The same for what the picture is compared with."""
        canvas, answer, measured = self._canvas, comparing.answer, comparing.measured
        if answer is not None and answer is not self._partner:
            canvas.set_partner(answer.synthesis.image)
            self._partner = answer
        values = measured.values if measured is not None else None
        if values is not None and values is not self._map:
            canvas.set_map(values)
        self._map = values
        picture = self.controller.picture
        if comparing.instant_wanted and picture is not None:
            comparing.take_instant(picture, canvas.read(self._instant_frame()))

    def _synchronise_exhibit(self) -> None:
        """The same for what a Lytro file without raw shows."""
        controller, exhibit = self.controller, self.controller.exhibit
        if exhibit is self._exhibit:
            return
        self._exhibit = None
        self._canvas.clear_exhibit()
        if exhibit is not None:
            try:
                self._canvas.set_exhibit(exhibit.pixels)
            except LfviewError as error:
                controller.close()
                controller.say(str(error))
                return
        self._exhibit = exhibit

    def _draw_exhibit(self, exhibit: Exhibit, target: Target, layout: Layout, pixels: float) -> None:
        caption, area = exhibit.caption, layout.picture
        state = self.controller.state
        placement = place(state.zoom, (caption.width, caption.height), area)
        colours = Colours(state.looking.colour_map, caption.span) if caption.span is not None else None
        self._canvas.draw_exhibit(target, _scaled(area, pixels), _magnified(placement, pixels), colours)

    def _paint(self, target: Target, layout: Layout, pixels: float) -> bool:
        """Paint the whole window in the processor's memory and have it shown, where all that is in it can be painted; whether
        that was so."""
        if self._light_field is None or self._saving or layout.strips is not None:
            return False
        frame = self._prepare_to_date()
        if self._copied(layout, pixels) is None:
            return False
        pieces = panel_painting.pieces_of(imgui.get_draw_data(), target.size)
        if pieces is None:
            return False
        (pane,) = arrange(self.controller.state, layout.picture)
        grounds, background = _panel_grounds(layout, pixels), _rgb(theme.BACKGROUND)
        layers = self._canvas.beneath(frame, target.size, grounds, background, *self._where(pane, frame, pixels))
        try:
            self._show(self._shared or self._canvas.sheets(target), target.size, layers, pieces)
        except OSError as error:  # the X server takes no memory of this size
            if self._shared is None:
                raise
            _log.warning("the window is copied from now on: %s", error)
            self._shared = None
            self._show(self._canvas.sheets(target), target.size, layers, pieces)
        return True

    def _show(self, sheets: Sheets, size: Size, layers: Sequence[Layer], pieces: Sequence[Piece]) -> None:
        """Paint what has changed of the window, and have it shown."""
        if not sheets.keeps(size):
            self._repainting.forget()
        sheet = sheets.sheet(size)
        boxes = self._repainting.outdated(size, layers, pieces)
        repainting.paint(sheet, boxes, layers, pieces)
        sheets.show(sheet, boxes)

    def _prepare_to_date(self) -> Frame:
        """The frame of the picture, which is made anew where the panels have changed it, or the canvas has taken more since."""
        frame = self._frame()
        if frame != self._prepared:
            self._canvas.prepare(frame)
            self._prepared = frame
        return frame

    def _draw_picture(self, target: Target, layout: Layout, pixels: float) -> None:
        """`pixels`: framebuffer pixels per window unit."""
        frame = self._prepare_to_date()
        copied = self._copied(layout, pixels)
        if copied is None:
            self._clear(target, layout, pixels)
        state = self.controller.state
        for pane in arrange(state, layout.picture):
            shown = self._partner_frame() if pane.partner else frame
            self._canvas.draw(shown, target, *self._where(pane, shown, pixels))
        self._clear(target, layout, pixels, copied)
        if layout.strips is not None and state.sliced is not None:
            self._draw_slices(layout.strips, state.sliced, target, arrange(state, layout.picture)[0], pixels)

    def _draw_slices(self, strips: Strips, through: Point, target: Target, pane: Pane, pixels: float) -> None:
        controller, state, canvas = self.controller, self.controller.state, self._canvas
        captured = controller.captured_sliced or not canvas.has_disparity
        placement = pane.placement(state.zoom, canvas.picture_size(state.look))
        scaled = Strips(_scaled(strips.below, pixels), _scaled(strips.beside, pixels))
        canvas.draw_slices(
            Slicing(through, controller.viewpoint, captured),
            state.looking.tone,
            target,
            scaled,
            _scaled(pane.frame, pixels),
            _magnified(placement, pixels),
        )

    def _frame(self) -> Frame:
        """What the picture is to show; dimmed where the chosen look has nothing to show here."""
        controller = self.controller
        state = controller.state
        comparison = state.comparison
        look, dim = state.look, 1.0
        mapped = not comparison.difference.measured or self._map is not None
        if look is Look.ERROR and not (controller.has_partner and mapped):
            look, dim = Look.SYNTHESIS, DIMMED
        if look.needs_disparity and not controller.has_disparity:
            look, dim = Look.SYNTHESIS, DIMMED
        return Frame(
            look,
            controller.viewpoint,
            share=controller.share,
            source=Source.CAPTURED if controller.step is Step.CAPTURED else Source.SYNTHESIS,
            partner=comparison.source,
            difference=comparison.difference,
            tone=state.looking.tone,
            gain=state.gain,
            disparity_range=controller.disparity_range or (0.0, 1.0),
            colour_map=state.looking.colour_map,
            level=state.looking.level,
            focusing=state.focusing,
            captured_summed=self._captured_summed,
            dim=dim,
        )

    @property
    def _captured_summed(self) -> bool:
        return self.controller.captured_summed or not self._canvas.has_disparity

    def _partner_frame(self) -> Frame:
        """What the picture is compared with; where that has none here, the picture, dimmed."""
        controller, state = self.controller, self.controller.state
        there = controller.has_partner
        return Frame(
            Look.SYNTHESIS,
            controller.viewpoint,
            share=controller.share,
            source=state.comparison.source if there else Source.SYNTHESIS,
            tone=state.looking.tone,
            dim=1.0 if there else DIMMED,
        )

    def _instant_frame(self) -> Frame:
        """The instant picture in the values that are stored."""
        return Frame(Look.SYNTHESIS, self.controller.viewpoint, source=Source.INSTANT)


def _let_imgui_recover() -> None:
    """Where a frame is broken off, imgui is to tidy up and not to complain; one of its three ways of telling must be on."""
    io = imgui.get_io()
    io.config_error_recovery_enable_assert = False
    io.config_error_recovery_enable_tooltip = False
    io.config_error_recovery_enable_debug_log = True


def _sentence(error: Exception) -> str:
    """What is said of a fault."""
    if isinstance(error, moderngl.Error):
        return f"The graphics cannot draw this: {error}; open a smaller light field, or update the graphics driver."
    return sentence(error)


def _panel_grounds(layout: Layout, pixels: float) -> list[tuple[Rect, tuple[float, float, float]]]:
    """Where panels lie, in framebuffer pixels, and in which colour."""
    areas = [area for area in (layout.panel, layout.status) if area is not None]
    return [(_scaled(area, pixels), _rgb(theme.PANEL)) for area in areas]


def _rgb(colour: ImVec4) -> tuple[float, float, float]:
    return colour.x, colour.y, colour.z


def _scaled(area: Rect, pixels: float) -> Rect:
    """From window units to framebuffer pixels."""
    return Rect(area.x * pixels, area.y * pixels, area.width * pixels, area.height * pixels)


def _magnified(placement: Placement, pixels: float) -> Placement:
    """The same for a placement."""
    return Placement(placement.scale * pixels, (placement.origin[0] * pixels, placement.origin[1] * pixels))
