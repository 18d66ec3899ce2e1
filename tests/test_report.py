"""The report: one page that holds everything, its numbers those of the evaluation, its crops where the errors are."""

from __future__ import annotations

import base64
import math
import os
import re
import subprocess
import sys
from dataclasses import dataclass, field
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

from lfcore.errors import InputError, OutputError
from lfcore.evaluation import Evaluation, SceneScore, ViewScore, evaluate_scene
from lfcore.lightfield import FloatArray, LightField
from lfcore.noise import SceneNoise
from lfcore.report import Report, page, write_report
from lfcore.report_charts import curve_chart, stage_bars
from lfcore.report_panels import ScenePanels, scene_panels
from lfcore.synthesizer import MeanSynthesizer, Synthesis
from lfcore.training.curve import CurvePoint, read_curve, write_curve

HOSTILE = "<script>alert('x')</script> & \"scene\""
_VOID = {"meta", "img", "br", "line", "rect", "polyline", "circle"}


@dataclass
class Reading(HTMLParser):
    """Checks that elements close as they opened, and collects what the tests ask for."""

    open: list[str] = field(default_factory=list)
    seen: list[tuple[str, dict[str, str | None]]] = field(default_factory=list)
    words: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        super().__init__()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.seen.append((tag, dict(attrs)))
        if tag not in _VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.seen.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if not self.open or self.open[-1] != "style":
            self.words.append(data)

    @classmethod
    def of(cls, text: str) -> Reading:
        reading = cls()
        reading.feed(text)
        reading.close()
        assert reading.open == []
        return reading

    def all(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.seen if name == tag]

    @property
    def text(self) -> str:
        return " ".join(" ".join(self.words).split())


class Flawed:
    """A synthesizer that is right but for one square, whose place it knows, at a jump of disparity."""

    name = key = "flawed"

    def set_light_field(self, light_field: LightField) -> None:
        self._light_field = light_field

    def synthesize(self, u: float, v: float, cancelled: object = None) -> Synthesis:
        view = self._light_field.at(u, v)
        assert view is not None
        image: FloatArray = self._light_field.view(*view).copy()
        image[130:150, 180:200] = 1 - image[130:150, 180:200]
        image[30:60, 30:60] = 1 - image[30:60, 30:60]  # worse, but far from any jump
        disparity = np.zeros(image.shape[:2], np.float32)
        disparity[:, 190:] = 5
        return Synthesis(u, v, self.name, image, disparity, None, {"disparity": 0.3, "colour": 0.1, "total": 0.5})


def light_field(name: str = "a scene") -> LightField:
    views = np.random.default_rng(3).integers(60, 200, (3, 3, 220, 260, 3), dtype=np.uint8)
    return LightField(views, name, "", "test")


@pytest.fixture(scope="module")
def made() -> tuple[Report, ScenePanels]:
    results = {
        "flawed": evaluate_scene(light_field(HOSTILE), Flawed(), whole_grid=True),
        "mean": evaluate_scene(light_field(HOSTILE), MeanSynthesizer(), whole_grid=True),
    }
    panels = scene_panels(results)
    evaluations = [Evaluation(label, "a machine", (result.score,)) for label, result in results.items()]
    noise = SceneNoise(HOSTILE, 0.2, (2.0, 1.0, math.nan), {"flawed": (1.0, 0.4, math.nan)})
    curve = [CurvePoint(step, step, 1e-4, 0.01, {"Buttercup": 25 + step / 100}) for step in (100, 200, 300)]
    report = Report(evaluations, [panels], [noise], {"run/curve.csv": curve}, ["DIR/b: found nothing."], "lfview eval x")
    return report, panels


def test_the_page_is_whole_and_fetches_nothing(made: tuple[Report, ScenePanels]) -> None:
    text = page(made[0])
    reading = Reading.of(text)
    assert not reading.all("script") and not reading.all("link") and not reading.all("iframe")
    assert not re.search(r"https?://|@import|url\(", text)
    assert all(str(image["src"]).startswith("data:image/png;base64,") for image in reading.all("img"))
    assert "prefers-color-scheme: dark" in text
    assert HOSTILE in reading.text  # as text, not as a script


def test_it_can_be_read_without_eyes(made: tuple[Report, ScenePanels]) -> None:
    reading = Reading.of(page(made[0]))
    alts = [image.get("alt") for image in reading.all("img")]
    assert all(alts) and len(set(alts)) == len(alts)
    heads = [head for head in reading.all("th") if head]
    assert heads and all(head.get("scope") in ("col", "row", "colgroup") for head in heads)
    pictures = [svg for svg in reading.all("svg") if svg.get("aria-hidden") != "true"]
    assert pictures and all(svg.get("role") == "img" and svg.get("aria-label") for svg in pictures)
    assert reading.all("html")[0].get("lang") == "en"


def test_the_page_says_what_was_measured(made: tuple[Report, ScenePanels]) -> None:
    report, _ = made
    text = Reading.of(page(report)).text
    for evaluation in report.evaluations:
        assert f"{evaluation.scenes[0].psnr:.2f}" in text
        assert f"{evaluation.scenes[0].ssim:.4f}" in text
        for view in evaluation.scenes[0].views:
            assert f"{view.psnr:.1f}" in text
    for piece in ("K16", "a machine", "lfview eval x", "DIR/b: found nothing.", "run/curve.csv", "20% flat", "0.400"):
        assert piece in text
    assert text.count("input") >= 8  # four corners of two heat maps


