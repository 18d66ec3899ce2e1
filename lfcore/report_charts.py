"""The report's charts as inline SVG: curves of training runs, and time by stage as bars."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from html import escape

from lfcore.training.curve import CurvePoint

_COLOURS = 6  # var(--c0) to var(--c5) of the style sheet
_DASHES = ("", "7 4", "2 3", "9 3 2 3")  # beside the colours, for eyes and printers without them
_MOST_DOTS = 40  # points of a curve that are marked one by one


def curve_chart(curve: Sequence[CurvePoint], name: str) -> str:
    """PSNR of each held-out light field over the steps of a training run."""
    scenes = sorted({scene for point in curve for scene in point.scores})
    values = [value for point in curve for value in point.scores.values() if math.isfinite(value)]
    if not values:
        return '<p class="soft">No score of a held-out light field stands in this curve.</p>'
    width, height, left, right, top, bottom = 860, 340, 56, 130, 14, 44
    low, high = math.floor(min(values)), math.ceil(max(values) + 0.01)
    last = max(max(point.step for point in curve), 1)

    def x(step: float) -> float:
        return left + (width - left - right) * step / last

    def y(value: float) -> float:
        return height - bottom - (height - top - bottom) * (value - low) / (high - low)

    parts = []
    for value in range(low, high + 1, max(1, math.ceil((high - low) / 8))):
        parts.append(f'<line class="axis" x1="{left}" x2="{x(last):.1f}" y1="{y(value):.1f}" y2="{y(value):.1f}"/>')
        parts.append(f'<text class="soft" x="{left - 8}" y="{y(value) + 4:.1f}" text-anchor="end">{value} dB</text>')
    for share in (0, 0.25, 0.5, 0.75, 1):
        step = round(last * share)
        parts.append(f'<text class="soft" x="{x(step):.1f}" y="{height - 24}" text-anchor="middle">{step}</text>')
    parts.append(f'<text class="soft" x="{(left + x(last)) / 2:.1f}" y="{height - 6}" text-anchor="middle">steps</text>')
    ends: list[float] = []
    for index, scene in enumerate(scenes):
        points = [(p.step, p.scores[scene]) for p in curve if math.isfinite(p.scores.get(scene, math.nan))]
        if not points:
            continue
        line = " ".join(f"{x(step):.1f},{y(value):.1f}" for step, value in points)
        colour = f"var(--c{index % _COLOURS})"
        dash = _DASHES[index % len(_DASHES)]
        parts.append(f'<polyline points="{line}" fill="none" stroke="{colour}" stroke-width="2" stroke-dasharray="{dash}"/>')
        if len(points) <= _MOST_DOTS:
            parts += [f'<circle cx="{x(step):.1f}" cy="{y(value):.1f}" r="3" fill="{colour}"/>' for step, value in points]
        place = y(points[-1][1]) + 4
        while any(abs(place - other) < 15 for other in ends):
            place += 4
        ends.append(place)
        label = escape(scene if len(scene) <= 16 else f"{scene[:15]}…")
        parts.append(f'<text x="{x(last) + 8:.1f}" y="{place:.1f}" style="fill:{colour}">{label}</text>')
    finals = "; ".join(f"{scene} {_last(curve, scene):.2f} dB" for scene in scenes)
    title = escape(f"PSNR over {last} steps of {name}; last: {finals}")
    tall = max(height, math.ceil(max(ends) + 8))
    return f'<svg viewBox="0 0 {width} {tall}" width="{width}" role="img" aria-label="{title}">{"".join(parts)}</svg>'


def stage_bars(stages: Mapping[str, Mapping[str, float]], totals: Mapping[str, float]) -> str:
    """Seconds a view by model and stage as stacked bars with a legend."""
    names = list(dict.fromkeys(name for model in stages.values() for name in model))
    longest = max([*totals.values(), 1e-9])
    left, right, row, bar = 150, 90, 34, 20
    width = 860
    scale = (width - left - right) / longest
    parts = []
    for index, (model, total) in enumerate(totals.items()):
        top = 8 + index * row
        label = escape(model if len(model) <= 18 else f"{model[:17]}…")
        parts.append(f'<text x="{left - 10}" y="{top + 15}" text-anchor="end">{label}</text>')
        at = float(left)
        for name, seconds in stages[model].items():
            colour = f"var(--c{names.index(name) % _COLOURS})"
            parts.append(f'<rect x="{at:.1f}" y="{top}" width="{max(seconds * scale, 0):.1f}" height="{bar}" fill="{colour}"/>')
            at += seconds * scale
        end = max(left + total * scale, at)
        parts.append(
            f'<rect x="{at:.1f}" y="{top}" width="{max(end - at, 0):.1f}" height="{bar}" fill="none" stroke="var(--soft)"/>'
        )
        parts.append(f'<text x="{end + 8:.1f}" y="{top + 15}">{total:.3g} s</text>')
    height = 8 + len(totals) * row
    at = float(left)
    for index, name in enumerate([*names, "other"]):
        fill = f'fill="var(--c{index % _COLOURS})"' if name in names else 'fill="none" stroke="var(--soft)"'
        parts.append(f'<rect x="{at:.1f}" y="{height + 4}" width="12" height="12" {fill}/>')
        parts.append(f'<text class="soft" x="{at + 18:.1f}" y="{height + 15}">{escape(name)}</text>')
        at += 18 + 8 * len(name) + 24
    title = escape("Seconds a view: " + "; ".join(f"{model} {total:.3g}" for model, total in totals.items()))
    return f'<svg viewBox="0 0 {width} {height + 24}" width="{width}" role="img" aria-label="{title}">{"".join(parts)}</svg>'


def _last(curve: Sequence[CurvePoint], scene: str) -> float:
    return next((point.scores[scene] for point in reversed(curve) if scene in point.scores), math.nan)
