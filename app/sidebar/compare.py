"""The tab Compare: the picture against its partner, the models at this view, the scores of all captured views."""

from __future__ import annotations

from dataclasses import replace

from imgui_bundle import ImVec2, imgui

from app import theme
from app.commands import Context
from app.comparison import CAPTURED_VIEW, INSTANT, NO_CAPTURED_VIEW, Arrangement, Difference, partners
from app.readout import Readout, ScoreText
from app.scoring import RULES
from app.sidebar import score_map
from app.state import GAIN_LIMITS, Look
from app.widgets import DASH, capital, choice, decibels, em, heading, number, rule, slider, text, tile, title, tooltip

NEVER_SCORED = "Not scored: captured views are its inputs"


def draw(context: Context, readout: Readout, fonts: theme.Fonts) -> None:
    """The whole tab."""
    title("The picture against its partner", fonts)
    _partner(context, readout)
    _arrangement(context)
    _difference(context)
    _score(context, readout)
    rule()
    _table(readout, fonts)
    if readout.grid is not None:
        total = score_map.summary(readout.grid, readout.compared.views)
        heading(f"All captured views: {score_map.scored_words(readout, readout.grid)} scored", fonts)
        score_map.draw(context, readout, readout.grid, total)


def _partner(context: Context, readout: Readout) -> None:
    state = context.state
    before = state.comparison.partner
    hint = "What the picture is compared with: the camera's own view, the corner views warped by the newest disparity, "
    hint += "another model.  (Q: the next one)"
    offered = partners(readout.models, readout.model)
    chosen = choice("Partner", before, offered, hint, lambda each: capital(each) if each == CAPTURED_VIEW else each)
    if chosen != before:
        state.comparison = replace(state.comparison, partner=chosen)


def _arrangement(context: Context) -> None:
    comparison = context.state.comparison
    gap = em() * 0.25
    third = (imgui.get_content_region_avail().x - 2 * gap) / 3
    imgui.push_style_var(imgui.StyleVar_.item_spacing, ImVec2(gap, imgui.get_style().item_spacing.y))
    tile("Flip", "flip", context.state.flipped, context, third)
    imgui.same_line()
    tile("Wipe", "wipe", comparison.arrangement is Arrangement.WIPE, context, third)
    imgui.same_line()
    tile("Beside", "side by side", comparison.arrangement is Arrangement.SIDE_BY_SIDE, context, third)
    imgui.pop_style_var()


def _difference(context: Context) -> None:
    state = context.state
    before = state.comparison.difference
    hint = "How the difference from the partner is drawn; 3 shows it, 1 the picture again.  (E: the next kind)"
    chosen = Difference(choice("Difference", before.value, [each.value for each in Difference], hint, capital))
    if chosen is not before:
        state.comparison = replace(state.comparison, difference=chosen)
        state.look = Look.ERROR
    imgui.begin_disabled(before is Difference.BLOCKS)
    hint = "Differences are shown this many times as large.  (, and .)"
    state.gain = slider("Gain", state.gain, GAIN_LIMITS, f"× {state.gain:.1f}", hint, imgui.SliderFlags_.logarithmic.value)
    imgui.end_disabled()


def _score(context: Context, readout: Readout) -> None:
    """Of the two pictures that are compared, and by which protocol all scores of the tab are."""
    comparison, score = context.state.comparison, readout.compared.score
    hint = f"{RULES[comparison.rule].says}. " if comparison.rule in RULES else ""
    hint += "On a grid of 7 × 7 views the mean of all novel ones is the score of 7x7-Y, on one of 8 × 8 that of 8x8-BGR."
    chosen = choice("Protocol", comparison.rule, list(RULES), hint)
    if chosen != comparison.rule:
        context.state.comparison = replace(comparison, rule=chosen)
    if score is None:
        text(_why_no_score(context, readout), theme.TEXT_FAINT)
        return
    text(f"PSNR {decibels(score.psnr)}    SSIM {number(score.ssim, 4)}")
    tooltip(f"The synthesis against its partner, from the very values that are shown. {score.protocol}")


def _why_no_score(context: Context, readout: Readout) -> str:
    partner = context.state.comparison.partner
    if partner == CAPTURED_VIEW and readout.model in readout.compared.never_scored:
        return NEVER_SCORED
    if partner == CAPTURED_VIEW:
        there = readout.captured_here is not None
        return "Scored when the synthesis is there" if there else NO_CAPTURED_VIEW
    return "Scored when the hand rests" if partner == INSTANT else "Scored when both syntheses are there"


def _table(readout: Readout, fonts: theme.Fonts) -> None:
    """PSNR and SSIM of each model against the captured view."""
    hint = "Computed when the hand rests" if readout.compared.table else NO_CAPTURED_VIEW
    table = readout.compared.table or tuple((name, None) for name in readout.models)
    best = max((score.psnr for _, score in table if score is not None), default=None)
    imgui.push_style_var(imgui.StyleVar_.cell_padding, ImVec2(0, 0))
    if imgui.begin_table("models", 3):
        imgui.table_setup_column("model", imgui.TableColumnFlags_.width_stretch.value, 1.5)
        _head(fonts)
        for name, score in table:
            imgui.table_next_row()
            imgui.table_next_column()
            text(name, theme.TEXT if name == readout.model else theme.TEXT_SOFT)
            why_none = NEVER_SCORED if name in readout.compared.never_scored else hint
            _cells(score, score is not None and score.psnr == best, why_none)
        imgui.end_table()
    imgui.pop_style_var()


def _head(fonts: theme.Fonts) -> None:
    """What stands in the columns."""
    imgui.table_next_row()
    for words in ("Models at this view", "PSNR", "SSIM"):
        imgui.table_next_column()
        title(words, fonts)


def _cells(score: ScoreText | None, best: bool, hint: str) -> None:
    """hint: why there is no score."""
    colour = theme.GOOD if best else theme.TEXT
    imgui.table_next_column()
    text(decibels(score.psnr) if score else DASH, colour)
    tooltip(score.protocol if score else hint)
    imgui.table_next_column()
    text(number(score.ssim, 4) if score else DASH, colour)
