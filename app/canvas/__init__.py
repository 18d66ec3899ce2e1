"""Textures, passes and read-back: the only place that knows moderngl."""

from app.canvas.canvas import Canvas
from app.canvas.contexts import draws_in_software, standalone_context, standalone_functions, windowed_context
from app.canvas.copying import Sheets, WindowCopy
from app.canvas.frame import BACKGROUND, Frame, Target
from app.canvas.magnifier import Colours
from app.canvas.placing import Pixels
from app.canvas.rasteriser import spread_rasteriser

__all__ = [
    "BACKGROUND",
    "Canvas",
    "Colours",
    "Frame",
    "Pixels",
    "Sheets",
    "Target",
    "WindowCopy",
    "draws_in_software",
    "spread_rasteriser",
    "standalone_context",
    "standalone_functions",
    "windowed_context",
]
