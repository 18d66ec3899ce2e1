"""A model that knows the truth of a plane of fine texture: any view of it is a formula."""

from __future__ import annotations

import numpy as np

from lfcore.lightfield import FloatArray
from lfcore.synthesizer import Synthesis
from tests.moving_scene import TruthSynthesizer
from tests.scenes import smooth_texture

DISPARITY = -6.0  # px over the baseline


def view(u: float, v: float, size: tuple[int, int]) -> FloatArray:
    """The view at (u, v), float32 (H, W, 3); size: (H, W)."""
    y, x = np.mgrid[: size[0], : size[1]].astype(np.float32)
    return smooth_texture(x - DISPARITY * u, y - DISPARITY * v)


class PlaneSynthesizer(TruthSynthesizer):
    """Answers with the formula."""

    def synthesize(self, u: float, v: float, cancelled: object = None) -> Synthesis:
        size = self._size
        disparity = np.full(size, DISPARITY, np.float32)
        return Synthesis(u, v, self.name, view(u, v, size), disparity, None, {"total": 0.0})
