"""What there is to say about an opened light field, as plain text facts in the order in which they are best read."""

from __future__ import annotations

import numpy as np

from lfcore.disparity_sign import DisparityCheck, Order, check_disparity
from lfcore.formats.images import depth_name
from lfcore.lightfield import LightField

# Disparities beyond this, in px over the full baseline, lie outside the levels of the paper's networks (see lfcore.span).
_SWEEP_LIMIT = 21.0

# Pictures whose median is darker than this share of white were most likely stored without gamma.
_LINEAR_MEDIAN = 0.16


def describe(light_field: LightField, check: DisparityCheck | None = None) -> dict[str, str]:
    """Facts for `lfview info`: label to text, JSON friendly. `check` is made (about 0.2 s) unless it is given."""
    check = check_disparity(light_field) if check is None else check
    facts = {
        "Name": light_field.name,
        "Kind": light_field.kind,
        "Views": f"{light_field.rows} rows x {light_field.columns} columns",
        "View size": f"{light_field.width} x {light_field.height} px",
        "Depth": depth_name(light_field.views.dtype),
        "Tone": tone(light_field),
        "Disparity": _disparity(light_field, check),
        "Order of views": check.sentence,
    }
    if light_field.aperture:
        facts["Colours"] = (
            "outer views of an Illum's ESLF are paler than inner ones; syntheses take that into account "
            f"({light_field.aperture**2:.0%} of what the corners of the middle 8 x 8 have)"
        )
    if light_field.dark:
        facts["Dark views"] = f"{len(light_field.dark)} of {light_field.rows * light_field.columns}: {_dark(light_field)}"
    facts.update(light_field.facts)
    warnings = [warning for warning in light_field.warnings if warning != check.sentence]
    for number, warning in enumerate(warnings, start=1):
        facts["Warning" if len(warnings) == 1 else f"Warning {number}"] = warning
    return facts


def median_level(light_field: LightField) -> float:
    """Median stored value of the centre view, as a share of white."""
    view = light_field.view(light_field.rows // 2, light_field.columns // 2)
    return float(np.median(view[::4, ::4]))


def tone(light_field: LightField) -> str:
    """How the values are most likely to be read: linear light or with gamma applied. A guess, and worded as one."""
    level = f"median {median_level(light_field):.2f} of white"
    if light_field.views.dtype.kind == "f":
        return f"linear light, as float pictures usually are ({level})"
    if light_field.kind == "ESLF":
        return f"as stored in the ESLF, without gamma ({level})"
    if median_level(light_field) < _LINEAR_MEDIAN:
        return f"dark, so probably without gamma ({level})"
    return f"probably with gamma applied ({level})"


def _disparity(light_field: LightField, check: DisparityCheck) -> str:
    if check.order is Order.UNKNOWN:
        return "not found"
    text = f"{check.low:.1f} to {check.high:.1f} px corner to corner"
    if max(abs(check.low), abs(check.high)) > _SWEEP_LIMIT:
        text += ", in the middle of the picture,"
    steps = light_field.columns - 1
    if steps > 1:
        text += f" ({check.low / steps:.2f} to {check.high / steps:.2f} px between neighbouring views)"
    if max(abs(check.low), abs(check.high)) > _SWEEP_LIMIT:
        text += f"; beyond the {_SWEEP_LIMIT:.0f} px either way that the networks know, so they are set to it"
    return text


def _dark(light_field: LightField) -> str:
    places = [f"({row}, {column})" for row, column in sorted(light_field.dark)]
    shown = ", ".join(places[:6])
    return f"{shown}, .." if len(places) > 6 else shown
