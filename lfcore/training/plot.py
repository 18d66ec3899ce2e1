"""The curve of a training run as a picture: PSNR of each held-out light field over the steps."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import OpenImageIO as oiio

from lfcore.figures import FONT, ByteArray
from lfcore.training.curve import CurvePoint

_WIDTH, _HEIGHT = 900, 480
_LEFT, _RIGHT, _TOP, _BOTTOM = 64, 24, 40, 48  # margins around the axes
_NAME_WIDTH, _LETTER, _MOST_NAMES = 200, 9, 8  # px of a name in the legend at most, and of a wide letter
_INK, _FAINT, _PAPER = (0.15, 0.15, 0.18), (0.86, 0.86, 0.88), (1.0, 1.0, 1.0)
_COLOURS = ((0.0, 0.36, 0.66), (0.80, 0.33, 0.0), (0.0, 0.52, 0.36), (0.55, 0.24, 0.60), (0.45, 0.42, 0.0))


def plot(curve: Sequence[CurvePoint]) -> ByteArray:
    """(H, W, 3) uint8. Points without a score are left out; a curve without any gives empty axes."""
    page = oiio.ImageBuf(oiio.ImageSpec(_WIDTH, _HEIGHT, 3, oiio.UINT8))
    oiio.ImageBufAlgo.fill(page, _PAPER)
    names = sorted({name for point in curve for name in point.scores})
    values = [value for point in curve for value in point.scores.values() if math.isfinite(value)]
    low, high = (math.floor(min(values)), math.ceil(max(values) + 0.1)) if values else (20, 40)
    last = max((point.step for point in curve), default=1)

    def place(step: float, value: float) -> tuple[int, int]:
        x = _LEFT + (_WIDTH - _LEFT - _RIGHT) * step / max(last, 1)
        y = _HEIGHT - _BOTTOM - (_HEIGHT - _TOP - _BOTTOM) * (value - low) / (high - low)
        return round(x), round(y)

    for value in range(low, high + 1, max(1, (high - low) // 8)):
        _line(page, [place(0, value), place(last, value)], _FAINT)
        _text(page, 10, place(0, value)[1] + 5, f"{value} dB")
    for step in sorted({round(last * share) for share in (0, 0.25, 0.5, 0.75, 1)}):
        x, y = place(step, low)
        _text(page, x - 16, y + 22, str(step))
    _text(page, _WIDTH // 2 - 20, _HEIGHT - 8, "steps")
    for index, name in enumerate(names):
        colour = _COLOURS[index % len(_COLOURS)]
        points = [place(p.step, p.scores[name]) for p in curve if math.isfinite(p.scores.get(name, math.nan))]
        _line(page, points, colour)
        _line(page, [(x, y + 1) for x, y in points], colour)
    _legend(page, names)
    return np.asarray(page.get_pixels(oiio.UINT8))


def _legend(page: oiio.ImageBuf, names: Sequence[str]) -> None:
    """The names side by side above the axes, each in an equal part of the width and shortened to it; where there are more than
    have room for a few letters, the last place says how many are left out."""
    room = _WIDTH - _LEFT - _RIGHT
    shown = list(names) if len(names) <= _MOST_NAMES else [*names[: _MOST_NAMES - 1], f"+ {len(names) - _MOST_NAMES + 1}"]
    width = min(room // max(len(shown), 1), _NAME_WIDTH)
    letters = width // _LETTER - 1
    for index, name in enumerate(shown):
        short = name if len(name) <= letters else f"{name[: letters - 2]}.."
        colour = _INK if index == len(shown) - 1 and len(shown) < len(names) else _COLOURS[index % len(_COLOURS)]
        _text(page, _LEFT + 8 + width * index, 24, short, colour)


def _line(page: oiio.ImageBuf, points: Sequence[tuple[int, int]], colour: tuple[float, float, float]) -> None:
    for (x0, y0), (x1, y1) in pairwise(points):
        oiio.ImageBufAlgo.render_line(page, x0, y0, x1, y1, colour)


def _text(page: oiio.ImageBuf, x: int, y: int, text: str, colour: tuple[float, float, float] = _INK) -> None:
    oiio.ImageBufAlgo.render_text(page, x, y, text, 14, FONT, colour)
