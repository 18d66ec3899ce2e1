"""Many views of one light field in one large texture, tile beside tile: what refocusing and slices draw from.

Captured views are handed to the graphics, views in between are drawn there, a few in every frame.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence

import moderngl
import numpy as np
import numpy.typing as npt

from app.canvas.elsewhere import draw_elsewhere
from app.canvas.passes import Passes
from app.canvas.textures import Textures
from app.geometry import Size
from app.tone import Tone
from lfcore.lightfield import as_float
from lfcore.metrics import to_uint8

MOST_BYTES = 256 * 2**20  # of graphics memory for one such texture; of a larger light field fewer views are taken
SYNTHESIZED_SIDE = 9  # views drawn in between, a side
_PIXELS_PER_FRAME = 1_000_000  # handed over in one frame
_DRAWN_PER_FRAME = 200_000  # pixels drawn in one frame
_BETTER = 0.05  # of the baseline: a synthesis this much nearer is worth drawing a view anew


class Gathered(ABC):
    """Views at the crossings of a grid over the square of viewpoints. `columns_at`, `rows_at`: their u and v."""

    def __init__(self, context: moderngl.Context, size: Size, columns_at: Sequence[float], rows_at: Sequence[float]) -> None:
        self.size = size
        self.columns_at, self.rows_at = tuple(columns_at), tuple(rows_at)
        self.positions = np.array([(u, v) for v in rows_at for u in columns_at])  # (N, 2)
        self.there = np.zeros(len(self.positions), bool)
        self.usable = np.zeros(len(self.positions), bool)  # there, and not a dark one
        self.version = 0  # grows with every change
        width, height = size[0] * len(columns_at), size[1] * len(rows_at)
        self.texture = context.texture((width, height), 4, alignment=1)
        self.target = context.framebuffer([self.texture])
        self.order = spread_order(self.positions)

    def tile(self, index: int) -> tuple[int, int]:
        """Where the view with that number lies in the texture, px."""
        row, column = divmod(index, len(self.columns_at))
        return column * self.size[0], row * self.size[1]

    @property
    @abstractmethod
    def complete(self) -> bool:
        """Whether all are there."""

    @abstractmethod
    def fill(self) -> None:
        """Put some more of them there: the part of one frame."""

    @abstractmethod
    def words(self, count: int) -> str:
        """So many of these views."""

    @property
    def spacing(self) -> float:
        """Of neighbouring views, in baselines."""
        return 1 / (min(len(self.columns_at), len(self.rows_at)) - 1)

    def release(self) -> None:
        """Give the memory of the graphics back."""
        self.target.release()
        self.texture.release()


class Captured(Gathered):
    """The captured views (V, U, H, W, 3), or of a large light field so many rows and columns as have room; `dark` ones, by
    row and column, are there but not to be used."""

    def __init__(
        self,
        context: moderngl.Context,
        views: npt.NDArray[np.generic],
        dark: frozenset[tuple[int, int]],
        most_bytes: int = MOST_BYTES,
    ) -> None:
        rows, columns, height, width = views.shape[:4]
        largest = int(context.info["GL_MAX_TEXTURE_SIZE"])
        self._views = views
        kept_columns, kept_rows = kept((rows, columns), (width, height), largest, most_bytes)
        self.kept = [(row, column) for row in kept_rows for column in kept_columns]
        super().__init__(
            context, (width, height), [c / (columns - 1) for c in kept_columns], [r / (rows - 1) for r in kept_rows]
        )
        self._pixels = np.full((height, width, 4), 255, np.uint8)
        self._dark = dark if set(self.kept) - dark else frozenset()  # better these than none
        self._waiting = list(self.order)

    @property
    def complete(self) -> bool:
        """Whether all are there."""
        return not self._waiting

    def words(self, count: int) -> str:
        """So many of these views."""
        rows, columns = self._views.shape[:2]
        return f"{count} of {rows * columns} captured views"

    def fill(self) -> None:
        """Hand over some more."""
        width, height = self.size
        for index in self._waiting[: max(_PIXELS_PER_FRAME // (width * height), 1)]:
            self._pixels[..., :3] = _in_8_bits(self._views[self.kept[index]])
            self.texture.write(self._pixels, viewport=(*self.tile(index), width, height))
            self._waiting.remove(index)
            self.there[index] = True
            self.usable[index] = self.kept[index] not in self._dark
            self.version += 1


class Synthesized(Gathered):
    """Views in between, drawn from what is at hand as app.canvas.elsewhere has it; anew when a nearer synthesis comes."""

    def __init__(self, context: moderngl.Context, passes: Passes, textures: Textures, most_bytes: int = MOST_BYTES) -> None:
        largest = int(context.info["GL_MAX_TEXTURE_SIZE"])
        side = len(kept((SYNTHESIZED_SIDE, SYNTHESIZED_SIDE), textures.size, largest, most_bytes)[0])
        places = np.linspace(0, 1, side).tolist()
        super().__init__(context, textures.size, places, places)
        self._passes = passes
        self._textures = textures
        self._distance = np.full(len(self.positions), np.inf)  # from the synthesis that each was drawn from

    def words(self, count: int) -> str:
        """So many of these views."""
        return f"{count} views in between"

    @property
    def complete(self) -> bool:
        """Whether all are there, drawn from nothing much farther than the newest synthesis."""
        return not self._gains().size

    def fill(self) -> None:
        """Draw some more, those first that gain most."""
        textures = self._textures
        made_at = textures.made_at
        if made_at is None:
            return
        width, height = self.size
        for index in self._gains()[: max(_DRAWN_PER_FRAME // (width * height), 1)]:
            at = (float(self.positions[index][0]), float(self.positions[index][1]))
            draw_elsewhere(self._passes, textures, self.target, self.tile(int(index)), at, Tone())
            self._distance[index] = math.dist(at, made_at)
            self.there[index] = self.usable[index] = True
            self.version += 1

    def redraw(self) -> None:
        """Draw all of them anew; those that are there stay until then."""
        self._distance[:] = np.inf

    def _gains(self) -> npt.NDArray[np.intp]:
        """The views that are worth being drawn now, in order."""
        made_at = self._textures.made_at
        if made_at is None:
            return np.zeros(0, np.intp)
        distance = np.hypot(*(self.positions - made_at).T)
        worth = self._distance - distance > _BETTER
        return np.array([index for index in self.order if worth[index]], np.intp)


def kept(views: Size, size: Size, largest: int, most_bytes: int) -> tuple[list[int], list[int]]:
    """The columns and rows of views that are taken: evenly, first and last among them, all where there is room.

    views: (rows, columns) that there are. size: (width, height) of each, px. largest: side of a texture, px.
    """
    rows, columns = views
    width, height = size
    while rows > 2 or columns > 2:
        if rows * columns * width * height * 4 <= most_bytes and columns * width <= largest and rows * height <= largest:
            break
        rows, columns = max(rows - 1, 2), max(columns - 1, 2)
    return _evenly(views[1], columns), _evenly(views[0], rows)


def _evenly(of: int, count: int) -> list[int]:
    """So many whole numbers from 0 to of - 1."""
    return [int(place) for place in np.linspace(0, of - 1, count).round()]


def spread_order(positions: npt.NDArray[np.float64]) -> list[int]:
    """The numbers of the positions (N, 2) in an order in which each lies as far as can be from those before it."""
    first = int(np.argmin(np.hypot(*(positions - positions.mean(0)).T)))
    order = [first]
    nearest = np.hypot(*(positions - positions[first]).T)
    for _ in range(len(positions) - 1):
        nearest[order[-1]] = -1.0
        farthest = int(np.argmax(nearest))
        order.append(farthest)
        nearest = np.minimum(nearest, np.hypot(*(positions - positions[farthest]).T))
    return order


def _in_8_bits(view: npt.NDArray[np.generic]) -> npt.NDArray[np.uint8]:
    return np.asarray(view, np.uint8) if view.dtype == np.uint8 else to_uint8(as_float(view))
