"""What lies over the picture and on top of everything, one module per thing."""

from app.overlays.browser import browser
from app.overlays.cards import loading, messages, path_field
from app.overlays.comparison import cross_hairs, names, wipe_handle
from app.overlays.inspector import inspector
from app.overlays.key_page import key_page
from app.overlays.labels import missing, notices
from app.overlays.legend import legend
from app.overlays.palette import palette
from app.overlays.pixels import pixels
from app.overlays.settings import settings
from app.overlays.start import start

__all__ = [
    "browser",
    "cross_hairs",
    "inspector",
    "key_page",
    "legend",
    "loading",
    "messages",
    "missing",
    "names",
    "notices",
    "palette",
    "path_field",
    "pixels",
    "settings",
    "start",
    "wipe_handle",
]
