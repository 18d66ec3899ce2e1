import copy
import functools
import itertools
import math
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from scenes import plane

from lfcore.compact import CompactModel
from lfcore.compact_synthesizer import CompactSynthesizer
from lfcore.errors import InputError
from lfcore.export import write_picture
from lfcore.lightfield import CORNERS, LightField
from lfcore.models import TRAINABLE
from lfcore.network_synthesizer import NetworkSynthesizer
from lfcore.networks import BORDER, FullModel, initialise
from lfcore.planesweep import Levels
from lfcore.synthesizer import corner_offsets
from lfcore.training import loop
from lfcore.training.architectures import Batch, Prediction, architecture
from lfcore.training.conditioning import mixing_matrix
from lfcore.training.curve import CurvePoint, write_curve
from lfcore.training.loop import Progress, Runtime, TrainConfig, Trainer, learning_rate, prepare_scene, train
from lfcore.training.loss import LossConfig, StepLoss, cut
from lfcore.training.patches import PatchConfig, PatchGroup, TrainingScene, margin, mixed, sample_group
from lfcore.training.plot import plot
from lfcore.training.trimming import trim
from lfcore.tuned_stack import Tuning
from lfcore.warp import backward_warp
from lfcore.weights import load_weights

LEVELS = Levels()
SMALL = PatchConfig(size=32, batch=2, group=2, tone_share=0.0)


@pytest.fixture(autouse=True)
def few_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    """A run looks for dead and idle channels in fewer patches, for that would take longer than its few steps."""
    monkeypatch.setattr(loop, "_LOOKED_AT", 4)


def scene(disparity: float, grid: tuple[int, int] = (4, 4), size: tuple[int, int] = (130, 150)) -> TrainingScene:
    return TrainingScene(plane(disparity, grid, size), disparity, disparity)


def test_the_range_of_disparities_is_found() -> None:
    for disparity in (-7.0, 4.0):
        field = plane(disparity, (3, 3), (120, 130))
        found = prepare_scene(field)
        assert found.low == pytest.approx(disparity, abs=0.5)
        assert found.high == pytest.approx(disparity, abs=0.5)


def test_a_pair_of_views_cannot_be_trained_on() -> None:
    with pytest.raises(InputError, match="3 x 3"):
        prepare_scene(plane(1.0, (2, 2)))


def test_patches_agree_with_their_inputs_under_shear_symmetry_and_tone() -> None:
    """Warped by its own disparity, each input of a patch of a plane equals the novel view, whatever was done to the patch."""
    config = PatchConfig(size=32, batch=4, group=2, tone_share=0.5, shear_spread=8)
    scenes = [scene(3.0, (5, 5))]
    disparities = set()
    for step in range(12):
        group = sample_group(scenes, config, LEVELS, np.random.default_rng((1, step)))
        near = min(range(-21, 22), key=lambda candidate: first_error(group, candidate))
        around = [near + quarters / 4 for quarters in range(-3, 4) if abs(near + quarters / 4) <= 21]
        best = min(around, key=lambda candidate: first_error(group, candidate))
        assert first_error(group, best) < 0.01, step
        disparities.add(best)
    assert len(disparities) > 3  # shears widen what one plane teaches
    assert min(disparities) < 0 < max(disparities)


def first_error(group: PatchGroup, disparity: float) -> float:
    """Mean difference of the first patch's inputs, warped by one disparity, from the novel view, each where it has samples."""
    inputs, target = torch.from_numpy(group.inputs[:, 0]), torch.from_numpy(group.target[0])
    flat, place = torch.full((1, 1, 32, 32), float(disparity)), (group.window.top, group.window.left)
    warped = backward_warp(inputs, flat, corner_offsets(group.u, group.v), place)
    seen = (warped != 0).all(1, keepdim=True)
    return float(((warped - target).abs() * seen).sum() / (3 * seen.sum())) if int(seen.sum()) > 1000 else math.inf


