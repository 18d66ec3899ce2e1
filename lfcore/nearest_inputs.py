"""Synthesis from the four captured views around the viewpoint, in place of the four corners.

The paper's setting is four views and no more. Of a whole capture there are others between them, and the nearer the inputs, the
better the picture. Captured views are its inputs then, so it has no score by any protocol of this program.
"""

from __future__ import annotations

import hashlib
import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from lfcore.coarse_colours import CoarseColours
from lfcore.errors import InputError
from lfcore.illum import aperture_of_part
from lfcore.lightfield import EXTRAPOLATION_LIMIT, FloatArray, LightField, check_viewpoint
from lfcore.synthesis import LateSynthesis, Synthesis, Synthesizer, WeighingSynthesizer, never, weighs

NEIGHBOURS = "neighbours"


@dataclass(frozen=True)
class Cell:
    """Four captured views, the corners of a part of the grid. All numbers count views."""

    row: int  # of the upper two
    column: int  # of the left two
    rows: int  # from the upper to the lower ones
    columns: int  # from the left to the right ones

    @classmethod
    def whole(cls, light_field: LightField) -> Cell:
        """The one whose views are the corners of the grid."""
        return cls(0, 0, light_field.rows - 1, light_field.columns - 1)

    @property
    def places(self) -> tuple[tuple[int, int], ...]:
        """(row, column) of its views, row by row."""
        lines, places = (self.row, self.row + self.rows), (self.column, self.column + self.columns)
        return tuple(itertools.product(lines, places))

    def of(self, light_field: LightField) -> LightField:
        """The four views as a light field of their own; it shares the memory of the whole."""
        views = light_field.views[self.row :: self.rows, self.column :: self.columns][:2, :2]
        return replace(light_field, views=views, dark=frozenset(), aperture=aperture_of_part(light_field, self.rows))

    def within(self, light_field: LightField, u: float, v: float) -> tuple[float, float]:
        """(u, v) of the whole in units of the cell: from 0 to 1 between its views."""
        return (
            (u * (light_field.columns - 1) - self.column) / self.columns,
            (v * (light_field.rows - 1) - self.row) / self.rows,
        )

    def share(self, light_field: LightField) -> float:
        """Its side, in units of the baseline from corner to corner of the whole."""
        return self.columns / (light_field.columns - 1)


