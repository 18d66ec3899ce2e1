"""An evaluation as one self-contained page: tables, heat maps, crops, curves, times; no script, nothing from elsewhere."""

from __future__ import annotations

import base64
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape

import numpy as np

from lfcore import colormaps
from lfcore.atomic import atomic_path
from lfcore.evaluation import Evaluation, SceneScore
from lfcore.noise import SCALES, SceneNoise
from lfcore.report_charts import curve_chart, stage_bars
from lfcore.report_panels import Crop, ScenePanels
from lfcore.report_style import STYLE
from lfcore.training.curve import CurvePoint


@dataclass(frozen=True)
class Report:
    """What a page tells. All evaluations hold the same scenes by one protocol, in the order of `panels`."""

    evaluations: Sequence[Evaluation]
    panels: Sequence[ScenePanels] = ()
    noises: Sequence[SceneNoise] = ()
    curves: Mapping[str, Sequence[CurvePoint]] = field(default_factory=dict)  # by name of the file
    failures: Sequence[str] = ()
    command: str = ""


def write_report(target: str | os.PathLike[str], report: Report) -> None:
    """Write the page, atomically. Raises OutputError."""
    text = page(report)
    with atomic_path(target) as temporary:
        temporary.write_text(text, encoding="utf-8")


def page(report: Report) -> str:
    """The page as HTML."""
    protocol = report.evaluations[0].protocol
    title = f"Synthesis from four corner views, scored by {protocol.name}"
    sections = [
        _heading(report, title),
        _scores(report),
        _heat_maps(report),
        _panels(report),
        _noise(report),
        _times(report),
        _curves(report),
    ]
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n<main>\n"
        + "\n".join(section for section in sections if section)
        + "\n</main>\n</body>\n</html>\n"
    )


def _heading(report: Report, title: str) -> str:
    first = report.evaluations[0]
    parts = [
        f"<h1>{escape(title)}</h1>",
        f"<p><strong>{escape(first.protocol.name)}</strong>: {escape(first.protocol.says)}. "
        "Scores by other protocols cannot be compared with these.</p>",
        f'<p class="soft">Measured on {escape(first.machine)}.</p>',
    ]
    if report.command:
        parts.append(f'<p class="soft">Made by <code>{escape(report.command)}</code></p>')
    if report.failures:
        items = "".join(f"<li>{escape(failure)}</li>" for failure in report.failures)
        parts.append(f"<p>Not scored:</p><ul>{items}</ul>")
    return "\n".join(parts)


def _scores(report: Report) -> str:
    models = [evaluation.model for evaluation in report.evaluations]
    heads = "".join(f'<th scope="colgroup" colspan="3" class="first">{escape(model)}</th>' for model in models)
    columns = '<th scope="col" class="first">PSNR, dB</th><th scope="col">SSIM</th><th scope="col">s a view</th>' * len(models)
    rows = []
    for scenes in zip(*(evaluation.scenes for evaluation in report.evaluations), strict=True):
        rows.append(f'<tr><th scope="row">{escape(scenes[0].name)}</th>{_score_cells(scenes)}</tr>')
    means = [
        SceneScore("mean", evaluation.mean_psnr, evaluation.mean_ssim, evaluation.mean_seconds)
        for evaluation in report.evaluations
    ]
    best = " The best of each row is bold." if len(models) > 1 else ""
    return "<h2>Scores</h2>\n" + _scrolling(
        f"<table><caption>PSNR, SSIM and seconds for one view, by scene and model.{best}</caption>"
        f'<thead><tr><th></th>{heads}</tr><tr><th scope="col">scene</th>{columns}</tr></thead>'
        f"<tbody>{''.join(rows)}</tbody>"
        f'<tfoot><tr><th scope="row">mean of {len(rows)}</th>{_score_cells(means)}</tr></tfoot></table>',
        "scores",
    )


