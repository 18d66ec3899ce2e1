"""What a synthesis by the paper's pair has to be in every pixel: the reference of corner views whose edges are repeated."""

from __future__ import annotations

from dataclasses import dataclass

import torch.nn.functional as F

from lfcore.lightfield import FloatArray, LightField
from lfcore.networks import BORDER, FullModel
from lfcore.synthesizer import corner_tensor, reference_synthesis

_BEYOND = 60  # px by which edges are repeated: more than 21 px of disparity need at a viewpoint 0.25 outside


@dataclass(frozen=True)
class Reference:
    """In float32: image (H, W, 3), 0 to 1, and disparity (H, W), px over the full baseline."""

    image: FloatArray
    disparity: FloatArray


def whole_reference(model: FullModel, field: LightField, u: float, v: float) -> Reference:
    """The reference of continued corner views, cut to the size of the views."""
    corners = F.pad(corner_tensor(field), (_BEYOND,) * 4, mode="replicate")
    image, disparity, _ = reference_synthesis(model, corners, u, v)
    inner, outer = _BEYOND - 2 * BORDER, _BEYOND - BORDER
    return Reference(
        image[:, inner:-inner, inner:-inner].clamp(0, 1).permute(1, 2, 0).numpy(),
        disparity[outer:-outer, outer:-outer].numpy(),
    )
