"""The tab Export: paths and export."""

from __future__ import annotations

from app import theme
from app.commands import Context
from app.readout import Readout


def draw(context: Context, readout: Readout, fonts: theme.Fonts) -> None:
    """The whole tab."""
