"""Exporting in the real window on a virtual screen, by real mouse and key events."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

from lfcore.export import write_picture
from lfcore.formats import open_light_field
from lfcore.metrics import to_uint8
from lfcore.sweep_export import export_sweep
from lfcore.sweep_frames import SweepFrames, remembering
from lfcore.sweep_plan import KeyFramePath, load_plan
from lfcore.sweep_target import Kind, Target
from tests.moving_scene import TruthSynthesizer, light_field, truth
from tests.virtual_screen import VirtualScreen, wait_until

VIEW = (120, 160)

# The program itself, on a model that knows the truth.
PROGRAM = """
import sys
from pathlib import Path
from app.engine import Engine, ModelChoice
from app.viewer import show
from tests.moving_scene import TruthSynthesizer
models = {"truth": ModelChoice(TruthSynthesizer, False)}
show(Path(sys.argv[1]), Engine(TruthSynthesizer, 2**26, name="truth"), "truth", models=models)
"""

SLOW_PROGRAM = PROGRAM.replace("(TruthSynthesizer, False)", "(lambda: TruthSynthesizer(0.3), False)")


def test_key_frames_are_set_played_saved_and_exported(
    screen: VirtualScreen, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    folder = views_folder(tmp_path / "a scene é")
    made = {name: tmp_path / f"a scene é sweep{name}" for name in (".mp4", ".json")}
    with screen.program(PROGRAM, str(folder)) as program:
        wait_until(lambda: screen.pixels().max() > 100, "the window")
        screen.xdotool("mousemove", 400, 300)

        # The picture as shown, at 1:1; the key is pressed again until the window takes keys.
        def saved() -> list[Path]:
            return sorted(tmp_path.glob("a scene é synthesis u0.50 v0.50*.png"))

        def shown() -> bool:
            screen.xdotool("key", "z")
            screen.xdotool("key", "ctrl+s")
            return any(np.abs(read(path).astype(int) - to_uint8(truth(0.5, 0.5, VIEW))).max() <= 1 for path in saved())

        wait_until(shown, "the picture as shown in a file")

        screen.xdotool("key", "ctrl+e")
        screen.xdotool("key", "k")
        for _ in range(4):
            screen.xdotool("key", "Right")
        screen.xdotool("key", "k")
        screen.xdotool("key", "ctrl+shift+s")
        wait_until(made[".json"].exists, "the saved path")
        screen.xdotool("key", "ctrl+shift+e")
        wait_until(made[".mp4"].exists, "the video")

        before = screen.pixels()
        screen.xdotool("key", "ctrl+shift+k")
        wait_until(lambda: bool((screen.pixels()[:600, :900] != before[:600, :900]).any()), "the preview to move the picture")
        screen.xdotool("key", "ctrl+q")
        assert program.wait(60) == 0
        assert program.stderr is not None
        assert program.stderr.read() == ""

    plan = load_plan(made[".json"])
    assert isinstance(plan.path, KeyFramePath)
    assert [key.u for key in plan.path.key_frames] == pytest.approx([0.5, 0.58])
    # The library makes the same file of the saved path.
    opened = open_light_field(folder)
    frames = SweepFrames(plan, opened, remembering(opened, TruthSynthesizer()))
    export_sweep(frames, Target(tmp_path / "library.mp4", Kind.VIDEO))
    assert (tmp_path / "library.mp4").read_bytes() == made[".mp4"].read_bytes()


def test_an_export_that_is_not_finished_at_the_end_leaves_nothing(
    screen: VirtualScreen, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    place = tmp_path / "place"
    folder = views_folder(place / "scene")
    with screen.program(SLOW_PROGRAM, str(folder)) as program:
        wait_until(lambda: screen.pixels().max() > 100, "the window")

        def begun() -> bool:
            screen.xdotool("key", "ctrl+shift+e")
            return any(place.glob(".scene sweep*"))  # the temporary file

        wait_until(begun, "the export to begin")
        message = (slice(0, 60), slice(300, 600))  # at the top of the picture
        before = screen.pixels()[message]
        screen.xdotool("key", "ctrl+q")
        wait_until(lambda: bool((screen.pixels()[message] != before).mean() > 0.3), "the question whether it is to be given up")
        assert program.poll() is None
        screen.xdotool("key", "ctrl+q")
        assert program.wait(60) == 0
    assert list(place.iterdir()) == [folder]


def views_folder(folder: Path) -> Path:
    folder.mkdir(parents=True)
    for row, views in enumerate(light_field(3, 3, VIEW).views):
        for column, view in enumerate(views):
            write_picture(folder / f"view_{row:02}_{column:02}.png", view)
    return folder


def read(path: Path) -> np.ndarray:
    pixels = oiio.ImageBuf(str(path)).get_pixels(oiio.UINT8)
    empty = np.full((*VIEW, 3), 255, np.uint8)
    return empty if pixels is None or pixels.shape != empty.shape else np.asarray(pixels)
