"""The training loop: all networks of a model at once, through the warp; resumes exactly where it was.

The data of step k depend on the seed and k alone, so that a checkpoint needs no state of a random generator: stopping and
going on gives the weights that going on without a stop would have given.
"""

from __future__ import annotations

import copy
import math
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as F
from torch import nn

from lfcore.allocator import keep_freed_memory
from lfcore.compact import CompactModel
from lfcore.disparity_sign import baselines_differ, check_disparity
from lfcore.errors import InputError
from lfcore.export import write_picture
from lfcore.illum import with_true_colours
from lfcore.lightfield import LightField
from lfcore.metrics import check_size, k16, k16_view
from lfcore.models import Model
from lfcore.planesweep import Levels, Window, luminance, plane_sweep
from lfcore.synthesizer import corner_offsets, corner_tensor, synthesizer_of
from lfcore.training.architectures import Batch, architecture
from lfcore.training.checkpoint import CHECKPOINT, Checkpoint, load_checkpoint, save_checkpoint
from lfcore.training.clearing import clear
from lfcore.training.curve import CurvePoint, column_names, write_curve
from lfcore.training.loss import LossConfig, StepLoss
from lfcore.training.optimiser import MuonAdam, moment_shapes
from lfcore.training.patches import PatchConfig, PatchGroup, TrainingScene, check_room, mixed, sample_group
from lfcore.training.plot import plot
from lfcore.training.revival import Part, Surroundings, revive
from lfcore.training.team import ALONE, Team
from lfcore.training.trimming import trim
from lfcore.tuning import machine_tuning
from lfcore.weights import Weights, save_weights

# So many groups of patches are looked at for dead and idle channels; the other number keeps their seeds apart from those of
# steps.
_LOOKED_AT = 24
_APART = 1000
_TEACHER = "realtime"


@dataclass(frozen=True)
class TrainConfig:
    """Everything that decides what comes out. The defaults are the paper's patches and batch, and a schedule for few steps."""

    steps: int = 20000
    learning_rate: float = 1e-4
    warm_up_steps: int = 100  # learning rate grows from 0
    decay_share: float = 0.3  # of the steps, at the end, in which the learning rate falls to a hundredth
    loss: LossConfig = field(default_factory=LossConfig)
    teacher: str = ""  # digest of the small pair whose disparity is a guide; empty: none
    initial: str = ""  # digest of the weights to go on from; empty: Xavier initialisation
    average: float = 0.999  # decay of the running average of the weights; the average is what is validated and shipped
    seed: int = 1
    generated_share: float = 0.5  # of the patches, where there are generated scenes
    patches: PatchConfig = field(default_factory=PatchConfig)
    model: str = "full"
    revival_steps: int = 500  # after so many, and before given weights' first, dead channels get new ones; 0: never


@dataclass(frozen=True)
class Runtime:
    """Where and how often; none of it decides what comes out, but for rounding."""

    device: str = "auto"  # auto, cpu, cuda
    validate_minutes: float = 5.0
    stop_after_minutes: float = math.inf


@dataclass(frozen=True)
class Progress:
    """What a run reports while it goes on."""

    step: int
    steps: int
    loss: float  # mean squared error of the last patches, running average
    steps_per_second: float
    validation: CurvePoint | None  # when one has just been made
    revived: int  # channels that have been given new weights before this step


