"""Labelled figures as plain 8-bit pictures: cells with a caption above and, where colours mean numbers, a legend below."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import OpenImageIO as oiio

ByteArray = npt.NDArray[np.uint8]

_FONT = "DroidSans"  # comes with OpenImageIO
_FONT_SIZE = 15
_LINE = 24  # height of a caption
_MARGIN = 8
_LEGEND_BAR = 10
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


def figure(cells: Sequence[Cell], columns: int) -> ByteArray:
    """Set cells of one picture size row by row into one picture (H, W, 3), uint8; captions too long for it are cut off."""
    height, width = cells[0].picture.shape[:2]
    rows = -(-len(cells) // columns)
    cell_height = _LINE + height + (_LEGEND_BAR + _LINE if any(cell.legend for cell in cells) else 0) + _MARGIN
    cell_width = width + _MARGIN
    page = np.full((rows * cell_height + _MARGIN, columns * cell_width + _MARGIN, 3), _BACKGROUND, np.uint8)
    for index, cell in enumerate(cells):
        if cell.picture.shape != cells[0].picture.shape:
            raise ValueError(f"cell {index} is {cell.picture.shape}, the first is {cells[0].picture.shape}")
        row, column = divmod(index, columns)
        top, left = _MARGIN + row * cell_height, _MARGIN + column * cell_width
        _draw_cell(page[top : top + cell_height, left : left + width], cell)
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
    drawn = oiio.ImageBufAlgo.render_text(line, x, _LINE - 8, text, _FONT_SIZE, _FONT, (_INK,) * 3, align, "baseline")
    if not drawn:
        raise RuntimeError(f"OpenImageIO cannot draw text: {line.geterror()}")
    pixels: npt.NDArray[np.float32] = line.get_pixels(oiio.FLOAT)
    return np.rint(np.clip(pixels, 0, 1) * 255).astype(np.uint8)
