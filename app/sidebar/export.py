"""The tab Export: a path, what its frames show, the file, and the queue of exports."""

from __future__ import annotations

from enum import Enum
from typing import TypeVar

from imgui_bundle import ImVec2, imgui

from app import theme
from app.commands import Context
from app.export_choices import KEY_FRAMES, LAYERS, RADIUS_LIMITS, SHAPES, SIZES, ExportChoices, Format, Product
from app.export_requests import CancelExport, ExportAction
from app.exporting import Phase, Status
from app.limits import within
from app.progress import clock
from app.readout import Readout
from app.state import Grid
from app.widgets import (
    button,
    capital,
    choice,
    counted,
    elided,
    em,
    font,
    heading,
    labelled,
    number,
    slider,
    text,
    tooltip,
    typed,
    wrapped,
)
from lfcore.key_frames import MAX_FOCUS
from lfcore.quilt import MAX_VIEWS
from lfcore.sweep_plan import GAIN_LIMITS, MAX_FPS, MAX_PLAYS, Layer
from lfcore.sweep_target import Kind

_Chosen = TypeVar("_Chosen", bound=Enum)

_LEAST_FPS = 0.1
_MOST_FRAMES = 9_999  # that can be typed; a file may say more
_ESLF_SIDE = 14  # views that an ESLF holds along each side
_SAME_MODEL = "As in the window"


def draw(context: Context, readout: Readout, fonts: theme.Fonts) -> None:
    """The whole tab."""
    choices = context.state.export
    imgui.dummy(ImVec2(0, 0))
    choices.product = _chosen("What", choices.product, Product, "What is exported")
    _go(context, choices, readout, fonts)
    if choices.product is Product.SWEEP:
        _path(context, choices, fonts)
        _frames(choices)
    elif readout.grid is not None:
        _grid(choices, readout.grid)
    _file(context, choices, readout, fonts)
    _queue(context, readout, fonts)


def _path(context: Context, choices: ExportChoices, fonts: theme.Fonts) -> None:
    heading("Path", fonts)
    choices.shape = choice("Shape", choices.shape, SHAPES, "The way of the viewpoint, at even speed", capital)
    if choices.shape == KEY_FRAMES:
        count = len(choices.key_frames)
        width = (imgui.get_content_region_avail().x - 2 * imgui.get_style().item_spacing.x) / 3
        button(f"Add ({count})", "add key frame", context, width)
        imgui.same_line()
        imgui.begin_disabled(not count)
        button("Remove", "remove key frame", context, width)
        imgui.end_disabled()
        imgui.same_line()
        _, choices.closed = imgui.checkbox("Closed", choices.closed)
        hint = "The path goes back to its first key frame, so that a video can be looped. "
        tooltip(f"{hint}In the pad, a right click adds or removes a key frame.")
    else:
        hint = "Reach from the middle view; 0.5 is the edge of the corner views"
        choices.radius = slider("Reach", choices.radius, RADIUS_LIMITS, number(choices.radius, 2), hint)
    _length(choices)
    half = (imgui.get_content_region_avail().x - imgui.get_style().item_spacing.x) / 2
    button("Stop" if choices.playing else "Play", "play path", context, half)
    imgui.same_line()
    imgui.begin_disabled(bool(choices.fault))
    button("Save path", "save path", context, half)
    imgui.end_disabled()


def _length(choices: ExportChoices) -> None:
    """How many frames at which rate, in one line."""
    labelled("Frames")
    imgui.set_next_item_width(4.4 * em())
    _, frames = imgui.input_int("##frames", choices.frames, 0)
    choices.frames = within(frames, (1, max(_MOST_FRAMES, choices.frames)))
    tooltip("Number of frames")
    imgui.same_line()
    text("at", theme.TEXT_SOFT)
    imgui.same_line()
    unit = "per s"
    imgui.set_next_item_width(
        imgui.get_content_region_avail().x - imgui.calc_text_size(unit).x - imgui.get_style().item_spacing.x
    )
    _, fps = imgui.input_float("##fps", choices.fps, 0.0, 0.0, "%.4g")
    choices.fps = typed(fps, choices.fps, (_LEAST_FPS, MAX_FPS))
    tooltip("Frames per second")
    imgui.same_line()
    text(unit, theme.TEXT_SOFT)


