"""How the program comes by light fields and models. Readers are imported when first asked for, since they are slow to load."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from app.desk import Folder
from app.engine import Engine, ModelChoice
from app.exhibits import Exhibition, open_exhibition
from app.readable import readable
from assets import weights_path
from lfcore.errors import InputError
from lfcore.lightfield import LightField
from lfcore.nearest_inputs import NEIGHBOURS, NearestInputs
from lfcore.remote import RemoteSynthesizer, SynthesisProcess
from lfcore.store import ViewStore
from lfcore.synthesis import Synthesizer
from lfcore.weights_header import read_stated

if TYPE_CHECKING:
    from lfcore.thumbnails import ThumbnailStore


def open_by_content(
    path: Path, progress: Callable[[float], None], cancelled: Callable[[], bool]
) -> LightField | Exhibition | Folder:
    """Open any light field that lfcore can read, what a Lytro file without raw shows, or a folder of light fields.

    Calibration of a Lytro camera is remembered, and an InputError says so.
    """
    from lfcore.decode.calibration_files import holds_calibration
    from lfcore.decode.remembered import remember
    from lfcore.formats import open_light_field
    from lfcore.formats.collection import members

    if holds_calibration(path):
        remember(path)
        raise InputError(f"{path} is calibration of a Lytro camera: it is remembered, and used for its captures from now on.")
    inside = members(path)
    if inside:
        return Folder(path, inside)
    exhibition = open_exhibition(path)
    return exhibition if exhibition is not None else open_light_field(path, progress=progress, cancelled=cancelled)


def list_folder(path: Path) -> Folder:
    """The folder at this path, and what in it may be a light field. Raises InputError where there is nothing."""
    from lfcore.formats.collection import members

    inside = members(path)
    if not inside:
        raise InputError(f"{path} is no folder with light fields to choose from; open another.")
    return Folder(path, inside)


def folder_around(path: Path) -> Path:
    """The nearest folder above this light field with several to choose from. Raises InputError where there is none."""
    from lfcore.formats.collection import folder_around as found_around

    return found_around(path)


def thumbnail_store() -> ThumbnailStore:
    """Where this user's thumbnails are kept."""
    from lfcore.thumbnails import default_store

    return default_store()


def preview(path: Path) -> LightField | None:
    """A coarse picture of what takes seconds to open, in the place of all its views; None for what opens at once, or not."""
    from lfcore.errors import LfviewError
    from lfcore.formats import coarse_light_field

    try:
        return coarse_light_field(path)
    except (LfviewError, OSError):
        return None  # opening it will say what is wrong


DEFAULT_MODEL = "full"
QUICK = "realtime"
# lfcore.synthesizer.MODEL_NAMES, without importing torch; and the small pair with nearer inputs.
SHIPPED = ("full", "realtime", "single", "planesweep", "mean", NEIGHBOURS)


# The networks take every core they find; the frame loop, which draws on the same cores where there is no GPU, comes first.
# It sleeps for a part of every sixtieth of a second, which is then theirs, so this takes nothing from them.
PROCESS_NICENESS = 7  # where other programs keep all cores busy, with 10 too little is left for it (docs/speed.md)


def synthesis_process() -> SynthesisProcess:
    """The process in which the models of one window run; not started yet."""
    return SynthesisProcess(niceness=PROCESS_NICENESS)


def make_engine(model: str, cache_bytes: int, process: SynthesisProcess, store: ViewStore | None = None) -> Engine:
    """The engine on the named model or weight file. While the hand moves, the small networks stand in for larger ones."""
    quick = (lambda: RemoteSynthesizer(process, QUICK)) if weights_path(QUICK).is_file() else None
    choice, name = _choice(model, process), model_name(model)
    engine = Engine(choice.make, cache_bytes, quick, store, name, choice.scored)
    engine.use(name, choice)
    return engine


def model_name(model: str) -> str:
    """By which a model, named or a weight file, is known in the window."""
    return readable(Path(model).name)


def is_slow(model: str) -> bool:
    """Whether the small networks should stand in for a model, named or a weight file, while the hand moves."""
    return model in ("full", "single") or model.endswith(".safetensors")


def offered_models(model: str, process: SynthesisProcess) -> dict[str, ModelChoice]:
    """The models to choose from in the window, by name: the shipped ones, and the one that the program was started with."""
    names = dict.fromkeys([*SHIPPED, model])
    return {model_name(name): _choice(name, process) for name in names}


def _choice(model: str, process: SynthesisProcess) -> ModelChoice:
    return ModelChoice(synthesizer_factory(model, process), is_slow(model), scored=model != NEIGHBOURS)


def synthesizer_factory(model: str, process: SynthesisProcess) -> Callable[[], Synthesizer]:
    """What makes the synthesizer of the named model or weight file, which runs in the process, when called."""
    if model == NEIGHBOURS:
        make = synthesizer_factory(QUICK, process)
        return lambda: NearestInputs(make())
    file = weights_path(model) if model in SHIPPED else Path(model)
    return lambda: RemoteSynthesizer(process, model, stated=read_stated(file))
