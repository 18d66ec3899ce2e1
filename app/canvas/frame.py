"""What the canvas is to draw, and into what, by value."""

from __future__ import annotations

from dataclasses import dataclass, field

import moderngl

from app.comparison import Difference, Source
from app.focusing import Focusing
from app.geometry import Point, Size
from app.state import Look
from app.tone import Tone
from lfcore.colormaps import ColourMap

BACKGROUND = (0.055, 0.058, 0.063)


@dataclass(frozen=True)
class Frame:
    """One picture: the way of looking, and all that it depends on."""

    look: Look
    viewpoint: Point
    share: float = 1.0  # how far the newest synthesis has been faded in over what was there before
    source: Source = Source.SYNTHESIS  # which picture is looked at
    partner: Source = Source.CAPTURED  # which picture it is compared with
    difference: Difference = Difference.ABSOLUTE
    tone: Tone = field(default_factory=Tone)
    gain: float = 1.0
    disparity_range: tuple[float, float] = (0.0, 1.0)
    colour_map: ColourMap = ColourMap.VIRIDIS
    level: float = 0.0  # of the plane sweep, px over the baseline
    focusing: Focusing = field(default_factory=Focusing)
    captured_summed: bool = True  # where it is refocused: captured views are summed up, else such as are drawn in between
    dim: float = 1.0


@dataclass(frozen=True)
class Target:
    """What is drawn into: a framebuffer and its (width, height). A window's framebuffer does not know its own size."""

    framebuffer: moderngl.Framebuffer
    size: Size
