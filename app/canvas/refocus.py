"""Refocusing: the views inside an aperture, shifted so that one disparity falls onto itself, and summed up.

A few views give the first picture of a new focus at once. All of them are then summed up over the next frames, so that no
frame takes long, and take its place. The result is that of lfcore.refocus, whose weights these are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import moderngl
import numpy as np
import numpy.typing as npt

from app.canvas.gathered import Captured, Gathered, Synthesized
from app.canvas.passes import Passes
from app.canvas.textures import Picture, Textures, make_texture
from app.geometry import Point
from app.limits import within
from app.tone import Tone
from lfcore.refocus import aperture_weights

_COARSE = 10  # views, as in refocus_coarse.frag
_MOST = 16  # views of a chunk, as in refocus_row.frag
_NEW_VIEWS = 8  # while views are still coming, the coarse picture is drawn again after so many
_READS_PER_FRAME = 4_000_000  # of pixels, about a millisecond for each million where two cores of a processor draw
_TAPS = 4

_Value = TypeVar("_Value")


@dataclass(frozen=True)
class Wanted:
    """A refocused picture: the viewpoint, the disparity that is sharp (px over the baseline), the aperture's diameter (in
    baselines), and whether captured views are summed up or such as are drawn in between."""

    viewpoint: Point
    focus: float
    aperture: float
    captured: bool


@dataclass(frozen=True)
class _Chunk:
    """Views of one row that are summed up together."""

    tiles: tuple[tuple[int, int], ...]
    across: tuple[float, ...]  # shifts, px
    weights: tuple[float, ...]
    down: float


class Refocused:
    """Makes refocused pictures at the light field's own size."""

    def __init__(self, context: moderngl.Context, passes: Passes, textures: Textures) -> None:
        self._context = context
        self._passes = passes
        self._textures = textures
        self._views: tuple[npt.NDArray[np.generic], frozenset[tuple[int, int]]] | None = None
        self._captured: Captured | None = None
        self._synthesized: Synthesized | None = None
        self._sums: _Sums | None = None
        self._summing: tuple[object, ...] = ()  # what is being, or has been, summed up
        self._waiting: list[_Chunk] = []
        self._summed_up = 0  # chunks
        self.words = ""  # which views are summed up

    def set_views(self, views: npt.NDArray[np.generic], dark: frozenset[tuple[int, int]]) -> None:
        """Take the captured views (V, U, H, W, 3), of which `dark` ones, by row and column, are left out."""
        self._views = (views, dark)

    def redraw_between(self) -> None:
        """Draw views in between anew."""
        if self._synthesized is not None:
            self._synthesized.redraw()

    def advance(self, wanted: Wanted) -> bool:
        """Do the part of one frame; whether more is to be done in the next."""
        gathered = self.gathered(wanted.captured)
        gathered.fill()
        # The first frame has its coarse picture to draw; while the focus or the viewpoint moves, every frame is a first one.
        if not self._begin(wanted, gathered) and self._waiting:
            self._sum_up(gathered)
        return not gathered.complete or bool(self._waiting)

    def picture(self, wanted: Wanted, tone: Tone) -> moderngl.Texture | None:
        """The best picture there is by now, or None where no view is there yet."""
        gathered = self.gathered(wanted.captured)
        if not gathered.usable.any():
            return None
        self._begin(wanted, gathered)
        sums = self._at_hand
        done = gathered.complete and not self._waiting
        stage = gathered.version if gathered.complete else gathered.version // _NEW_VIEWS
        if sums.picture.outdated("refocused", wanted, gathered, stage, done, tone):
            sums.picture.target.use()
            if done:
                self._passes.toned("refocused.frag", tone).render({"sum": sums.sum}, {})
            else:
                self._coarse(wanted, gathered, tone)
        return sums.picture.texture

    def gathered(self, captured: bool) -> Gathered:
        """The views that are summed up."""
        if captured:
            if self._captured is None:
                assert self._views is not None
                self._captured = Captured(self._context, *self._views)
            return self._captured
        if self._synthesized is None:
            self._synthesized = Synthesized(self._context, self._passes, self._textures)
        return self._synthesized

    def release(self) -> None:
        """Give the memory of the graphics back."""
        for each in (self._captured, self._synthesized, self._sums):
            if each is not None:
                each.release()

    @property
    def _at_hand(self) -> _Sums:
        if self._sums is None:
            self._sums = _Sums(self._context, self._textures)
        return self._sums

    def _begin(self, wanted: Wanted, gathered: Gathered) -> bool:
        """Start anew where something else is wanted than what is being summed up; whether it is."""
        summing = (wanted, gathered, gathered.version)
        if summing == self._summing:
            return False
        self._summing = summing
        self._waiting = _chunks(wanted, gathered, self._chunk_size) if gathered.complete else []
        self.words = gathered.words(int(np.count_nonzero(_weights(wanted, gathered))))
        self._summed_up = 0
        return True

    @property
    def _chunk_size(self) -> int:
        width, height = self._textures.size
        return within(_READS_PER_FRAME // (width * height * _TAPS) - 1, (1, _MOST))

    def _sum_up(self, gathered: Gathered) -> None:
        sums = self._at_hand
        width, height = self._textures.size
        reads = 0
        while self._waiting and (reads == 0 or reads < _READS_PER_FRAME // 2):
            chunk = self._waiting.pop(0)
            sums.row_target.use()
            count = len(chunk.tiles)
            self._passes.get("refocus_row.frag").render(
                {"views": gathered.texture},
                {
                    "size": gathered.size,
                    "count": count,
                    "tiles": _padded(chunk.tiles, (0, 0), _MOST),
                    "shifts": _padded(chunk.across, 0.0, _MOST),
                    "weights": _padded(chunk.weights, 0.0, _MOST),
                },
            )
            sums.sum_target.use()
            if self._summed_up:  # the first takes the place of what was there before
                self._context.enable_only(moderngl.BLEND)
                self._context.blend_func = moderngl.ONE, moderngl.ONE
            self._passes.get("refocus_column.frag").render({"row": sums.row}, {"shift": chunk.down})
            self._context.disable(moderngl.BLEND)
            self._summed_up += 1
            reads += width * height * _TAPS * (count + 1)

    def _coarse(self, wanted: Wanted, gathered: Gathered, tone: Tone) -> None:
        chosen = coarse_views(_weights(wanted, gathered), gathered.positions, wanted)
        numbers, counts = np.unique(chosen, return_counts=True)
        shifts = np.round((gathered.positions[numbers] - wanted.viewpoint) * wanted.focus).astype(int)
        weights = counts / counts.sum()
        self._passes.toned("refocus_coarse.frag", tone).render(
            {"views": gathered.texture},
            {
                "size": gathered.size,
                "tiles": _padded([gathered.tile(int(index)) for index in numbers], (0, 0), _COARSE),
                "shifts": _padded([(int(x), int(y)) for x, y in shifts], (0, 0), _COARSE),
                "weights": _padded(weights.tolist(), 0.0, _COARSE),
            },
        )


class _Sums:
    """What refocusing draws into."""

    def __init__(self, context: moderngl.Context, textures: Textures) -> None:
        self.row = make_texture(context, textures.size, 4, "f4")
        self.row_target = context.framebuffer([self.row])
        self.sum = make_texture(context, textures.size, 4, "f4")
        self.sum_target = context.framebuffer([self.sum])
        self.picture = Picture(context, textures.size, textures.picture_type, textures)

    def release(self) -> None:
        """Give the memory of the graphics back."""
        for each in (self.row_target, self.sum_target, self.row, self.sum, self.picture):
            each.release()


def coarse_views(weights: npt.NDArray[np.float64], positions: npt.NDArray[np.float64], wanted: Wanted) -> npt.NDArray[np.intp]:
    """The numbers of _COARSE views, some of them repeated, that are spread over the aperture as evenly as can be.

    weights: (N,), 0 for views that are not there or not inside. The points of a sunflower (Vogel 1979), each moved to the
    nearest view inside.
    """
    inside = np.flatnonzero(weights)
    k = np.arange(_COARSE) + 0.5
    radius, angle = wanted.aperture / 2 * np.sqrt(k / _COARSE), k * np.pi * (3 - np.sqrt(5))
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle)], 1) + wanted.viewpoint  # (_COARSE, 2)
    distance = np.hypot(*(points[:, None] - positions[inside]).transpose(2, 0, 1))  # (_COARSE, inside)
    return inside[np.argmin(distance, 1)]


