"""A synthesis is made of an Illum's corner views in true colours, and comes out as the camera shows its viewpoint.

What is known of that camera is in lfcore.illum.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from lfcore.illum import displacement, mixing, outwardness
from lfcore.lightfield import FloatArray

_BURNT = 0.98  # from here on to 1 the least of the three colours tells of a place that is


@dataclass(frozen=True)
class IllumCorrection:
    """At a corner what came in comes out. Where `aperture`, a LightField's, is 0, nothing is done."""

    aperture: float = 0.0

    def true(self, corners: Tensor) -> Tensor:
        """Corner views (4, 3, H, W) without paleness, from 0."""
        if self.aperture == 0:
            return corners
        inverse = torch.linalg.inv(torch.from_numpy(mixing(self.aperture**2)))
        return torch.einsum("nchw,dc->ndhw", corners, inverse).clamp_(min=0)

    def stored(self, image: FloatArray, u: float, v: float) -> FloatArray:
        """A picture (H, W, 3) in the colours of a view at (u, v); beyond the corners in theirs."""
        return self._mixed(image, self.aperture**2 * min(float(outwardness(u, v)), 1.0))

    def stored_of_corners(self, warped: FloatArray) -> FloatArray:
        """Warped inputs (4, H, W, 3) in the colours of the corner views."""
        return self._mixed(warped, self.aperture**2)

    def moves(self, u: float, v: float) -> tuple[float, float]:
        """px along x and y by which the inputs of a warp are sampled farther on, so that the picture lies as the view does."""
        x, y = displacement(self.aperture, u, v)
        return -x, -y

    def _mixed(self, pictures: FloatArray, paleness: float) -> FloatArray:
        if paleness == 0:
            return pictures
        matrix, given = torch.from_numpy(mixing(paleness)), torch.from_numpy(pictures).flatten(0, -2)  # (N, 3)
        # What is burnt out stays white: how bright it was, so that the camera's white would come of it, is not known.
        burnt = ((given.amin(1, keepdim=True) - _BURNT) / (1 - _BURNT)).clamp(0, 1)
        mixed: FloatArray = torch.addmm(burnt * (1 - matrix.sum(1)), given, matrix.T).view(pictures.shape).numpy()
        return mixed
