"""Both themes can be read, and whoever holds a colour sees the theme change."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from imgui_bundle import ImVec4

from app import theme
from app.settings import Theme


@pytest.fixture(autouse=True)
def dark_again() -> Iterator[None]:
    yield
    theme.use(Theme.DARK)


def luminance(colour: ImVec4) -> float:
    """Relative luminance as WCAG 2 defines it."""
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in (colour.x, colour.y, colour.z)]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(a: ImVec4, b: ImVec4) -> float:
    dark, light = sorted((luminance(a), luminance(b)))
    return (light + 0.05) / (dark + 0.05)


@pytest.mark.parametrize("chosen", list(Theme))
def test_words_stand_out_from_their_grounds(chosen: Theme) -> None:
    theme.use(chosen)
    for ground in (theme.PANEL, theme.CARD):
        for words in (theme.TEXT, theme.TEXT_SOFT, theme.ACCENT, theme.GOOD, theme.WARNING, theme.ERROR, theme.REALTIME):
            assert contrast(words, ground) >= 4.5
        assert contrast(theme.TEXT_FAINT, ground) >= 3.5
    for ground in (theme.FIELD, theme.FIELD_HOVERED, theme.ACCENT_DEEP):
        assert contrast(theme.TEXT, ground) >= 4.5


@pytest.mark.parametrize("chosen", list(Theme))
def test_the_grounds_are_neutral(chosen: Theme) -> None:
    """A tint around a picture would change how its colours are seen."""
    theme.use(chosen)
    for ground in (theme.BACKGROUND, theme.PANEL, theme.CARD):
        parts = (ground.x, ground.y, ground.z)
        assert max(parts) - min(parts) <= 6 / 255


def sizes(imgui: Any) -> dict[str, object]:
    style = imgui.get_style()
    values = {name: getattr(style, name) for name in dir(style) if not name.startswith("_")}
    numbers = {name: value for name, value in values.items() if isinstance(value, int | float)}
    pairs = {name: (value.x, value.y) for name, value in values.items() if isinstance(value, imgui.ImVec2)}
    return {**numbers, **pairs}


def test_one_scale_after_another_is_the_last_alone(imgui_context: Any) -> None:
    theme.apply(1.5)
    fresh = sizes(imgui_context)
    for scale in (3.0, 1.0, 2.25, 1.5):
        theme.change_scale(scale)
    assert sizes(imgui_context) == fresh
    assert fresh["separator_size"] == 1.0  # imgui rounds down
    theme.change_scale(3.0)
    assert sizes(imgui_context)["separator_size"] == 3.0


def test_a_change_reaches_imgui_and_what_has_been_handed_out(imgui_context: Any) -> None:
    held = theme.TEXT
    theme.apply(1.0)
    style = imgui_context.get_style()
    dark = style.color_(imgui_context.Col_.window_bg).x
    theme.change(Theme.LIGHT)
    assert style.color_(imgui_context.Col_.window_bg).x > 0.8 > 0.3 > dark
    assert luminance(held) < 0.05
