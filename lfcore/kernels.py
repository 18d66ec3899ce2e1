"""Parts of a synthesis in C (kernels.c), for which torch has no fast operation. They are compiled when the package is
installed, where there is a compiler; elsewhere the same is computed in torch, more slowly.

What is computed is said in the modules that call this one; here it is handed over, as torch keeps it in memory.
"""

from __future__ import annotations

from types import ModuleType

import torch
from torch import Tensor


def _compiled() -> ModuleType | None:
    try:
        from lfcore import _kernels  # type: ignore[attr-defined]
    except ImportError:
        return None
    return _kernels


_KERNELS = _compiled()


def compiled() -> bool:
    """Whether they are there."""
    return _KERNELS is not None


def can_sweep(luma: Tensor, out: Tensor) -> bool:
    """Whether `plane_sweep` takes these arguments."""
    return (
        _KERNELS is not None
        and luma.device.type == out.device.type == "cpu"
        and luma.dtype == torch.float32
        and out.dtype in (torch.float32, torch.bfloat16)
        and out.stride(1) == 1
        and not (luma.requires_grad and torch.is_grad_enabled())
    )


def plane_sweep(luma: Tensor, whole: Tensor, taps: Tensor, valid: Tensor, corner: tuple[int, int], out: Tensor) -> None:
    """Mean and deviation at each of L levels over the N inputs (N, B, H, W) that count there.

    whole: (N, L, 2), whole pixels of the shift of each input and level along x and y. taps: (N, L, 2, 4), the weights of the
    samples at -1, 0, 1, 2 past it; samples beyond an edge repeat it. valid: (N, L, 2, 2), of the novel view's columns and rows
    the first that counts and the one past the last. corner: (top, left), the place in the novel view of the first pixel
    of `out`, (B, 2 L, h, w), channels side by side: the L means, then the L deviations. Arguments as `can_sweep` wants them.
    """
    assert _KERNELS is not None
    luma, taps = luma.contiguous(), taps.float().contiguous()
    whole, valid = whole.int().contiguous(), valid.int().contiguous()
    inputs, batch, height, width = luma.shape
    levels, rows, columns = out.shape[1] // 2, *out.shape[2:]
    assert whole.shape == (inputs, levels, 2) and taps.shape == (inputs, levels, 2, 4) and valid.shape == (inputs, levels, 2, 2)
    assert out.shape[0] == batch
    tables = (luma.data_ptr(), whole.data_ptr(), taps.data_ptr(), valid.data_ptr(), out.data_ptr())
    sizes = (inputs, batch, height, width, levels, *corner, rows, columns)
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
