import functools
import itertools
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
import torch
from numpy.typing import NDArray

from app.__main__ import main
from lfcore.errors import InputError
from lfcore.export import write_picture
from lfcore.formats import open_light_field
from lfcore.planesweep import Levels
from lfcore.training.generated import ContentConfig, GeneratedScene, SceneConfig, Textures, generate_pool, generate_scene
from lfcore.training.patches import PatchConfig, TrainingScene, sample_group
from lfcore.training.scenes import shapes, surfaces
from lfcore.training.scenes.arrangement import arrange, draw_range
from lfcore.training.scenes.camera import FAULTLESS, CameraConfig, add_noise, draw_camera, expose, tone_table
from lfcore.training.scenes.render import Glint, Layer, render
from lfcore.training.scenes.sampling import enlarge, read
from lfcore.training.scenes.surfaces import Canvas
from lfcore.training.scenes.textures import PROCEDURAL
from lfcore.warp import backward_warp, source_offset

CANVAS = Canvas(96, 112, 24)
SMALL = SceneConfig(views=3, height=96, width=112)
CORNERS_AND_MIDDLE = torch.tensor([(-0.5, -0.5), (0.5, -0.5), (-0.5, 0.5), (0.5, 0.5), (0.0, 0.0)])
AT_HOME = torch.zeros(5, 2)


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def wavy(x: torch.Tensor, y: torch.Tensor) -> torch.Tensor:
    """A picture (..., 3) that is known between the pixels, of wavelengths of 6 px and more."""
    return torch.stack([0.5 + 0.2 * torch.sin(x / 1.1 + k) + 0.2 * torch.cos(y / 1.4 - 0.4 * x + k) for k in range(3)], -1)


def wavy_layer(canvas: Canvas) -> torch.Tensor:
    y, x = torch.meshgrid(*(torch.arange(size).float() for size in canvas.full), indexing="ij")
    return torch.cat((wavy(x, y), torch.ones(*canvas.full, 1)), -1)


def test_a_layer_is_read_between_its_pixels_as_the_picture_that_it_samples() -> None:
    layer = wavy_layer(CANVAS)
    x, y = (torch.from_numpy(rng(k).uniform(30, 110, (50, 60)).astype(np.float32)) for k in (1, 2))
    values = read(enlarge(layer, 0.0), x, y)[..., :3]
    # Bilinear reading of half pixels flattens a wave of 6 px by up to 3.4% a way, half of it given beforehand; amplitude 0.4.
    torch.testing.assert_close(values, wavy(x, y), atol=0.025, rtol=0)


def test_blur_takes_from_each_wave_what_a_gaussian_takes() -> None:
    sigma, period = 1.3, 8
    x = torch.arange(128.0)
    wave = torch.sin(2 * math.pi * x / period).expand(128, 128).unsqueeze(-1)
    blurred = enlarge(wave, sigma)[0, 0, ::2, ::2].numpy()  # at the pixels, where bilinear reading takes nothing
    kept = 1 - (1 - math.cos(math.pi / period)) / 6
    expected = math.exp(-2 * (math.pi * sigma / period) ** 2) / kept
    np.testing.assert_allclose(blurred, expected * wave[..., 0].numpy(), atol=1e-4)


@pytest.mark.parametrize("disparity", [-9.0, 0.0, 5.5, 20.0])
def test_content_of_positive_disparity_moves_to_larger_x_and_y(disparity: float) -> None:
    canvas = Canvas(64, 64, 24)
    picture = torch.zeros(*canvas.full, 4)
    picture[..., 3] = 1
    picture[48:64, 48:64, :3] = 1  # its centre is the pixel place 55.5 on the layer, 31.5 in the middle view
    layer = Layer(picture, torch.full(canvas.coarse, disparity), 0.6)
    light = render(canvas, [layer], CORNERS_AND_MIDDLE, AT_HOME).light[..., 0].numpy()
    for view, (u, v) in zip(light, CORNERS_AND_MIDDLE.tolist(), strict=True):
        rows, columns = np.arange(64), np.arange(64)
        assert (view.sum(0) * columns).sum() / view.sum() == pytest.approx(31.5 + u * disparity, abs=0.02)
        assert (view.sum(1) * rows).sum() / view.sum() == pytest.approx(31.5 + v * disparity, abs=0.02)


def forms() -> dict[str, torch.Tensor]:
    return {
        "flat": torch.full(CANVAS.coarse, -7.0),
        "slanted": surfaces.plane(CANVAS, 5.0, -8.0),
        "folded": 2 * surfaces.waves(CANVAS, rng(4)),
        "rounded": 3 * surfaces.ridge(CANVAS, rng(5)),
    }