def prepare_scene(light_field: LightField) -> TrainingScene:
    """Find the range of disparities of a scene by a plane sweep over its corners, so that shears keep it within the levels.
    Colours are the true ones, as the synthesizers give them to the networks.

    Raises InputError where there are too few views that lie equally far apart along rows and columns.
    """
    field = _evenly_spaced(light_field)
    side = min(field.rows, field.columns)
    if side < 3:
        grid, even = f"{light_field.rows} x {light_field.columns}", f"{field.rows} x {field.columns}"
        which = "" if even == grid else f", of which {even} lie equally far apart along rows and columns"
        raise InputError(f"{light_field.name} has {grid} views{which}; training needs 3 x 3 or more.")
    field = with_true_colours(field)
    square = replace(field, views=field.views[:side, :side])
    levels = Levels()
    luma = luminance(corner_tensor(square)).unsqueeze(1)  # (4, 1, H, W)
    window = Window(0, square.height, 0, square.width)
    features = plane_sweep(luma, corner_offsets(0.5, 0.5), levels, window)
    mean, deviation = features[0, : levels.count], features[0, levels.count :]
    cost, best = F.avg_pool2d(deviation.unsqueeze(0), 9, 4).squeeze(0).min(0)
    # Only where there is texture and the inputs agree at some level does the minimum mean anything.
    texture = F.avg_pool2d((mean.mean(0) - F.avg_pool2d(mean.mean(0)[None], 9, 1, 4)[0]).abs()[None], 9, 4)[0]
    clear = (cost < F.avg_pool2d(deviation.mean(0)[None], 9, 4)[0] * 0.5) & (texture > texture.median())
    found = levels.values()[best[clear]] if int(clear.sum()) > 50 else levels.values()[best.flatten()]
    low, high = np.percentile(found.numpy(), (1, 99))
    return TrainingScene(field, float(low), float(high))


