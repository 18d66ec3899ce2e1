"""Labelled figures as plain 8-bit pictures: cells with a caption above and, where colours mean numbers, a legend below."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import OpenImageIO as oiio

from lfcore import colormaps
from lfcore.lightfield import FloatArray

ByteArray = npt.NDArray[np.uint8]

FONT = "DroidSans"  # comes with OpenImageIO
_FONT_SIZE = 15
_LINE = 24  # height of a caption
_MARGIN = 8
_LEGEND_BAR = 10
_LEGEND = 2 + _LEGEND_BAR + _LINE  # height of a legend
_BACKGROUND, _INK = 24, 0.9


@dataclass(frozen=True)
class Legend:
    """A strip of colours (N, 3), uint8, with what its two ends mean."""

    colours: ByteArray
    low: str
    high: str


@dataclass(frozen=True)
class Cell:
    """A picture, uint8 (H, W, 3), its caption, and the legend of its colours if they stand for numbers."""

    picture: ByteArray
    caption: str
    legend: Legend | None = None


def disparity_cell(disparity: FloatArray) -> Cell:
    """A disparity map (H, W), px from corner to corner, in colours, with the range they stand for."""
    colours = colormaps.disparity_colours()
    # Outermost percentiles, so that a few stray pixels do not take up the whole scale.
    low, high = (float(value) for value in np.percentile(disparity, (1, 99)))
    return Cell(
        colormaps.apply(colours, disparity, low, high),
        "disparity, pixels from corner to corner",
        Legend(colours, f"{_one_decimal(low)} px or less", f"{_one_decimal(high)} px or more"),
    )


def figure(cells: Sequence[Cell], columns: int) -> ByteArray:
    """Set cells of one picture size row by row into one picture (H, W, 3), uint8; captions too long are cut off."""
    for index, cell in enumerate(cells):
        if cell.picture.shape != cells[0].picture.shape:
            raise ValueError(f"cell {index} is {cell.picture.shape}, the first is {cells[0].picture.shape}")
    height, width = cells[0].picture.shape[:2]
    rows = [cells[first : first + columns] for first in range(0, len(cells), columns)]
    heights = [_LINE + height + (_LEGEND if any(cell.legend for cell in row) else 0) + _MARGIN for row in rows]
    page = np.full((sum(heights) + _MARGIN, columns * (width + _MARGIN) + _MARGIN, 3), _BACKGROUND, np.uint8)
    top = _MARGIN
    for row, row_height in zip(rows, heights, strict=True):
        for column, cell in enumerate(row):
            left = _MARGIN + column * (width + _MARGIN)
            _draw_cell(page[top : top + row_height, left : left + width], cell)
        top += row_height
    return page


def _draw_cell(area: ByteArray, cell: Cell) -> None:
    height, width = cell.picture.shape[:2]
    area[:_LINE] = _text_line(width, cell.caption, "left")
    area[_LINE : _LINE + height] = cell.picture
    if cell.legend is None:
        return
    top = _LINE + height + 2
    places = np.linspace(0, len(cell.legend.colours) - 1, width).round().astype(np.intp)
    area[top : top + _LEGEND_BAR] = cell.legend.colours[places]
    top += _LEGEND_BAR
    ends = np.maximum(_text_line(width, cell.legend.low, "left"), _text_line(width, cell.legend.high, "right"))
    area[top : top + _LINE] = ends


def _text_line(width: int, text: str, align: str) -> ByteArray:
    """One line of text on the background: (_LINE, width, 3)."""
    line = oiio.ImageBuf(oiio.ImageSpec(width, _LINE, 3, "float"))
    oiio.ImageBufAlgo.fill(line, (_BACKGROUND / 255,) * 3)
    x = 0 if align == "left" else width - 1
    drawn = oiio.ImageBufAlgo.render_text(line, x, _LINE - 8, text, _FONT_SIZE, FONT, (_INK,) * 3, align, "baseline")
    if not drawn:
        raise RuntimeError(f"OpenImageIO cannot draw text: {line.geterror()}")
    pixels = line.get_pixels(oiio.FLOAT)
    if pixels is None:
        raise RuntimeError(f"OpenImageIO cannot hand out the drawn text: {line.geterror()}")
    return np.rint(np.clip(pixels, 0, 1) * 255).astype(np.uint8)


def _one_decimal(value: float) -> str:
    return f"{round(value, 1) + 0.0:.1f}"  # without the sign of a rounded -0.0
