"""What is looked at, and put right, in light fields of several kinds after they are read."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lfcore.disparity_sign import DisparityCheck, Order, baselines_differ, check_disparity
from lfcore.formats.dark import find_dark_views
from lfcore.formats.images import Pixels
from lfcore.lightfield import LightField


def without_non_finite(view: Pixels) -> int:
    """Set nan and inf of a float view to 0 in place; return how many there were."""
    if view.dtype.kind != "f":
        return 0
    bad = ~np.isfinite(view)
    count = int(np.count_nonzero(bad))
    if count:
        view[bad] = 0
    return count


def with_warnings(light_field: LightField) -> LightField:
    """With warnings: rows and columns run against the pictures, their baselines differ, values lie above white."""
    return _warned_of_order(warned_of_white(light_field), check_disparity(light_field))


def put_in_order(light_field: LightField) -> LightField:
    """With its rows reversed, in place, where one axis runs against the pictures; else as with_warnings.

    For kinds of which either axis may run the other way; which of them does cannot be told from the pictures.
    """
    check = check_disparity(light_field)
    if check.order is not Order.REVERSED:
        return _warned_of_order(warned_of_white(light_field), check)
    _reverse_rows(light_field.views)
    facts = {**light_field.facts, "Row order": "reversed, as the pictures show"}
    return warned_of_white(replace(light_field, facts=facts, dark=find_dark_views(light_field.views)))


def warned_of_white(light_field: LightField) -> LightField:
    """With a warning where values lie above white."""
    views = light_field.views
    if views.dtype.kind != "f" or (most := float(views.max())) <= 1:
        return light_field
    share = np.count_nonzero(np.greater(views, 1)) / views.size
    return _with(
        light_field, f"{share:.1%} of the values lie above 1, up to {most:g}; 1 is white, which is what they are taken for."
    )


def _warned_of_order(light_field: LightField, check: DisparityCheck) -> LightField:
    if check.is_wrong:
        return _with(light_field, check.sentence)
    if baselines_differ(light_field, check):
        grid = f"{light_field.rows} x {light_field.columns}"
        return _with(
            light_field,
            f"The views of this grid of {grid} lie equally far apart along rows and columns, so its two baselines differ, "
            "which a synthesis takes as equal: open a square part of it, in a folder of its own.",
        )
    return light_field


def _with(light_field: LightField, warning: str) -> LightField:
    return replace(light_field, warnings=(*light_field.warnings, warning))


def _reverse_rows(views: Pixels) -> None:
    """In place and row by row, since the views of a gantry may fill much of the memory."""
    for row in range(len(views) // 2):
        upper = views[row].copy()
        views[row] = views[-1 - row]
        views[-1 - row] = upper
