"""From a raw capture of a Lytro camera to a light field, step by step."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
import torch

from lfcore.decode.calibration import Choice, Rule, choose_white_image
from lfcore.decode.colour import camera_to_screen, gains, stored_values, upright
from lfcore.decode.demosaic import LensProfile, ViewPlaces, Weights, estimate, weights
from lfcore.decode.grid import LensGrid
from lfcore.decode.grid_check import check_metadata
from lfcore.decode.grid_fit import GridFit, GridNotFound, grid_of_capture, grid_of_white_image
from lfcore.decode.kept import DecodedStore, key_of
from lfcore.decode.resample import HALF_ROW, PictureGrid, centres_inside, lens_columns, lens_rows, picture_grid, resample
from lfcore.decode.shading import lens_profile, light_on_pixels, mend_hot_pixels, relative_light
from lfcore.decode.unpack import Mosaic, unpack
from lfcore.errors import Cancelled, InputError, OutputError
from lfcore.formats.dark import find_dark_views
from lfcore.formats.lytro.container import Container, open_container
from lfcore.formats.lytro.contents import raw_file
from lfcore.formats.lytro.metadata import Capture, RawImage, read_capture
from lfcore.lightfield import LightField

ACROSS = 14  # views across a microlens, as in the ESLF

_ROWS = 48  # pixel rows of the views made at a time
_OTHER_GRID = 0.3  # px: farther from the white image's grid, the capture's own is used
# Light under a microlens until it is measured: what the views in the middle are weighted by.
_TYPICAL_PROFILE = LensProfile((0.0, 0.5, 0.9, 1.0), (1.0, 0.85, 0.6, 0.3))


@dataclass(frozen=True)
class DecodeOptions:
    """What to make of a capture.

    `views`: side of the middle square of the 14 x 14 views. `every_row`: keep all rows of microlenses (625 x 434 px of an
    Illum) in place of one pixel per pitch as in the ESLF (541 x 376 px). `linear`: linear light, 16 bits, no sRGB curve.
    `depth`: 8 or 16 bits.
    """

    views: int = ACROSS
    every_row: bool = False
    linear: bool = False
    depth: int = 8

    def __post_init__(self) -> None:
        if not 2 <= self.views <= ACROSS:
            raise InputError(f"{self.views} x {self.views} views were asked for; expected from 2 x 2 to {ACROSS} x {ACROSS}.")
        if self.depth not in (8, 16):
            raise InputError(f"{self.depth} bits were asked for; views have 8 or 16.")

    @property
    def stored_depth(self) -> int:
        """Bits per value: linear light needs 16."""
        return 16 if self.linear else self.depth


@dataclass(frozen=True)
class _Prepared:
    """A capture before its views are made: light on the pixels, and where the views lie in it."""

    light: torch.Tensor  # (H, W)
    picture: PictureGrid
    kernel: Weights


def decode_capture(
    path: str | os.PathLike[str],
    calibration: str | os.PathLike[str] | None = None,
    options: DecodeOptions | None = None,
    progress: Callable[[float], None] | None = None,
    cancelled: Callable[[], bool] = lambda: False,
) -> LightField:
    """The light field of a raw capture: views uint8 or uint16, upright.

    `calibration` is where white images are looked for first (see lfcore.decode.calibration). `progress` is called with
    rising shares up to 1, `cancelled` is asked often. Raises InputError where the file is no capture, is damaged or shows no
    microlenses, Cancelled where `cancelled` says so.
    """
    steps = _Steps(progress, cancelled)
    container, capture = _open(Path(path))
    choice = choose_white_image(container, capture, calibration)
    return _decode(container, capture, choice, options or DecodeOptions(), steps)


def open_capture(
    path: str | os.PathLike[str],
    options: DecodeOptions,
    store: DecodedStore,
    progress: Callable[[float], None] | None = None,
    cancelled: Callable[[], bool] = lambda: False,
) -> LightField:
    """As `decode_capture`, but taken from the store where it was decoded before, and else kept there if that can be done."""
    steps = _Steps(progress, cancelled)
    container, capture = _open(Path(path))
    choice = choose_white_image(container, capture)
    key = _key(container, choice, options)
    kept = store.get(key)
    if kept is not None:
        steps.reach(1.0)
        return replace(kept, name=container.path.stem, source=str(container.path))
    light_field = _decode(container, capture, choice, options, steps)
    with contextlib.suppress(OutputError):  # no room or no permission: it will be decoded again
        store.put(key, light_field)
    return light_field


def is_kept(path: str | os.PathLike[str], options: DecodeOptions, store: DecodedStore) -> bool:
    """Whether `open_capture` would find the capture decoded."""
    container, capture = _open(Path(path))
    return store.holds(_key(container, choose_white_image(container, capture), options))


def _key(container: Container, choice: Choice, options: DecodeOptions) -> str:
    return key_of(tuple(section.name for section in container.sections), choice, options)


def _decode(container: Container, capture: Capture, choice: Choice, options: DecodeOptions, steps: _Steps) -> LightField:
    mosaic = _mosaic(container, capture)
    steps.reach(0.1)
    mended = mend_hot_pixels(mosaic, capture.raw)
    steps.reach(0.15)
    fit, profile, white = _calibrate(container.path, capture, mosaic, choice)
    steps.reach(0.3)
    light = light_on_pixels(mosaic, capture.raw, gains(capture.facts, capture.raw), white)
    del mosaic
    steps.reach(0.35)
    places = ViewPlaces(options.views, fit.grid.pitch / ACROSS, fit.grid.rotation)
    matrix = camera_to_screen(capture.facts)
    kernel = weights(fit.grid.pitch, places, capture.raw.cfa, profile, matrix, white is None)
    steps.reach(0.45)
    sensor = capture.raw.height, capture.raw.width
    picture = picture_grid(fit.grid, sensor, HALF_ROW if options.every_row else 1.0)
    views = _views(_Prepared(light, picture, kernel), options, steps)
    views = upright(views, capture.facts.orientation)
    return LightField(
        views=views,
        name=container.path.stem,
        source=str(container.path),
        kind=f"{capture.facts.generation.value} raw",
        facts=_facts(capture, choice, fit, mended, options, sensor),
        warnings=_warnings(choice),
        dark=find_dark_views(views),
    )


def coarse_view(path: str | os.PathLike[str]) -> npt.NDArray[np.uint8]:
    """The middle view of a capture, (H, W, 3) uint8 sRGB, upright, without calibration: what can be had in a second."""
    container, capture = _open(Path(path))
    mosaic = _mosaic(container, capture)
    fit = _grid_of_capture(container.path, capture, mosaic)
    light = light_on_pixels(mosaic, capture.raw, gains(capture.facts, capture.raw), None)
    places = ViewPlaces(1, fit.grid.pitch / ACROSS, fit.grid.rotation)
    kernel = weights(fit.grid.pitch, places, capture.raw.cfa, _TYPICAL_PROFILE, camera_to_screen(capture.facts), True)
    picture = picture_grid(fit.grid, (capture.raw.height, capture.raw.width), 1.0)
    views = _views(_Prepared(light, picture, kernel), DecodeOptions(), _Steps(None, lambda: False))
    return np.asarray(upright(views, capture.facts.orientation)[0, 0])


class _Steps:
    """Tells how far the work is, and ends it where nobody wants it any more."""

    def __init__(self, progress: Callable[[float], None] | None, cancelled: Callable[[], bool]) -> None:
        self._progress, self._cancelled = progress, cancelled

    def reach(self, share: float) -> None:
        """`share` of the work is done. Raises Cancelled."""
        if self._cancelled():
            raise Cancelled
        if self._progress is not None:
            self._progress(share)


def _open(path: Path) -> tuple[Container, Capture]:
    container = open_container(path)
    capture = read_capture(container)
    if capture is None or capture.image is None:
        raise InputError(f"{path} holds no raw capture; the raw would be in {raw_file(container, capture)}.")
    return container, capture


def _mosaic(container: Container, capture: Capture) -> Mosaic:
    raw = capture.raw
    assert capture.image is not None
    if capture.image.length != raw.length:
        raise InputError(
            f"{container.path}: the mosaic has {capture.image.length:,} bytes, but {raw.width} x {raw.height} px of "
            f"{raw.packing.bits} bits take {raw.length:,}; the file is damaged or of another camera."
        )
    return unpack(container.data(capture.image), raw.packing, raw.width, raw.height)


def _calibrate(
    path: Path, capture: Capture, mosaic: Mosaic, choice: Choice
) -> tuple[GridFit, LensProfile, torch.Tensor | None]:
    """The grid, the mean light under a microlens, and what each pixel is divided by (None without a white image)."""
    if choice.white is None:
        fit = _grid_of_capture(path, capture, mosaic)
        return fit, lens_profile(mosaic, capture.raw, fit.grid), None
    white, raw = choice.white.mosaic(), choice.white.raw
    try:
        fit = grid_of_white_image(white, _black(raw), capture.lenslets.spacing[0], _row_scale(capture))
    except GridNotFound as error:
        raise InputError(f"{choice.white.label} shows no microlenses; give another calibration, or none.") from error
    profile, light = lens_profile(white, raw, fit.grid), relative_light(white, raw, fit.grid)
    if choice.rule is Rule.NEAREST and (choice.zoom_distance or choice.focus_distance):
        own = _grid_of_capture(path, capture, mosaic)
        if own.share > 0.5 and _distance(own.grid, fit.grid, mosaic.shape) > _OTHER_GRID:
            fit = own
    return fit, profile, light


def _grid_of_capture(path: Path, capture: Capture, mosaic: Mosaic) -> GridFit:
    try:
        return grid_of_capture(mosaic, _black(capture.raw), capture.lenslets.spacing[0], _row_scale(capture))
    except GridNotFound as error:
        raise InputError(
            f"{path} shows no pattern of microlenses about {capture.lenslets.spacing[0]:.1f} px apart; the capture is too "
            "dark, burnt out or of another camera: take it again."
        ) from error


def _black(raw: RawImage) -> float:
    return sum(raw.black) / 4


def _row_scale(capture: Capture) -> float:
    return capture.lenslets.scale[1] / capture.lenslets.scale[0]


def _distance(one: LensGrid, other: LensGrid, sensor: tuple[int, ...]) -> float:
    """Greatest distance in px of the grids at the sensor's corners and middle."""
    y, x = np.meshgrid(*(np.linspace(0, side - 1, 3) for side in sensor), indexing="ij")
    centres = one.centres(*one.nearest(x, y))
    nearest = other.centres(*other.nearest(centres[..., 0], centres[..., 1]))
    return float(np.hypot(*np.moveaxis(nearest - centres, -1, 0)).max())