def test_only_the_best_of_a_row_is_bold() -> None:
    scores = [SceneScore("s", psnr, similarity, 1.0) for psnr, similarity in ((30.0, 0.95), (31.5, 0.91))]
    text = page(Report([Evaluation(name, "m", (score,)) for name, score in zip("ab", scores, strict=True)]))
    assert re.findall(r"<strong>([\d.]+)</strong>", text) == ["0.9500", "31.50"] * 2  # the scene and the mean
    assert "Where the models err" not in text and "Noise" not in text and "Training" not in text
    assert "<strong>30" not in page(Report([Evaluation("a", "m", (scores[0],))]))


def test_the_first_crop_is_at_the_error_near_the_jump(made: tuple[Report, ScenePanels]) -> None:
    _, panels = made
    crop = panels.crops[0]
    assert panels.near_occlusions
    assert crop.top <= 130 and crop.left <= 180 and crop.top + crop.side >= 150 and crop.left + crop.side >= 200
    assert all(22 <= c.top <= 220 - 22 - c.side and 22 <= c.left <= 260 - 22 - c.side for c in panels.crops)
    for one in panels.crops:
        for other in panels.crops:
            assert one is other or abs(one.top - other.top) >= one.side or abs(one.left - other.left) >= one.side


def test_crops_hold_the_pixels_they_name(made: tuple[Report, ScenePanels], tmp_path: Path) -> None:
    _, panels = made
    crop = panels.crops[0]
    (tmp_path / "crop.png").write_bytes(crop.truth)
    found = oiio.ImageBuf(str(tmp_path / "crop.png")).get_pixels(oiio.UINT8)
    truth = light_field().views[1, 1]
    assert np.array_equal(found, truth[crop.top : crop.top + crop.side, crop.left : crop.left + crop.side])
    assert crop.disparity["mean"] is None and crop.disparity["flawed"] is not None
    bad = truth[130:150, 180:200].astype(float)
    expected = math.sqrt(((255 - 2 * bad) ** 2).sum() / (crop.side**2 * 3))
    assert crop.rms["flawed"] == pytest.approx(expected, rel=1e-3)


def test_equal_pictures_and_odd_grids_make_a_page() -> None:
    views = (ViewScore(0, 1, math.inf, 1.0, 0.1), ViewScore(1, 1, math.inf, 1.0, 0.1))
    score = SceneScore("equal", math.inf, 1.0, 0.1, views, (2, 3))
    text = Reading.of(page(Report([Evaluation("m", "a machine", (score,))]))).text
    assert "equal" in text and "nan" not in text and "inf " not in text


def test_curve_files_come_back_as_they_were_written(tmp_path: Path) -> None:
    curve = [CurvePoint(10, 5, 1e-4, 0.5, {"a": 25.125}), CurvePoint(20, 9, 5e-5, 0.25, {"a": 26.5, "b": 30.25})]
    write_curve(tmp_path, curve)
    assert read_curve(tmp_path / "curve.csv") == curve


@pytest.mark.parametrize(
    "text", ["", "name,age\n", "a,b\n1,2\n", "step,seconds,learning_rate,loss,x\n1,2,3\n", "step,seconds\n\xff"]
)
def test_other_files_are_no_curve(tmp_path: Path, text: str) -> None:
    path = tmp_path / "curve.csv"
    path.write_bytes(text.encode("latin-1"))
    with pytest.raises(InputError, match="not a training curve"):
        read_curve(path)
    with pytest.raises(InputError, match="No training curve"):
        read_curve(tmp_path / "none.csv")


def test_charts_place_their_values() -> None:
    chart = curve_chart([CurvePoint(0, 0, 0, 0, {"a": 20.0}), CurvePoint(100, 0, 0, 0, {"a": 29.0})], "x<y")
    (line,) = re.findall(r'points="([^"]+)"', chart)
    (x0, y0), (x1, y1) = ([float(value) for value in pair.split(",")] for pair in line.split())
    assert x0 < x1 and y0 > y1  # steps to the right, decibels upwards
    assert "x&lt;y" in chart and "29.00 dB" in chart
    assert "No score" in curve_chart([CurvePoint(0, 0, 0, 0, {})], "none")
    bars = stage_bars({"full": {"warp": 1.0, "colour": 3.0}, "mean": {}}, {"full": 4.0, "mean": 0.1})
    widths = [float(width) for width in re.findall(r'<rect [^>]*width="([\d.]+)" height="20" fill="var', bars)]
    assert widths[1] == pytest.approx(3 * widths[0], rel=0.01)


def test_a_target_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    report = Report([Evaluation("m", "a machine", (SceneScore("s", 30.0, 0.9, 1.0),))])
    with pytest.raises(OutputError, match="Cannot write"):
        write_report(tmp_path / "none" / "r.html", report)
    write_report(tmp_path / "é r.html", report)
    assert [path.name for path in tmp_path.iterdir()] == ["é r.html"]


def test_pictures_in_the_page_are_png(made: tuple[Report, ScenePanels]) -> None:
    first = str(Reading.of(page(made[0])).all("img")[0]["src"]).partition(",")[2]
    assert base64.b64decode(first).startswith(b"\x89PNG")


def test_curves_are_written_in_the_encoding_that_they_are_read_in(tmp_path: Path) -> None:
    """Whatever that of the system is."""
    code = (
        "from pathlib import Path; from lfcore.training.curve import CurvePoint, write_curve; "
        f"write_curve(Path({str(tmp_path)!r}), [CurvePoint(10, 5, 1e-4, 0.5, {{'W\\xe4ldchen \\u68ee': 25.125}})])"
    )
    plain = {**os.environ, "LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    subprocess.run([sys.executable, "-c", code], cwd=Path(__file__).parents[1], env=plain, check=True, timeout=60)
    assert read_curve(tmp_path / "curve.csv")[0].scores == {"Wäldchen 森": 25.125}
