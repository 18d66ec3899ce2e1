"""What lies behind the colours of a canvas's picture."""

from __future__ import annotations

import moderngl
import numpy as np

from app.canvas import Canvas, Frame
from lfcore.lightfield import FloatArray


def map_of(canvas: Canvas, frame: Frame) -> FloatArray:
    """The map (H, W) that the frame shows in colours."""
    made = canvas._made(frame)
    assert isinstance(made, moderngl.Texture)
    width, height = made.size
    return np.frombuffer(made.read(), np.float32).reshape(height, width)
