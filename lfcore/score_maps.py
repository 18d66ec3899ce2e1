"""Where in a picture a score comes from: SSIM around each pixel and PSNR by block, by the rules of the scoring protocols.

Every map is float32 (H, W), as large as the pictures, and nan where the rule does not look; the mean of a map of SSIM is the
score of that rule (`lfcore.metrics`). Pictures are float (H, W, 3), 1 = white.
"""

from __future__ import annotations

import numpy as np

from lfcore.lightfield import FloatArray
from lfcore.metrics import (
    FLAT_RADIUS,
    K16_CROP,
    PSNR_BLOCK,
    SSIM_RADIUS,
    AnyArray,
    block_psnr,
    block_psnr_of,
    flat_similarity,
    luma_pair,
    luma_similarity,
    similarity_map,
    to_uint8,
)


def rgb_similarity(synthesized: FloatArray, truth: FloatArray, crop: int = K16_CROP) -> FloatArray:
    """SSIM as K16 has it: colour pictures in 8 bits as volumes, mean over the channels."""
    inside = _inside(truth, crop)
    return _framed(truth, crop, similarity_map(to_uint8(synthesized)[inside], to_uint8(truth)[inside]))


def rgb_blocks(synthesized: FloatArray, truth: FloatArray, crop: int = K16_CROP) -> FloatArray:
    """PSNR in dB by block as K16 has it: over all channels in 8 bits."""
    inside = _inside(truth, crop)
    return _spread(truth, crop, block_psnr(to_uint8(synthesized)[inside], to_uint8(truth)[inside]))


def luma_similarity_map(synthesized: FloatArray, truth: FloatArray) -> FloatArray:
    """SSIM as 7x7-Y has it: of the luminance."""
    inside = _inside(truth, K16_CROP)
    found, captured = (picture[inside] for picture in luma_pair(synthesized, truth))
    return _framed(truth, K16_CROP + SSIM_RADIUS, luma_similarity(found, captured))


def luma_blocks(synthesized: FloatArray, truth: FloatArray) -> FloatArray:
    """PSNR in dB by block as 7x7-Y has it: of the luminance, the peak being 255."""
    inside = _inside(truth, K16_CROP)
    found, captured = (picture[inside] for picture in luma_pair(synthesized, truth))
    return _spread(truth, K16_CROP, block_psnr_of((found - captured) ** 2, 255.0))


def channel_similarity(synthesized: FloatArray, truth: FloatArray) -> FloatArray:
    """SSIM as 8x8-BGR has it: the mean over the channels of each one's own."""
    inside = _inside(truth, K16_CROP)
    a, b = to_uint8(synthesized)[inside], to_uint8(truth)[inside]
    mean = sum(flat_similarity(a[..., channel], b[..., channel]) for channel in range(3)) / 3
    return _framed(truth, K16_CROP + FLAT_RADIUS, np.asarray(mean))


def channel_blocks(synthesized: FloatArray, truth: FloatArray) -> FloatArray:
    """PSNR in dB by block as 8x8-BGR has it: the mean over the channels of each one's own."""
    inside = _inside(truth, K16_CROP)
    squares = (to_uint8(synthesized)[inside].astype(np.float64) - to_uint8(truth)[inside]) ** 2
    return _spread(truth, K16_CROP, np.mean([block_psnr_of(squares[..., channel], 255.0) for channel in range(3)], axis=0))


def _inside(picture: FloatArray, crop: int) -> tuple[slice, slice]:
    height, width = picture.shape[:2]
    return slice(crop, height - crop), slice(crop, width - crop)


def _framed(picture: FloatArray, crop: int, values: AnyArray) -> FloatArray:
    """Values of the pixels within the crop, in a frame of nan."""
    framed = np.full(picture.shape[:2], np.nan, np.float32)
    framed[_inside(picture, crop)] = values
    return framed


def _spread(picture: FloatArray, crop: int, blocks: AnyArray) -> FloatArray:
    """Every pixel within the crop gets its block's value."""
    height, width = picture.shape[0] - 2 * crop, picture.shape[1] - 2 * crop
    return _framed(picture, crop, blocks.repeat(PSNR_BLOCK, axis=0).repeat(PSNR_BLOCK, axis=1)[:height, :width])
