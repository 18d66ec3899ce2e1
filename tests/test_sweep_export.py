"""Sweeps as files: videos and numbered frames hold the frames; a failure or a cancel leaves nothing behind."""

from __future__ import annotations

import struct
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import av
import numpy as np
import OpenImageIO as oiio
import pytest

from lfcore.errors import Cancelled, InputError, OutputError
from lfcore.key_frames import Stop
from lfcore.metrics import to_uint8
from lfcore.sweep_export import check_target, export_sweep
from lfcore.sweep_frames import SweepFrames
from lfcore.sweep_plan import KeyFramePath, Layer, SweepPlan
from lfcore.sweep_target import Kind, Target
from tests.moving_scene import DISPARITY, TruthSynthesizer, light_field, truth

LINE = KeyFramePath((Stop(0, 0.5), Stop(1, 0.5)))


def frames_of(plan: SweepPlan) -> SweepFrames:
    return SweepFrames(plan, light_field(), TruthSynthesizer().synthesize)


def read(path: Path) -> np.ndarray:
    return np.asarray(oiio.ImageBuf(str(path)).get_pixels(oiio.FLOAT))


def test_png_frames_are_numbered_and_hold_the_pictures(tmp_path: Path) -> None:
    folder = tmp_path / "deep" / "frames é"
    frames = frames_of(SweepPlan(LINE, 3))
    counts: list[int] = []
    export_sweep(frames, Target(folder, Kind.PNG), counts.append)
    assert counts == [1, 2, 3]
    assert sorted(path.name for path in folder.iterdir()) == ["frame_0001.png", "frame_0002.png", "frame_0003.png"]
    for index, u in enumerate((0, 0.5, 1)):
        stored = np.rint(read(folder / f"frame_000{index + 1}.png") * 255)
        assert np.array_equal(stored, to_uint8(truth(u, 0.5)))


def test_exr_frames_hold_numbers(tmp_path: Path) -> None:
    export_sweep(frames_of(SweepPlan(LINE, 2, layer=Layer.DISPARITY)), Target(tmp_path / "d", Kind.EXR))
    disparity = read(tmp_path / "d" / "frame_0002.exr")
    assert disparity.shape[2] == 1
    assert (disparity == DISPARITY).all()
    export_sweep(frames_of(SweepPlan(LINE, 2)), Target(tmp_path / "i", Kind.EXR))
    assert np.abs(read(tmp_path / "i" / "frame_0001.exr") - truth(0, 0.5)).max() < 2**-11
    export_sweep(frames_of(SweepPlan(LINE, 2, layer=Layer.ERROR)), Target(tmp_path / "e", Kind.EXR))
    assert read(tmp_path / "e" / "frame_0001.exr").max() < 0.51 / 255  # the truth against its 8 bits


def test_a_video_holds_the_frames(tmp_path: Path) -> None:
    path = tmp_path / "sweep.mp4"
    export_sweep(frames_of(SweepPlan(LINE, 4, 12)), Target(path, Kind.VIDEO))
    with av.open(str(path)) as container:
        found = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
        assert container.streams.video[0].average_rate == 12
    assert len(found) == 4
    for index, frame in enumerate(found):
        away = [np.abs(frame.astype(float) - 255 * truth(u, 0.5)).mean() for u in np.linspace(0, 1, 4)]
        assert np.argmin(away) == index
        assert away[index] < 5  # colour has a quarter of the pixels


@pytest.mark.parametrize(("plays", "webp", "gif"), [(0, 0, 0), (1, 1, None), (4, 4, 3)])
def test_animated_pictures_know_how_often_they_play(tmp_path: Path, plays: int, webp: int, gif: int | None) -> None:
    frames = frames_of(SweepPlan(LINE, 2, 10, plays=plays))
    export_sweep(frames, Target(tmp_path / "a.webp", Kind.VIDEO))
    data = (tmp_path / "a.webp").read_bytes()
    assert struct.unpack_from("<H", data, data.index(b"ANIM") + 12)[0] == webp
    export_sweep(frames, Target(tmp_path / "a.gif", Kind.VIDEO))
    data = (tmp_path / "a.gif").read_bytes()
    place = data.find(b"NETSCAPE2.0")
    assert (None if place < 0 else struct.unpack_from("<H", data, place + 13)[0]) == gif


TARGETS = [("a.mp4", Kind.VIDEO), ("frames", Kind.PNG), ("deep/er/frames", Kind.EXR)]


