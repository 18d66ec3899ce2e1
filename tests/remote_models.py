"""Models for tests of synthesis in another process, which finds them here by name."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from lfcore.errors import Cancelled, InputError
from lfcore.lightfield import CORNERS, FloatArray, LightField
from lfcore.synthesis import Synthesis, Synthesizer

PATIENT_SECONDS = 30.0


def blend(corners: FloatArray, u: float, v: float) -> FloatArray:
    """Corner views (4, H, W, 3) by their nearness to (u, v): tells them apart by place."""
    return sum(
        (np.float32(abs(1 - cu - u) * abs(1 - cv - v)) * view for (cu, cv), view in zip(CORNERS, corners, strict=True)),
        np.zeros_like(corners[0]),
    )


class Blender:
    """Blends the corners. What else happens is told by its name; "patient" may say which file tells that a query has begun."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.key = f"key of {name}"
        self._corners: FloatArray | None = None

    def set_light_field(self, light_field: LightField) -> None:
        self._corners = light_field.corners()

    def synthesize(self, u: float, v: float, cancelled: Callable[[], bool] = lambda: False) -> Synthesis:
        assert self._corners is not None
        if self.name.startswith("patient"):
            began = self.name.partition(" ")[2]
            if began:
                Path(began).touch()
            end = time.monotonic() + PATIENT_SECONDS
            while time.monotonic() < end:
                if cancelled():
                    raise Cancelled
                time.sleep(0.005)
        if self.name == "threaded":
            threading.Thread(target=time.sleep, args=(PATIENT_SECONDS,), daemon=True).start()
        if self.name == "wrong input":
            raise InputError("One sentence.")
        if self.name == "faulty":
            raise ZeroDivisionError("of the model")
        if self.name == "dying":
            os._exit(3)
        image = blend(self._corners, u, v)
        disparity = None if self.name == "flat" else np.full(image.shape[:2], u - v, np.float32)
        return Synthesis(u, v, self.name, image, disparity, None, {"total": 0.5})


class Weigher(Blender):
    """The same, and tells the shares of the corners."""

    weighs = True

    def synthesize_weighed(self, u: float, v: float, cancelled: Callable[[], bool] = lambda: False) -> Synthesis:
        synthesis = self.synthesize(u, v, cancelled)
        shares = [np.full(synthesis.image.shape[:2], 255 * abs(1 - cu - u) * abs(1 - cv - v), np.uint8) for cu, cv in CORNERS]
        return replace(synthesis, weights=np.stack(shares))


def make(model: str) -> Synthesizer:
    """The model of that name."""
    if model == "weigher":
        return Weigher(model)
    if model == "missing":
        raise InputError("There is no such model.")
    return Blender(model)
