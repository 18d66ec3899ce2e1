"""H.264 streams such as later refocus stacks are, made for the tests."""

from __future__ import annotations

import io
from collections.abc import Sequence
from fractions import Fraction

import av
import numpy as np


def encode_video(pictures: Sequence[np.ndarray], kind: str) -> bytes:
    """Pictures (H, W, 3), uint8, as H.264: a bare stream ("h264"), or in a file ("mp4")."""
    target = io.BytesIO()
    with av.open(target, "w", format=kind) as output:
        stream = output.add_stream("libx264", rate=Fraction(25), options={"crf": "10"})
        stream.height, stream.width = pictures[0].shape[:2]
        stream.pix_fmt = "yuv420p"
        for pixels in pictures:
            output.mux(stream.encode(av.VideoFrame.from_ndarray(np.ascontiguousarray(pixels), format="rgb24")))
        output.mux(stream.encode())
    return target.getvalue()
