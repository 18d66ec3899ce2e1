"""The square-root tone in which networks see pictures: shot noise of equal size everywhere, dark captures not far from bright.

An ESLF holds linear values with a mean near 0.14; most other light fields come with a gamma. Shot noise grows with the root of
the light, so that after the root its size is the same in shadow and light (Anscombe 1948), and a difference of exposure by four
is one by two.
"""

from __future__ import annotations

import torch
from torch import Tensor

TOE = 0.004  # one step of 8 bits: the slope of the root stays finite in the dark, where read noise rules


def root_tone(stored: Tensor) -> Tensor:
    """Stored values (any shape, 1 = white; below 0 is taken as 0) to the root tone, about 0.06 to 1."""
    return torch.sqrt(stored.clamp_min(0) + TOE)


def stored_from_root(toned: Tensor) -> Tensor:
    """The inverse of `root_tone` for values that it can give; differentiable everywhere."""
    return toned.square() - TOE