def test_shears_and_shifts_together_leave_no_gap_among_the_disparities() -> None:
    """Of a plane seen by 8 x 8 views, shears alone would show disparities 7 px apart."""
    field = plane(3.0, (8, 8), (190, 190))
    sheared, seen = set(), []
    for step in range(150):
        group = sample_group([TrainingScene(field, 3.0, 3.0)], SMALL, LEVELS, np.random.default_rng((5, step)))
        candidates = 3.0 + 7 * np.arange(-3, 3)
        if abs(7 * group.u - round(7 * group.u)) > 1e-6 or abs(7 * group.v - round(7 * group.v)) > 1e-6:
            continue  # of a smaller sub-grid
        errors = [plane_error(group, float(candidate)) for candidate in candidates]
        found = float(candidates[int(np.argmin(errors))])
        assert min(errors) < 0.01
        sheared.add(found)
        seen.append(found + group.shift)
    assert len(sheared) >= 4 and min(seen) >= -21 and max(seen) <= 21
    middle = [disparity for disparity in sorted(seen) if abs(disparity) < 12]
    assert max(np.diff(middle)) < 3 and middle[0] < -9 and middle[-1] > 9


def plane_error(group: PatchGroup, disparity: float) -> float:
    """Mean difference of the inputs, warped by one disparity, from the novel view, where all have samples."""
    inputs, target = torch.from_numpy(group.inputs[:, 0]), torch.from_numpy(group.target[0])
    w, offsets = group.window, corner_offsets(group.u, group.v)
    flat = torch.full((1, 1, w.bottom - w.top, w.right - w.left), disparity)
    warped = backward_warp(inputs, flat, offsets, (w.top, w.left))
    seen = (warped != 0).all(1, keepdim=True).all(0)
    return float(((warped - target).abs() * seen).sum() / (12 * seen.sum())) if int(seen.sum()) > 300 else math.inf


class Constant(torch.nn.Module):
    """A disparity network that has made up its mind; what it was given is kept."""

    def __init__(self, disparity: float, border: int) -> None:
        super().__init__()
        self.disparity, self.border = disparity, border
        self.given = torch.empty(0)
        self.unused = torch.nn.Parameter(torch.zeros(1))  # it tells the device

    def forward(self, features: torch.Tensor) -> torch.Tensor:
        self.given = features
        size = [extent - 2 * self.border for extent in features.shape[2:]]
        return torch.full((features.shape[0], 1, *size), self.disparity)


class MeanOfInputs(torch.nn.Module):
    """A colour network that takes the mean of the paper's warped inputs."""

    def forward(self, h: torch.Tensor) -> torch.Tensor:
        return cut(h[:, 1:13].unflatten(1, (4, 3)).mean(1), BORDER)  # the disparity stands before them


@pytest.mark.parametrize("shift", [-3.0, 0.0, 2.5])
def test_a_shifted_sweep_shows_disparities_that_are_so_much_higher(shift: float) -> None:
    """The levels' least deviation lies at the shifted disparity, and by that disparity the inputs are warped rightly."""
    alone = replace(SMALL, batch=1, group=1, edge_share=0)
    drawn = sample_group([scene(3.0)], alone, LEVELS, np.random.default_rng(6))
    group = replace(drawn, shift=shift)
    real = min(np.arange(-21, 21.01, 0.25), key=lambda candidate: plane_error(group, float(candidate)))
    batch = Batch.of([group], torch.device("cpu"))
    pair, model = architecture("full"), FullModel()
    model.disparity, model.colour = Constant(float(real) + shift, BORDER), MeanOfInputs()  # type: ignore[assignment]
    with torch.no_grad():
        prediction = pair.predict(model, batch, lambda: torch.autocast("cpu", enabled=False))
        _, loss = StepLoss(model, pair, LossConfig(matching_steps=2, matching_weight=1.0), False)(batch, 0)
    torch.testing.assert_close(prediction.image, cut(batch.targets, 2 * BORDER), atol=0.02, rtol=0)
    deviations = model.disparity.given[:, LEVELS.count :].mean((0, 2, 3))
    assert abs(float(LEVELS.values()[deviations.argmin()]) - (real + shift)) < 0.6
    assert float(loss) < 0.3  # the best match is where the network says


