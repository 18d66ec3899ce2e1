"""Parts of a synthesis in C, for which torch has no fast operation. They are compiled when the package is installed, where
there is a compiler; elsewhere the same is computed in torch, more slowly.

What is computed is said in the modules that call this one; here it is handed over, as torch keeps it in memory. All tensors are
on the CPU.
"""

from __future__ import annotations

import math
import os
from dataclasses import dataclass

import torch
import torch.nn.functional as F
from torch import Tensor

from lfcore.extensions import extension

_FUNCTIONS = (
    "plane_sweep",
    "cubic_sample",
    "fourier_forward",
    "fourier_backward",
    "winograd_convolution",
    "halves",
    "amx",
    "amx_products",
    "amx_convolution",
    "compact_disparity",
    "compact_align",
    "compact_warp",
    "compact_blend",
)

FOURIER_LEAST_CHANNELS = 16  # as many as lie in a register
FOURIER_FREQUENCIES = 129  # of a tile of 16 x 16 px: what a real picture has, but for 0
WINOGRAD_LEAST_CHANNELS = 8  # in float32
COLUMNS = 16  # channels out that are multiplied together
AMX_PIECE = 32  # values that the matrix unit multiplies at once
AMX_MOST_PIECES = 512  # under a kernel
AMX_MOST_VALUES = 64 * AMX_PIECE  # of rows that lie behind one another
_AMX_ROWS = 16
_NEVER = -1e30  # a score that is never chosen

_KERNELS = extension("lfcore._kernels", _FUNCTIONS)


def compiled() -> bool:
    """Whether they are there."""
    return _KERNELS is not None


def can_sweep(luma: Tensor, out: Tensor) -> bool:
    """Whether `plane_sweep` takes these arguments."""
    return (
        _KERNELS is not None
        and luma.device.type == out.device.type == "cpu"
        and luma.dtype == torch.float32
        and (out.dtype == torch.float32 or (out.dtype == torch.bfloat16 and out.shape[1] % 2 == 0))  # written in pairs
        and out.stride(1) == 1
        and not (luma.requires_grad and torch.is_grad_enabled())
    )


def plane_sweep(
    luma: Tensor, whole: Tensor, taps: Tensor, valid: Tensor, kept: Tensor, corner: tuple[int, int], out: Tensor
) -> None:
    """Means at some of L levels and deviations at all, over the N inputs (N, B, H, W) that count there.

    whole: (N, L, 2), whole pixels of the shift of each input and level along x and y. taps: (N, L, 2, 4), the weights of the
    samples at -1, 0, 1, 2 past it; samples beyond an edge repeat it. valid: (N, L, 2, 2), of the novel view's columns and rows
    the first that counts and the one past the last. kept: (K,), ascending, the levels whose means are wanted. corner:
    (top, left), the place in the novel view of the first pixel of `out`, (B, K + L, h, w), channels side by side: these means,
    then the deviations. Arguments as `can_sweep` wants them.
    """
    assert _KERNELS is not None
    luma, taps = luma.contiguous(), taps.float().contiguous()
    whole, valid, kept = whole.int().contiguous(), valid.int().contiguous(), kept.int().contiguous()
    inputs, batch, height, width = luma.shape
    levels, means, (channels, rows, columns) = whole.shape[1], len(kept), out.shape[1:]
    assert whole.shape == (inputs, levels, 2) and taps.shape == (inputs, levels, 2, 4) and valid.shape == (inputs, levels, 2, 2)
    assert out.shape[0] == batch and channels == means + levels
    tables = (luma.data_ptr(), whole.data_ptr(), taps.data_ptr(), valid.data_ptr(), kept.data_ptr(), out.data_ptr())
    sizes = (inputs, batch, height, width, levels, means, *corner, rows, columns)
    layout = (out.stride(0), out.stride(2), out.stride(3), out.dtype == torch.bfloat16)
    _KERNELS.plane_sweep(*tables, *sizes, *layout, torch.get_num_threads())


def can_sample(images: Tensor, x: Tensor, y: Tensor) -> bool:
    """Whether `cubic_sample` takes these arguments."""
    return _KERNELS is not None and all(
        part.device.type == "cpu" and part.dtype == torch.float32 and not (part.requires_grad and torch.is_grad_enabled())
        for part in (images, x, y)
    )


