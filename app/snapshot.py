"""The part of the view state that belongs to looking at a light field: what is undone and redone, and kept for each file."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import replace
from functools import lru_cache

from app.geometry import ZOOM_LIMITS
from app.limits import within
from app.plain_json import Json, field_types, from_json, to_json
from app.state import GAIN_LIMITS, TAIL_LIMITS, ViewState

Snapshot = Mapping[str, Json]

# Fields of ViewState that a snapshot holds.
LOOKED_AT = ("u", "v", "look", "captured", "looking", "focusing", "comparison", "zoom", "gain", "tail")


def take(state: ViewState) -> Snapshot:
    """The fields as JSON, which must not be changed."""
    return {name: _json_of(getattr(state, name)) for name in LOOKED_AT}


@lru_cache(maxsize=64, typed=True)  # True is not 1.0 here
def _json_of(value: Hashable) -> Json:
    """As `to_json`; a snapshot is taken in every frame, and most of it is as in the one before."""
    return to_json(value)


def put_back(state: ViewState, snapshot: Snapshot) -> None:
    """Give the state these fields, within their limits; what is missing or is not what it should be stays as it is."""
    expected = field_types(ViewState)
    for name in LOOKED_AT:
        if name in snapshot:
            try:
                setattr(state, name, from_json(expected[name], snapshot[name]))
            except (TypeError, ValueError):
                continue
    _hold_within_limits(state)


def _hold_within_limits(state: ViewState) -> None:
    """What a file says may have been written by any hand."""
    state.move_to(state.u, state.v)
    zoom = state.zoom
    scale = None if zoom.scale is None else within(zoom.scale, ZOOM_LIMITS)
    centre = (within(zoom.centre[0], (0.0, 1.0)), within(zoom.centre[1], (0.0, 1.0)))
    state.zoom = replace(zoom, scale=scale, centre=centre)
    state.gain = within(state.gain, GAIN_LIMITS)
    state.tail = within(state.tail, TAIL_LIMITS)
    state.looking = state.looking.bounded()
    state.focusing = state.focusing.bounded()
    state.comparison = state.comparison.bounded()