def _views(prepared: _Prepared, options: DecodeOptions, steps: _Steps) -> npt.NDArray[np.generic]:
    """All views (V, U, H, W, 3), some rows of pixels after the other."""
    picture, kernel = prepared.picture, prepared.kernel
    outputs = kernel.values.shape[1]
    count = round((outputs / 3) ** 0.5)
    dtype = np.uint8 if options.stored_depth == 8 else np.uint16
    views = np.empty((count, count, picture.height, picture.width, 3), dtype)
    whole = np.dtype((np.void, 3 * views.itemsize))  # three colours move as one
    pixels = views.view(whole)[..., 0]
    columns = lens_columns(picture)
    sensor = prepared.light.shape[0], prepared.light.shape[1]
    known = torch.empty(0, columns[1] - columns[0], outputs)  # microlenses that the band before has left
    first_known = lens_rows(picture, 0, 1)[0]
    for begin in range(0, picture.height, _ROWS):
        end = min(begin + _ROWS, picture.height)
        rows = lens_rows(picture, begin, end)
        known = known[rows[0] - first_known :]
        missing = rows[0] + len(known), rows[1]
        centres = centres_inside(picture, missing, columns, sensor, kernel.reach + 1)
        lenses = estimate(prepared.light, centres.reshape(-1, 2), kernel)
        known, first_known = torch.cat([known, lenses.reshape(*centres.shape[:2], outputs)]), rows[0]
        band = resample(known, rows, columns, picture, begin, end)
        stored = stored_values(band, options.linear, options.stored_depth)  # (rows, W, V * U * 3)
        stored = np.ascontiguousarray(stored).reshape(end - begin, picture.width, count, count, 3)
        pixels[:, :, begin:end] = stored.view(whole)[..., 0].transpose(2, 3, 0, 1)
        steps.reach(0.45 + 0.5 * end / picture.height)
    return views


def _facts(
    capture: Capture, choice: Choice, fit: GridFit, mended: int, options: DecodeOptions, sensor: tuple[int, int]
) -> dict[str, str]:
    start = (ACROSS - options.views) // 2
    taken = "all 14 x 14" if options.views == ACROSS else f"the middle {options.views} x {options.views} of 14 x 14"
    numbers = "" if options.views == ACROSS else f" (rows and columns {start} to {start + options.views - 1}, counted from 0)"
    check = check_metadata(fit.grid, capture.lenslets, sensor)
    degrees = np.degrees(fit.grid.rotation)
    facts = {
        "Camera": capture.facts.generation.value,
        "Views taken": taken + numbers,
        "White image": choice.sentence,
        "Microlenses": f"{fit.grid.pitch:.3f} px apart, turned by {degrees:.3f} degrees, residual {fit.residual:.2f} px; "
        + check.sentence,
        "Hot pixels": f"{mended} mended",
        "Light": "linear" if options.linear else "sRGB",
    }
    if capture.assumed:
        facts["Assumed"] = ", ".join(capture.assumed)
    return facts


def _warnings(choice: Choice) -> tuple[str, ...]:
    return (choice.sentence,) if choice.rule is Rule.NONE else ()
