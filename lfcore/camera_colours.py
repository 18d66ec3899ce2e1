"""The colours in which a synthesis is made: those of an Illum's corner views without their paleness (lfcore.paleness)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from lfcore.lightfield import FloatArray
from lfcore.paleness import mixing, outwardness


@dataclass(frozen=True)
class CameraColours:
    """What is made of true colours gets those that the camera stores of its viewpoint; at a corner what came in comes out."""

    paleness: float = 0.0  # of the corner views; 0: true and stored ones are the same

    def true(self, corners: Tensor) -> Tensor:
        """Corner views (4, 3, H, W) without paleness, from 0; the same where there is none."""
        if self.paleness == 0:
            return corners
        inverse = torch.linalg.inv(torch.from_numpy(mixing(self.paleness)))
        return torch.einsum("nchw,dc->ndhw", corners, inverse).clamp_(min=0)

    def stored(self, image: FloatArray, u: float, v: float) -> FloatArray:
        """A picture (H, W, 3) as the camera stores what it sees at (u, v); beyond the corners as at them."""
        return self._mixed(image, self.paleness * min(float(outwardness(u, v)), 1.0))

    def stored_of_corners(self, warped: FloatArray) -> FloatArray:
        """Warped inputs (4, H, W, 3) in the colours of the corner views."""
        return self._mixed(warped, self.paleness)

    def _mixed(self, pictures: FloatArray, paleness: float) -> FloatArray:
        if paleness == 0:
            return pictures
        flat = torch.from_numpy(pictures).flatten(0, -2) @ torch.from_numpy(np.ascontiguousarray(mixing(paleness).T))
        mixed: FloatArray = flat.view(pictures.shape).numpy()
        return mixed