@pytest.mark.parametrize("form", forms())
def test_views_are_the_surface_seen_along_its_disparity(form: str) -> None:
    """Each pixel shows the surface point p with p + d D(p) = s, found here by bisection on the exact bilinear surface."""
    surface = forms()[form]
    views = render(CANVAS, [Layer(wavy_layer(CANVAS), surface, 0.0)], CORNERS_AND_MIDDLE, AT_HOME)
    rows, columns = np.arange(8, 90, 7), np.arange(9, 104, 7)
    fine = CANVAS.enlarge(surface).numpy()
    for k, (u, v) in enumerate(CORNERS_AND_MIDDLE.tolist()):
        for row in rows:
            for column in columns:
                found = _solve(fine, row + CANVAS.margin, column + CANVAS.margin, u, v)
                assert float(views.disparity[k, row, column]) == pytest.approx(found, abs=0.05)
                x, y = torch.tensor(column + CANVAS.margin - u * found), torch.tensor(row + CANVAS.margin - v * found)
                np.testing.assert_allclose(views.light[k, row, column], wavy(x, y), atol=0.045)


def _solve(fine: NDArray[np.float32], row: int, column: int, u: float, v: float) -> float:
    def at(x: float, y: float) -> float:
        left, top = int(x), int(y)
        a, b = x - left, y - top
        upper, lower = fine[top, left : left + 2], fine[top + 1, left : left + 2]
        return float((1 - b) * (upper[0] * (1 - a) + upper[1] * a) + b * (lower[0] * (1 - a) + lower[1] * a))

    low, high = -21.0, 21.0
    for _ in range(40):
        middle = (low + high) / 2
        low, high = (middle, high) if at(column - u * middle, row - v * middle) > middle else (low, middle)
    return (low + high) / 2


@pytest.mark.parametrize("seed", range(4))
def test_views_warped_by_the_true_disparity_agree_outside_occlusions(seed: int) -> None:
    """Of pixels whose surface both views see, 95% agree within 0.03, and far better than without the warp."""
    content = ContentConfig(translucent_share=0, glint_share=0, defocus_share=0)
    config = replace(SMALL, content=content, camera=replace(FAULTLESS, dark_share=0.0))
    scene = generate_scene(seed, Textures(), config)
    views = torch.from_numpy(scene.light_field.views.astype(np.float32) / 255).permute(0, 1, 4, 2, 3)  # (V, U, 3, H, W)
    disparity = torch.from_numpy(scene.disparity)
    middle, corner = views[1, 1], views[0, 2]
    offset = source_offset(torch.tensor([[1.0, 0.0]]), torch.tensor([[0.5, 0.5]]))
    warped = backward_warp(corner[None], disparity[1, 1][None, None], offset)[0]
    other = backward_warp(disparity[0, 2][None, None], disparity[1, 1][None, None], offset)[0, 0]
    own = disparity[1, 1]
    # Seen in both: the same disparity in both places, and no edge of depth within two pixels.
    spread = torch.nn.functional.max_pool2d(own[None], 5, 1, 2)[0] + torch.nn.functional.max_pool2d(-own[None], 5, 1, 2)[0]
    seen = ((other - own).abs() < 0.15) & (spread < 0.6)
    seen[:14], seen[-14:], seen[:, :14], seen[:, -14:] = False, False, False, False
    assert int(seen.sum()) > 300
    error = (warped - middle).abs().amax(0)[seen]
    plain = (corner - middle).abs().amax(0)[seen]
    assert float(error.quantile(0.95)) < 0.03
    assert float(error.mean()) < 0.5 * float(plain.mean())


def test_near_things_hide_far_ones_and_edges_mix_in_linear_light() -> None:
    canvas = Canvas(48, 48, 24)
    behind = torch.ones(*canvas.full, 4) * torch.tensor([0.2, 0.2, 0.2, 1])
    before = torch.zeros(*canvas.full, 4)
    before[:, :48] = torch.tensor([0.8, 0.8, 0.8, 1])
    layers = [
        Layer(behind, torch.full(canvas.coarse, 4.0), 0.8),
        Layer(before, torch.full(canvas.coarse, -6.0), 0.8),
    ]
    views = render(canvas, layers, CORNERS_AND_MIDDLE, AT_HOME)
    line = views.light[4, 20, :, 0]
    np.testing.assert_allclose(line[:20], 0.8, atol=0.01)
    np.testing.assert_allclose(line[28:], 0.2, atol=0.01)
    assert float(line[23] + line[24]) == pytest.approx(1.0, abs=0.01)  # the edge lies between the two: halves mix evenly
    assert views.disparity[4, 20, 23] == -6 and views.disparity[4, 20, 24] == 4
    assert views.disparity[0, 20, 26] == -6  # seen from the left, what is near stands further to the right