def _focus(choices: ExportChoices) -> None:
    first, last = choices.focus
    limits = (-MAX_FOCUS, MAX_FOCUS)
    if choices.shape == KEY_FRAMES:
        of_keys = ", ".join(number(key.focus or 0.0, 1) for key in choices.key_frames)
        text(elided(f"{of_keys} px", imgui.get_content_region_avail().x), theme.TEXT_FAINT)
        tooltip("Disparity in focus at the key frames, px from corner to corner")
    else:
        first = _decimal("From", first, limits, "%.1f", "Disparity in focus where the path begins, px from corner to corner")
        last = _decimal("To", last, limits, "%.1f", "Disparity in focus where the path ends; closed ones go back")
    choices.focus = (first, last)
    choices.aperture = slider(
        "Aperture", choices.aperture, (0.0, 2.0), number(choices.aperture, 2), "Its diameter in baselines"
    )


def _frames(choices: ExportChoices) -> None:
    layers = {layer: name for name, layer in LAYERS.items()}
    hint = "What the frames show. Differences are shown at captured views only."
    choices.layer = LAYERS[choice("Show", layers[choices.layer], tuple(LAYERS), hint)]
    if choices.layer is Layer.ERROR:
        logarithmic = imgui.SliderFlags_.logarithmic.value
        hint = "The colours end at white divided by this."
        choices.gain = slider("Gain", choices.gain, GAIN_LIMITS, f"× {choices.gain:.1f}", hint, logarithmic)
    _size(choices)
    _, choices.labels = imgui.checkbox("Labels", choices.labels)
    tooltip("Captions with (u, v), and the scales of colours")
    imgui.same_line(0, em() * 0.9)
    _, choices.brighten = imgui.checkbox("Brighten", choices.brighten)
    tooltip("The display tone for dark captures: ^(1/1.5), saturation × 1.5")
    imgui.same_line(0, em() * 0.9)
    _, choices.refocus = imgui.checkbox("Focus", choices.refocus)
    tooltip(
        "Frames are the mean of the views within an aperture, shifted to the disparity in focus. Key frames have that of the "
        "tab Focus when they were added."
    )
    if choices.refocus:
        _focus(choices)


def _size(choices: ExportChoices) -> None:
    """One of the usual sizes, or that of a saved sweep."""
    usual = next((name for name, scale in SIZES.items() if scale == choices.scale), None)
    shown = usual or f"{100 * choices.scale:.4g} % (as saved)"
    chosen = choice("Size", shown, tuple(dict.fromkeys((*SIZES, shown))), "Of the views' own size")
    choices.scale = SIZES.get(chosen, choices.scale)


def _grid(choices: ExportChoices, grid: Grid) -> None:
    if choices.product is Product.QUILT:
        choices.columns = _whole("Across", choices.columns, (1, MAX_VIEWS), "Views in a row of the quilt")
        choices.rows = _whole("Down", choices.rows, (2, MAX_VIEWS), "Rows of the quilt")
        _, choices.refocus = imgui.checkbox("Screen's plane", choices.refocus)
        tooltip("Shift the views so that a disparity lies in the plane of the screen; else it is 0")
        if choices.refocus:
            hint = "The disparity in the plane of the screen, px from corner to corner"
            plane = _decimal("Focus", choices.focus[0], (-MAX_FOCUS, MAX_FOCUS), "%.1f", hint)
            choices.focus = (plane, choices.focus[1])
        width, height = choices.columns * grid.width, choices.rows * grid.height
        text(f"{width} × {height} px", theme.TEXT_FAINT)
        return
    most = _ESLF_SIDE if choices.product is Product.ESLF else MAX_VIEWS
    choices.side = _whole("Views", min(choices.side, most), (2, most), "Views along each side, from corner to corner")


def _file(context: Context, choices: ExportChoices, readout: Readout, fonts: theme.Fonts) -> None:
    heading("File", fonts)
    if choices.product is Product.SWEEP:
        choices.format = _chosen("Kind", choices.format, Format, "Frames go into a folder: PNG to look at, EXR to compute with")
        if choices.format.counts_plays:
            choices.plays = _whole("Plays", choices.plays, (0, MAX_PLAYS), "How often it is played; 0: for ever")
    models = (_SAME_MODEL, *readout.models)
    model = choice("Model", choices.model or _SAME_MODEL, models, "The model that makes the views; realtime is the fastest")
    choices.model = "" if model == _SAME_MODEL else model
    _folder(context, choices)
    _take_keyboard(choices, "Name")
    choices.name = _typed("Name", choices.name, "The file's name, without the ending of its kind")


def _go(context: Context, choices: ExportChoices, readout: Readout, fonts: theme.Fonts) -> None:
    """The button, and below it why it cannot be pressed, what it replaces, or how long the video will be: where all of it is
    seen together."""
    fault = choices.fault
    imgui.begin_disabled(bool(fault))
    button("Export", "export", context, imgui.get_content_region_avail().x)
    imgui.end_disabled()
    with font(fonts.regular, theme.SMALL):
        if fault:
            wrapped(fault, theme.WARNING)
        elif readout.grid is not None and choices.replaces((readout.grid.width, readout.grid.height)):
            wrapped("Replaces the file of that name", theme.WARNING)
        elif choices.product is Product.SWEEP:
            lasts = f"{choices.frames / choices.fps:.1f} s of video"
            text(lasts if choices.format.kind is Kind.VIDEO else counted(choices.frames, "frame"), theme.TEXT_FAINT)


