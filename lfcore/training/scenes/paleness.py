"""How the outer views of an Illum lose colour against the inner ones."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lfcore.lightfield import FloatArray

# Colours of a corner view by those of the middle, rows red, green, blue: light that strays between neighbouring pixels under a
# microlens mixes the outer views' colours. The mean over the four corners of train/IMG_0288, an ESLF of an Illum; toolboxes'
# decodings (train/toys) have about a quarter of it.
_PALE = np.array([[0.910, 0.078, 0.005], [0.023, 0.939, 0.019], [0.037, 0.072, 0.880]], np.float32)


def outwardness(u: npt.ArrayLike, v: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """0 in the middle of the grid of views, 1 at its corners: where paleness is 0, and as much as it gets."""
    return 2 * ((np.asarray(u, np.float64) - 0.5) ** 2 + (np.asarray(v, np.float64) - 0.5) ** 2)


def mixing(paleness: npt.NDArray[np.float64]) -> FloatArray:
    """(N,) paleness, 1 = that of an Illum's corner view -> (N, 3, 3), stored colours by true ones."""
    identity = np.eye(3, dtype=np.float32)
    mixed: FloatArray = (identity + paleness[:, None, None] * (_PALE - identity)).astype(np.float32)
    return mixed
