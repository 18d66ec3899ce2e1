"""The frames of a sweep: what a plan shows at each of its stops, as numbers or as finished 8-bit pictures, one by one."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
import OpenImageIO as oiio

from lfcore import colormaps
from lfcore.cache import SynthesisCache, cache_key
from lfcore.display_tone import brightened
from lfcore.errors import InputError
from lfcore.figures import Cell, Legend, figure
from lfcore.key_frames import Stop
from lfcore.lightfield import FloatArray, LightField
from lfcore.metrics import absolute_error, to_uint8
from lfcore.refocus import aperture_weights, captured_serve, refocus
from lfcore.sweep_plan import Layer, SweepPlan

if TYPE_CHECKING:
    from lfcore.synthesizer import Synthesis, Synthesizer

ByteArray = npt.NDArray[np.uint8]
Synthesize = Callable[[float, float], "Synthesis"]

MAX_SIDE = 16_383  # px of a frame: the most that a WebP, and about what H.264, can hold
_CACHE_BYTES = 256 * 2**20  # of past syntheses: a way back meets those of the way there
_RANGE_STRIDE = 2  # every second row and column tell a range well enough
_SUMMED = 9  # synthesized views a side, where the captured ones are too few


def remembering(light_field: LightField, synthesizer: Synthesizer) -> Synthesize:
    """Syntheses of this light field, which the synthesizer takes over; what was asked before comes from a cache."""
    synthesizer.set_light_field(light_field)
    cache = SynthesisCache(_CACHE_BYTES)

    def synthesize(u: float, v: float) -> Synthesis:
        key = cache_key(light_field, synthesizer, u, v)
        synthesis = cache.get(key)
        if synthesis is None:
            synthesis = synthesizer.synthesize(u, v)
            cache.put(key, synthesis)
        return synthesis

    return synthesize


class SweepFrames:
    """The frames of a plan on one light field. `synthesize` is asked for each view, in the thread that asks for the frame.

    Of error frames the viewpoint is that of the nearest captured view, since elsewhere nobody knows the truth. Refocused frames
    are the mean of the captured views within the aperture where there are 5 x 5 or more and neighbours differ by no more than
    3 px of disparity, else of 9 x 9 synthesized ones. Raises InputError where the light field cannot give what the plan shows.
    """

    def __init__(self, plan: SweepPlan, light_field: LightField, synthesize: Synthesize) -> None:
        self.plan = plan
        self._light_field = light_field
        self._synthesize = synthesize
        self.stops = plan.stops()
        if plan.layer is Layer.ERROR:
            _check_has_truth(light_field)
            self.stops = [_at_captured(stop, light_field) for stop in self.stops]
        pictures = 2 if plan.layer in (Layer.BESIDE_CAPTURED, Layer.BESIDE_DISPARITY) else 1
        if max(light_field.height, pictures * light_field.width) * plan.scale > MAX_SIDE - 100:  # labels take some
            raise InputError(
                f"At scale {plan.scale:g} a frame would be larger than {MAX_SIDE} px a side; choose a smaller one."
            )

    def __len__(self) -> int:
        return len(self.stops)

    def picture(self, index: int) -> ByteArray:
        """Frame `index` as it is to be seen: uint8 (H, W, 3), all of one size."""
        stop = self.stops[index]
        cells = [replace(cell, picture=self._scaled(cell.picture)) for cell in self._cells(stop)]
        if self.plan.labels:
            return figure(cells, columns=len(cells))
        return np.concatenate([cell.picture for cell in cells], axis=1)

    def numbers(self, index: int) -> FloatArray:
        """Frame `index` as numbers to compute with, in the light field's own size and tone: the image (H, W, 3), the disparity
        (H, W, 1) in px over the full baseline, or the absolute error (H, W, 1) with 1 = white. Raises InputError for layers
        that stand side by side."""
        stop = self.stops[index]
        layer = self.plan.layer
        if layer is Layer.IMAGE:
            return self._image(stop)
        if layer is Layer.DISPARITY:
            return self._disparity(stop)[..., None]
        if layer is Layer.ERROR:
            return self._error(stop)[..., None]
        raise InputError(f"Frames of numbers hold one layer, not {layer.value}; choose image, disparity or error.")

    def _cells(self, stop: Stop) -> list[Cell]:
        layer = self.plan.layer
        if layer is Layer.DISPARITY:
            return [self._disparity_cell(stop)]
        if layer is Layer.ERROR:
            return [self._error_cell(stop)]
        image = Cell(self._shown(self._image(stop)), _caption("", stop))
        if layer is Layer.BESIDE_CAPTURED:
            return [image, self._captured_cell(stop)]
        return [image, self._disparity_cell(stop)] if layer is Layer.BESIDE_DISPARITY else [image]

    def _image(self, stop: Stop) -> FloatArray:
        if stop.focus is None:
            return self._synthesize(stop.u, stop.v).image
        weights = aperture_weights(self._summed, (stop.u, stop.v), self.plan.aperture, self._spacing)
        views = (
            ((float(u), float(v)), self._summed_view(index), float(weight))
            for index, ((u, v), weight) in enumerate(zip(self._summed, weights, strict=True))
            if weight > 0
        )
        return refocus(views, (stop.u, stop.v), stop.focus)

    def _disparity(self, stop: Stop) -> FloatArray:
        synthesis = self._synthesize(stop.u, stop.v)
        if synthesis.disparity is None:
            raise InputError(f"The model {synthesis.model} has no disparity; choose another model, or show the image.")
        return synthesis.disparity

    def _error(self, stop: Stop) -> FloatArray:
        truth = self._light_field.view(*self._light_field.nearest(stop.u, stop.v))
        return absolute_error(self._image(stop), truth)

    def _disparity_cell(self, stop: Stop) -> Cell:
        low, high = self._disparity_range
        table = colormaps.disparity_colours()
        legend = Legend(table, f"{low:.1f} px or less", f"{high:.1f} px or more")
        picture = colormaps.apply(table, self._disparity(stop), low, high)
        return Cell(picture, _caption("disparity, px from corner to corner", stop), legend)

    def _error_cell(self, stop: Stop) -> Cell:
        table = colormaps.error_colours()
        end = 1 / self.plan.gain
        legend = Legend(table, "0", f"{100 * end:.1f} % of white or more")
        return Cell(colormaps.apply(table, self._error(stop), 0, end), _caption("absolute error", stop), legend)

    def _captured_cell(self, stop: Stop) -> Cell:
        row, column = self._light_field.nearest(stop.u, stop.v)
        u, v = self._light_field.position(row, column)
        return Cell(self._shown(self._light_field.view(row, column)), _caption("captured", Stop(u, v)))

    def _shown(self, image: FloatArray) -> ByteArray:
        return to_uint8(brightened(image) if self.plan.brighten else image)

    @cached_property
    def _disparity_range(self) -> tuple[float, float]:
        """One range for all frames, so that colours do not flicker: the 1st and 99th percentile from the middle viewpoint."""
        values = self._disparity(Stop(0.5, 0.5))[::_RANGE_STRIDE, ::_RANGE_STRIDE]
        low, high = (float(value) for value in np.percentile(values, (1, 99)))
        return low, high

    @cached_property
    def _captured_serve(self) -> bool:
        """Whether the captured views are summed up: they do, or there is no disparity by which others could be made."""
        if self._synthesize(0.5, 0.5).disparity is None:
            return True
        return captured_serve(self._light_field.rows, self._light_field.columns, self._disparity_range)

    @cached_property
    def _bright(self) -> list[tuple[int, int]]:
        """(row, column) of the captured views that are not too dark to be used."""
        rows, columns, dark = self._light_field.rows, self._light_field.columns, self._light_field.dark
        return [place for place in itertools.product(range(rows), range(columns)) if place not in dark]

    @cached_property
    def _summed(self) -> npt.NDArray[np.float64]:
        """(u, v) of the views that refocusing sums up: (N, 2)."""
        if self._captured_serve:
            return np.array([self._light_field.position(*place) for place in self._bright])
        steps = np.linspace(0, 1, _SUMMED)
        return np.array([(u, v) for v in steps for u in steps])

    @cached_property
    def _spacing(self) -> float:
        if self._captured_serve:
            return 1 / (min(self._light_field.rows, self._light_field.columns) - 1)
        return 1 / (_SUMMED - 1)

    def _summed_view(self, index: int) -> FloatArray:
        if self._captured_serve:
            return self._light_field.view(*self._bright[index])
        u, v = self._summed[index]
        return self._synthesize(float(u), float(v)).image

    def _scaled(self, picture: ByteArray) -> ByteArray:
        if self.plan.scale == 1:
            return picture
        height, width = (max(round(side * self.plan.scale), 1) for side in picture.shape[:2])
        source = oiio.ImageBuf(np.ascontiguousarray(picture))
        scaled = oiio.ImageBufAlgo.resize(source, roi=oiio.ROI(0, width, 0, height, 0, 1, 0, 3))
        pixels = scaled.get_pixels(oiio.UINT8)
        if pixels is None:
            raise RuntimeError(f"OpenImageIO cannot scale a picture: {scaled.geterror()}")
        return np.asarray(pixels, np.uint8)


def _check_has_truth(light_field: LightField) -> None:
    if light_field.rows == light_field.columns == 2:
        raise InputError(
            f"{light_field.name}: found only the four corner views, which are the input; an error needs captured views in "
            "between (at least 3 x 3 views)."
        )


def _at_captured(stop: Stop, light_field: LightField) -> Stop:
    u, v = light_field.position(*light_field.nearest(stop.u, stop.v))
    return Stop(u, v, stop.focus)


def _caption(what: str, stop: Stop) -> str:
    place = f"u {stop.u:.2f}  v {stop.v:.2f}"
    focus = "" if stop.focus is None else f"  focus {stop.focus:.1f} px"
    return f"{what}  {place}{focus}".strip()
