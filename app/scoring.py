"""How far two pictures of one viewpoint are apart: scores, and maps of them, by the rule of a scoring protocol."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from app.readout import ScoreText
from lfcore import score_maps
from lfcore.lightfield import FloatArray
from lfcore.metrics import K16_CROP, SSIM_RADIUS, Score, channel_score, k16, luma_score, psnr, ssim, to_uint8

Compare = Callable[[FloatArray, FloatArray], FloatArray]

_LEAST_SIDE = 2 * K16_CROP + 2 * SSIM_RADIUS + 1  # px, that the protocols ask for


@dataclass(frozen=True)
class Rule:
    """A rule of scoring one picture (H, W, 3), 1 = white, against another, and its maps (H, W), nan where it does not look."""

    name: str
    says: str
    score: Callable[[FloatArray, FloatArray], Score]
    similarity: Compare
    blocks: Compare


def _whole(shown: FloatArray, truth: FloatArray) -> Score:
    a, b = to_uint8(shown), to_uint8(truth)
    return Score(psnr(a, b), ssim(a, b))


RULES = {
    rule.name: rule
    for rule in (
        Rule("K16", f"RGB in 8 bits, {K16_CROP} px cropped", k16, score_maps.rgb_similarity, score_maps.rgb_blocks),
        Rule(
            "7x7-Y",
            f"luminance Y, {K16_CROP} px cropped",
            luma_score,
            score_maps.luma_similarity_map,
            score_maps.luma_blocks,
        ),
        Rule(
            "8x8-BGR",
            f"mean of channels in 8 bits, {K16_CROP} px cropped",
            channel_score,
            score_maps.channel_similarity,
            score_maps.channel_blocks,
        ),
    )
}
DEFAULT_RULE = "K16"

_WHOLE = Rule(
    "whole picture",
    "RGB in 8 bits, for views too small to be cropped",
    _whole,
    partial(score_maps.rgb_similarity, crop=0),
    partial(score_maps.rgb_blocks, crop=0),
)


def rule_for(name: str, height: int, width: int) -> Rule:
    """The named rule, or that of the whole picture where pictures are too small for it."""
    return RULES[name] if min(height, width) >= _LEAST_SIDE else _WHOLE


def score(rule: str, shown: FloatArray, truth: FloatArray) -> ScoreText:
    """PSNR and SSIM of one picture against another by the named rule."""
    chosen = rule_for(rule, *truth.shape[:2])
    found = chosen.score(shown, truth)
    return ScoreText(found.psnr, found.ssim, f"{chosen.name}: {chosen.says}")
