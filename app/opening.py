"""How the program comes by light fields and models; both are imported when first asked for, since they are slow to load."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from app.engine import Engine, ModelChoice
from app.exhibits import Exhibition, open_exhibition
from assets import weights_path
from lfcore.errors import InputError
from lfcore.lightfield import LightField
from lfcore.store import ViewStore

if TYPE_CHECKING:
    from lfcore.synthesizer import Synthesizer


def open_by_content(path: Path, progress: Callable[[float], None], cancelled: Callable[[], bool]) -> LightField | Exhibition:
    """Open any light field that lfcore can read, or what a Lytro file without raw shows.

    Calibration of a Lytro camera is remembered, and an InputError says so.
    """
    from lfcore.decode.calibration_files import holds_calibration
    from lfcore.decode.remembered import remember
    from lfcore.formats import open_light_field

    if holds_calibration(path):
        remember(path)
        raise InputError(f"{path} is calibration of a Lytro camera: it is remembered, and used for its captures from now on.")
    exhibition = open_exhibition(path)
    return exhibition if exhibition is not None else open_light_field(path, progress=progress, cancelled=cancelled)


def preview(path: Path) -> LightField | None:
    """A coarse picture of what takes seconds to open, in the place of all its views; None for what opens at once, or not."""
    from lfcore.errors import LfviewError
    from lfcore.formats import coarse_light_field

    try:
        return coarse_light_field(path)
    except (LfviewError, OSError):
        return None  # opening it will say what is wrong


QUICK = "realtime"
SHIPPED = ("full", "realtime", "planesweep", "mean")  # lfcore.synthesizer.MODEL_NAMES, without importing torch


def make_engine(model: str, cache_bytes: int, store: ViewStore | None = None) -> Engine:
    """The engine on the named model or weight file. While the hand moves, the small networks stand in for larger ones."""
    quick = synthesizer_factory(QUICK) if weights_path(QUICK).is_file() else None
    engine = Engine(synthesizer_factory(model), cache_bytes, quick, store, Path(model).name)
    engine.use(Path(model).name, synthesizer_factory(model), is_slow(model))
    return engine


def is_slow(model: str) -> bool:
    """Whether the small networks should stand in for a model, named or a weight file, while the hand moves."""
    return model == "full" or model.endswith(".safetensors")


def offered_models(model: str) -> dict[str, ModelChoice]:
    """The models to choose from in the window, by name: the shipped ones, and the one that the program was started with."""
    names = dict.fromkeys([*SHIPPED, model])
    return {Path(name).name: ModelChoice(synthesizer_factory(name), is_slow(name)) for name in names}


def synthesizer_factory(model: str) -> Callable[[], Synthesizer]:
    """What makes the synthesizer of the named model or weight file when called."""

    def make() -> Synthesizer:
        # Threads of the networks that wait for each other spin for some microseconds, then sleep: for ever spinning ones would
        # keep the frame loop, and each other, from the cores; ones that sleep at once make the thousands of small steps of
        # the plane sweep five times slower (2.1 s in place of 0.45 s). Read when torch is loaded.
        if "OMP_WAIT_POLICY" not in os.environ:
            os.environ.setdefault("GOMP_SPINCOUNT", "10000")
        from lfcore.synthesizer import make_synthesizer

        return make_synthesizer(model)

    return make