def test_the_small_pair_sweeps_and_warps_with_the_shift_too() -> None:
    """Its answer to a shifted group is that to the same group without a shift, if the levels are those of the shift."""
    drawn = sample_group([scene(3.0)], replace(SMALL, edge_share=0), LEVELS, np.random.default_rng(7))
    pair = architecture("realtime")
    model = pair.start(2)
    assert isinstance(model, CompactModel)
    with torch.no_grad():
        model.disparity.sharpness.fill_(1000.0)  # untrained as it is, it takes the least deviation at its word

    def predicted(shift: float) -> Prediction:
        with torch.no_grad():
            batch = Batch.of([replace(drawn, shift=shift)], torch.device("cpu"))
            return pair.predict(model, batch, lambda: torch.autocast("cpu", enabled=False))

    spacing = float(model.config.levels.values().diff()[0])
    plain, shifted = predicted(0.0), predicted(2 * spacing)  # whole levels, since the least deviation lies at a level
    assert plain.disparity is not None and shifted.disparity is not None
    assert float((shifted.disparity - plain.disparity).median()) == pytest.approx(2 * spacing, abs=0.4)
    assert float((shifted.image - plain.image).abs().mean()) < 0.02


def test_all_novel_positions_of_all_sub_grids_are_drawn_but_no_corner() -> None:
    drawn, alone, only = set(), replace(SMALL, batch=1, group=1, candidates=1), scene(1.0)
    for step in range(1000):
        group = sample_group([only], alone, LEVELS, np.random.default_rng((2, step)))
        drawn.add((round(group.u * 6), round(group.v * 6)))
    thirds = {(2 * a, 2 * b) for a, b in itertools.product(range(4), repeat=2)}
    halves = {(3 * a, 3 * b) for a, b in itertools.product(range(3), repeat=2)}
    corners = {(6 * a, 6 * b) for a, b in itertools.product(range(2), repeat=2)}
    assert drawn == (thirds | halves) - corners


def test_a_group_depends_on_the_state_of_its_generator_alone() -> None:
    a, b, c = (sample_group([scene(1.0)], SMALL, LEVELS, np.random.default_rng(seed)) for seed in (1, 1, 2))
    np.testing.assert_array_equal(a.inputs, b.inputs)
    assert (a.u, a.v, a.window) == (b.u, b.v, b.window)
    assert a.inputs.shape != c.inputs.shape or not np.array_equal(a.inputs, c.inputs)


def test_generated_scenes_are_drawn_as_often_as_asked() -> None:
    """Scenes of two brightnesses tell where a patch comes from."""
    captured, generated = (
        [TrainingScene(LightField(np.full((3, 3, 120, 120, 3), value, np.uint8), "", "", ""), 0, 0) for _ in range(count)]
        for value, count in ((10, 2), (200, 7))
    )
    scenes = mixed(captured, generated, 0.3)
    drawn = [sample_group(scenes, SMALL, LEVELS, np.random.default_rng((3, k))).target.mean((1, 2, 3)) for k in range(200)]
    assert np.mean(np.concatenate(drawn) > 0.5) == pytest.approx(0.3, abs=0.07)  # 400 patches: 3 standard deviations
    assert {scene.weight for scene in mixed(captured, [], 0.3)} == {0.5}
    assert {scene.weight for scene in mixed([], generated, 0.3)} == {1 / 7}


def flat_scene(colour: tuple[int, int, int]) -> TrainingScene:
    views = np.broadcast_to(np.array(colour, np.uint8), (5, 5, 130, 130, 3)).copy()
    return TrainingScene(LightField(views, "flat", "", ""), 0, 0)


def test_tones_are_the_same_for_all_views_of_a_patch() -> None:
    config = PatchConfig(size=32, batch=2, group=2, tone_share=1.0)
    for colour in ((220, 90, 90), (60, 20, 20), (150, 150, 150)):
        toned = set()
        for step in range(30):
            group = sample_group([flat_scene(colour)], config, LEVELS, np.random.default_rng((4, step)))
            for patch in range(2):
                novel = group.target[patch, :, 10, 10]
                np.testing.assert_allclose(group.inputs[:, patch, :, 40, 40], np.broadcast_to(novel, (4, 3)), atol=1e-6)
                toned.add(tuple(novel.round(3)))
        assert len(toned) > 30


def test_the_margin_holds_every_sample_of_the_sweep() -> None:
    assert margin(LEVELS) >= 21 + 2
    assert margin(LEVELS) % 2 == 0  # half-resolution models begin at whole pixels of theirs


def train_small(tmp_path: Path, steps: int, run: str, stop_at: int | None = None, model: str = "full") -> list[Progress]:
    config = TrainConfig(
        model=model, steps=steps, decay_share=0, loss=LossConfig(matching_steps=3), patches=SMALL, revival_steps=2
    )
    reports: list[Progress] = []
    train(
        config,
        Runtime(device="cpu"),
        [plane(2.0, (3, 3), (120, 120)), plane(-3.0, (3, 3), (120, 120))],
        [plane(1.0, (3, 3), (72, 72))],
        tmp_path / f"{run}.safetensors",
        tmp_path / run,
        reports.append,
        lambda: stop_at is not None and len(reports) + 1 >= stop_at,
    )
    return reports