def _weights(wanted: Wanted, gathered: Gathered) -> npt.NDArray[np.float64]:
    """Of each view that is there, by where it lies in the aperture: (N,)."""
    weights = np.zeros(len(gathered.positions))
    there = np.flatnonzero(gathered.usable)
    weights[there] = aperture_weights(gathered.positions[there], wanted.viewpoint, wanted.aperture, gathered.spacing)
    return weights


def _chunks(wanted: Wanted, gathered: Gathered, most: int) -> list[_Chunk]:
    """All views inside the aperture, row by row, at most so many at once; their weights sum up to 1."""
    weights = _weights(wanted, gathered)
    weights = weights / weights.sum()
    shifts = (gathered.positions - wanted.viewpoint) * wanted.focus  # (N, 2)
    columns = len(gathered.columns_at)
    chunks = []
    for start in range(0, len(weights), columns):
        row = start + np.flatnonzero(weights[start : start + columns])
        pieces = -(-len(row) // most)
        for part in np.array_split(row, pieces) if pieces else ():
            chunks.append(
                _Chunk(
                    tuple(gathered.tile(int(index)) for index in part),
                    tuple(shifts[part, 0].tolist()),
                    tuple(weights[part].tolist()),
                    float(shifts[start, 1]),
                )
            )
    return chunks


def _padded(values: Sequence[_Value], filler: _Value, length: int) -> tuple[_Value, ...]:
    return (*values, *[filler] * (length - len(values)))
