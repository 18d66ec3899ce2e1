"""Do the rows and columns of a light field run the way its pictures move? Told from the corner views alone.

Where a point has disparity D, view (u, v) sees it moved by (u D, v D) pixels: the same D along x as along y. If rows or
columns are numbered the other way round the two differ in sign, and if rows and columns are exchanged the content moves
along y where it should along x. So four arrangements of the same four pictures are tried, each with every disparity of a
range: the pictures are shifted back onto one another, and the arrangement in which they match best is the true one. The
comparison treats all arrangements alike (each is a relabelling of the others), so none is favoured.

Reversing rows and columns together only changes the sign of D and cannot be told this way.
"""

from __future__ import annotations

import enum
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lfcore.lightfield import FloatArray, LightField, as_float

_STEP = 0.5  # px of the averaged picture from one disparity that is tried to the next
_NEAR_LIMIT = 0.75  # share of the nearer look's reach beyond which the farther one is taken as well

# Side of the square blocks that are matched, and radius of the local mean taken off (views differ in brightness).
_BLOCK = 8
_LOCAL_RADIUS = 6

# The blocks with the least texture, which say nothing, are left out: this share of them.
_FLAT_SHARE = 0.4

# Below either of these the answer is "cannot be told". Real scenes have 15 or more, and 0.75 or more.
_MIN_SIGNIFICANCE = 6.0
_MIN_AGREEMENT = 0.6
_MIN_BLOCKS = 12

_LUMINANCE = np.array([0.2989, 0.5870, 0.1140], np.float32)


class Order(enum.Enum):
    """How rows and columns of views run, as the pictures show it."""

    AGREES = "agrees"
    REVERSED = "reversed"
    EXCHANGED = "exchanged"
    TURNED = "turned"
    UNKNOWN = "unknown"


_SENTENCES = {
    Order.AGREES: "The pictures agree with the order of rows and columns.",
    Order.REVERSED: (
        "Either the rows or the columns of views are reversed: along one axis the pictures move against the other; "
        "number the rows (or the columns) the other way round."
    ),
    Order.EXCHANGED: (
        "Rows and columns of views are exchanged: the pictures move along y from column to column; "
        "swap the two numbers in the names."
    ),
    Order.TURNED: (
        "Rows and columns of views are exchanged and one of them is reversed: the grid is turned by a quarter against the "
        "pictures; swap the two numbers in the names and number the rows (or the columns) the other way round."
    ),
    Order.UNKNOWN: (
        "Whether rows and columns run the right way cannot be told from the pictures: too little texture, or too little "
        "or too much movement between the corner views."
    ),
}

# (exchanged, one axis reversed) of the four arrangements, in the order of the first axis of the costs.
_ARRANGEMENTS = {
    Order.AGREES: (False, False),
    Order.REVERSED: (False, True),
    Order.EXCHANGED: (True, False),
    Order.TURNED: (True, True),
}


@dataclass(frozen=True)
class _Look:
    """`long_side`: px that pictures are averaged down to at most. `reach`: how far disparities are tried, of the longer side,
    and of the shorter one at most."""

    long_side: int
    reach: float
    of_shorter: float

    def tried(self, height: int, width: int) -> float:
        """The largest disparity, px of averaged pictures of this size."""
        limit = min(max(height, width) * self.reach, min(height, width) * self.of_shorter)
        return _STEP * math.floor(limit / _STEP)


# What cameras with microlenses have, and what gantries and arrays of cameras may have.
_NEARER = _Look(320, 1 / 16, 1.0)
_FARTHER = _Look(192, 3 / 8, 3 / 8)


@dataclass(frozen=True)
class DisparityCheck:
    """What the pictures say about the order of the views and about the disparities.

    `low`, `median`, `high` are the 2nd, 50th and 98th percentile of the disparity of textured blocks, in pixels over the
    full baseline along u, counted in the true arrangement; nan where nothing was found. `agreement` is the share of
    textured blocks that prefer the verdict to the next best arrangement (chance: about 0.5), `significance` that
    preference over its standard error.
    """

    order: Order
    low: float
    median: float
    high: float
    agreement: float
    significance: float
    blocks: int

    @property
    def sentence(self) -> str:
        """The verdict for the person at the screen, with what to do."""
        return _SENTENCES[self.order]

    @property
    def is_wrong(self) -> bool:
        """Whether the views are certainly in another order than the pictures show."""
        return self.order not in (Order.AGREES, Order.UNKNOWN)


def check_disparity(light_field: LightField) -> DisparityCheck:
    """Find out from four corner views in which arrangement they match, and at which disparities. Takes about 0.3 s, where
    they lie far apart half as long again.

    The corners are those of the grid, where one of them is dark of the largest part of it in the middle whose corners are not;
    its sides are equal parts of the two baselines. Disparities are found up to three eighths of the views' shorter side.
    """
    near, share = _look(light_field, _parts(light_field), _NEARER)
    if near.order is not Order.UNKNOWN and share < _NEAR_LIMIT:
        return near
    far, _ = _look(light_field, _parts(light_field), _FARTHER)
    return near if far.order is Order.UNKNOWN else far