def _evenly_spaced(light_field: LightField) -> LightField:
    """The views that lie equally far apart along rows and columns, which patches are taken of: all of a square grid.

    Along both sides of another grid there is one disparity, so its neighbours lie farther apart along the side with fewer
    views, and of the other so many are left out; unless the pictures tell that all lie equally far apart.
    """
    rows, columns = light_field.rows, light_field.columns
    if rows == columns or baselines_differ(light_field, check_disparity(light_field)):
        return light_field
    parts = math.gcd(rows - 1, columns - 1)
    views = light_field.views[:: (rows - 1) // parts, :: (columns - 1) // parts]
    return replace(light_field, views=views)


def train(
    config: TrainConfig,
    runtime: Runtime,
    scenes: Sequence[LightField],
    validation: Sequence[LightField],
    out: Path,
    run_dir: Path,
    report: Callable[[Progress], None],
    stopped: Callable[[], bool],
    initial: Weights | None = None,
    team: Team = ALONE,
    generated: Sequence[TrainingScene] = (),
    teacher: Weights | None = None,
) -> None:
    """Train from `initial` or anew until `config.steps`, `runtime.stop_after_minutes` or `stopped()`; if `run_dir` holds a
    checkpoint, go on from there.

    Writes `out` (the averaged weights that scored best on `validation`, or the newest where there is none, or no file), and in
    `run_dir` checkpoint.safetensors, curve.csv and curve.png. With a `team` of several processes each takes its share of every
    batch, and the first alone validates, writes and reports; all must see the same `run_dir`. `generated` scenes, whose range
    of disparities is known, are drawn for `config.generated_share` of the patches. A `teacher` guides the disparity. A run that
    has ended already writes `out` where it is missing, and does nothing else. Raises InputError for scenes too small and for a
    checkpoint of another configuration.
    """
    keep_freed_memory()
    for light_field in validation:  # what cannot be scored is refused now, not after the first minutes
        k16_view(light_field)
        check_size(light_field, "K16")
    config = _settled(config, initial, teacher, team)
    trainer = Trainer(config, device_of(runtime.device), run_dir, initial.model if initial else None, team, teacher)
    prepared = [prepare_scene(scene) for scene in scenes]
    check_room([*prepared, *generated], config.patches, trainer.levels)
    prepared = mixed(prepared, generated, config.generated_share)
    began = last_validation = time.monotonic()
    first_step = trainer.step
    running = math.nan
    with ThreadPoolExecutor(1) as pool:
        upcoming = pool.submit(trainer.draw, prepared, trainer.step)
        while trainer.step < config.steps:
            groups = upcoming.result()
            revived = trainer.revive(prepared) if revival_due(config, trainer.step) else 0
            upcoming = pool.submit(trainer.draw, prepared, trainer.step + 1)
            loss = trainer.take_step(groups)
            running = loss if math.isnan(running) else 0.98 * running + 0.02 * loss
            now = time.monotonic()
            out_of_time = now - began > 60 * runtime.stop_after_minutes
            ending = trainer.step == config.steps or team.any(out_of_time or stopped())
            point = None
            if team.leads and (ending or now - last_validation > 60 * runtime.validate_minutes):
                trainer.save_checkpoint()  # whatever may stop the validation
                point = trainer.validate(validation, running)
                trainer.save(out, scenes, prepared, len(generated), validation)
                last_validation = time.monotonic()
            rate = (trainer.step - first_step) / max(now - began, 1e-9)
            if team.leads:
                report(Progress(trainer.step, config.steps, running, rate, point, revived))
            if ending:
                break
    if team.leads and trainer.owes(out):
        point = trainer.validate(validation, trainer.last_loss)
        trainer.save(out, scenes, prepared, len(generated), validation)
        report(Progress(trainer.step, config.steps, point.loss, 0.0, point, 0))
    team.wait()  # until the weights are written


def check_patches(config: TrainConfig, taught: bool) -> None:
    """Raise InputError where the model, or a teacher of it, cannot be given patches of this size."""
    names = (config.model, _TEACHER) if taught else (config.model,)
    multiple = math.lcm(*(architecture(name).alignment for name in names))
    size = config.patches.size
    if size % multiple:
        raise InputError(
            f"Patches of {size} px were asked for, but {names[-1]} takes multiples of {multiple} px; choose "
            f"{size - size % multiple} or {size - size % multiple + multiple}."
        )


def _settled(config: TrainConfig, initial: Weights | None, teacher: Weights | None, team: Team) -> TrainConfig:
    """The config with what the other arguments decide. Raises InputError where they do not fit together."""
    check_patches(config, teacher is not None)
    groups = config.patches.batch // config.patches.group
    if groups % team.size:
        raise InputError(f"{groups} groups of patches a step cannot be shared by {team.size} processes; change the batch.")
    if teacher is not None and not isinstance(teacher.model, CompactModel):
        raise InputError(f"The teacher's weights are those of {teacher.model.config.name}; only {_TEACHER} can teach.")
    config = replace(config, teacher=teacher.digest if teacher else "")
    if initial is None:
        return config
    if initial.model.config.name != config.model:
        raise InputError(f"The weights to go on from are those of {initial.model.config.name}, not of {config.model}.")
    return replace(config, initial=initial.digest)


class Trainer:
    """Model, running average and optimiser of one run."""

    def __init__(
        self,
        config: TrainConfig,
        device: torch.device,
        run_dir: Path,
        initial: Model | None = None,
        team: Team = ALONE,
        teacher: Weights | None = None,
    ) -> None:
        self._config = config
        self._device = device
        self._run_dir = run_dir
        self._team = team
        self._architecture = architecture(config.model)
        # Given weights keep their own config, which may be another than that of new ones.
        self._model = self._architecture.start(config.seed) if initial is None else copy.deepcopy(initial)
        # What is idle in given weights stays so, if nothing revives it.
        self._trimmed = trim(self._model) if initial is not None and config.revival_steps <= 0 else None
        self._architecture.prepare(self._model)
        self._model.to(device=device, memory_format=torch.channels_last)  # type: ignore[call-overload]
        self._average = copy.deepcopy(self._model)
        self._optimiser = MuonAdam(self._model.parameters(), config.learning_rate)
        bfloat16 = device.type == "cuda" or machine_tuning().dtype == torch.bfloat16
        guide = teacher.model.eval().to(device) if teacher and isinstance(teacher.model, CompactModel) else None
        self._loss = team.share(StepLoss(self._model, self._architecture, config.loss, bfloat16, guide, team))
        self._curve: list[CurvePoint] = []
        self._seconds = 0.0
        self._resumed = time.monotonic()
        self.step = 0
        run_dir.mkdir(parents=True, exist_ok=True)
        shapes = {name: tuple(value.shape) for name, value in self._model.state_dict().items()}
        moments = [moment_shapes(parameter) for parameter in self._model.parameters()]
        checkpoint = load_checkpoint(self._checkpoint_path, asdict(config), shapes, moments)
        if checkpoint is not None:
            self._restore(checkpoint)

    @property
    def _checkpoint_path(self) -> Path:
        return self._run_dir / CHECKPOINT

    def draw(self, scenes: Sequence[TrainingScene], step: int) -> list[PatchGroup]:
        """This process's share of the patches of one step, by the seed and the step's number alone."""
        patches = self._config.patches
        mine = self._team.numbers(patches.batch // patches.group)
        generators = [np.random.default_rng((self._config.seed, step, index)) for index in mine]
        return [sample_group(scenes, patches, self.levels, rng) for rng in generators]

    def revive(self, scenes: Sequence[TrainingScene]) -> int:
        """Give channels that are never positive in the patches of some steps new weights; returns how many there were.

        The patches depend on the seed and the step alone, and every process of a team takes the same.
        """
        averages = dict(zip(self._model.parameters(), self._average.parameters(), strict=True))

        def forget(parameter: nn.Parameter, part: Part) -> None:
            averages[parameter][part] = parameter[part]
            for moment in self._optimiser.state.get(parameter, {}).values():
                if moment.shape == parameter.shape:
                    moment[part] = 0

        generator = torch.Generator().manual_seed(self._config.seed + self.step)
        show = partial(self._show, self._model, scenes, self.step, self._device)
        return revive(self._model, Surroundings(show, forget, self._team.agree, generator))

    def _plain(self) -> Model:
        """The averaged weights as they are used."""
        whole = self._trimmed.whole(copy.deepcopy(self._average)) if self._trimmed else self._average
        return self._architecture.plain(whole)

    def _plain_and_cleared(self, scenes: Sequence[TrainingScene]) -> tuple[Model, int]:
        """The averaged weights as they are used, and how many of their channels are idle and were set to 0."""
        plain = self._plain()
        return plain, clear(plain, partial(self._show, plain, scenes, 0, torch.device("cpu")))

    def _show(self, model: Model, scenes: Sequence[TrainingScene], step: int, device: torch.device) -> None:
        """Run a model over patches that show what its channels do, in float32, the same ones in every process."""
        for index in range(_LOOKED_AT):
            rng = np.random.default_rng((self._config.seed, step, _APART, index))
            group = sample_group(scenes, self._config.patches, self.levels, rng)
            exact = partial(torch.autocast, device.type, enabled=False)
            self._architecture.predict(model, Batch.of([group], device), exact)

    @property
    def levels(self) -> Levels:
        """The disparities within which patches are sheared."""
        return self._architecture.levels(self._model) or Levels()

    @property
    def last_loss(self) -> float:
        """That of the last validation; nan where there was none."""
        return self._curve[-1].loss if self._curve else math.nan

    def owes(self, out: Path) -> bool:
        """Whether the weights of this step have not been validated, or there are none at `out`."""
        return self.step > 0 and not (out.exists() and self._curve and self._curve[-1].step == self.step)

    def take_step(self, groups: Sequence[PatchGroup]) -> float:
        """One step of the optimiser; returns the mean squared error over RGB."""
        for parameters in self._optimiser.param_groups:
            parameters["lr"] = learning_rate(self._config, self.step)
        self._optimiser.zero_grad(set_to_none=True)
        squared_error, loss = self._loss(Batch.of(groups, self._device), self.step)
        loss.backward()
        torch.nn.utils.clip_grad_norm_(self._model.parameters(), 1.0)
        self._optimiser.step()
        self.step += 1
        with torch.no_grad():
            # The average forgets the first steps faster than the last ones.
            decay = min(self._config.average, (1 + self.step) / (10 + self.step))
            for mean, value in zip(self._average.parameters(), self._model.parameters(), strict=True):
                mean.lerp_(value, 1 - decay)
        error = float(squared_error)
        if not math.isfinite(error):
            raise InputError(f"The training has diverged at step {self.step} (its loss is {error}); lower the learning rate.")
        return error

    def validate(self, light_fields: Sequence[LightField], loss: float) -> CurvePoint:
        """K16 of the averaged weights on each held-out light field, by the synthesizer that users get."""
        synthesizer = synthesizer_of(self._plain(), "validation")
        scores: dict[str, float] = {}
        for name, light_field in zip(column_names([each.name for each in light_fields]), light_fields, strict=True):
            row, column = k16_view(light_field)
            synthesizer.set_light_field(light_field)
            synthesis = synthesizer.synthesize(*light_field.position(row, column))
            scores[name] = k16(synthesis.image, light_field.view(row, column)).psnr
        point = CurvePoint(self.step, self._elapsed(), learning_rate(self._config, self.step), loss, scores)
        self._curve = [*(past for past in self._curve if past.step < self.step), point]
        return point

    def save(
        self,
        out: Path,
        scenes: Sequence[LightField],
        prepared: Sequence[TrainingScene],
        generated: int,
        validation: Sequence[LightField],
    ) -> None:
        """Checkpoint, curve, and the weights if they are the best so far, or there are none."""
        best = max(self._curve, key=lambda point: point.mean)
        if best is self._curve[-1] or not validation or not out.exists():
            plain, idle = self._plain_and_cleared(prepared)
            training = {
                "steps": self.step,
                "hours": round(self._elapsed() / 3600, 3),
                "config": asdict(self._config),
                "scenes": sorted({scene.name for scene in scenes}),
                "generated_scenes": generated,
                "idle_channels": idle,
                "k16_psnr": {
                    name: round(value, 3) if math.isfinite(value) else None for name, value in self._curve[-1].scores.items()
                },
            }
            save_weights(out, plain, training)
        self.save_checkpoint()
        write_curve(self._run_dir, self._curve)
        write_picture(self._run_dir / "curve.png", plot(self._curve))

    def save_checkpoint(self) -> None:
        """What the run goes on from."""
        save_checkpoint(
            self._checkpoint_path,
            Checkpoint(
                self.step,
                self._elapsed(),
                self._curve,
                self._model.state_dict(),
                self._average.state_dict(),
                [self._optimiser.state.get(p, {}) for p in self._model.parameters()],
            ),
            asdict(self._config),
        )

    def _elapsed(self) -> float:
        return self._seconds + time.monotonic() - self._resumed

    def _restore(self, checkpoint: Checkpoint) -> None:
        self.step = checkpoint.step
        self._seconds = checkpoint.seconds
        self._curve = list(checkpoint.curve)
        self._model.load_state_dict(checkpoint.model)
        self._average.load_state_dict(checkpoint.average)
        for parameter, state in zip(self._model.parameters(), checkpoint.moments, strict=True):
            self._optimiser.state[parameter] = {
                # The count of steps stays on the CPU; layouts follow the parameter's.
                name: value if name == "step" else torch.empty_like(parameter).copy_(value)
                for name, value in state.items()
            }


def revival_due(config: TrainConfig, step: int) -> bool:
    """Whether dead channels are looked for before this step: not in the last half of the falling rate, for what is revived must
    have time to learn."""
    if config.revival_steps <= 0 or (step == 0 and not config.initial):
        return False
    return step % config.revival_steps == 0 and step <= config.steps * (1 - config.decay_share / 2)


def learning_rate(config: TrainConfig, step: int) -> float:
    """Grows over the warm-up, stays, and falls along a cosine to a hundredth over the last part of the steps."""
    if step < config.warm_up_steps:
        return config.learning_rate * (step + 1) / config.warm_up_steps
    decay = config.decay_share * config.steps
    falling = (step - (config.steps - decay)) / max(decay, 1)
    if falling <= 0:
        return config.learning_rate
    return config.learning_rate * (0.01 + 0.99 * 0.5 * (1 + math.cos(math.pi * min(falling, 1))))


def device_of(name: str) -> torch.device:
    """Where to compute: cpu, cuda, or auto, which is cuda where there is one. Raises InputError where there is none."""
    if name == "auto":
        return torch.device("cuda" if torch.cuda.is_available() else "cpu")
    if name == "cuda" and not torch.cuda.is_available():
        raise InputError("There is no CUDA device that torch can use here; train with --device cpu or auto.")
    return torch.device(name)
