"""Colours, type and spacing of the interface: calm, dark, neutral around the picture."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import imgui_bundle
from imgui_bundle import ImVec2, ImVec4, imgui

FONT_SIZE = 15.0
SMALL = 13.0
LARGE = 19.0


def colour(code: int, alpha: float = 1.0) -> ImVec4:
    return ImVec4((code >> 16 & 255) / 255, (code >> 8 & 255) / 255, (code & 255) / 255, alpha)


BACKGROUND = colour(0x0E0F10)
PANEL = colour(0x17181A)
CARD = colour(0x1D1F22)
LABEL = colour(0x1D1F22, 0.9)
FIELD = colour(0x26282C)
FIELD_HOVERED = colour(0x303338)
FIELD_ACTIVE = colour(0x3A3E45)
LINE = colour(0x2B2D31)
TEXT = colour(0xE4E6E9)
TEXT_SOFT = colour(0xA3A8B0)
TEXT_FAINT = colour(0x7C828B)
ACCENT = colour(0x6CB6E8)
ACCENT_DEEP = colour(0x284A62)
REALTIME = colour(0xC79BE8)
GOOD = colour(0x79C48C)
WARNING = colour(0xE5B567)
ERROR = colour(0xE8766C)


@dataclass(frozen=True)
class Fonts:
    """The typefaces, in any size."""

    regular: imgui.ImFont
    bold: imgui.ImFont


def apply(scale: float) -> Fonts:
    """Give the current imgui context its style and fonts; `scale` 1 is 96 dots per inch. Called once per context."""
    style = imgui.get_style()
    imgui.style_colors_dark()
    _shapes(style)
    _colours(style)
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


def change_scale(scale: float) -> None:
    """Go to another scale, as when the window is moved to another monitor."""
    style = imgui.get_style()
    _shapes(style)
    rescale(style, scale)


def _shapes(style: imgui.Style) -> None:
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
