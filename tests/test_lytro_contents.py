"""What Lytro files hold beside the raw mosaic: kinds, pictures, refocus stacks, depth maps; and pictures that lie."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
import pytest

from lfcore.errors import InputError
from lfcore.formats.lytro.compose import write_backup
from lfcore.formats.lytro.container import Container, open_container, reference_to, write_container
from lfcore.formats.lytro.contents import Contents, Kind, read_contents, roles
from lfcore.formats.lytro.extras import Extras, decode_pictures, describe, read_extras
from tests.lytro_files import SHARED, illum_public, write_f01, write_illum
from tests.lytro_video import encode_video

real_files = pytest.mark.skipif(not SHARED.is_dir(), reason="needs the real Lytro files of ../shared/data/lfp")


def opened(path: Path) -> tuple[Container, Contents]:
    container = open_container(path)
    return container, read_contents(container)


def extras(path: Path) -> Extras:
    return read_extras(*opened(path))


def smooth(height: int, width: int, shade: int) -> np.ndarray:
    """A picture that JPEG and H.264 keep nearly as it is."""
    y, x = np.mgrid[:height, :width]
    return np.stack([x * 255 // width, y * 255 // height, np.full_like(x, shade)], axis=-1).astype(np.uint8)


def encoded(folder: Path, pixels: np.ndarray, suffix: str = ".jpg") -> bytes:
    """A picture as the bytes of a file, written by OpenImageIO."""
    path = folder / f"encoded{suffix}"
    output = oiio.ImageOutput.create(str(path))
    spec = oiio.ImageSpec(pixels.shape[1], pixels.shape[0], pixels.shape[2], "uint8")
    spec.attribute("Compression", "jpeg:98")
    assert output.open(str(path), spec)
    assert output.write_image(np.ascontiguousarray(pixels))
    output.close()
    return path.read_bytes()


def acceleration(kind: str, content: dict[str, Any]) -> dict[str, Any]:
    """A table of contents of the first generation with one structure."""
    return {"picture": {"frameArray": [], "accelerationArray": [{"type": kind, "vendorContent": content}]}}


def write_stack(path: Path, folder: Path, shades: dict[int, float], size: tuple[int, int] = (48, 64)) -> Path:
    """A refocus stack of JPEG pictures: shade to lambda."""
    parts = [encoded(folder, smooth(*size, shade)) for shade in shades]
    entries = [
        {"representation": "jpeg", "width": size[1], "height": size[0], "lambda": focus, "imageRef": reference_to(part)}
        for part, focus in zip(parts, shades.values(), strict=True)
    ]
    write_container(path, acceleration("com.lytro.acceleration.refocusStack", {"imageArray": entries}), parts)
    return path


# Real files


@real_files
def test_real_refocus_stack() -> None:
    container, contents = opened(SHARED / "f01_refocus_stack.lfp")
    assert contents.kind is Kind.REFOCUS_STACK
    found = read_extras(container, contents)
    assert found.stack is not None
    assert found.stack.images.shape == (12, 1080, 1080, 3)
    assert (np.diff(found.stack.focus) > 0).all()
    assert found.stack.focus[[0, -1]] == pytest.approx([-8.92292785, 4.97506952])
    # Sharpness peaks somewhere inside the stack or at an end, but differs: these are differently focused pictures.
    edges = [float(np.abs(np.diff(image.astype(np.float32), axis=1)).mean()) for image in found.stack.images]
    assert max(edges) > 1.1 * min(edges)
    assert [stored.label for stored in contents.maps] == ["depth table"]


@real_files
def test_real_depth_map() -> None:
    found = extras(SHARED / "f01_depth_map.lfp")
    assert found.depth is not None
    assert found.depth.confidence is not None
    assert found.depth.depth.shape == found.depth.confidence.shape == (330, 330)
    # The table of contents says -20 to 11.
    assert -20 <= found.depth.depth.min() < found.depth.depth.max() <= 11
    assert 0 <= found.depth.confidence.min() <= found.depth.confidence.max() <= 1
    # Neighbours mostly agree: rows and columns are not mixed up.
    assert np.median(np.abs(np.diff(found.depth.depth, axis=0))) < 0.05


@real_files
def test_real_preview_of_an_illum() -> None:
    container, contents = opened(SHARED / "illum_preview.LFP")
    found = read_extras(container, contents)
    assert contents.kind is Kind.REFOCUS_STACK
    assert "the raw capture would be IMG_0480.LFR" in found.sentence
    assert found.stack is not None
    assert found.stack.images.shape == (10, 480, 704, 3)
    assert found.stack.focus.tolist() == [-15, -10, -7.5, -5, -1.5, 1.5, 5, 7.5, 10, 12.5]
    assert found.depth is not None
    assert found.depth.depth.shape == (60, 88)
    assert (found.depth.depth.min(), found.depth.depth.max()) == (-15, 12.5)


@real_files
def test_real_metadata_only() -> None:
    container, contents = opened(SHARED / "f01_metadata_only.lfp")
    assert contents.kind is Kind.METADATA
    assert "metadata only, without the raw capture" in describe(container, contents)
    assert roles(container) == {
        "sha1-031d1e1d0e65efcd6ea74c811a0bc170498d8574": "picture.frameArray[0].frame.metadataRef",
        "sha1-990a1858fe077fa0601df485704fc1d674a5e6b0": "picture.frameArray[0].frame.privateMetadataRef",
    }


# Made-up files


def test_captures_and_backups(tmp_path: Path) -> None:
    for path in (write_illum(tmp_path / "a.LFR"), write_f01(tmp_path / "a.lfp")):
        assert opened(path)[1].kind is Kind.CAPTURE
    contents = opened(write_backup(tmp_path, {"MOD_0000.RAW": b"a", "x": b"b"}, parts=1)[0])[1]
    assert contents.kind is Kind.CALIBRATION
    assert [file.name for file in contents.files] == ["MOD_0000.RAW", "x"]
    write_container(tmp_path / "b.lfp", {"novelty": 1}, [b""])
    assert opened(tmp_path / "b.lfp")[1].kind is Kind.UNKNOWN


def test_names_of_a_backup_lead_nowhere(tmp_path: Path) -> None:
    names = ["../../etc/passwd", "C:\\T1CALIB\\..\\MOD_0001.RAW", "..", "/", "", "a/.."]
    files = [{"name": name, "dataRef": reference_to(b"x")} for name in names]
    write_container(tmp_path / "data.C.0", {"files": [*files, {"name": "n"}, {"dataRef": "sha1-0"}]}, [b"x"])
    assert [file.name for file in opened(tmp_path / "data.C.0")[1].files] == ["passwd", "MOD_0001.RAW"]


def test_a_stack_is_sorted_from_near_to_far(tmp_path: Path) -> None:
    found = extras(write_stack(tmp_path / "a-stk.lfp", tmp_path, {200: 3.5, 100: -2.0, 0: 0.5}))
    assert found.stack is not None
    assert found.stack.focus.tolist() == [-2.0, 0.5, 3.5]
    for image, shade in zip(found.stack.images, (100, 0, 200), strict=True):
        assert np.abs(image.astype(int) - smooth(48, 64, shade)).mean() < 2
    assert "the raw capture would be a.lfp" in found.sentence
    assert found.pictures == ()


@pytest.mark.parametrize("kind", ["h264", "mp4"])
def test_a_stack_as_video(tmp_path: Path, kind: str) -> None:
    shades = [30, 90, 150, 210]
    data = encode_video([smooth(48, 64, shade) for shade in shades], kind)
    entries = [{"width": 64, "height": 48, "lambda": focus} for focus in (4, 2, 3, 1)]
    block = {"representation": "h264", "blockOfImagesRef": reference_to(data), "metadataArray": entries}
    table = acceleration("com.lytro.acceleration.refocusStack", {"blockOfImages": block})
    write_container(tmp_path / "a-stk.lfp", table, [data])
    found = extras(tmp_path / "a-stk.lfp")
    assert found.stack is not None
    assert found.stack.focus.tolist() == [1, 2, 3, 4]
    for image, shade in zip(found.stack.images, (210, 90, 150, 30), strict=True):
        assert np.abs(image.astype(int) - smooth(48, 64, shade)).mean() < 6
    entries += entries
    write_container(tmp_path / "a-stk.lfp", table, [data])
    with pytest.raises(InputError, match="has 4 of 8 pictures"):
        extras(tmp_path / "a-stk.lfp")


def test_thumbnails_and_views_of_an_illum(tmp_path: Path) -> None:
    grey, png = encoded(tmp_path, smooth(20, 30, 9)[..., :1]), encoded(tmp_path, smooth(20, 30, 77), ".png")
    view = {"perspectiveU": -0.5, "perspectiveV": 0.25, "imageRef": reference_to(png)}
    table = {
        "thumbnails": [{"width": 30, "height": 20, "imageRef": reference_to(grey), "representation": "jpeg"}],
        "frames": [{"frame": {"metadata": illum_public()}}],
        "views": [{"accelerations": [{"kind": "edofPerspective", "representation": "png", "perImage": [view]}]}],
    }
    write_container(tmp_path / "a.LFP", table, [grey, png])
    container, contents = opened(tmp_path / "a.LFP")
    assert contents.kind is Kind.PICTURES
    assert [picture.label for picture in contents.pictures] == ["perspective stack", "thumbnail"]
    assert contents.pictures[0].viewpoint == (-0.5, 0.25)
    first, second = (pixels for _, pixels in read_extras(container, contents).pictures)
    assert (first == smooth(20, 30, 77)).all()
    assert second.shape == (20, 30, 3)
    assert (second[..., 0] == second[..., 2]).all()


def test_depth_maps_of_the_illum_carry_their_own_size(tmp_path: Path) -> None:
    depth = np.linspace(-5, 5, 12, dtype=np.float32).reshape(3, 4)
    entry = {"width": 4, "height": 3, "representation": "packedFloat", "imageRef": reference_to(depth.tobytes())}
    table = {"views": [{"accelerations": [{"kind": "focusStack", "width": 99, "height": 77, "depthMap": entry}]}]}
    write_container(tmp_path / "a.LFP", table, [depth.tobytes()])
    found = extras(tmp_path / "a.LFP")
    assert found.depth is not None
    assert (found.depth.depth == depth).all()
    entry["height"] = 4
    write_container(tmp_path / "a.LFP", table, [depth.tobytes()])
    with pytest.raises(InputError, match="holds 48 bytes, but a depth map of 4 x 4 takes 64"):
        extras(tmp_path / "a.LFP")
    entry["representation"] = "half"
    write_container(tmp_path / "a.LFP", table, [depth.tobytes()])
    with pytest.raises(InputError, match="as 'half'; expected raw or packedFloat"):
        extras(tmp_path / "a.LFP")


# Pictures that lie


def picture_file(path: Path, data: bytes) -> Path:
    table = {"thumbnails": [{"width": 64, "height": 48, "imageRef": reference_to(data)}]}
    write_container(path, table, [data])
    return path


def refusal(path: Path) -> str:
    container, contents = opened(path)
    with pytest.raises(InputError) as caught:
        decode_pictures(container, contents.pictures)
    message = str(caught.value)
    assert message.startswith(str(path))
    assert "\n" not in message
    return message


# The largest is found out by OpenImageIO, the others by the room that their decoding would take.
SIDES = pytest.mark.parametrize("side, told", [(2_500, "one of 2500 x 2500 px"), (9_000, "claims"), (60_000, "claims")])


@SIDES
def test_a_small_jpeg_that_claims_to_be_huge(tmp_path: Path, side: int, told: str) -> None:
    data = bytearray(encoded(tmp_path, smooth(48, 64, 1)))
    frame = data.index(b"\xff\xc0")
    data[frame + 5 : frame + 9] = struct.pack(">HH", side, side)
    assert told in refusal(picture_file(tmp_path / "a", bytes(data)))


@SIDES
def test_a_small_png_that_claims_to_be_huge(tmp_path: Path, side: int, told: str) -> None:
    data = bytearray(encoded(tmp_path, smooth(48, 64, 1), ".png"))
    data[16:24] = struct.pack(">II", side, side)
    data[29:33] = struct.pack(">I", zlib.crc32(data[12:29]))
    assert told in refusal(picture_file(tmp_path / "a", bytes(data)))


def test_damaged_pictures(tmp_path: Path) -> None:
    whole = encoded(tmp_path, smooth(48, 64, 1))
    assert "neither JPEG nor PNG" in refusal(picture_file(tmp_path / "a", b"GIF89a" + bytes(50)))
    assert "neither JPEG nor PNG" in refusal(picture_file(tmp_path / "a", b""))
    assert "damaged or cut off" in refusal(picture_file(tmp_path / "a", whole[: len(whole) // 2]))
    assert "section 2 of 2" in refusal(picture_file(tmp_path / "a", whole[:20]))
    assert "more than 64 scans" in refusal(picture_file(tmp_path / "a", whole + b"\xff\xda" * 70))


def test_stacks_of_mixed_sizes(tmp_path: Path) -> None:
    parts = [encoded(tmp_path, smooth(48, 64, 1)), encoded(tmp_path, smooth(40, 64, 1))]
    entries = [{"lambda": index, "imageRef": reference_to(part)} for index, part in enumerate(parts)]
    table = acceleration("com.lytro.acceleration.refocusStack", {"imageArray": entries})
    write_container(tmp_path / "a", table, parts)
    with pytest.raises(InputError, match="pictures of different sizes"):
        extras(tmp_path / "a")


@pytest.mark.parametrize("times, told", [(390, "too large for its size"), (9_000, "more than 400 pictures")])
def test_one_picture_repeated_over_and_over(tmp_path: Path, times: int, told: str) -> None:
    """A small file may refer to the same picture many times: that must not fill the memory."""
    data = encoded(tmp_path, np.zeros((400, 400, 3), np.uint8))
    entries = [{"lambda": index, "imageRef": reference_to(data)} for index in range(times)]
    write_container(tmp_path / "a", acceleration("com.lytro.acceleration.refocusStack", {"imageArray": entries}), [data])
    with pytest.raises(InputError, match=told):
        extras(tmp_path / "a")


def test_video_that_is_none(tmp_path: Path) -> None:
    data = bytes(range(256)) * 8
    block = {"representation": "h264", "blockOfImagesRef": reference_to(data), "metadataArray": [{"lambda": 1}]}
    write_container(tmp_path / "a", acceleration("com.lytro.acceleration.refocusStack", {"blockOfImages": block}), [data])
    with pytest.raises(InputError, match=r"no readable H\.264 video|has 0 of 1 pictures"):
        extras(tmp_path / "a")