def after(count: int, error: type[BaseException]) -> Callable[[int], None]:
    def done(made: int) -> None:
        if made == count:
            raise error

    return done


@pytest.mark.parametrize(("name", "kind"), TARGETS)
@pytest.mark.parametrize("error", [KeyboardInterrupt, InputError])
def test_an_error_on_the_way_leaves_nothing(tmp_path: Path, name: str, kind: Kind, error: type[BaseException]) -> None:
    folder = tmp_path / name if kind is not Kind.VIDEO else tmp_path
    with pytest.raises(error):
        export_sweep(frames_of(SweepPlan(LINE, 4)), Target(tmp_path / name, kind), after(2, error))
    assert list(tmp_path.iterdir()) == []
    assert kind is Kind.VIDEO or not folder.exists()


@pytest.mark.parametrize(("name", "kind"), TARGETS)
def test_a_cancelled_sweep_leaves_nothing_of_its_own(tmp_path: Path, name: str, kind: Kind) -> None:
    counts: list[int] = []
    other = tmp_path / "other.txt"
    other.write_text("not ours")
    with pytest.raises(Cancelled):
        export_sweep(frames_of(SweepPlan(LINE, 9)), Target(tmp_path / name, kind), counts.append, lambda: len(counts) >= 2)
    assert counts == [1, 2]
    assert list(tmp_path.iterdir()) == [other]


def test_a_folder_that_vanishes_is_told(tmp_path: Path) -> None:
    folder = tmp_path / "frames"

    def vanish(made: int) -> None:
        for file in folder.iterdir():
            file.unlink()
        folder.rmdir()

    with pytest.raises(OutputError, match="frames"):
        export_sweep(frames_of(SweepPlan(LINE, 4)), Target(folder, Kind.PNG), vanish)
    assert list(tmp_path.iterdir()) == []


FULL = """
import resource, sys
import numpy as np
from pathlib import Path
from lfcore.errors import OutputError
from lfcore.export import write_image, write_rows
from lfcore.video import write_video
noise = np.random.default_rng(0).integers(0, 256, (200, 300, 3), dtype=np.uint8)
resource.setrlimit(resource.RLIMIT_FSIZE, (40_000, 40_000))
for name in ("a.png", "a.tif", "a.exr", "rows.png", "a.mp4", "a.webm", "a.webp", "a.gif"):
    target = Path(sys.argv[1]) / name
    try:
        if target.stem == "rows":
            write_rows(target, noise.shape[:2], (noise[top : top + 20] for top in range(0, 200, 20)))
        elif target.suffix in (".png", ".tif", ".exr"):
            write_image(target, noise / np.float32(255))
        else:
            write_video(target, (np.roll(noise, shift, 1) for shift in range(30)), 10)
    except OutputError as error:
        print(name, "make room there" in str(error))
"""


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no limit of the size of files")
def test_files_that_find_no_room_are_told_and_leave_nothing(tmp_path: Path) -> None:
    root = Path(__file__).parents[1]
    done = subprocess.run([sys.executable, "-c", FULL, str(tmp_path)], cwd=root, capture_output=True, text=True, timeout=120)
    assert done.stdout.split("\n")[:-1] == [
        f"{name} True" for name in ("a.png", "a.tif", "a.exr", "rows.png", "a.mp4", "a.webm", "a.webp", "a.gif")
    ], done.stderr
    assert list(tmp_path.iterdir()) == []


def test_impossible_targets_are_refused_before_the_work(tmp_path: Path) -> None:
    plan = SweepPlan(LINE, 2)
    with pytest.raises(OutputError, match=r"\.mp4, \.webm, \.webp, \.gif.*folder"):
        check_target(plan, Target(tmp_path / "a.avi", Kind.VIDEO))
    with pytest.raises(InputError, match="one layer"):
        check_target(SweepPlan(LINE, layer=Layer.BESIDE_DISPARITY), Target(tmp_path / "f", Kind.EXR))
    with pytest.raises(InputError, match="leave out"):
        check_target(SweepPlan(LINE, labels=True), Target(tmp_path / "f", Kind.EXR))
    with pytest.raises(InputError, match="frames per second"):
        check_target(SweepPlan(LINE, fps=60), Target(tmp_path / "a.gif", Kind.VIDEO))
    (tmp_path / "frame_0001.png").write_bytes(b"another sweep")
    with pytest.raises(OutputError, match="holds some already"):
        check_target(plan, Target(tmp_path, Kind.PNG))
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="folder"):
        check_target(plan, Target(tmp_path / "file", Kind.PNG))
