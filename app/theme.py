"""Colours, type and spacing of the interface: calm, neutral around the picture, dark or light."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import imgui_bundle
from imgui_bundle import ImVec2, ImVec4, imgui

from app.settings import Theme

FONT_SIZE = 15.0
SMALL = 13.0
LARGE = 19.0


def colour(code: int, alpha: float = 1.0) -> ImVec4:
    return ImVec4((code >> 16 & 255) / 255, (code >> 8 & 255) / 255, (code & 255) / 255, alpha)


# The parts that colours play. These very objects take other values when the theme changes (see `use`), so that whoever
# holds one draws by the theme of the day. Around the picture all is neutral grey.
BACKGROUND, PANEL, CARD, LABEL = colour(0), colour(0), colour(0), colour(0)
FIELD, FIELD_HOVERED, FIELD_ACTIVE, LINE = colour(0), colour(0), colour(0), colour(0)
TEXT, TEXT_SOFT, TEXT_FAINT = colour(0), colour(0), colour(0)
ACCENT, ACCENT_DEEP, REALTIME = colour(0), colour(0), colour(0)
GOOD, WARNING, ERROR = colour(0), colour(0), colour(0)

_PARTS = (
    (BACKGROUND, colour(0x0E0F10), colour(0xC6C8CB)),
    (PANEL, colour(0x17181A), colour(0xF1F2F3)),
    (CARD, colour(0x1D1F22), colour(0xFAFAFB)),
    (LABEL, colour(0x1D1F22, 0.9), colour(0xFAFAFB, 0.92)),
    (FIELD, colour(0x26282C), colour(0xE1E3E6)),
    (FIELD_HOVERED, colour(0x303338), colour(0xD5D8DC)),
    (FIELD_ACTIVE, colour(0x3A3E45), colour(0xC4C8CE)),
    (LINE, colour(0x2B2D31), colour(0xD3D6DA)),
    (TEXT, colour(0xE4E6E9), colour(0x1A1C1F)),
    (TEXT_SOFT, colour(0xA3A8B0), colour(0x50565F)),
    (TEXT_FAINT, colour(0x7C828B), colour(0x737983)),
    (ACCENT, colour(0x6CB6E8), colour(0x1768A3)),
    (ACCENT_DEEP, colour(0x284A62), colour(0xB9D8EE)),
    (REALTIME, colour(0xC79BE8), colour(0x7A3FB0)),
    (GOOD, colour(0x79C48C), colour(0x22733D)),
    (WARNING, colour(0xE5B567), colour(0x8A5A00)),
    (ERROR, colour(0xE8766C), colour(0xB8342A)),
)


def use(theme: Theme) -> None:
    """Draw by this theme from now on."""
    for part, dark, light in _PARTS:
        chosen = light if theme is Theme.LIGHT else dark
        part.x, part.y, part.z, part.w = chosen.x, chosen.y, chosen.z, chosen.w


use(Theme.DARK)


@dataclass(frozen=True)
class Fonts:
    """The typefaces, in any size."""

    regular: imgui.ImFont
    bold: imgui.ImFont


def apply(scale: float) -> Fonts:
    """Give the current imgui context its style and fonts; `scale` 1 is 96 dots per inch. Called once per context."""
    style = imgui.get_style()
    _shapes(style)
    change(Theme.DARK)
    rescale(style, scale)
    folder = Path(imgui_bundle.__file__).parent / "assets" / "fonts" / "Roboto"
    fonts = imgui.get_io().fonts
    return Fonts(
        fonts.add_font_from_file_ttf(str(folder / "Roboto-Regular.ttf"), FONT_SIZE),
        fonts.add_font_from_file_ttf(str(folder / "Roboto-Bold.ttf"), FONT_SIZE),
    )


def rescale(style: imgui.Style, scale: float) -> None:
    """Give a freshly shaped style its scale."""
    style.scale_all_sizes(scale)
    style.font_size_base = FONT_SIZE
    style.font_scale_dpi = scale


def change(theme: Theme) -> None:
    """Go to another theme."""
    use(theme)
    if theme is Theme.LIGHT:
        imgui.style_colors_light()
    else:
        imgui.style_colors_dark()
    _colours(imgui.get_style())


def change_scale(scale: float) -> None:
    """Go to another scale, as when the window is moved to another monitor."""
    style = imgui.get_style()
    _shapes(style)
    rescale(style, scale)


def _unscale(style: imgui.Style) -> None:
    """Give every size that imgui scales its first value again; scaling would multiply one scale by the other."""
    fresh, scaled = imgui.Style(), imgui.Style()
    scaled.scale_all_sizes(2.0)
    for name in dir(fresh):
        value = getattr(fresh, name)
        if isinstance(value, float) and value != getattr(scaled, name):
            setattr(style, name, value)
        elif isinstance(value, ImVec2):
            other = getattr(scaled, name)
            if (value.x, value.y) != (other.x, other.y):
                setattr(style, name, ImVec2(value.x, value.y))


def _shapes(style: imgui.Style) -> None:
    _unscale(style)
    style.window_padding = ImVec2(16, 14)
    style.frame_padding = ImVec2(8, 4)
    style.item_spacing = ImVec2(8, 6)
    style.item_inner_spacing = ImVec2(8, 4)
    style.cell_padding = ImVec2(6, 3)
    style.window_rounding = 0
    style.child_rounding = 4
    style.frame_rounding = 4
    style.popup_rounding = 6
    style.grab_rounding = 3
    style.scrollbar_rounding = 4
    style.scrollbar_size = 10
    style.window_border_size = 0
    style.popup_border_size = 1
    style.frame_border_size = 0
    style.grab_min_size = 10
    style.window_min_size = ImVec2(8, 8)
    style.hover_delay_normal = 0.45
    style.hover_stationary_delay = 0.15


def _colours(style: imgui.Style) -> None:
    table = {
        imgui.Col_.window_bg: PANEL,
        imgui.Col_.child_bg: colour(0, 0),
        imgui.Col_.popup_bg: CARD,
        imgui.Col_.border: LINE,
        imgui.Col_.text: TEXT,
        imgui.Col_.text_disabled: TEXT_FAINT,
        imgui.Col_.frame_bg: FIELD,
        imgui.Col_.frame_bg_hovered: FIELD_HOVERED,
        imgui.Col_.frame_bg_active: FIELD_ACTIVE,
        imgui.Col_.button: FIELD,
        imgui.Col_.button_hovered: FIELD_HOVERED,
        imgui.Col_.button_active: FIELD_ACTIVE,
        imgui.Col_.header: ACCENT_DEEP,
        imgui.Col_.header_hovered: FIELD_HOVERED,
        imgui.Col_.header_active: FIELD_ACTIVE,
        imgui.Col_.check_mark: ACCENT,
        imgui.Col_.slider_grab: ACCENT,
        imgui.Col_.slider_grab_active: ACCENT,
        imgui.Col_.separator: LINE,
        imgui.Col_.scrollbar_bg: colour(0, 0),
        imgui.Col_.scrollbar_grab: FIELD_ACTIVE,
        imgui.Col_.plot_histogram: ACCENT,
        imgui.Col_.text_selected_bg: ACCENT_DEEP,
        imgui.Col_.nav_cursor: ACCENT,
        imgui.Col_.modal_window_dim_bg: colour(0, 0.5),
    }
    for place, value in table.items():
        style.set_color_(place, value)
