"""Over the picture: all that is known of the pixel under the cursor."""

from __future__ import annotations

from imgui_bundle import ImVec2, ImVec4, imgui

from app import theme
from app.geometry import Rect
from app.readout import Readout
from app.samples import Part, Samples
from app.state import Look, ViewState
from app.tone import toned
from app.widgets import DASH, PASSIVE, card, disparity_words, em, number, packed, text
from lfcore.lightfield import CORNERS, FloatArray

_CORNER_NAMES = {(0.0, 0.0): "top left", (1.0, 0.0): "top right", (0.0, 1.0): "bottom left", (1.0, 1.0): "bottom right"}
_WIDTH = 19.5  # em
_NAMES = 5.7  # em, the column of names


def inspector(area: Rect, state: ViewState, readout: Readout) -> None:
    """Place, viewpoint, values and difference; in the corner where the cursor is not."""
    if not state.inspector or area.width < 30 * em() or area.height < 20 * em():
        return
    part = _under(state)
    mouse = imgui.get_mouse_pos()
    low = mouse.y > area.y + area.height - 16 * em() and mouse.x > area.x + area.width - (_WIDTH + 3) * em()
    with card("inspector", area, (1.0, 0.0 if low else 1.0), _WIDTH * em(), PASSIVE):
        _row("Pixel", f"x {part.left}   y {part.top}" if part else DASH)
        _row("Viewpoint", f"u {number(state.u, 4)}   v {number(state.v, 4)}")
        samples = readout.samples
        if part is None or samples is None or not samples.holds(part):
            for name in ("Stored", "Shown", "Disparity", "Difference"):
                _row(name, DASH)
            if state.look in _DETAILS:
                _row(_DETAILS[state.look], DASH)
            return
        stored = _stored(samples, part, state)
        _row("Stored", _row_of(stored, 4))
        shown = toned(stored[None, None], state.looking.tone)[0, 0]
        _swatch(shown)
        _row("Shown", _row_of(255 * shown, 0))
        _row("Disparity", _disparity(samples, part, readout))
        error = samples.error(part)
        _row("Difference", DASH if error is None else f"{_row_of(255 * error[0, 0], 1)}  of 255")
        if state.look in _DETAILS:
            _row(_DETAILS[state.look], _detail(samples, part, state))


_DETAILS = {
    Look.LEAN: "Leans on",
    Look.DISAGREEMENT: "Deviation",
    Look.SWEEP_MEAN: "Mean",
    Look.SWEEP_DEVIATION: "Deviation",
}


def _under(state: ViewState) -> Part | None:
    if state.cursor is None:
        return None
    x, y = int(state.cursor[0]), int(state.cursor[1])
    return Part(x, y, x + 1, y + 1)


def _stored(samples: Samples, part: Part, state: ViewState) -> FloatArray:
    """The picture's values, 1 = white: those of a warped input where one is looked at."""
    corner = CORNERS.index(state.tile) if state.look is Look.WARPED_ALL else state.look.corner
    if corner is not None and samples.disparity is not None:
        return samples.warped(corner, part)[0, 0]
    return samples.picture(part)[0, 0]


def _disparity(samples: Samples, part: Part, readout: Readout) -> str:
    if samples.disparity is None or readout.grid is None:
        return DASH
    return disparity_words(float(samples.disparity[part.top, part.left]), readout.grid.columns)


def _detail(samples: Samples, part: Part, state: ViewState) -> str:
    if state.look is Look.LEAN and samples.disparity is not None:
        shares = samples.shares(part)[0, 0]
        most = int(shares.argmax())
        return f"{_CORNER_NAMES[CORNERS[most]]}, {100 * float(shares[most]):.0f} %"
    patch = samples.patch(state.look, part, state.looking, state.gain, (0.0, 1.0))
    return DASH if patch is None else f"{number(float(patch.values[0, 0, 0]), 2)}  {patch.unit}"


def _row_of(values: FloatArray, decimals: int) -> str:
    return "   ".join(number(float(value), decimals) for value in values)


def _row(name: str, words: str) -> None:
    text(name, theme.TEXT_SOFT)
    imgui.same_line(_NAMES * em())
    text(words)


def _swatch(colour: FloatArray) -> None:
    """The colour itself, at the right end of the next line."""
    corner = imgui.get_cursor_screen_pos()
    side = em() * 0.9
    x = corner.x + imgui.get_content_region_avail().x - side
    red, green, blue = (float(value) for value in colour)
    brush = imgui.get_window_draw_list()
    brush.add_rect_filled(
        ImVec2(x, corner.y), ImVec2(x + side, corner.y + side), packed(ImVec4(red, green, blue, 1.0)), em() * 0.15
    )
