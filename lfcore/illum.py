"""What is known of a Lytro Illum's ESLF, as Lytro's own software stores it: the colours and the places of its views.

Light strays between neighbouring pixels under a microlens, which lie behind filters of other colours: the farther out a view,
the paler. And the main lens shifts what a view shows by the cube of how far out it is. Of both the corners of the middle 8 x 8
views have a known measure, and those of fewer views less, as the square and the cube of their part of the aperture
(docs/evaluation.md). Four corners do not show it; but that a light field is one of these can be told. The readers of files say
so (LightField.aperture), and lfcore.illum_correction makes up for it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from lfcore.lightfield import FloatArray, LightField, as_float

# Colours of a corner view by those of the middle, rows red, green, blue: the mean over the four corners of train/IMG_0288, an
# ESLF of an Illum; toolboxes' decodings (train/toys) have about a fifth of it, rendered light fields none.
_PALE = np.array([[0.910, 0.078, 0.005], [0.023, 0.939, 0.019], [0.037, 0.072, 0.880]], np.float32)
# px by which all that a view shows is shifted, per cube of how far out it is, as by spherical aberration: the mean of seven
# training captures of Illums, which have 0.03 to 0.10.
_ABERRATION = 0.07

# View sizes that Lytro's own tools write, width by height.
CAMERA_SIZES = frozenset({(541, 376), (541, 375), (540, 375), (540, 376)})
_BRIGHTEST = 0.3  # median of its corner views: an ESLF holds linear light, and what has a display's tone is brighter
_WHOLE = 7  # views from corner to corner of the middle of an ESLF to whose corners the measures belong
_FEWEST = 4  # of fewer, one cannot tell whether some between them were left out; and then there is little of it


def outwardness(u: npt.ArrayLike, v: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """0 in the middle of the grid of views, 1 at its corners: the square of how far out a view is."""
    return 2 * ((np.asarray(u, np.float64) - 0.5) ** 2 + (np.asarray(v, np.float64) - 0.5) ** 2)


def mixing(paleness: npt.ArrayLike) -> FloatArray:
    """(...) paleness, 1 = that of an Illum's corner view -> (..., 3, 3), stored colours by true ones."""
    identity = np.eye(3, dtype=np.float32)
    mixed: FloatArray = (identity + np.asarray(paleness, np.float32)[..., None, None] * (_PALE - identity)).astype(np.float32)
    return mixed


def displacement(aperture: float, u: float, v: float) -> tuple[float, float]:
    """px along x and y by which all that a view at (u, v) shows is shifted against what the corners make one expect: what grows
    with the cube, less its part in proportion, which counts as disparity. None at the corners, and beyond them as at them."""
    x, y = (2 * min(max(place, 0.0), 1.0) - 1 for place in (u, v))
    scale = _ABERRATION * aperture**3 * (x * x + y * y - 2)
    return scale * x, scale * y


def aperture_of_views(views: npt.NDArray[np.generic], steps: tuple[int, int] | None = None) -> float:
    """LightField.aperture of a grid: 0, unless it is most likely the middle of an ESLF as it is stored, by how many views there
    are, by their size and by their light.

    views: (V, U, H, W, 3), as stored; steps: rows and columns from corner to corner of the grid that they were taken from,
    where some were left out.
    """
    rows, columns, height, width, _ = views.shape
    apart, across = steps or (rows - 1, columns - 1)
    if across != apart or not _FEWEST <= apart <= _WHOLE or not {(width, height), (height, width)} & CAMERA_SIZES:
        return 0.0
    light = float(np.median(as_float(views[[0, 0, -1, -1], [0, -1, 0, -1], ::4, ::4])))
    return apart / _WHOLE if light < _BRIGHTEST else 0.0


def aperture_of_part(light_field: LightField, steps: int) -> float:
    """That of a part in the middle of a grid, `steps` rows of it from corner to corner."""
    return light_field.aperture * steps / (light_field.rows - 1)


def with_true_colours(light_field: LightField) -> LightField:
    """All views of a light field as they would be without paleness, float32 from 0; the same where there is none."""
    if light_field.aperture == 0:
        return light_field
    views = np.empty(light_field.views.shape, np.float32)
    for row, column in np.ndindex(light_field.rows, light_field.columns):
        paleness = light_field.aperture**2 * outwardness(*light_field.position(row, column))
        np.matmul(light_field.view(row, column), np.linalg.inv(mixing(paleness)).T, out=views[row, column])
    return replace(light_field, views=np.maximum(views, 0, out=views), aperture=0.0)
