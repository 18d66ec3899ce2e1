"""The optimiser: Muon for the convolutions' weights, Adam for all else.

Muon (Jordan 2024) replaces the mean gradient of a matrix by the nearest matrix with orthonormal rows, so that directions in
which the gradient is small are learnt as fast as those in which it is large. That is what the sweep's features ask for: what
tells two neighbouring levels apart is a small part of them. docs/training.md has the measurement.
"""

from __future__ import annotations

from collections.abc import Iterable

import torch
from torch import Tensor, nn
from torch.optim import Optimizer

_MOMENTUM = 0.95
# Coefficients of the quintic iteration, for five steps (Jordan 2024).
_A, _B, _C = 3.4445, -4.7750, 2.0315
_ITERATIONS = 5


def is_matrix(parameter: Tensor) -> bool:
    """Whether Muon is for this parameter: a convolution's weights with more than a few outputs."""
    return parameter.ndim == 4 and parameter.shape[0] >= 16


def orthogonalised(matrix: Tensor) -> Tensor:
    """The matrix (rows, columns) with its singular values brought near 1 (0.7 to 1.2), by a Newton-Schulz iteration."""
    x = matrix.T if matrix.shape[0] > matrix.shape[1] else matrix
    x = x / (x.norm() + 1e-7)
    for _ in range(_ITERATIONS):
        gram = x @ x.T
        x = _A * x + (_B * gram + _C * gram @ gram) @ x
    return x.T if matrix.shape[0] > matrix.shape[1] else x


def moment_shapes(parameter: Tensor) -> dict[str, tuple[int, ...]]:
    """The shapes of what is kept of a parameter from step to step, by name."""
    shape = tuple(parameter.shape)
    return {"momentum": shape} if is_matrix(parameter) else {"step": (), "mean": shape, "square": shape}


class MuonAdam(Optimizer):
    """Muon and Adam with one learning rate: Muon's steps are scaled to the size that Adam's have (Liu et al. 2025)."""

    def __init__(self, parameters: Iterable[nn.Parameter], lr: float) -> None:
        super().__init__(parameters, {"lr": lr, "betas": (0.9, 0.999)})

    @torch.no_grad()
    def step(self, closure: None = None) -> None:  # type: ignore[override]
        """Take one step by the gradients that are there."""
        for group in self.param_groups:
            for parameter in group["params"]:
                if parameter.grad is None:
                    continue
                state = self.state[parameter]
                update = _muon(parameter.grad, state) if is_matrix(parameter) else _adam(parameter.grad, state, group["betas"])
                parameter.add_(update, alpha=-group["lr"])


def _muon(gradient: Tensor, state: dict[str, Tensor]) -> Tensor:
    momentum = state.setdefault("momentum", torch.zeros_like(gradient))
    momentum.mul_(_MOMENTUM).add_(gradient)
    ahead = gradient.add(momentum, alpha=_MOMENTUM)  # Nesterov
    matrix = orthogonalised(ahead.reshape(ahead.shape[0], -1))
    return matrix.mul_(0.2 * max(matrix.shape) ** 0.5).reshape(gradient.shape)


def _adam(gradient: Tensor, state: dict[str, Tensor], betas: tuple[float, float]) -> Tensor:
    count = state.setdefault("step", torch.zeros(()))
    mean = state.setdefault("mean", torch.zeros_like(gradient))
    square = state.setdefault("square", torch.zeros_like(gradient))
    count += 1
    mean.lerp_(gradient, 1 - betas[0])
    square.lerp_(gradient.square(), 1 - betas[1])
    scale = (square / (1 - betas[1] ** float(count))).sqrt_().add_(1e-8)
    return mean / (1 - betas[0] ** float(count)) / scale