def baselines_differ(light_field: LightField, check: DisparityCheck) -> bool:
    """Whether rows and columns lie equally far apart in a grid that has more of one than of the other, and whose `check` so
    could not tell.

    A synthesis from its corners takes both baselines as equal, as a LightField says, which they are not then.
    """
    if light_field.rows == light_field.columns or check.order is not Order.UNKNOWN:
        return False
    squares = [(side - 1, side - 1) for side in range(min(light_field.rows, light_field.columns), 1, -1)]
    return any(_look(light_field, squares, look)[0].order is Order.AGREES for look in (_NEARER, _FARTHER))


_Steps = tuple[int, int]  # rows and columns from the first to the last


def _parts(light_field: LightField) -> list[_Steps]:
    """Parts of the grid, the largest first, whose sides are equal parts of both baselines: one disparity holds along both."""
    down, across = light_field.rows - 1, light_field.columns - 1
    parts = math.gcd(down, across)
    return [(down // parts * size, across // parts * size) for size in range(parts, 0, -1)]


def _look(light_field: LightField, parts: Sequence[_Steps], look: _Look) -> tuple[DisparityCheck, float]:
    """What the first of these parts tells that has no dark corner, and how much of its reach the disparities take; 0 where
    none are found."""
    corners, scale = _corners_of(light_field, parts, look.long_side)  # (4, h, w), full-baseline px per px here
    if corners is None:
        return _unknown(), 0.0
    reach = look.tried(*corners.shape[1:])
    check = _judge(corners, scale, reach)
    taken = 0.0 if check.order is Order.UNKNOWN else max(abs(check.low), abs(check.high)) / (scale * reach)
    return check, taken


def _corners_of(light_field: LightField, parts: Sequence[_Steps], long_side: int) -> tuple[FloatArray | None, float]:
    """The four corner pictures of the first part, in the middle, without a dark one, in the order (top, left), (top, right),
    (bottom, left), (bottom, right), made comparable."""
    rows, columns, height, width = light_field.views.shape[:4]
    for down, across in parts:
        top, left = (rows - 1 - down) // 2, (columns - 1 - across) // 2
        places = list(itertools.product((top, top + down), (left, left + across)))
        if min(down, across) > 0 and not light_field.dark.intersection(places):
            shrink = min(math.ceil(max(height, width) / long_side), height, width)
            pictures = np.stack([_comparable(light_field.views[place], shrink) for place in places])
            return pictures, shrink * (columns - 1) / across
    return None, 1.0


def _comparable(view: npt.NDArray[np.generic], shrink: int) -> FloatArray:
    """Luminance averaged over shrink x shrink px, tone flattened, local mean removed, spread 1; (h, w)."""
    height, width = view.shape[0] // shrink, view.shape[1] // shrink
    cut = as_float(view[: height * shrink, : width * shrink])
    mean = cut.reshape(height, shrink, width, shrink, 3).mean(axis=(1, 3))
    # The square root keeps highlights of linear pictures from outweighing everything else.
    grey = np.sqrt(np.clip(mean @ _LUMINANCE, 0, None))
    detail = grey - _local_mean(grey)
    spread = float(detail.std())
    return (detail / spread if spread > 0 else detail).astype(np.float32)


def _local_mean(picture: FloatArray) -> FloatArray:
    side = 2 * _LOCAL_RADIUS + 1
    padded = np.pad(picture, ((_LOCAL_RADIUS + 1, _LOCAL_RADIUS), (_LOCAL_RADIUS + 1, _LOCAL_RADIUS)), mode="edge")
    total = padded.cumsum(axis=0, dtype=np.float64).cumsum(axis=1)
    window = total[side:, side:] - total[:-side, side:] - total[side:, :-side] + total[:-side, :-side]
    return (window / side**2).astype(np.float32)


def _judge(corners: FloatArray, scale: float, reach: float) -> DisparityCheck:
    height, width = corners.shape[1:]
    disparities = np.arange(-reach, reach + _STEP / 2, _STEP, dtype=np.float32)
    margin = math.ceil(reach / 2) + 1
    if min(height, width) - 2 * margin < _BLOCK or reach < 1:
        return _unknown()
    costs = _block_costs(corners, disparities, margin)  # (4, D, Y, X)
    texture = costs.mean(axis=(0, 1))
    textured = (texture > 1e-3) & (texture >= np.quantile(texture, _FLAT_SHARE))  # (Y, X)
    blocks = int(np.count_nonzero(textured))
    if blocks < _MIN_BLOCKS:
        return _unknown()
    least = costs.min(axis=1)[:, textured] / texture[textured]  # (4, blocks)
    best, second = np.argsort(least.mean(axis=1))[:2]
    gain = least[second] - least[best]
    error = float(gain.std()) / math.sqrt(blocks)
    significance = float(gain.mean()) / error if error > 0 else 0.0
    agreement = float(np.mean(gain > 0))
    if significance < _MIN_SIGNIFICANCE or agreement < _MIN_AGREEMENT:
        return _unknown(agreement, significance, blocks)
    found = _finest(costs[best], disparities)
    kept = textured & _like_neighbours(found)
    low, median, high = np.percentile(found[kept if kept.any() else textured] * scale, (2, 50, 98))
    order = list(_ARRANGEMENTS)[best]
    return DisparityCheck(order, float(low), float(median), float(high), agreement, significance, blocks)


def _unknown(agreement: float = 0.0, significance: float = 0.0, blocks: int = 0) -> DisparityCheck:
    return DisparityCheck(Order.UNKNOWN, math.nan, math.nan, math.nan, agreement, significance, blocks)


def _block_costs(corners: FloatArray, disparities: FloatArray, margin: int) -> FloatArray:
    """How badly the four corners match in each block, for each arrangement and disparity: (4, D, Y, X).

    A corner at (x, y), each -1/2 or 1/2 from the middle of the baseline, is sampled at s + (x, y) D. Whatever the
    arrangement, every corner is shifted by half of D along each axis; only the signs and the axes differ. So the 16 shifted
    pictures of one |D| serve all eight combinations of arrangement and sign.
    """
    places = [(y, x) for y in (-1, 1) for x in (-1, 1)]
    half = len(disparities) // 2
    inner = [(length - 2 * margin) // _BLOCK for length in corners.shape[1:]]
    costs = np.empty((len(_ARRANGEMENTS), len(disparities), *inner), np.float32)
    for index, disparity in enumerate(disparities[half:]):
        shifted, energy = _shifts(corners, float(disparity) / 2, margin)
        for arrangement, (exchanged, reverse) in enumerate(_ARRANGEMENTS.values()):
            for sign in (1, -1):
                keys = []
                for corner, (y, x) in enumerate(places):
                    along_y, along_x = (x, y) if exchanged else (y, x)
                    keys.append((corner, sign * along_y * (-1 if reverse else 1), sign * along_x))
                a, b, c, d = (shifted[key] for key in keys)
                total = a + b + c + d
                spread = energy[keys[0]] + energy[keys[1]] + energy[keys[2]] + energy[keys[3]] - _block_sums(total**2) / 4
                costs[arrangement, half + sign * index] = spread
    return costs


_Shifted = dict[tuple[int, int, int], FloatArray]


def _shifts(corners: FloatArray, shift: float, margin: int) -> tuple[_Shifted, _Shifted]:
    """Each corner sampled `shift` px up or down and left or right, inner part only, and the block sums of its squares."""
    shifted: _Shifted = {}
    energy: _Shifted = {}
    for corner, picture in enumerate(corners):
        for y in (-1, 1):
            moved = _sampled(picture, y * shift, margin, axis=0)
            for x in (-1, 1):
                shifted[corner, y, x] = _sampled(moved, x * shift, margin, axis=1)
                energy[corner, y, x] = _block_sums(shifted[corner, y, x] ** 2)
    return shifted, energy


def _sampled(picture: FloatArray, shift: float, margin: int, axis: int) -> FloatArray:
    """`picture` at positions + shift along one axis, linearly interpolated, without `margin` px at either end."""
    whole = math.floor(shift)
    part = np.float32(shift - whole)
    begin, end = margin + whole, picture.shape[axis] - margin + whole
    lines = picture if axis == 0 else picture.T
    near = lines[begin:end]
    if part:
        near = near + part * (lines[begin + 1 : end + 1] - near)
    return near if axis == 0 else near.T


def _block_sums(values: FloatArray) -> FloatArray:
    """Sums over _BLOCK x _BLOCK px: (Y, X)."""
    rows, columns = values.shape[0] // _BLOCK, values.shape[1] // _BLOCK
    down = np.add.reduceat(values[: rows * _BLOCK, : columns * _BLOCK], range(0, rows * _BLOCK, _BLOCK), axis=0)
    return np.add.reduceat(down, range(0, columns * _BLOCK, _BLOCK), axis=1)


def _finest(costs: FloatArray, disparities: FloatArray) -> FloatArray:
    """Disparity of the least cost per block, (D, Y, X) -> (Y, X), between the steps by a parabola through its neighbours."""
    place = costs.argmin(axis=0).clip(1, len(disparities) - 2)
    before, here, after = (np.take_along_axis(costs, place[None] + offset, axis=0)[0] for offset in (-1, 0, 1))
    curvature = np.maximum(before - 2 * here + after, 1e-12)
    return disparities[place] + np.clip(0.5 * (before - after) / curvature, -0.5, 0.5) * _STEP


def _like_neighbours(found: FloatArray) -> npt.NDArray[np.bool_]:
    """Whether at least three of the eight blocks around have nearly the same disparity: (Y, X). Chance matches do not."""
    padded = np.pad(found, 1, constant_values=np.inf)
    rows, columns = found.shape
    alike = np.zeros(found.shape, np.int64)
    for y, x in itertools.product(range(3), range(3)):
        alike += np.abs(padded[y : y + rows, x : x + columns] - found) <= 1
    return alike >= 4  # the block itself is among the nine
