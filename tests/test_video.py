"""Video files: read back, they hold the frames, their colours, size and rate; a failure leaves no file."""

from __future__ import annotations

import signal
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import numpy.typing as npt
import OpenImageIO as oiio
import pytest

from lfcore.errors import InputError, OutputError
from lfcore.video import VIDEO_EXTENSIONS, check_video_target, write_video

COLOURS = [(200, 30, 30), (30, 200, 60), (20, 60, 220), (128, 128, 128), (250, 250, 250), (5, 5, 5)]
SIDE = 32


def patches(shift: int) -> npt.NDArray[np.uint8]:
    """A row of flat patches, in turn from patch `shift` on: (33, 193, 3), odd both ways."""
    row = np.zeros((SIDE + 1, SIDE * len(COLOURS) + 1, 3), np.uint8)
    for place in range(len(COLOURS)):
        row[:, SIDE * place :][:, : SIDE + 1] = COLOURS[(place + shift) % len(COLOURS)]
    return row


def movie(count: int = 6) -> Iterator[npt.NDArray[np.uint8]]:
    return (patches(k) for k in range(count))


def read_back(path: Path) -> list[npt.NDArray[np.uint8]]:
    if path.suffix == ".webp":  # libav writes animated WebP, yet does not read it
        source = oiio.ImageInput.open(str(path))
        frames = []
        while source.seek_subimage(len(frames), 0):
            frames.append(source.read_image(len(frames), 0, 0, 3, "uint8"))
        return frames
    with av.open(str(path)) as container:
        return [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]


