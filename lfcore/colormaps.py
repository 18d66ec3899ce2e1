"""Colour maps for maps of one value; but for Turbo, lightness rises evenly with the value."""

from __future__ import annotations

from enum import Enum

import numpy as np
import numpy.typing as npt

from lfcore.lightfield import FloatArray

# Stops from low to high as (lightness, a, b) of the Oklab space (Ottosson 2020), in which equal steps look equal.
# Lightness rises evenly, so that the maps read the same in print and to colour-blind eyes.
_DISPARITY_STOPS = (
    (0.20, 0.04, -0.12),
    (0.38, 0.02, -0.15),
    (0.56, -0.08, -0.05),
    (0.74, -0.12, 0.11),
    (0.92, 0.01, 0.17),
)
_MAGMA_STOPS = ((0.05, 0.0, 0.0), (0.28, 0.07, -0.11), (0.51, 0.16, -0.02), (0.74, 0.12, 0.09), (0.97, -0.01, 0.06))
_CIVIDIS_STOPS = ((0.24, -0.02, -0.09), (0.41, -0.01, -0.05), (0.58, 0.0, 0.01), (0.75, -0.01, 0.08), (0.92, -0.01, 0.16))
_GREY_STOPS = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))
_ERROR_STOPS = ((0.0, 0.0, 0.0), (0.30, 0.12, -0.06), (0.55, 0.19, 0.10), (0.78, 0.07, 0.15), (1.0, 0.0, 0.0))

_OKLAB_TO_LMS = np.array(
    [
        [1, 0.3963377774, 0.2158037573],
        [1, -0.1055613458, -0.0638541728],
        [1, -0.0894841775, -1.2914855480],
    ]
)
_LMS_TO_RGB = np.array(
    [
        [4.0767416621, -3.3077115913, 0.2309699292],
        [-1.2684380046, 2.6097574011, -0.3413193965],
        [-0.0041960863, -0.7034186147, 1.7076147010],
    ]
)


# Red, green and blue of Turbo by ascending powers of the value (the approximation published with it: Mikhailov 2019).
_TURBO = (
    (0.13572138, 4.61539260, -42.66032258, 132.13108234, -152.94239396, 59.28637943),
    (0.09140261, 2.19418839, 4.84296658, -14.18503333, 4.27729857, 2.82956604),
    (0.10667330, 12.64194608, -60.58204836, 110.36276771, -89.90310912, 27.34824973),
)


class ColourMap(Enum):
    """The colour maps to choose from; the value is the name on screen."""

    VIRIDIS = "Violet to yellow"
    MAGMA = "Black, red, cream"
    CIVIDIS = "Blue to yellow"
    TURBO = "Turbo"
    GREY = "Grey"


def colours(chosen: ColourMap) -> npt.NDArray[np.uint8]:
    """The colours of a map from low to high: uint8 (256, 3), sRGB."""
    if chosen is ColourMap.TURBO:
        places = np.linspace(0, 1, 256)
        channels = [np.polynomial.polynomial.polyval(places, powers) for powers in _TURBO]
        return np.rint(255 * np.clip(np.stack(channels, axis=1), 0, 1)).astype(np.uint8)
    return _table(_STOPS[chosen])


def disparity_colours() -> npt.NDArray[np.uint8]:
    """The colour map of disparity, from dark violet (low) to light yellow (high): uint8 (256, 3), sRGB."""
    return _table(_DISPARITY_STOPS)


def error_colours() -> npt.NDArray[np.uint8]:
    """The colour map of errors, from black (none) over red and yellow to white (full scale): uint8 (256, 3), sRGB."""
    return _table(_ERROR_STOPS)


def apply(table: npt.NDArray[np.uint8], values: FloatArray, low: float, high: float) -> npt.NDArray[np.uint8]:
    """Colours (H, W, 3) of the values (H, W): `low` takes the table's first colour, `high` its last, nan is grey."""
    span = high - low if high > low else 1.0
    # Not-a-number has no index; it is looked up as 0 and painted over below.
    scaled = np.nan_to_num((values - low) / span, nan=0.0, posinf=1.0, neginf=0.0)
    picture = table[np.rint(np.clip(scaled, 0, 1) * (len(table) - 1)).astype(np.intp)]
    picture[np.isnan(values)] = 128
    return picture


_STOPS = {
    ColourMap.VIRIDIS: _DISPARITY_STOPS,
    ColourMap.MAGMA: _MAGMA_STOPS,
    ColourMap.CIVIDIS: _CIVIDIS_STOPS,
    ColourMap.GREY: _GREY_STOPS,
}


def _table(stops: tuple[tuple[float, float, float], ...]) -> npt.NDArray[np.uint8]:
    places, wanted = np.linspace(0, 1, len(stops)), np.linspace(0, 1, 256)
    oklab = np.stack([np.interp(wanted, places, channel) for channel in np.array(stops).T], axis=1)
    linear = np.clip((oklab @ _OKLAB_TO_LMS.T) ** 3 @ _LMS_TO_RGB.T, 0, 1)
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return np.rint(255 * encoded).astype(np.uint8)
