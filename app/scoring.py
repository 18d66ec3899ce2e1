"""How far two pictures of one viewpoint are apart: scores, and maps of them, by the protocol that suits their size.

A map and its score are of the same pixels: what the protocol leaves out has no value in the map.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from app.readout import ScoreText
from lfcore.lightfield import FloatArray
from lfcore.metrics import K16_CROP, PSNR_BLOCK, block_psnr, k16, psnr, similarity_map, ssim, to_uint8

_SSIM_WINDOW = 11


@dataclass(frozen=True)
class Rule:
    """The protocol by which pictures are scored, and how many pixels it leaves out on each side."""

    protocol: str
    crop: int


def rule_for(height: int, width: int) -> Rule:
    """K16, or the same without its crop where the pictures are too small for that."""
    if min(height, width) > 2 * K16_CROP + _SSIM_WINDOW:
        return Rule(f"K16: 8 bits, {K16_CROP} px cropped", K16_CROP)
    return Rule("8 bits, whole picture", 0)


def score(shown: FloatArray, truth: FloatArray) -> ScoreText:
    """PSNR and SSIM of one picture (H, W, 3) against another, 1 = white."""
    rule = rule_for(*truth.shape[:2])
    if rule.crop:
        found = k16(shown, truth)
        return ScoreText(found.psnr, found.ssim, rule.protocol)
    a, b = to_uint8(shown), to_uint8(truth)
    return ScoreText(psnr(a, b), ssim(a, b), rule.protocol)


def similarity(shown: FloatArray, truth: FloatArray) -> FloatArray:
    """SSIM around each pixel, float32 (H, W), nan where the protocol does not look."""
    rule = rule_for(*truth.shape[:2])
    inside = _inside(rule, truth)
    values = np.full(truth.shape[:2], np.nan, np.float32)
    values[inside] = similarity_map(to_uint8(shown)[inside], to_uint8(truth)[inside])
    return values


def blocks(shown: FloatArray, truth: FloatArray) -> FloatArray:
    """PSNR in dB of the block in which each pixel lies, float32 (H, W), nan where the protocol does not look."""
    rule = rule_for(*truth.shape[:2])
    inside = _inside(rule, truth)
    values = np.full(truth.shape[:2], np.nan, np.float32)
    found = block_psnr(to_uint8(shown)[inside], to_uint8(truth)[inside])
    height, width = values[inside].shape
    values[inside] = found.repeat(PSNR_BLOCK, axis=0).repeat(PSNR_BLOCK, axis=1)[:height, :width]
    return values


def _inside(rule: Rule, picture: FloatArray) -> tuple[slice, slice]:
    height, width = picture.shape[:2]
    return slice(rule.crop, height - rule.crop), slice(rule.crop, width - rule.crop)