@pytest.mark.parametrize("extension", VIDEO_EXTENSIONS)
def test_frames_come_back_in_order_with_their_colours(tmp_path: Path, extension: str) -> None:
    path = tmp_path / f"a sweep é{extension}"
    write_video(path, movie(), 25)
    frames = read_back(path)
    assert len(frames) == 6
    even = extension in (".mp4", ".webm")
    for k, frame in enumerate(frames):
        assert frame.shape == ((34, 194, 3) if even else (33, 193, 3))
        middles = frame[SIDE // 2, SIDE // 2 :: SIDE][: len(COLOURS)].astype(int)
        wanted = [COLOURS[(place + k) % len(COLOURS)] for place in range(len(COLOURS))]
        assert np.abs(middles - wanted).max() <= 5
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("extension", [".mp4", ".webm"])
def test_pixels_and_tags_are_bt709_limited_range(tmp_path: Path, extension: str) -> None:
    path = tmp_path / f"v{extension}"
    write_video(path, movie(1), 25)
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        frame = next(container.decode(stream))
        tags = stream.codec_context
        assert [tags.color_primaries, tags.color_trc, tags.colorspace, tags.color_range] == [1, 1, 1, 1]
        assert frame.format.name == "yuv420p"
        planes = frame.to_ndarray()
    luma = planes[SIDE // 2, SIDE // 2 : SIDE * len(COLOURS) : SIDE]
    red, green, blue = np.array(COLOURS).T / 255
    wanted = 16 + 219 * (0.2126 * red + 0.7152 * green + 0.0722 * blue)  # Rec. ITU-R BT.709, item 3.2 and 6.10
    assert np.abs(luma - wanted).max() <= 2


@pytest.mark.parametrize(("extension", "fps"), [(".mp4", 25), (".webm", 29.97), (".gif", 20)])
def test_the_rate_is_kept(tmp_path: Path, extension: str, fps: float) -> None:
    path = tmp_path / f"v{extension}"
    write_video(path, movie(), fps)
    with av.open(str(path)) as container:
        assert float(container.streams.video[0].average_rate or 0) == pytest.approx(fps, rel=1e-3)
        times = [frame.time for frame in container.decode(video=0)]
    assert np.diff(times) == pytest.approx([1 / fps] * 5, abs=1.1e-3)  # WebM counts in milliseconds


def test_an_animated_webp_keeps_rate_and_repeats_for_ever(tmp_path: Path) -> None:
    path = tmp_path / "v.webp"
    write_video(path, movie(), 20)
    data = path.read_bytes()
    loops = struct.unpack_from("<H", data, data.index(b"ANIM") + 12)[0]
    frame = data.index(b"ANMF")
    milliseconds = int.from_bytes(data[frame + 20 : frame + 23], "little")
    assert (loops, milliseconds, data.count(b"ANMF")) == (0, 50, 6)


def test_a_gif_repeats_for_ever(tmp_path: Path) -> None:
    path = tmp_path / "v.gif"
    write_video(path, movie(), 20)
    data = path.read_bytes()
    extension = data.index(b"NETSCAPE2.0") + 11
    assert data[extension : extension + 5] == bytes([3, 1, 0, 0, 0])


def test_the_same_frames_give_the_same_file(tmp_path: Path) -> None:
    texture = np.random.default_rng(0).integers(0, 256, (96, 128, 3), dtype=np.uint8)
    frames = [np.roll(texture, 3 * k, axis=1) for k in range(20)]
    files = []
    for count in range(3):
        write_video(tmp_path / f"{count}.mp4", iter(frames), 25)
        files.append((tmp_path / f"{count}.mp4").read_bytes())
    assert files[0] == files[1] == files[2]


def test_an_mp4_starts_with_its_index(tmp_path: Path) -> None:
    path = tmp_path / "v.mp4"
    write_video(path, movie(), 25)
    data = path.read_bytes()
    assert data.index(b"moov") < data.index(b"mdat")


@pytest.mark.parametrize("extension", VIDEO_EXTENSIONS)
def test_an_error_on_the_way_leaves_the_old_file(tmp_path: Path, extension: str) -> None:
    def broken() -> Iterator[npt.NDArray[np.uint8]]:
        yield from movie(3)
        raise KeyboardInterrupt

    path = tmp_path / f"v{extension}"
    path.write_bytes(b"old")
    with pytest.raises(KeyboardInterrupt):
        write_video(path, broken(), 25)
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("name", ["v.avi", "v", ".mp4", "v.mp4.part"])
def test_other_kinds_of_file_are_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(OutputError, match=r"\.mp4, \.webm, \.webp, \.gif"):
        write_video(tmp_path / name, movie(), 25)
    assert list(tmp_path.iterdir()) == []


def test_no_frames_and_frames_of_two_sizes_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no frames"):
        write_video(tmp_path / "v.mp4", iter(()), 25)
    with pytest.raises(ValueError, match="frame 1"):
        write_video(tmp_path / "v.mp4", iter([patches(0), patches(0)[:-2]]), 25)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("name", "fps"), [("v.mp4", 0), ("v.mp4", -1), ("v.mp4", float("nan")), ("v.mp4", 0.0004), ("v.mp4", 241), ("v.gif", 51)]
)
def test_impossible_rates_are_refused(tmp_path: Path, name: str, fps: float) -> None:
    with pytest.raises(InputError, match="frames per second"):
        check_video_target(tmp_path / name, fps)
    assert check_video_target(tmp_path / name, 24) == tmp_path / name


def test_a_rate_with_a_fraction_stays_exact(tmp_path: Path) -> None:
    path = tmp_path / "v.mp4"
    write_video(path, movie(), 30000 / 1001)
    with av.open(str(path)) as container:
        assert container.streams.video[0].average_rate == Fraction(30000, 1001)


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGINT for another process")
def test_ctrl_c_leaves_no_half_file(tmp_path: Path) -> None:
    script = (
        "import sys, time, numpy as np\n"
        "from lfcore.video import write_video\n"
        "def frames():\n"
        "    for k in range(10**6):\n"
        "        if k == 3: print('running', flush=True)\n"
        "        time.sleep(0.01); yield np.full((64, 64, 3), k % 256, np.uint8)\n"
        "write_video(sys.argv[1], frames(), 25)\n"
    )
    root = Path(__file__).parents[1]
    with subprocess.Popen(
        [sys.executable, "-c", script, str(tmp_path / "v.mp4")],
        cwd=root, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
    ) as process:  # fmt: skip
        assert process.stdout is not None
        assert process.stdout.readline() == b"running\n"
        time.sleep(0.05)
        assert len(list(tmp_path.iterdir())) == 1  # the temporary file
        process.send_signal(signal.SIGINT)
        try:
            assert process.wait(timeout=60) != 0
        finally:
            process.kill()  # else the end of this block would wait for one that went on
    assert list(tmp_path.iterdir()) == []
