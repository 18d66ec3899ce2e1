"""The values behind the picture on screen, exact: from the very arrays that it is made of, for the part that is asked for.

The shaders draw the same for whole pictures in 8 bits; here it is computed again, pixel by pixel, to be printed.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt
from numpy.lib.stride_tricks import sliding_window_view

from app.geometry import Point
from app.looking import CORNER_COLOURS, LEAN_REACH, LEAN_TOLERANCE, Looking
from app.state import Look
from app.tone import toned
from lfcore import colormaps
from lfcore.lightfield import CORNERS, FloatArray, LightField, as_float

# As lfcore.planesweep and lfcore.tone have them, which would bring torch with them.
_LUMINANCE = np.array([0.2989, 0.5870, 0.1140], np.float32)
_TOE = 0.004

_KEPT = 4  # patches: that of the window, and that under the cursor, of this frame and the last


@dataclass(frozen=True)
class Part:
    """A rectangle of whole pixels of a picture, y downwards; the last ones are not included."""

    left: int
    top: int
    right: int
    bottom: int

    @property
    def slices(self) -> tuple[slice, slice]:
        """Rows and columns."""
        return slice(self.top, self.bottom), slice(self.left, self.right)


@dataclass(frozen=True)
class Patch:
    """What a look shows in a part: values (h, w, 1, 3 or 4) in units in which `unit` is said, and as light (h, w, 3)."""

    part: Part
    values: FloatArray
    light: FloatArray
    decimals: int
    unit: str

    @cached_property
    def labels(self) -> tuple[tuple[int, int, str, bool], ...]:
        """Column, row and values in words of each pixel, and whether it is light."""
        rows, columns = self.values.shape[:2]
        printed = [[_words(self.values[y, x], self.decimals) for x in range(columns)] for y in range(rows)]
        light = (self.light @ _LUMINANCE > 0.45).tolist()
        left, top = self.part.left, self.part.top
        return tuple((left + x, top + y, printed[y][x], bool(light[y][x])) for y in range(rows) for x in range(columns))


def _words(values: FloatArray, decimals: int) -> str:
    return "\n".join(f"{value:.{decimals}f}".replace("-", "\N{MINUS SIGN}") for value in values.tolist())


@dataclass(frozen=True, eq=False)
class Samples:
    """What is on screen of a viewpoint whose synthesis is at hand. `image` (H, W, 3) and `disparity` (H, W) are those of the
    synthesis; `captured` is the camera's own view there, as stored; `partner` is what the synthesis is compared with: the
    image of another model, the captured view, or None where that is neither."""

    light_field: LightField
    viewpoint: Point
    image: FloatArray
    disparity: FloatArray | None
    captured: npt.NDArray[np.generic] | None = None
    partner: npt.NDArray[np.generic] | None = None
    shows_captured: bool = False
    weights: npt.NDArray[np.uint8] | None = None  # (4, H, W), of the inputs in the image, 255 = whole
    _last: dict[object, Patch | None] = field(default_factory=dict, repr=False)  # what was asked for last

    def holds(self, part: Part) -> bool:
        """Whether the part lies inside the picture: some looks show larger ones."""
        height, width = self.image.shape[:2]
        return part.right <= width and part.bottom <= height

    def picture(self, part: Part) -> FloatArray:
        """The picture as stored, 1 = white: (h, w, 3)."""
        shown = self.captured if self.shows_captured and self.captured is not None else self.image
        return as_float(shown[part.slices])

    def error(self, part: Part) -> FloatArray | None:
        """The synthesis less the captured view, of white: (h, w, 3)."""
        return None if self.captured is None else self.image[part.slices] - as_float(self.captured[part.slices])

    def patch(self, look: Look, part: Part, looking: Looking, gain: float, span: tuple[float, float]) -> Patch | None:
        """What the look shows in that part, or None where it has no values here. span: disparities of the first and the
        last colour. The patches that were asked for last are at hand when they are asked for again."""
        if look is not Look.WARPED_ALL and not self.holds(part):
            return None
        wanted = (look, part, looking, gain, span)
        found = self._last.pop(wanted) if wanted in self._last else self._patch(look, part, looking, gain, span)
        self._last[wanted] = found  # as the newest
        if len(self._last) > _KEPT:
            del self._last[next(iter(self._last))]
        return found

    def _patch(self, look: Look, part: Part, looking: Looking, gain: float, span: tuple[float, float]) -> Patch | None:
        if look is Look.SYNTHESIS:
            return self._of_picture(self.picture(part), part, looking)
        if look is Look.SWEEP_MEAN:
            mean = self._swept(part, looking.level)[0]
            return Patch(part, 255 * mean[..., None], toned(_grey(mean), looking.tone), 1, "of 255")
        if look is Look.SWEEP_DEVIATION:
            return _of_map(255 * self._swept(part, looking.level)[1], (0.0, 255 / gain), part, looking, 1, "of 255")
        if look is Look.ERROR:
            return self._difference(part, gain)
        if self.disparity is None:
            return None
        if look is Look.DISPARITY:
            return _of_map(self.disparity[part.slices], span, part, looking, 2, "px over the baseline")
        if look is Look.WARPED_ALL:
            return self._of_picture(self._sheet(part), part, looking)
        if look.corner is not None:
            return self._of_picture(self.warped(look.corner, part), part, looking)
        if look is Look.DISAGREEMENT:
            return _of_map(255 * self._disagreement(part), (0.0, 255 / gain), part, looking, 1, "of 255")
        if look is not Look.LEAN:
            return None
        shares = self.shares(part)
        shown = shares
        if self.weights is not None:
            shown = (shares / np.maximum(shares.max(2, keepdims=True), 1e-6)) ** np.float32(gain)
            shown = shown / np.maximum(shown.sum(2, keepdims=True), 1e-6)
        return Patch(part, 100 * shares, shown @ np.array(CORNER_COLOURS, np.float32), 0, "% of the inputs")

    def warped(self, corner: int, part: Part) -> FloatArray:
        """A corner view, warped by the disparity, as stored, 0 where it has no sample: (h, w, 3)."""
        return self._warped(corner, part)[0]

    def shares(self, part: Part) -> FloatArray:
        """How much of each warped input is in the picture, (h, w, 4) in the order of CORNERS, sum 1: by weights, or where the
        model has told none by how like the picture is to each around the pixel."""
        if self.weights is not None:
            found = np.moveaxis(self.weights[:, *part.slices], 0, 2).astype(np.float32)
            return found / np.maximum(found.sum(2, keepdims=True), 1)
        assert self.disparity is not None
        rows, columns = (np.arange(each.start, each.stop) // 2 for each in part.slices)  # in the grid of every second pixel
        lasts = (self.disparity.shape[0] - 1) // 2, (self.disparity.shape[1] - 1) // 2
        firsts = max(int(rows[0]) - LEAN_REACH, 0), max(int(columns[0]) - LEAN_REACH, 0)
        ends = min(int(rows[-1]) + LEAN_REACH, lasts[0]), min(int(columns[-1]) + LEAN_REACH, lasts[1])
        wide = Part(2 * firsts[1], 2 * firsts[0], 2 * ends[1] + 1, 2 * ends[0] + 1)
        image = self.image[wide.slices]
        squares = [np.where(inside, np.square(seen - image).sum(2), np.float32(1)) for seen, inside in self._all_warped(wide)]
        distances = np.stack([*squares, np.ones_like(squares[0])], axis=2)[::2, ::2]  # (., ., 5); the last counts
        missing = [
            (LEAN_REACH - (int(places[0]) - first), LEAN_REACH - (end - int(places[-1])))
            for places, first, end in zip((rows, columns), firsts, ends, strict=True)
        ]
        padded = np.pad(distances, (*missing, (0, 0)))
        sums = sliding_window_view(padded, (2 * LEAN_REACH + 1,) * 2, axis=(0, 1)).sum((3, 4))
        sums = sums[np.ix_(rows - rows[0], columns - columns[0])]  # (h, w, 5)
        mean = sums[..., :4] / sums[..., 4:]
        likeness = np.exp((mean.min(2, keepdims=True) - mean) / (2 * LEAN_TOLERANCE**2))
        return np.asarray(likeness / likeness.sum(2, keepdims=True), np.float32)

    def _of_picture(self, stored: FloatArray, part: Part, looking: Looking) -> Patch:
        return Patch(part, 255 * stored, toned(stored, looking.tone), 0, "of 255")

    def _difference(self, part: Part, gain: float) -> Patch | None:
        if self.partner is None:
            return None
        difference = self.image[part.slices] - as_float(self.partner[part.slices])
        return Patch(part, 255 * difference, np.clip(gain * np.abs(difference), 0, 1), 1, "of 255")

    def _disagreement(self, part: Part) -> FloatArray:
        seen, counts = (np.stack(each) for each in zip(*self._all_warped(part), strict=True))
        return np.asarray(np.sqrt(np.square(_deviation(seen, counts[..., None])).mean(axis=2)), np.float32)

    def _swept(self, part: Part, level: float) -> tuple[FloatArray, FloatArray]:
        """Mean and deviation of the plane sweep, (h, w) each."""
        flat = np.full((part.bottom - part.top, part.right - part.left), level, np.float32)
        found = [self._shifted(corner, flat, part, root=True) for corner in range(len(CORNERS))]
        seen, counts = (np.stack(each) for each in zip(*found, strict=True))
        seen = seen[..., 0]
        return _mean(seen, counts), _deviation(seen, counts)

    def _sheet(self, part: Part) -> FloatArray:
        """The four warped inputs beside each other, (h, w, 3); the part is one of the sheet."""
        height, width = self.image.shape[:2]
        values = np.zeros((part.bottom - part.top, part.right - part.left, 3), np.float32)
        for corner, (u, v) in enumerate(CORNERS):
            x, y = int(u) * width, int(v) * height  # where the input lies
            left, top = max(part.left, x), max(part.top, y)
            right, bottom = min(part.right, x + width), min(part.bottom, y + height)
            if left < right and top < bottom:
                place = Part(left - part.left, top - part.top, right - part.left, bottom - part.top)
                seen = Part(left - x, top - y, right - x, bottom - y)
                values[place.slices] = self.warped(corner, seen)
        return values

    def _all_warped(self, part: Part) -> list[tuple[FloatArray, npt.NDArray[np.bool_]]]:
        return [self._warped(corner, part) for corner in range(len(CORNERS))]

    def _warped(self, corner: int, part: Part) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
        assert self.disparity is not None
        return self._shifted(corner, self.disparity[part.slices], part, root=False)

    def _shifted(self, corner: int, disparity: FloatArray, part: Part, root: bool) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
        """A corner view, or its luminance in the root tone, warped by a disparity (h, w) of this part, 0 where it has no
        sample; and where it has one."""
        u, v = CORNERS[corner]
        view = self.light_field.views[-int(v), -int(u)]  # (H, W, 3), as stored
        height, width = view.shape[:2]
        y, x = np.mgrid[part.slices].astype(np.float32)
        x = x + np.float32(u - self.viewpoint[0]) * disparity
        y = y + np.float32(v - self.viewpoint[1]) * disparity
        inside = (x >= 0) & (x <= width - 1) & (y >= 0) & (y <= height - 1)
        first_x, first_y = np.floor(x).astype(int), np.floor(y).astype(int)
        across, down = _cubic_taps(x - first_x), _cubic_taps(y - first_y)
        total = np.zeros((*disparity.shape, 1 if root else 3), np.float32)
        for j in range(4):
            rows = np.clip(first_y + j - 1, 0, height - 1)
            for i in range(4):
                stored = as_float(view[rows, np.clip(first_x + i - 1, 0, width - 1)])
                value = np.sqrt(np.maximum(stored @ _LUMINANCE, 0) + _TOE)[..., None] if root else stored
                total += (down[j] * across[i])[..., None] * value
        return np.where(inside[..., None], total, np.float32(0)), inside


def _cubic_taps(t: FloatArray) -> tuple[FloatArray, ...]:
    """Weights of the samples at -1, 0, 1, 2 (Keys 1981, a = -0.5)."""
    t2, t3 = t * t, t * t * t
    return -0.5 * t3 + t2 - 0.5 * t, 1.5 * t3 - 2.5 * t2 + 1, -1.5 * t3 + 2 * t2 + 0.5 * t, 0.5 * t3 - 0.5 * t2


def _mean(seen: FloatArray, counts: npt.NDArray[np.bool_]) -> FloatArray:
    """Over the first dimension, of what counts."""
    return np.asarray((seen * counts).sum(0) / np.maximum(counts.sum(0), 1), np.float32)


def _deviation(seen: FloatArray, counts: npt.NDArray[np.bool_]) -> FloatArray:
    """Standard deviation (N - 1) over the first dimension, of what counts; 0 where fewer than two do."""
    squares = np.square((seen - _mean(seen, counts)) * counts).sum(0)
    return np.asarray(np.sqrt(squares / np.maximum(counts.sum(0) - 1, 1)), np.float32)


def _of_map(values: FloatArray, span: tuple[float, float], part: Part, looking: Looking, decimals: int, unit: str) -> Patch:
    light = as_float(colormaps.apply(colormaps.colours(looking.colour_map), values, *span))
    return Patch(part, values[..., None], light, decimals, unit)


def _grey(values: FloatArray) -> FloatArray:
    return np.repeat(values[..., None], 3, axis=2)