def test_a_highlight_moves_with_a_disparity_of_its_own_within_its_body() -> None:
    canvas = Canvas(64, 64, 24)
    behind = torch.ones(*canvas.full, 4) * torch.tensor([0.1, 0.1, 0.1, 1])
    body = torch.zeros(*canvas.full, 4)
    body[40:72, 40:72] = torch.tensor([0.2, 0.2, 0.2, 1])
    small, wide = torch.zeros(*canvas.full, 3), torch.ones(*canvas.full, 3)
    small[55:57, 55:57] = 1
    grid = torch.zeros(canvas.coarse)
    layers = [Layer(behind, grid, 0.5), Layer(body, grid, 0.5, Glint(small, grid + 10))]
    left, right = render(canvas, layers, torch.tensor([(-0.5, 0.0), (0.5, 0.0)]), torch.zeros(2, 2)).light[..., 0]
    columns = torch.arange(64.0)
    spots = [(view - 0.3).clamp_min(0).sum(0) for view in (left, right)]
    places = [float((spot * columns).sum() / spot.sum()) for spot in spots]
    assert places[1] - places[0] == pytest.approx(10, abs=0.05)
    layers[1] = replace(layers[1], glint=Glint(wide, grid))
    light = render(canvas, layers, CORNERS_AND_MIDDLE, AT_HOME).light[4, ..., 0]
    np.testing.assert_allclose(light[:10], 0.1, atol=0.005)  # none beside the body
    np.testing.assert_allclose(light[24:40, 24:40], 1.2, atol=0.01)


def test_nothing_of_a_thing_at_one_edge_appears_at_the_other() -> None:
    canvas = Canvas(64, 64, 24)
    behind = torch.ones(*canvas.full, 4) * torch.tensor([0.1, 0.1, 0.1, 1])
    thing = torch.zeros(*canvas.full, 4)
    thing[30:60, :50] = 1
    grid = torch.full(canvas.coarse, -12.0)
    for sigma in (0.45, 3.0):
        light = render(canvas, [Layer(behind, grid, 0.5), Layer(thing, grid, sigma)], CORNERS_AND_MIDDLE, AT_HOME).light
        np.testing.assert_allclose(light[4, :, 26 + math.ceil(3 * sigma) + 4 :], 0.1, atol=1e-6)


@pytest.mark.parametrize("draw", sorted({*shapes.BODIES, *shapes.THIN, shapes.ground}, key=lambda draw: draw.__name__))
def test_every_shape_covers_a_part_with_soft_edges(draw: shapes.Draw) -> None:
    covered = []
    for seed in range(12):
        shape = draw((150, 170), rng(seed))
        assert shape.alpha.shape == shape.shade.shape == (150, 170)
        assert float(shape.alpha.min()) >= 0 and float(shape.alpha.max()) <= 1
        assert torch.isfinite(shape.shade).all() and float(shape.shade.min()) > 0
        covered.append(float(shape.alpha.mean()))
    assert 0.005 < np.mean(covered) < 0.95
    assert ((shape.alpha > 0.05) & (shape.alpha < 0.95)).any()


@pytest.mark.parametrize("paint", sorted(set(PROCEDURAL), key=lambda paint: paint.__name__))
def test_every_procedural_texture_is_linear_light(paint: object) -> None:
    for seed in range(6):
        picture = paint((90, 110), rng(seed))  # type: ignore[operator]
        assert picture.shape == (90, 110, 3) and torch.isfinite(picture).all()
        assert float(picture.min()) >= 0 and 0.002 < float(picture.mean()) < 3


def test_the_same_seed_gives_the_same_scene_to_the_bit(tmp_path: Path) -> None:
    textures = photographs(tmp_path)
    first, again, other = (generate_scene(seed, textures, SMALL) for seed in (7, 7, 8))
    assert np.array_equal(first.light_field.views, again.light_field.views)
    assert np.array_equal(first.disparity, again.disparity)
    assert not np.array_equal(first.light_field.views, other.light_field.views)


