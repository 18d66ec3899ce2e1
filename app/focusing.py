"""What belongs to refocusing, slices and stereo, as plain values."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
import numpy.typing as npt

from app.geometry import Point
from app.limits import within
from lfcore.key_frames import MAX_FOCUS
from lfcore.refocus import captured_serve

APERTURE_LIMITS = (0.0, 1.5)  # diameter in baselines; from 1.42 on it takes in all views, from the middle
BASELINE_LIMITS = (0.02, 1.0)  # between the eyes, in baselines of the light field
FOCUS_STEP = 0.25  # px over the baseline, by a key
BASELINES = (0.1, 0.2, 0.3, 0.5, 0.75, 1.0)  # of stereo, by a key
_APERTURE_FACTOR = 1.25  # by a key
_LEAST_APERTURE = 0.05  # by a key: below it the aperture is a pinhole
_ITERATIONS = 4
SLICE_RANGE = (-0.06, 1.06)  # of u, or v, that a slice shows


class Choice(Enum):
    """Which views are summed up; the value is the name on screen."""

    AUTOMATIC = "automatic"
    CAPTURED = "captured"
    SYNTHESIZED = "synthesized"


@dataclass(frozen=True)
class Focusing:
    """`focus`: the disparity that is sharp, px over the baseline. `aperture`: its diameter in baselines. `slices`: whether
    epipolar slices are shown, `pin`: through which picture point, None: through the cursor. `baseline`: between the eyes of
    a stereo pair, in baselines; `convergence`: the disparity that both see at the same place."""

    focus: float = 0.0
    aperture: float = 1.0
    views: Choice = Choice.AUTOMATIC
    slices: bool = False
    pin: Point | None = None
    baseline: float = 0.3
    convergence: float = 0.0

    def bounded(self) -> Focusing:
        """With everything held within its limits."""
        return replace(
            self,
            focus=within(self.focus, (-MAX_FOCUS, MAX_FOCUS)),
            aperture=within(self.aperture, APERTURE_LIMITS),
            baseline=within(self.baseline, BASELINE_LIMITS),
            convergence=within(self.convergence, (-MAX_FOCUS, MAX_FOCUS)),
        )

    def among(self, limits: tuple[float, float]) -> Focusing:
        """With focus and convergence in the middle of these disparities where they lie outside, and nothing would be sharp."""
        return replace(self, focus=among(self.focus, limits), convergence=among(self.convergence, limits))

    def focused_at(self, disparity: float) -> Focusing:
        """Sharp at this disparity."""
        return replace(self, focus=disparity).bounded()

    def with_aperture_scaled(self, steps: int) -> Focusing:
        """With an aperture larger by so many steps, or smaller; at the lower end it is a pinhole."""
        if steps > 0 and self.aperture < _LEAST_APERTURE:
            return replace(self, aperture=_LEAST_APERTURE)
        aperture = self.aperture * _APERTURE_FACTOR**steps
        return replace(self, aperture=0.0 if aperture < _LEAST_APERTURE * 0.99 else aperture).bounded()

    def eyes(self, viewpoint: Point) -> tuple[Point, Point]:
        """Viewpoints of the left and the right eye about the one on screen."""
        u, v = viewpoint
        return (u - self.baseline / 2, v), (u + self.baseline / 2, v)


@dataclass(frozen=True)
class FocusFacts:
    """What panels print about it. `limits`: least and greatest focus of a slider, px over the baseline. `summed`: how many of
    which views are summed up. `under`: the disparity where slices go through. `exact_eyes`: both pictures of a stereo pair are
    synthesized for their own viewpoints."""

    limits: tuple[float, float] = (-8.0, 8.0)
    summed: str = ""
    under: float | None = None
    exact_eyes: bool = False


def among(disparity: float, limits: tuple[float, float]) -> float:
    """The disparity, or the middle of the limits where it lies outside."""
    low, high = limits
    return disparity if low <= disparity <= high else (low + high) / 2


def captured_summed(choice: Choice, rows: int, columns: int, span: tuple[float, float] | None) -> bool:
    """Whether the captured views are those to be summed up. `span`: least and greatest disparity of the scene, px over the
    baseline, None where no disparity is known, and so nothing can be drawn in between."""
    if span is None or choice is Choice.CAPTURED:
        return True
    return choice is Choice.AUTOMATIC and captured_serve(rows, columns, span)


def focus_limits(span: tuple[float, float] | None) -> tuple[float, float]:
    """The disparities between which a slider goes, in whole px: a quarter more than what the scene has, to either side."""
    if span is None:
        return FocusFacts().limits
    low, high = span
    margin = max((high - low) / 4, 0.5)
    return float(np.floor(low - margin)), float(np.ceil(high + margin))


def carried_disparity(disparity_map: npt.NDArray[np.float32], made_at: Point, viewpoint: Point, point: Point) -> float | None:
    """The disparity at a picture point seen from the viewpoint, px over the baseline; None outside the picture.

    disparity_map: (H, W), made for the viewpoint `made_at`. As shaders/carry.glsl, for one point: what lies in front holds.
    """
    height, width = disparity_map.shape
    column, row = int(np.floor(point[0])), int(np.floor(point[1]))
    if not (0 <= column < width and 0 <= row < height):
        return None
    shift = (made_at[0] - viewpoint[0], made_at[1] - viewpoint[1])

    def looked_up(disparity: float) -> float:
        x = int(np.floor(column + shift[0] * disparity + 0.5))
        y = int(np.floor(row + shift[1] * disparity + 0.5))
        return float(disparity_map[within(y, (0, height - 1)), within(x, (0, width - 1))])

    from_here, from_near = 0.0, float(disparity_map.min())
    before = from_near
    for _ in range(_ITERATIONS):
        before = from_near
        from_here, from_near = looked_up(from_here), looked_up(from_near)
    return min(from_near, from_here) if abs(from_near - before) < 0.5 else from_here


def captured_sliced(choice: Choice, rows: int, columns: int) -> bool:
    """Whether slices are drawn from the captured views, where others could be drawn in between."""
    enough = choice is Choice.AUTOMATIC and min(rows, columns) > 2
    return enough or choice is Choice.CAPTURED


def place_in_slice(share: float) -> float:
    """The u, or v, at a share of a slice's extent."""
    return SLICE_RANGE[0] + share * (SLICE_RANGE[1] - SLICE_RANGE[0])


def share_of_slice(place: float) -> float:
    """The inverse of `place_in_slice`."""
    return (place - SLICE_RANGE[0]) / (SLICE_RANGE[1] - SLICE_RANGE[0])