def cell_around(light_field: LightField, u: float, v: float) -> Cell:
    """The smallest cell around (u, v) in which no view is dark; where there is none, the whole grid.

    Its sides are equal parts of the baselines, since one disparity holds along both; on a grid of V x U views there are as many
    parts as (V - 1) and (U - 1) have in common. Of several cells, that with its middle nearest. Beyond the corners cells grow:
    none is left by more than EXTRAPOLATION_LIMIT of its side. Raises InputError outside the allowed range.
    """
    check_viewpoint(u, v)
    parts = math.gcd(light_field.rows - 1, light_field.columns - 1)
    for size in range(1, parts + 1):
        rows, columns = ((count - 1) // parts * size for count in (light_field.rows, light_field.columns))
        starts = _starts(light_field.rows, rows, v), _starts(light_field.columns, columns, u)
        cells = [Cell(row, column, rows, columns) for row, column in itertools.product(*starts)]
        fitting = [cell for cell in cells if light_field.dark.isdisjoint(cell.places)]
        if fitting:
            return min(fitting, key=lambda cell: math.dist(cell.within(light_field, u, v), (0.5, 0.5)))
    return Cell.whole(light_field)


def _starts(count: int, side: int, place: float) -> list[int]:
    """The first views along an axis of so many, from which a side reaches around a place, 0 to 1 from end to end."""
    inside, limit = min(max(place, 0.0), 1.0) * (count - 1), EXTRAPOLATION_LIMIT * side
    outside = abs(place * (count - 1) - inside)
    return [first for first in range(count - side) if first <= inside <= first + side and outside <= limit]


class _Colours:
    """Colours of the captured views in the coarse, found when first asked for; they take a hundredth of a view's memory."""

    def __init__(self, light_field: LightField) -> None:
        self._light_field = light_field
        self._coarse = CoarseColours(light_field.height, light_field.width)
        self._known: dict[tuple[int, int], FloatArray] = {}

    def given_to(self, image: FloatArray, cell: Cell, at: tuple[float, float]) -> FloatArray:
        """The image (H, W, 3) at a place in the cell with the colours of the cell's views there, by nearness; 0 to 1."""
        u, v = (min(max(place, 0.0), 1.0) for place in at)
        shares = (1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v
        wanted = sum(np.float32(share) * self._of(place) for share, place in zip(shares, cell.places, strict=True))
        coloured = self._coarse.spread(wanted - self._coarse.of(image))
        coloured += image
        return np.clip(coloured, 0, 1, out=coloured)

    def _of(self, place: tuple[int, int]) -> FloatArray:
        if place not in self._known:
            self._known[place] = self._coarse.of(self._light_field.view(*place))
        return self._known[place]


class NearestInputs:
    """Another model, given the nearest inputs; see lfcore.synthesis.Synthesizer. Disparities are those of the whole grid.

    The other takes the inputs over anew when the viewpoint goes from one cell to the next. Memory: the light field's own.

    Networks that have learnt how a camera's corner views differ in colour from the views between them would change the colours
    of neighbours too, which differ by less. So colours in the coarse are taken from the inputs, unless these are the corners.
    """

    name = NEIGHBOURS

    def __init__(self, model: Synthesizer) -> None:
        self._model = model
        self.key = hashlib.blake2b(f"{NEIGHBOURS} {model.key}".encode(), digest_size=16).hexdigest()
        self._light_field: LightField | None = None
        self._colours: _Colours | None = None
        self._cell: Cell | None = None  # the one whose views the model has taken

    @property
    def weighs(self) -> bool:
        """See WeighingSynthesizer."""
        return weighs(self._model)

    def set_light_field(self, light_field: LightField) -> None:
        """See Synthesizer. The views around a viewpoint are handed on with its query."""
        self._light_field, self._colours, self._cell = light_field, _Colours(light_field), None

    def synthesize(self, u: float, v: float, cancelled: Callable[[], bool] = never) -> Synthesis:
        """See Synthesizer; the warped inputs are those of the cell, in the order of CORNERS."""
        return self._asked(self._model.synthesize, u, v, cancelled)

    def synthesize_weighed(self, u: float, v: float, cancelled: Callable[[], bool] = never) -> Synthesis:
        """See WeighingSynthesizer."""
        ask = self._model.synthesize_weighed if isinstance(self._model, WeighingSynthesizer) else self._model.synthesize
        return self._asked(ask, u, v, cancelled)

    def _asked(self, ask: Callable[..., Synthesis], u: float, v: float, cancelled: Callable[[], bool]) -> Synthesis:
        light_field = self._light_field
        if light_field is None or self._colours is None:
            raise InputError("No light field is set; call set_light_field first.")
        cell = cell_around(light_field, u, v)
        if cell != self._cell:
            self._cell = None  # whatever the model has, should it fail
            self._model.set_light_field(cell.of(light_field))
            self._cell = cell
        at, share = cell.within(light_field, u, v), cell.share(light_field)
        found = ask(*at, cancelled)
        image = found.image if share == 1 else self._colours.given_to(found.image, cell, at)
        disparity = None if found.disparity is None else found.disparity / np.float32(share)
        if isinstance(found, LateSynthesis):
            late = LateSynthesis(u, v, self.name, image, disparity, None, found.timings, found.weights)
            return late.with_warped(lambda: found.warped)
        return Synthesis(u, v, self.name, image, disparity, found.warped, found.timings, found.weights)