def _score_cells(scores: Sequence[SceneScore]) -> str:
    psnr, similarity = [_psnr_text(score.psnr) for score in scores], [f"{score.ssim:.4f}" for score in scores]
    best_psnr, best_similarity = max(score.psnr for score in scores), max(score.ssim for score in scores)
    cells = []
    for score, first, second in zip(scores, psnr, similarity, strict=True):
        cells.append(
            f'<td class="first">{_bold(first, len(scores) > 1 and first == _psnr_text(best_psnr))}</td>'
            f"<td>{_bold(second, len(scores) > 1 and second == f'{best_similarity:.4f}')}</td><td>{score.seconds:.2f}</td>"
        )
    return "".join(cells)


def _heat_maps(report: Report) -> str:
    with_grid = [
        scenes
        for scenes in zip(*(evaluation.scenes for evaluation in report.evaluations), strict=True)
        if len(scenes[0].views) > 1
    ]
    if not with_grid:
        return ""
    parts = [
        "<h2>PSNR over the grid of captured views</h2>",
        "<p>Each cell is a captured view, row 1 at the top; its number is the PSNR in dB of the synthesis at its place. The "
        "corners are the input. One scale of colours for all models of a scene, its ends written beside it.</p>",
    ]
    own = report.evaluations[0].protocol
    if own.side is None:
        parts.append("<p>The outlined cell is the view that the protocol scores.</p>")
    for scenes in with_grid:
        finite = [view.psnr for scene in scenes for view in scene.views if math.isfinite(view.psnr)]
        low, high = (min(finite), max(finite)) if finite else (0.0, 1.0)
        outlined = (scenes[0].grid[0] // 2, scenes[0].grid[1] // 2) if own.side is None else None
        tables = "".join(
            _heat_map(evaluation.model, scene, low, high, outlined)
            for evaluation, scene in zip(report.evaluations, scenes, strict=True)
        )
        legend = _legend(colormaps.disparity_colours(), f"{low:.1f} dB", f"{high:.1f} dB")
        parts.append(f"<h3>{escape(scenes[0].name)}</h3><p class=soft>{legend}</p><div class=maps>{tables}</div>")
    return "\n".join(parts)


def _heat_map(model: str, scene: SceneScore, low: float, high: float, outlined: tuple[int, int] | None) -> str:
    by_place = {(view.row, view.column): view.psnr for view in scene.views}
    rows, columns = scene.grid
    colours = colormaps.disparity_colours()
    lines = []
    for row in range(rows):
        cells = []
        for column in range(columns):
            value = by_place.get((row, column))
            if value is None:
                corner = row in (0, rows - 1) and column in (0, columns - 1)
                cells.append('<td class="input">input</td>' if corner else '<td class="none"></td>')
                continue
            share = min(max((value - low) / max(high - low, 1e-9), 0), 1) if math.isfinite(value) else 1.0
            colour = colours[round(share * (len(colours) - 1))]
            ink = "#000" if float(colour @ np.array([0.299, 0.587, 0.114])) > 130 else "#fff"
            mark = ' class="own"' if (row, column) == outlined else ""
            cells.append(f'<td{mark} style="background:{_hex(colour)};color:{ink}">{_psnr_text(value, 1)}</td>')
        lines.append(f'<tr><th scope="row">{row + 1}</th>{"".join(cells)}</tr>')
    heads = "".join(f'<th scope="col">{column + 1}</th>' for column in range(columns))
    mean = np.mean([value for value in by_place.values() if math.isfinite(value)] or [math.inf])
    return _scrolling(
        f'<table class="heat"><caption>{escape(model)}: {_psnr_text(float(mean))} dB on average</caption>'
        f"<thead><tr><th></th>{heads}</tr></thead><tbody>{''.join(lines)}</tbody></table>",
        f"PSNR over the grid, {scene.name}, {model}",
    )


def _panels(report: Report) -> str:
    if not report.panels:
        return ""
    parts = [
        "<h2>Where the models err</h2>",
        "<p>The crops are chosen by a rule, not by eye: where the mean squared error of the models that know depth is largest "
        "within 5 px of a jump of disparity, which is where something hides something.</p>",
    ]
    parts += [_scene(report, panels) for panels in report.panels]
    return "\n".join(parts)


def _scene(report: Report, panels: ScenePanels) -> str:
    models = [evaluation.model for evaluation in report.evaluations]
    width, height = panels.size
    boxes = "".join(
        f'<rect x="{crop.left}" y="{crop.top}" width="{crop.side}" height="{crop.side}" fill="none" stroke="#000" '
        f'stroke-width="4"/><rect x="{crop.left}" y="{crop.top}" width="{crop.side}" height="{crop.side}" fill="none" '
        f'stroke="#fff" stroke-width="2"/><text x="{crop.left + 6}" y="{crop.top + 18}" '
        f'style="fill:#fff;stroke:#000;stroke-width:3;paint-order:stroke;font-size:16px">{number}</text>'
        for number, crop in enumerate(panels.crops, 1)
    )
    notes = [f"captured view {panels.view[0] + 1}, {panels.view[1] + 1} of {panels.grid[0]} x {panels.grid[1]}"]
    if panels.brightened:
        notes.append("brightened for looking (over the brightest tone, power 1 / 1.5); the errors are those of stored values")
    if not panels.near_occlusions:
        notes.append("no model gave a jump of disparity, so the crops are those of the largest error")
    legends = [f"absolute error {_legend(colormaps.error_colours(), '0', f'{panels.error_scale:.0f} of 255 or more')}"]
    if panels.disparity_scale is not None:
        low, high = panels.disparity_scale
        legends.append(
            "disparity "
            + _legend(colormaps.disparity_colours(), f"{low:.1f} px", f"{high:.1f} px")
            + " from corner to corner of the grid"
        )
    crops = "".join(_crop(models, crop, number, panels.name) for number, crop in enumerate(panels.crops, 1))
    return (
        f"<h3>{escape(panels.name)}</h3>"
        f'<figure><div class="overview"><img src="{_data_uri(panels.overview)}" width="{width}" height="{height}" '
        f'alt="Captured view of {escape(panels.name, quote=True)} with the crops marked">'
        f'<svg viewBox="0 0 {width} {height}" aria-hidden="true">{boxes}</svg></div>'
        f"<figcaption>{escape('; '.join(notes)).capitalize()}.</figcaption></figure>"
        + "".join(f'<p class="soft">{legend}</p>' for legend in legends)
        + crops
    )


def _crop(models: Sequence[str], crop: Crop, number: int, scene: str) -> str:
    where = f"crop {number} of {scene}"
    heads = "".join(
        f'<th scope="col">{escape(model)}<br><span class="soft">rms {crop.rms[model]:.1f}</span></th>' for model in models
    )
    pictures = [_image(crop.truth, f"{where}, captured", crop.side)]
    errors, disparities = [""], [""]
    for model in models:
        pictures.append(_image(crop.synthesis[model], f"{where}, synthesis of {model}", crop.side))
        errors.append(_image(crop.error[model], f"{where}, error of {model}, rms {crop.rms[model]:.1f}", crop.side))
        disparity = crop.disparity[model]
        disparities.append(_image(disparity, f"{where}, disparity of {model}", crop.side) if disparity else "none")
    rows = "".join(
        f'<tr><th scope="row">{name}</th>{"".join(f"<td>{cell}</td>" for cell in cells)}</tr>'
        for name, cells in (("picture", pictures), ("error", errors), ("disparity", disparities))
    )
    return _scrolling(
        f'<table class="crop"><caption>Crop {number}: {crop.side} x {crop.side} px at {crop.left}, {crop.top}; '
        "rms is the error in steps of 8 bits</caption>"
        f'<thead><tr><th></th><th scope="col">captured</th>{heads}</tr></thead><tbody>{rows}</tbody></table>',
        where,
    )


def _noise(report: Report) -> str:
    if not report.noises:
        return ""
    heads = "".join(f'<th scope="colgroup" colspan="2" class="first">{scale} x {scale} px</th>' for scale in SCALES)
    columns = '<th scope="col" class="first">sigma</th><th scope="col">ratio</th>' * len(SCALES)
    rows = []
    for scene in report.noises:
        captured = "".join(f'<td class="first">{_number(value, 3)}</td><td></td>' for value in scene.captured)
        flat = f"{scene.flat_share:.0%} flat"
        rows.append(f'<tr><th scope="row">{escape(scene.name)}: captured, {flat}</th>{captured}</tr>')
        for model, sigmas in scene.synthesized.items():
            pairs = zip(sigmas, scene.ratio(model), strict=True)
            cells = "".join(f'<td class="first">{_number(s, 3)}</td><td>{_number(r, 2)}</td>' for s, r in pairs)
            rows.append(f'<tr><th scope="row">&emsp;{escape(model)}</th>{cells}</tr>')
    return (
        "<h2>Noise</h2>\n<p>Standard deviation of the noise on flat regions, in steps of 8 bits, of the captured view and of "
        "the syntheses at its place, with the ratio of the two: between neighbouring pixels, and on means of 2 x 2 and 4 x 4 "
        "of them. Noise of decoded captures is correlated over some pixels, and a warp by parts of a pixel averages its "
        "inputs, so the coarser scales tell more of the noise that an eye sees. The average of four views with independent "
        "noise has half of it.</p>\n"
        + _scrolling(
            f'<table><thead><tr><th></th>{heads}</tr><tr><th scope="col">picture</th>{columns}</tr></thead>'
            f"<tbody>{''.join(rows)}</tbody></table>",
            "noise",
        )
    )


def _times(report: Report) -> str:
    stages, totals = {}, {}
    for evaluation in report.evaluations:
        names = list(dict.fromkeys(name for scene in evaluation.scenes for name in scene.stages))
        stages[evaluation.model] = {
            name: float(np.mean([scene.stages.get(name, 0.0) for scene in evaluation.scenes])) for name in names
        }
        totals[evaluation.model] = evaluation.mean_seconds
    return (
        "<h2>Time</h2>\n<p>Seconds for one view, mean over the scenes, by stage; first views of a model are among them, and "
        "whatever else the machine did.</p>\n<figure>" + _scrolling(stage_bars(stages, totals), "time") + "</figure>"
    )


def _curves(report: Report) -> str:
    if not report.curves:
        return ""
    parts = ["<h2>Training</h2>", "<p>PSNR by K16 of the held-out light fields while the networks were trained.</p>"]
    for name, curve in report.curves.items():
        chart = _scrolling(curve_chart(curve, name), f"curve {name}")
        parts.append(f"<figure>{chart}<figcaption>{escape(name)}</figcaption></figure>")
    return "\n".join(parts)


def _scrolling(content: str, label: str) -> str:
    """Wide content in a box that scrolls by itself, also by keyboard."""
    return f'<div class="scroll" tabindex="0" role="region" aria-label="{escape(label)}">{content}</div>'


def _legend(colours: np.ndarray, low: str, high: str) -> str:
    stops = ",".join(_hex(colours[round(place)]) for place in np.linspace(0, len(colours) - 1, 9))
    return f'{escape(low)}<span class="scale" style="background:linear-gradient(90deg,{stops})"></span>{escape(high)}'


def _image(png: bytes, alt: str, side: int) -> str:
    return f'<img src="{_data_uri(png)}" width="{side}" height="{side}" alt="{escape(alt)}">'


def _data_uri(png: bytes) -> str:
    return "data:image/png;base64," + base64.b64encode(png).decode("ascii")


def _hex(colour: np.ndarray) -> str:
    return "#" + "".join(f"{int(channel):02x}" for channel in colour)


def _bold(text: str, bold: bool) -> str:
    return f"<strong>{text}</strong>" if bold else text


def _psnr_text(value: float, digits: int = 2) -> str:
    return f"{value:.{digits}f}" if math.isfinite(value) else "equal"


def _number(value: float, digits: int) -> str:
    return f"{value:.{digits}f}" if math.isfinite(value) else "–"