def _folder(context: Context, choices: ExportChoices) -> None:
    ask = "\N{HORIZONTAL ELLIPSIS}"
    room = imgui.calc_text_size(ask).x + 2 * imgui.get_style().frame_padding.x + imgui.get_style().item_spacing.x
    _take_keyboard(choices, "Folder")
    _labelled("Folder", room)
    _, choices.folder = imgui.input_text("##Folder", choices.folder)
    tooltip("Where it is written")
    imgui.same_line()
    if imgui.button(f"{ask}##folder"):
        context.requests.append(ExportAction.CHOOSE_FOLDER)
    tooltip("Choose the place by the system's dialog")


def _take_keyboard(choices: ExportChoices, field: str) -> None:
    """The next field, of that name, takes the keyboard if a command has asked for it."""
    if choices.typing == field:
        imgui.set_keyboard_focus_here()
        choices.typing = ""


def _queue(context: Context, readout: Readout, fonts: theme.Fonts) -> None:
    if not readout.exports:
        return
    heading("Exports", fonts)
    for status in reversed(readout.exports):
        imgui.push_id(status.number)
        with font(fonts.regular, theme.SMALL):
            _job(context, status)
        imgui.pop_id()
    if any(status.phase.over for status in readout.exports):
        if imgui.button("Clear", ImVec2(imgui.get_content_region_avail().x, 0)):
            context.requests.append(ExportAction.CLEAR)
        tooltip("Forget those that are over; files stay")
    choices = context.state.export
    if choices.seen_exports < readout.exports[-1].number:  # a new one has come: into sight with it
        choices.seen_exports = readout.exports[-1].number
        imgui.set_scroll_here_y(1.0)


def _job(context: Context, status: Status) -> None:
    width = imgui.get_content_region_avail().x
    text(elided(status.target.name, width))
    tooltip(f"{status.title}\n{status.target}")
    if status.phase is Phase.DONE:
        wrapped(f"Written in {clock(status.seconds)}: {status.target}", theme.GOOD)
    elif status.phase is Phase.FAILED:
        wrapped(status.message, theme.ERROR)
    elif status.phase is Phase.CANCELLED:
        text("Cancelled", theme.TEXT_FAINT)
    else:
        imgui.progress_bar(status.done / max(status.total, 1), ImVec2(-1, em() * 0.4), "")
        text(progress_words(status), theme.TEXT_SOFT)
        imgui.same_line()
        cancel = "Cancel"
        room = imgui.calc_text_size(cancel).x + 2 * imgui.get_style().frame_padding.x
        imgui.set_cursor_pos_x(imgui.get_cursor_pos_x() + max(imgui.get_content_region_avail().x - room, 0))
        if imgui.small_button(cancel):
            context.requests.append(CancelExport(status.number))
        tooltip("Give it up; nothing of it stays")


def progress_words(status: Status) -> str:
    """How far a job is, how fast, and how long it will take."""
    if status.phase is Phase.WAITING:
        return "Waiting"
    words = f"{status.done} of {status.total}"
    if status.rate is not None and status.seconds_left is not None:
        words += f", {status.rate:.1f}/s, {clock(status.seconds_left)} left"
    return words


def _chosen(label: str, value: _Chosen, kind: type[_Chosen], hint: str) -> _Chosen:
    """A list of all members of an enumeration, by their values."""
    return kind(choice(label, value.value, [each.value for each in kind], hint))


def _labelled(label: str, room: float = 0.0) -> None:
    """The label of a field that fills the line, but for `room` at its end."""
    labelled(label)
    imgui.set_next_item_width(imgui.get_content_region_avail().x - room)


def _whole(label: str, value: int, limits: tuple[int, int], hint: str) -> int:
    _labelled(label)
    _, value = imgui.input_int(f"##{label}", value)
    tooltip(hint)
    return within(value, limits)


def _decimal(label: str, value: float, limits: tuple[float, float], shown: str, hint: str) -> float:
    _labelled(label)
    _, changed = imgui.input_float(f"##{label}", value, 1.0, 5.0, shown)
    tooltip(hint)
    return typed(changed, value, limits)


def _typed(label: str, value: str, hint: str) -> str:
    _labelled(label)
    _, value = imgui.input_text(f"##{label}", value)
    tooltip(hint)
    return value
