"""The tab Compare: the synthesis against the captured view."""

from __future__ import annotations

from app import theme
from app.commands import Context
from app.readout import Readout
from app.state import Step
from app.widgets import DASH, font, heading, number, pairs, text


def draw(context: Context, readout: Readout, fonts: theme.Fonts) -> None:
    """The whole tab."""
    heading("Against the captured view", fonts)
    score = readout.score
    pairs(
        "score",
        [
            ("PSNR", f"{number(score.psnr, 2)} dB" if score else DASH),
            ("SSIM", number(score.ssim, 4) if score else DASH),
        ],
    )
    with font(fonts.regular, theme.SMALL):
        text(score.protocol if score else _why_no_score(readout), theme.TEXT_FAINT)


def _why_no_score(readout: Readout) -> str:
    if readout.captured_here is None:
        return "No captured view at this viewpoint"
    return "The camera's own view" if readout.step is Step.CAPTURED else "Scored when the synthesis is there"