def cubic_sample(images: Tensor, x: Tensor, y: Tensor, a: float, outside: bool) -> Tensor:
    """Keys' cubic interpolation of images (N, C, H, W) at the places x and y, px, each (N, ...): (N, C, ...).

    a: of the kernel. outside: whether places outside the picture give its edge, repeated; else they give 0. A place that is
    not a number counts as outside. Arguments as `can_sample` wants them.
    """
    assert _KERNELS is not None and x.shape == y.shape and x.shape[0] == images.shape[0]
    images, x, y = images.contiguous(), x.contiguous(), y.contiguous()
    count, channels, height, width = images.shape
    out = torch.empty(count, channels, *x.shape[1:])
    places = x[0].numel() if count else 0
    addresses = (images.data_ptr(), x.data_ptr(), y.data_ptr(), out.data_ptr())
    _KERNELS.cubic_sample(*addresses, count, channels, height, width, places, a, outside, torch.get_num_threads())
    return out


def fourier_forward(x: Tensor, spectra: Tensor, sums: Tensor, step: int, first: int) -> None:
    """Spectra of tiles of 16 x 16 px, of which each begins `step` px after the last; zeros beyond the picture.

    x: (1, C, H, W), channels_last, float32 or bfloat16, C at least FOURIER_LEAST_CHANNELS. The tiles cover a result of
    (H - 16 + step, W - 16 + step). spectra: (129, tiles, 2 C), set for the tiles from `first` on, row by row: the
    real, then the imaginary parts, in the order that lfcore.fourier knows. sums: (tiles, C) float32, frequency 0.
    """
    _, _, height, width = x.shape
    _transform(x, spectra, sums, None, (height - 16 + step, width - 16 + step), step, first)


def fourier_backward(spectra: Tensor, sums: Tensor, bias: Tensor, out: Tensor, step: int, first: int) -> None:
    """The inverse, times 256: of each tile the first `step` x `step` px, with the bias (C,) float32, where positive, else 0.

    out: (1, C, h, w), channels_last, of which the tiles from `first` on are set. Otherwise as `fourier_forward`.
    """
    assert bias.shape == (out.shape[1],)
    _transform(out, spectra, sums, bias, (out.shape[2], out.shape[3]), step, first)


def _transform(
    x: Tensor, spectra: Tensor, sums: Tensor, bias: Tensor | None, result: tuple[int, int], step: int, first: int
) -> None:
    assert _KERNELS is not None
    batch, channels, height, width = x.shape
    frequencies, tiles, parts = spectra.shape
    assert frequencies == FOURIER_FREQUENCIES and parts == 2 * channels and channels >= FOURIER_LEAST_CHANNELS and batch == 1
    assert sums.shape == (tiles, channels)
    assert first >= 0 and first + tiles <= math.ceil(result[0] / step) * math.ceil(result[1] / step)
    assert spectra.is_contiguous() and spectra.dtype == x.dtype
    _check((x,), (sums,) if bias is None else (sums, bias))
    run = _KERNELS.fourier_forward if bias is None else _KERNELS.fourier_backward
    addresses = (*_addresses((x, spectra, sums)), 0 if bias is None else bias.data_ptr())
    run(*addresses, height, width, channels, *result, step, first, tiles, x.dtype == torch.bfloat16, torch.get_num_threads())


def can_convolve(dtype: torch.dtype) -> bool:
    """Whether `winograd_convolution` takes pictures of this type: bfloat16 needs AVX-512 with its products of pairs."""
    if _KERNELS is None:
        return False
    return dtype == torch.float32 or (dtype == torch.bfloat16 and bool(_KERNELS.halves()))


