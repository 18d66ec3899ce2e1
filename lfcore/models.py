"""The models that a weight file can hold, by name: each a config dataclass and a module built from it. No I/O here."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields
from typing import Any

from lfcore.compact import CompactConfig, CompactModel
from lfcore.networks import FullModel, ModelConfig, SingleConfig, SingleModel
from lfcore.planesweep import Levels

Model = FullModel | CompactModel | SingleModel
Config = ModelConfig | CompactConfig | SingleConfig

_BUILDERS: Mapping[str, tuple[type[Config], Callable[[Any], Model]]] = {
    "full": (ModelConfig, FullModel),
    "realtime": (CompactConfig, CompactModel),
    "single": (SingleConfig, SingleModel),
}
TRAINABLE = tuple(_BUILDERS)

# More is no config of this program; memory is taken only after this check.
_MOST_CHANNELS, _MOST_LAYERS = 512, 32


def build_model(config: Config) -> Model:
    """A model of that config with whatever weights torch starts from."""
    return _BUILDERS[config.name][1](config)


def config_from_json(values: Mapping[str, Any]) -> Config:
    """A config as `dataclasses.asdict` and JSON made it. Raises ValueError for what no model here has."""
    name = values.get("name")
    if not isinstance(name, str) or name not in _BUILDERS:
        raise ValueError(f"a model named {name!r}")
    kind = _BUILDERS[name][0]
    known = {field.name for field in fields(kind)}
    if not values.keys() <= known:
        raise ValueError(f"settings that {name} does not have ({', '.join(sorted(values.keys() - known))})")
    read = {key: _value(key, value) for key, value in values.items()}
    if kind is ModelConfig:
        read.setdefault("tone", "stored")  # files written before the root tone do not say it
    return kind(**read)


def _value(key: str, value: Any) -> Any:
    if key == "levels":
        return _levels(value)
    if key == "tone" and value not in ("root", "stored"):
        raise ValueError(f"a tone named {value!r}")
    if isinstance(value, list):
        if len(value) > _MOST_LAYERS:
            raise ValueError(f"{len(value)} layers")
        return tuple(_size(key, item) for item in value)
    return value if key in ("name", "tone") else _size(key, value)


def _levels(value: Any) -> Levels:
    try:
        levels = Levels(int(value["count"]), float(value["low"]), float(value["high"]))
    except (KeyError, TypeError, ValueError) as error:
        raise ValueError("levels without count, low and high") from error
    if not (2 <= levels.count <= 1000 and -1000 < levels.low < levels.high < 1000):
        raise ValueError(f"{levels.count} levels from {levels.low:g} to {levels.high:g}")
    return levels


def _size(key: str, value: Any) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or not 1 <= value <= _MOST_CHANNELS:
        raise ValueError(f"{key} = {value!r}")
    return value