def test_a_pool_is_the_same_whatever_the_number_of_workers() -> None:
    config = replace(SMALL, height=48, width=48)
    told: list[int] = []
    alone = list(generate_pool(2, 20, Textures(), config))
    together = list(generate_pool(2, 20, Textures(), config, workers=2, progress=told.append))
    assert told == [1, 2]
    for one, two in zip(alone, together, strict=True):
        assert np.array_equal(one.light_field.views, two.light_field.views)
        assert (one.low, one.high) == (two.low, two.high)


def test_ranges_of_disparity_are_drawn_as_told() -> None:
    drawn = np.array([draw_range(ContentConfig(), rng(seed)) for seed in range(800)])
    assert (drawn[:, 0] >= -21).all() and (drawn[:, 1] <= 21).all() and (drawn[:, 1] - drawn[:, 0] > 1.9).all()
    extent = np.abs(drawn).max(1)
    assert 0.45 < (extent <= 6).mean() < 0.75
    assert 0.85 < (extent <= 12).mean() < 0.98
    narrow = np.array([draw_range(ContentConfig(largest_disparity=3.0), rng(seed)) for seed in range(100)])
    assert np.abs(narrow).max() <= 3


@functools.cache
def small_scenes() -> tuple[list[GeneratedScene], list[GeneratedScene]]:
    """Dark and bright ones of 2 x 2 views and disparities up to 5 px, for the tests that only look at them."""
    config = replace(SMALL, height=48, width=48, views=2, content=ContentConfig(largest_disparity=5.0))
    dark, bright = (replace(config, camera=replace(CameraConfig(), dark_share=share)) for share in (1.0, 0.0))
    return (
        [generate_scene(seed, Textures(), dark) for seed in range(4)],
        [generate_scene(seed, Textures(), bright) for seed in range(4, 8)],
    )


def test_disparities_of_a_scene_keep_to_their_range() -> None:
    for scene in itertools.chain(*small_scenes()):
        assert -5 <= scene.low == scene.disparity.min() < scene.disparity.max() == scene.high <= 5


def test_what_is_drawn_later_is_nearer() -> None:
    """Front layers have the smaller disparity wherever they cover others, so that occlusions are true ones."""
    for seed in range(5):
        layers = arrange(CANVAS, Textures(), ContentConfig(), 0.5, rng(seed))
        front = torch.full(CANVAS.coarse, math.inf)
        for layer in layers:
            covered = CANVAS.shrink(layer.picture[..., 3]) > 0.02
            assert (layer.surface[covered] <= front[covered] + 1e-3).all()
            front = torch.where(covered, torch.minimum(front, layer.surface), front)


def test_noise_has_the_variance_that_was_asked_for() -> None:
    light = np.repeat(np.array([0.05, 0.2, 0.6], np.float32), 200_000)
    noise = add_noise(light, 4e-4, 3e-3, rng(1)) - light
    for k, level in enumerate((0.05, 0.2, 0.6)):
        part = noise[k * 200_000 : (k + 1) * 200_000]
        assert part.mean() == pytest.approx(0, abs=2e-4)
        assert part.var() == pytest.approx(4e-4 * level + 9e-6, rel=0.02)


def test_the_camera_stores_light_in_its_tone_with_its_gains() -> None:
    camera = draw_camera(3, replace(FAULTLESS, dark_share=1.0, dark_mean=(0.15, 0.15)), rng())
    light = torch.full((9, 40, 40, 3), 7.0)
    assert np.unique(expose(light, camera, rng())).tolist() == [round(0.15 * 255)]
    bright = draw_camera(3, replace(FAULTLESS, dark_share=0.0, bright_mean=(0.2, 0.2)), rng())
    assert np.unique(expose(light, bright, rng())).tolist() == [round(255 * (1.055 * 0.2 ** (1 / 2.4) - 0.055))]
    gains = camera.gains.copy()
    gains[8] = 0.5, 1.0, 9.0
    stored = expose(light, replace(camera, gains=gains), rng())
    assert stored[8, 0, 0].tolist() == [19, 38, 255] and stored[0, 0, 0].tolist() == [38, 38, 38]
    table = tone_table(False)
    assert table[0] == 0 and table[-1] == 255 and (np.diff(table.astype(int)) >= 0).all()