def winograd_convolution(
    x: Tensor,
    weights: Tensor,
    bias: Tensor,
    plus: Tensor | None,
    out: Tensor,
    padding: int,
    dilation: int,
    of_positive: bool,
    positive: bool,
) -> None:
    """A convolution with 3 x 3 kernels, as lfcore.layers.Layer describes it, from kernels that are transformed already.

    x: (1, C, H, W), channels_last, of a type that `can_convolve`. weights, of the same type: (36, groups, pairs,
    COLUMNS, 2), channels in by pairs, channels out in groups, both filled up with zeros; of each full 32 channels
    in, the even ones come first, then the odd ones. In float32 (36, groups, C, COLUMNS), as they are. bias: (O,)
    float32. plus: like `out`, or None. out: (1, O, H - 2 (dilation - padding), W - ...), channels_last, not x, of the same
    type. In float32 C and O are at least WINOGRAD_LEAST_CHANNELS.
    """
    assert _KERNELS is not None and can_convolve(x.dtype)
    (batch, channels, height, width), (_, outputs, *size) = x.shape, out.shape
    halved = x.dtype == torch.bfloat16
    groups = math.ceil(outputs / COLUMNS)
    kernels = (math.ceil(channels / 2), COLUMNS, 2) if halved else (channels, COLUMNS)
    assert weights.shape == (36, groups, *kernels) and weights.is_contiguous() and weights.dtype == x.dtype
    assert batch == 1 and bias.shape == (outputs,) and (halved or min(channels, outputs) >= WINOGRAD_LEAST_CHANNELS)
    lost = 2 * (dilation - padding)
    assert size == [height - lost, width - lost] and min(size) > 0 and padding >= 0 and dilation >= 1
    assert plus is None or plus.shape == out.shape
    _check((x, out) if plus is None else (x, out, plus), (bias,))
    addresses = (*_addresses((x, weights, bias)), 0 if plus is None else plus.data_ptr(), out.data_ptr())
    sizes = (height, width, channels, padding, groups, outputs, *size, dilation)
    _KERNELS.winograd_convolution(*addresses, *sizes, of_positive, positive, halved, torch.get_num_threads())


def has_amx() -> bool:
    """Whether there is a matrix unit for bfloat16, and it may be used: ONEDNN_MAX_CPU_ISA binds this as it binds torch."""
    allowed = os.environ.get("ONEDNN_MAX_CPU_ISA", "DEFAULT").upper()
    return _KERNELS is not None and (allowed == "DEFAULT" or "AMX" in allowed) and bool(_KERNELS.amx())


