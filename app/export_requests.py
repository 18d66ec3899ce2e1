"""What the tab Export asks of the program, beyond the view state."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class ExportAction(Enum):
    """One thing that needs nothing more to be said."""

    EXPORT = "export as chosen"
    SAVE_PATH = "save the sweep as JSON"
    SAVE_PICTURE = "save the picture as shown"
    CHOOSE_FOLDER = "ask for the file or folder by the system's own dialog"
    CANCEL_ALL = "give up all exports"
    CLEAR = "forget the exports that are over"


@dataclass(frozen=True)
class CancelExport:
    """Give up the export of this number."""

    number: int


ExportRequest = ExportAction | CancelExport