def test_the_camera_of_each_scene_keeps_to_the_ranges() -> None:
    config = CameraConfig()
    cameras = [draw_camera(5, config, rng(seed)) for seed in range(60)]
    shifts = np.array([camera.shifts.numpy().std() for camera in cameras])
    assert shifts.mean() > 0.02 and np.abs([camera.shifts.abs().max() for camera in cameras]).max() <= 2 * 0.2
    assert 0.2 < np.mean([camera.dark for camera in cameras]) < 0.7
    for camera in cameras:
        assert camera.blurs[12] == 0 and camera.blurs[0] == camera.blurs.max()
        assert config.shot_noise[0] <= camera.shot_noise <= config.shot_noise[1]
        assert config.softness[0] <= camera.softness <= config.softness[1]
        span = config.dark_mean if camera.dark else config.bright_mean
        assert span[0] <= camera.mean <= span[1]


def test_dark_scenes_are_dark_and_others_are_not() -> None:
    dark, bright = ([scene.light_field.views.mean() / 255 for scene in scenes] for scenes in small_scenes())
    assert 0.05 < np.mean(dark) < 0.25
    assert 0.3 < np.mean(bright) < 0.65


def photographs(folder: Path) -> Textures:
    """Three photographs of one colour each, so that it can be seen what came of them."""
    for k, name in enumerate(("a.png", "b.png", "inner/c.png")):
        (folder / name).parent.mkdir(exist_ok=True)
        picture = np.zeros((200, 260, 3), np.uint8)
        picture[..., k] = 200
        write_picture(folder / name, picture)
    return Textures(folder)


def test_photographs_are_found_cropped_and_taken_to_linear_light(tmp_path: Path) -> None:
    textures = photographs(tmp_path)
    assert [path.name for path in textures.files] == ["a.png", "b.png", "c.png"]
    crop = textures.crop(1, (150, 90), rng())
    assert crop.shape == (150, 90, 3)
    np.testing.assert_allclose(crop[..., 1], ((200 / 255 + 0.055) / 1.055) ** 2.4, atol=1e-3)
    assert float(crop[..., 0].max()) == 0
    assert textures.crop(0, (400, 300), rng()).shape == (400, 300, 3)  # larger than the photograph


def test_photographs_are_kept_within_bounds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    textures = photographs(tmp_path)
    monkeypatch.setattr("lfcore.training.scenes.textures._CACHE_BYTES", 2 * 200 * 260 * 3)
    for k in (0, 1, 2, 0):
        textures.photograph(k)
    assert [path.name for path in textures._cache] == ["c.png", "a.png"]


def test_folders_without_photographs_are_refused_in_a_sentence(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="is no folder"):
        Textures(tmp_path / "none")
    with pytest.raises(InputError, match="holds no pictures"):
        Textures(tmp_path)
    (tmp_path / "broken.png").write_bytes(b"no picture at all")
    with pytest.raises(InputError, match=r"broken\.png"):
        Textures(tmp_path).photograph(0)


def test_generated_scenes_can_be_trained_on() -> None:
    scene = generate_scene(3, Textures(), SceneConfig(views=3, height=128, width=128))
    levels = Levels()
    group = sample_group(
        [TrainingScene(scene.light_field, scene.low, scene.high)], PatchConfig(size=32, batch=2, group=2), levels, rng()
    )
    assert group.target.shape == (2, 3, 32, 32)


def test_scenes_that_cannot_be_are_refused() -> None:
    with pytest.raises(ValueError, match="2 x 2"):
        SceneConfig(views=1)


def test_generated_scenes_are_written_as_folders_that_open(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "scenes"
    arguments = ["generate", "--count", "2", "--seed", "4", "--views", "3", "--size", "64", "--out", str(out)]
    assert main(arguments) == 0
    captured = capsys.readouterr()
    assert "2 scenes of 3 x 3 views, 64 x 64 px" in captured.out and captured.err == ""
    assert sorted(path.name for path in out.iterdir()) == ["generated_00004", "generated_00005"]
    scene = generate_scene(5, Textures(), SceneConfig(views=3, height=64, width=64))
    opened = open_light_field(out / "generated_00005")
    assert np.array_equal(opened.views, scene.light_field.views)
    truth = oiio.ImageBuf(str(out / "generated_00005" / "truth" / "disparity.exr")).get_pixels(oiio.FLOAT)
    np.testing.assert_array_equal(truth[..., 0], scene.disparity[1, 1])
    assert main(arguments) == 2
    assert "is there already" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["--views", "1"], "cannot be generated"),
        (["--seed", "-1"], "0 or more"),
        (["--size", "100000"], "GiB"),
        (["--textures", "nowhere"], "is no folder"),
    ],
)
def test_what_cannot_be_generated_is_refused(
    arguments: list[str], complaint: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["generate", "--out", str(tmp_path / "scenes"), *arguments]) == 2
    assert complaint in capsys.readouterr().err
    assert not (tmp_path / "scenes").exists()