def amx_packed(matrices: Tensor) -> Tensor:
    """Matrices (N, C, P) as the matrix unit takes them, filled up: (N, groups, pieces, AMX_PIECE / 2, COLUMNS, 2)."""
    filled = F.pad(matrices, (0, -matrices.shape[2] % COLUMNS, 0, -matrices.shape[1] % AMX_PIECE))
    parts = filled.unflatten(2, (-1, COLUMNS)).unflatten(1, (-1, AMX_PIECE // 2, 2))
    return parts.permute(0, 4, 1, 2, 5, 3).to(torch.bfloat16).contiguous()


def amx_room(matrices: int, count: int, values: int) -> Tensor:
    """Flat memory for the rows of `amx_products`, bfloat16, with what that reads, but does not use, beyond the last."""
    return torch.empty(matrices * count * values + (_AMX_ROWS - 1) * values + AMX_PIECE, dtype=torch.bfloat16)


def amx_products(room: Tensor, values: int, packed: Tensor, out: Tensor) -> None:
    """Products of N matrices, where `has_amx`.

    room: by `amx_room`, for as much or more; it begins with the rows, (N, M, C), finite. values: C. packed: by `amx_packed`, of
    (N, C, P). out: (N, M, P) bfloat16, contiguous.
    """
    assert _KERNELS is not None
    matrices, count, columns = out.shape
    groups, pieces = math.ceil(columns / COLUMNS), math.ceil(values / AMX_PIECE)
    assert packed.shape == (matrices, groups, pieces, AMX_PIECE // 2, COLUMNS, 2) and values <= AMX_MOST_VALUES
    used = matrices * count * values
    assert room.ndim == 1 and len(room) >= used + (_AMX_ROWS - 1) * values + AMX_PIECE
    assert all(part.is_contiguous() and part.dtype == torch.bfloat16 for part in (room, packed, out))
    room[used : used + AMX_PIECE] = 0  # multiplied by zeros, which must not meet what is no number
    _KERNELS.amx_products(*_addresses((room, packed, out)), matrices, count, values, columns, torch.get_num_threads())


@dataclass(frozen=True)
class AmxKernel:
    """A convolution's kernel and its place, as `amx_convolution` takes it."""

    packed: Tensor  # (1, groups, pieces, AMX_PIECE / 2, COLUMNS, 2): see lfcore.amx
    bias: Tensor  # (groups * COLUMNS,) float32
    size: int  # px along both axes
    stride: int
    padding: int
    dilation: int


def amx_pieces(size: int, channels: int, dilation: int) -> int:
    """How many pieces of channels lie under a kernel: without gaps those of a row of pixels lie side by side."""
    runs, run = (size, size) if dilation == 1 else (size**2, 1)
    return runs * math.ceil(run * channels / AMX_PIECE)


def amx_convolution(x: Tensor, kernel: AmxKernel, plus: Tensor | None, out: Tensor, of_positive: bool, positive: bool) -> None:
    """A convolution as lfcore.layers.Layer describes it, where `has_amx`.

    x: (1, C, H, W), channels_last, finite. plus: like `out`, or None. out: (1, O, h, w), channels_last, not x. All
    bfloat16.
    """
    assert _KERNELS is not None
    (batch, channels, height, width), (_, outputs, *size) = x.shape, out.shape
    groups, pieces = math.ceil(outputs / COLUMNS), amx_pieces(kernel.size, channels, kernel.dilation)
    assert batch == 1 and pieces <= AMX_MOST_PIECES and kernel.packed.shape[1:3] == (groups, pieces)
    assert kernel.packed.is_contiguous() and kernel.bias.shape == (groups * COLUMNS,)
    lost = (kernel.size - 1) * kernel.dilation - 2 * kernel.padding
    assert size == [(extent - lost - 1) // kernel.stride + 1 for extent in (height, width)] and min(size) > 0
    assert plus is None or plus.shape == out.shape
    assert x.dtype == kernel.packed.dtype == torch.bfloat16
    _check((x, out) if plus is None else (x, out, plus), (kernel.bias,))
    addresses = (*_addresses((x, kernel.packed, kernel.bias)), 0 if plus is None else plus.data_ptr(), out.data_ptr())
    shape = (kernel.size, kernel.stride, kernel.padding, kernel.dilation)
    sizes = (height, width, channels, *shape, outputs, *size)
    _KERNELS.amx_convolution(*addresses, *sizes, of_positive, positive, torch.get_num_threads())


def paired(matrices: Tensor) -> Tensor:
    """Matrices (N, C, P) as products of bfloat16 take them: (N, groups, pairs, COLUMNS, 2), filled up with zeros."""
    filled = F.pad(matrices, (0, -matrices.shape[2] % COLUMNS, 0, matrices.shape[1] % 2))
    return filled.unflatten(2, (-1, COLUMNS)).unflatten(1, (-1, 2)).permute(0, 3, 1, 4, 2).to(torch.bfloat16).contiguous()


@dataclass(frozen=True)
class PixelMatrix:
    """A matrix by which the channels of pixels are multiplied, and a bias, as `compact_disparity` takes them."""

    weights: Tensor  # (C, P) float32, P a multiple of COLUMNS
    halved: Tensor | None  # the same, `paired`, where the processor can multiply it
    packed: Tensor | None  # the same, `amx_packed`, where there is a matrix unit
    bias: Tensor  # (P,) float32

    @classmethod
    def of(cls, weights: Tensor, bias: Tensor) -> PixelMatrix:
        """weights: (C, P) and bias: (P,), filled up with columns that are never looked at."""
        more = -len(bias) % COLUMNS
        weights, bias = F.pad(weights, (0, more)).contiguous(), F.pad(bias, (0, more), value=_NEVER)
        can_halve = can_convolve(torch.bfloat16) and weights.shape[0] % 2 == 0
        can_pack = has_amx() and weights.shape[0] <= AMX_MOST_VALUES
        halved, packed = (
            (pack(weights.unsqueeze(0)) if can else None) for pack, can in ((paired, can_halve), (amx_packed, can_pack))
        )
        return cls(weights, halved, packed, bias)

    def addresses(self, dtype: torch.dtype) -> tuple[int, int, int, int]:
        """For pixels of a type."""
        short = dtype == torch.bfloat16
        halved, packed = (part.data_ptr() if short and part is not None else 0 for part in (self.halved, self.packed))
        return self.weights.data_ptr(), halved, packed, self.bias.data_ptr()


def compact_disparity(
    pixels: Tensor,
    deviations: Tensor,
    score: PixelMatrix,
    values: Tensor,
    spread: PixelMatrix,
    sharpness: float,
) -> Tensor:
    """The last steps of lfcore.compact.CompactDisparity, from its hidden channels to the four phases of the disparity.

    pixels: (1, C, h, w), not negative, and deviations: (1, L, h, w) of the sweep, both channels_last and of one type,
    bfloat16 or float32. score: (C, P), P not less than L; what goes beyond L must have a bias that is never chosen. values:
    (P,) float32, px. spread: (C, 48): column 4 k + phase is the score of neighbour k of nine, columns from 36 on do not
    count. Returns (4, h, w) float32, px.
    """
    assert _KERNELS is not None
    _, channels, height, width = pixels.shape
    levels, outputs = deviations.shape[1], values.numel()
    assert deviations.shape == (1, levels, height, width) and levels <= outputs
    assert score.weights.shape == (channels, outputs) and spread.weights.shape == (channels, 48)
    _check((pixels, deviations), (score.weights, score.bias, values, spread.weights, spread.bias))
    coarse, disparity = torch.empty(height, width), torch.empty(4, height, width)
    dtype = pixels.dtype
    matrices = (score.addresses(dtype), values.data_ptr(), spread.addresses(dtype))
    parts = (*_addresses((pixels, deviations)), *matrices, *_addresses((coarse, disparity)))
    sizes = (height, width, channels, levels, outputs)
    halved = dtype == torch.bfloat16
    _KERNELS.compact_disparity(*parts, *sizes, sharpness, halved, halved and can_convolve(dtype), torch.get_num_threads())
    return disparity


def compact_align(
    luma: Tensor,
    disparity: Tensor,
    offsets: Tensor,
    moves: Tensor,
    reach: int,
    a: float,
    weights: Tensor,
    flat: float,
    most: float,
) -> Tensor:
    """The phases of a disparity, moved to where the inputs agree best: what lfcore.alignment does, warp included.

    luma: (4, H, W) float32, continued by `reach` px beyond the edges, at least two. disparity: (4, h, w) float32. offsets,
    moves, a: as for `compact_warp`. weights: (7,) float32, flat, most: see lfcore.alignment. Returns (4, h, w) float32.
    Beside it, memory for 24 bytes a pixel of the picture.
    """
    assert _KERNELS is not None
    _, height, width = disparity.shape
    assert luma.ndim == 3 and luma.shape[0] == 4 and min(luma.shape[1:]) >= 4 and reach >= 2 and luma.numel() < 2**31
    assert disparity.shape[0] == 4 and offsets.shape == moves.shape == (4, 2)
    along_axes = torch.stack((offsets.T, moves.T))  # (2, 2, 4)
    assert weights.shape == (7,)
    _check((), (luma, disparity, along_axes, weights))
    warped, products = torch.empty(2 * height, 4, 2 * width + 2), torch.empty(2 * height, 2, 2 * width)
    aligned = torch.empty(4, height, width)
    parts = _addresses((luma, disparity, along_axes, weights, warped, products, aligned))
    _KERNELS.compact_align(*parts, *luma.shape[1:], height, width, reach, a, flat, most, torch.get_num_threads())
    return aligned


def warp_type(dtype: torch.dtype) -> torch.dtype:
    """In which `compact_warp` takes corners and returns warped inputs for networks of a type: float16, half the memory, where
    products of bfloat16 are (processors with AVX-512), else float32."""
    return torch.float16 if dtype == torch.bfloat16 and can_convolve(dtype) else torch.float32


def compact_warp(
    corners: Tensor,
    disparity: Tensor,
    offsets: Tensor,
    moves: Tensor,
    reach: int,
    a: float,
    position: tuple[float, float],
    dtype: torch.dtype,
) -> tuple[Tensor, Tensor]:
    """The inputs warped by the phases of a disparity, and with it what lfcore.compact.CompactColour begins with.

    corners: (4, H, W, 4) of `warp_type(dtype)`, three channels and one that does not count, continued by `reach` px beyond the
    edges, at least two. disparity: (4, h, w) float32. offsets, moves: (4, 2) float32; inputs are sampled at x + move + offset *
    disparity. a: of the cubic kernel. position: as the network takes it. Returns (1, 64, h, w) in channels_last order and of
    `dtype`, by phase: means and the differences from them of the four inputs, three channels each; then the position, the mean
    disparity and how far it spreads; and the warped inputs, (h, w, 4, 4, 4) by phase, input and channel, the fourth of which
    does not count, of the corners' type.
    """
    assert _KERNELS is not None
    _, height, width = disparity.shape
    assert corners.shape[0] == corners.shape[3] == 4 and min(corners.shape[1:3]) >= 4 and reach >= 2
    assert disparity.shape[0] == 4 and offsets.shape == moves.shape == (4, 2) and corners.numel() < 2**31
    along_axes = torch.stack((offsets.T, moves.T))  # (2, 2, 4)
    _check((), (disparity, along_axes))
    assert corners.is_contiguous() and corners.dtype == warp_type(dtype)
    gathered = torch.empty(1, 64, height, width, dtype=dtype, memory_format=torch.channels_last)
    warped = torch.empty(height, width, 4, 4, 4, dtype=corners.dtype)
    sizes = (*corners.shape[1:3], height, width, reach)
    parts = _addresses((corners, disparity, along_axes, gathered, warped))
    types = (dtype == torch.bfloat16, corners.dtype == torch.float16)
    _KERNELS.compact_warp(*parts, *sizes, a, *position, *types, torch.get_num_threads())
    return gathered, warped


def compact_blend(
    outputs: Tensor,
    straight: Tensor,
    warped: Tensor,
    nearness: Tensor,
    size: tuple[int, int],
    scales: tuple[float, float, float],
) -> Tensor:
    """The last steps of lfcore.compact.CompactColour: the warped inputs, each with its weight, and the residual.

    outputs: (1, 28, h, w) and straight: (1, 12, h, w), channels_last, of one type, bfloat16 or float32: 16 scores by input,
    then phase, and 12 channels of the residual by phase, then channel, to which `straight` is added. warped: as `compact_warp`
    returns it. nearness: (4,) float32, added to the inputs' scores. size: of the picture, at most (2 h, 2 w).
    scales: what was taken off the warped inputs, what the residual counts, and the toe of the root tone. Returns (height,
    width, 3) float32, stored values.
    """
    assert _KERNELS is not None
    _, _, height, width = outputs.shape
    assert outputs.shape[1] == 28 and straight.shape == (1, 12, height, width)
    assert warped.shape == (height, width, 4, 4, 4) and nearness.shape == (4,)
    assert size[0] <= 2 * height and size[1] <= 2 * width
    _check((outputs, straight), (nearness,))
    assert warped.is_contiguous() and warped.dtype == warp_type(outputs.dtype)
    picture = torch.empty(*size, 3)
    parts = _addresses((outputs, straight, warped, nearness, picture))
    types = (outputs.dtype == torch.bfloat16, warped.dtype == torch.float16)
    _KERNELS.compact_blend(*parts, height, width, *size, *scales, *types, torch.get_num_threads())
    return picture


def _check(of_networks: tuple[Tensor, ...], others: tuple[Tensor, ...]) -> None:
    """Raises AssertionError where memory is not as the C code takes it to be."""
    for part in of_networks:
        assert part.is_contiguous(memory_format=torch.channels_last) and part.dtype == of_networks[0].dtype
        assert part.dtype in (torch.float32, torch.bfloat16)
    assert all(part.is_contiguous() and part.dtype == torch.float32 for part in others)


def _addresses(parts: tuple[Tensor, ...]) -> tuple[int, ...]:
    return tuple(part.data_ptr() for part in parts)