@pytest.fixture(scope="module")
def one_step(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """The folder of a run of one step, trained.safetensors and trained/, by the model; tests that only read it share it."""

    @functools.cache
    def folder(model: str) -> Path:
        made = tmp_path_factory.mktemp(model)
        train_small(made, 1, "trained", model=model)
        return made

    return folder


@pytest.mark.parametrize("model", TRAINABLE)
def test_a_stopped_run_goes_on_exactly_where_it_was(tmp_path: Path, model: str) -> None:
    whole = train_small(tmp_path, 5, "straight", model=model)
    first = train_small(tmp_path, 5, "halved", stop_at=2, model=model)
    second = train_small(tmp_path, 5, "halved", model=model)
    assert [p.step for p in first] == [1, 2]
    assert [p.step for p in second] == [3, 4, 5]
    # Channels that were dead from the beginning have been given new weights before it was stopped, and after.
    assert [p.revived for p in first + second] == [p.revived for p in whole]
    assert (whole[2].revived > 0) == (model != "realtime") and whole[0].revived == whole[1].revived == 0
    straight = load_weights(tmp_path / "straight.safetensors").model.state_dict()
    halved = load_weights(tmp_path / "halved.safetensors").model.state_dict()
    last = [load_checkpoint_tensors(tmp_path / run) for run in ("straight", "halved")]
    for name in last[0]:
        torch.testing.assert_close(last[0][name], last[1][name], atol=1e-6, rtol=1e-5)
    assert straight.keys() == halved.keys()


def test_a_run_goes_on_from_given_weights_and_names_them(
    tmp_path: Path, one_step: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    given = load_weights(one_step("full") / "trained.safetensors")
    monkeypatch.undo()  # the patches decide what is idle
    config = TrainConfig(
        steps=1, learning_rate=1e-9, warm_up_steps=0, loss=LossConfig(matching_steps=0), patches=SMALL, revival_steps=0
    )
    out, run = tmp_path / "second.safetensors", tmp_path / "second"
    scenes = [plane(2.0, (3, 3), (120, 120))]
    train(config, Runtime(device="cpu"), scenes, [], out, run, lambda p: None, lambda: False, given)
    found = load_weights(out)
    assert found.training["config"]["initial"] == given.digest
    # Next to nothing was learnt, so the weights are those given.
    trained = load_checkpoint_tensors(run)
    mixed_first = trained.pop("model/disparity.hidden.0.parametrizations.weight.original")
    trained["model/disparity.hidden.0.weight"] = torch.einsum("ocyx,cd->odyx", mixed_first, mixing_matrix(Levels()))
    without_idle = copy.deepcopy(given.model)
    trim(without_idle)
    for name, value in without_idle.state_dict().items():
        torch.testing.assert_close(trained[f"model/{name}"], value, atol=1e-5, rtol=1e-4)
    for name, value in given.model.state_dict().items():
        written = found.model.state_dict()[name]
        kept = (written != 0) | (value == 0)  # all but those of channels that the patches of this run show to be idle
        torch.testing.assert_close(written[kept], value[kept], atol=1e-5, rtol=1e-4)
        assert kept.float().mean() > 0.8


def test_a_run_does_not_begin_with_the_weights_of_another_model(tmp_path: Path, one_step: Callable[[str], Path]) -> None:
    given = load_weights(one_step("realtime") / "trained.safetensors")
    scenes = [plane(2.0, (3, 3), (120, 120))]
    out, run = tmp_path / "o.safetensors", tmp_path / "r"
    with pytest.raises(InputError, match="of realtime, not of full"):
        train(TrainConfig(model="full", patches=SMALL), Runtime("cpu"), scenes, [], out, run, print, lambda: False, given)


def test_a_teacher_adds_the_distance_to_its_disparity(one_step: Callable[[str], Path]) -> None:
    teacher = load_weights(one_step("realtime") / "trained.safetensors")
    assert isinstance(teacher.model, CompactModel)
    pair, model = architecture("full"), FullModel()
    initialise(model, 1)
    drawn = sample_group([scene(3.0)], SMALL, LEVELS, np.random.default_rng(5))
    batch = Batch.of([replace(drawn, shift=0.0)], torch.device("cpu"))
    weight = LossConfig(matching_steps=0, teacher_weight=0.7)
    with torch.no_grad():
        _, alone = StepLoss(model, pair, weight, False)(batch, 0)
        _, taught = StepLoss(model, pair, weight, False, teacher.model)(batch, 0)
        disparity = pair.predict(model, batch, lambda: torch.autocast("cpu", enabled=False)).disparity
    # The teacher's own synthesizer, on a picture that is the patch with its margin, sees the same.
    group = batch.groups[0]
    views = np.zeros((2, 2, *group.inputs.shape[-2:], 3), np.float32)
    wanted = []
    for patch in range(group.inputs.shape[1]):
        for k, (u, v) in enumerate(CORNERS):
            views[int(v), int(u)] = group.inputs[k, patch].transpose(1, 2, 0)
        synthesizer = CompactSynthesizer(copy.deepcopy(teacher.model), "teacher", Tuning())
        synthesizer.set_light_field(LightField(views.copy(), "patch", "", ""))
        found = synthesizer.synthesize(group.u, group.v).disparity
        assert found is not None
        w = group.window
        wanted.append(found[w.top + BORDER : w.bottom - BORDER, w.left + BORDER : w.right - BORDER])
    assert disparity is not None
    distance = torch.nn.functional.smooth_l1_loss(disparity[:, 0], torch.from_numpy(np.stack(wanted)))
    assert float(taught - alone) == pytest.approx(0.7 * float(distance), rel=0.15)  # what lies beyond the patch differs


def test_at_an_edge_of_the_picture_the_papers_pair_is_trained_on_what_it_is_used_for() -> None:
    """The group's inputs as a light field of their own: there the synthesizer finds the same picture as the training."""
    pair, model = architecture("full"), FullModel()
    initialise(model, 3)
    with torch.no_grad():
        model.disparity.last.weight *= 20  # some pixels of disparity, so that samples lie beyond the edge
    at_edge = replace(SMALL, batch=1, group=1, edge_share=1.0)
    group = replace(sample_group([scene(3.0)], at_edge, LEVELS, np.random.default_rng(8)), shift=0.0)
    w, (height, width) = group.window, group.inputs.shape[-2:]
    assert min(w.top, w.left, height - w.bottom, width - w.right) == 0
    with torch.no_grad():
        found = pair.predict(model, Batch.of([group], torch.device("cpu")), lambda: torch.autocast("cpu", enabled=False))
    views = np.zeros((2, 2, height, width, 3), np.float32)
    for k, (u, v) in enumerate(CORNERS):
        views[int(v), int(u)] = group.inputs[k, 0].transpose(1, 2, 0)
    synthesizer = NetworkSynthesizer(model, "same", Tuning())
    synthesizer.set_light_field(LightField(views, "patch", "", ""))
    expected = synthesizer.synthesize(group.u, group.v)
    inner = slice(w.top + found.border, w.bottom - found.border), slice(w.left + found.border, w.right - found.border)
    np.testing.assert_allclose(found.image[0].clamp(0, 1).permute(1, 2, 0), expected.image[inner], atol=1e-4)


def test_only_the_small_pair_can_teach(tmp_path: Path, one_step: Callable[[str], Path]) -> None:
    teacher, scenes = load_weights(one_step("full") / "trained.safetensors"), [plane(2.0, (3, 3), (120, 120))]
    out, run = tmp_path / "o.safetensors", tmp_path / "r"
    with pytest.raises(InputError, match="only realtime can teach"):
        train(TrainConfig(steps=1, patches=SMALL), Runtime("cpu"), scenes, [], out, run, print, lambda: False, teacher=teacher)


def load_checkpoint_tensors(run: Path) -> dict[str, torch.Tensor]:
    from safetensors.torch import load_file

    return load_file(run / "checkpoint.safetensors")


def test_a_checkpoint_of_another_configuration_or_a_damaged_one_is_refused(
    tmp_path: Path, one_step: Callable[[str], Path]
) -> None:
    shutil.copytree(one_step("full") / "trained", tmp_path / "run")
    config = TrainConfig(steps=2, decay_share=0, loss=LossConfig(matching_steps=3), patches=SMALL, learning_rate=5e-3)
    scenes = [plane(2.0, (3, 3), (120, 120))]
    arguments = (scenes, [], tmp_path / "o.safetensors", tmp_path / "run", lambda p: None, lambda: False)
    with pytest.raises(InputError, match="learning_rate"):
        train(config, Runtime(device="cpu"), *arguments)
    path = tmp_path / "run" / "checkpoint.safetensors"
    path.write_bytes(path.read_bytes()[:1000])
    with pytest.raises(InputError, match="not a readable checkpoint"):
        train(config, Runtime(device="cpu"), *arguments)


@pytest.mark.parametrize("model", ["full", "realtime"])
def test_steps_on_the_same_patches_lower_their_error(tmp_path: Path, model: str) -> None:
    config = TrainConfig(model=model, learning_rate=3e-4, warm_up_steps=1, loss=LossConfig(matching_steps=0), patches=SMALL)
    trainer = Trainer(config, torch.device("cpu"), tmp_path)
    groups = trainer.draw([scene(5.0)], 0)
    errors = [trainer.take_step(groups) for _ in range(12)]
    assert errors[-1] < 0.5 * errors[0]


def test_the_learning_rate_rises_stays_and_falls() -> None:
    config = TrainConfig(steps=1000, learning_rate=1e-3, warm_up_steps=10, decay_share=0.5)
    rates = [learning_rate(config, step) for step in range(1001)]
    assert rates[0] == pytest.approx(1e-4)
    assert rates[10] == rates[500] == 1e-3
    assert rates[1000] == pytest.approx(1e-5)
    assert all(a >= b for a, b in itertools.pairwise(rates[500:]))


def test_the_curve_is_written_as_table_and_picture(tmp_path: Path) -> None:
    curve = [CurvePoint(k, 60.0 * k, 1e-4, 0.01 / k, {"a": 20.0 + k, "b": 22.0 + k}) for k in range(1, 6)]
    write_curve(tmp_path, curve)
    write_picture(tmp_path / "curve.png", plot(curve))
    lines = (tmp_path / "curve.csv").read_text().splitlines()
    assert lines[0] == "step,seconds,learning_rate,loss,a,b"
    assert lines[5].split(",")[-2:] == ["25.000", "27.000"]
    picture = plot(curve).astype(int)
    bluest, reddest = (picture[..., 2] - picture[..., 0]), (picture[..., 0] - picture[..., 2])
    # Two rising lines, one above the other by 2 dB, each in its colour.
    assert (bluest > 100).sum() > 500 and (reddest > 100).sum() > 500
    heights = [np.nonzero((colour[60:, 70:] > 100).any(1))[0] for colour in (bluest, reddest)]
    assert heights[0].min() > heights[1].min()
    assert plot([]).shape == picture.shape
    assert curve[0].mean == 22.0 and CurvePoint(1, 1, 1, 1, {}).mean == -math.inf


def test_corner_views_alone_cannot_be_validated_on(tmp_path: Path) -> None:
    scenes, corners = [plane(2.0, (3, 3), (120, 120))], [plane(1.0, (2, 2), (72, 72))]
    out, run = tmp_path / "o.safetensors", tmp_path / "r"
    with pytest.raises(InputError, match="only the four corner views"):
        train(TrainConfig(steps=1, patches=SMALL), Runtime(device="cpu"), scenes, corners, out, run, print, lambda: False)
    assert not run.exists()


def test_scenes_too_small_for_the_patch_are_refused_in_words(tmp_path: Path) -> None:
    field = LightField(np.zeros((3, 3, 60, 60, 3), np.uint8), "tiny", "", "")
    with pytest.raises(InputError, match="tiny"):
        out, run = tmp_path / "o.safetensors", tmp_path / "r"
        train(TrainConfig(steps=1), Runtime(device="cpu"), [field], [], out, run, print, lambda: False)


def test_a_training_that_diverges_ends_in_a_sentence_and_writes_nothing(tmp_path: Path) -> None:
    config = TrainConfig(
        model="realtime", learning_rate=1e9, warm_up_steps=1, steps=5, loss=LossConfig(matching_steps=0), patches=SMALL
    )
    out = tmp_path / "o.safetensors"
    scenes = [plane(2.0, (3, 3), (130, 150))]
    with pytest.raises(InputError, match="diverged at step"):
        train(config, Runtime(device="cpu"), scenes, [], out, tmp_path / "run", lambda progress: None, lambda: False)
    assert not out.exists()
