"""The training loop: both networks at once, through the warp, by the paper's squared error; resumes exactly where it was.

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
from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor

from lfcore.allocator import keep_freed_memory
from lfcore.errors import InputError
from lfcore.export import write_picture
from lfcore.lightfield import LightField
from lfcore.metrics import k16, k16_view
from lfcore.networks import BORDER, FullModel, colour_features
from lfcore.planesweep import Window, luminance, matching_disparity, plane_sweep
from lfcore.synthesizer import NetworkSynthesizer, corner_offsets, corner_tensor, fastest_dtype
from lfcore.training.checkpoint import Checkpoint, load_checkpoint, save_checkpoint
from lfcore.training.conditioning import condition, initialise_conditioned, plain_copy
from lfcore.training.curve import CurvePoint, write_curve
from lfcore.training.patches import PatchConfig, PatchGroup, TrainingScene, check_room, sample_group
from lfcore.training.plot import plot
from lfcore.warp import backward_warp
from lfcore.weights import Weights, save_weights


@dataclass(frozen=True)
class TrainConfig:
    """Everything that decides what comes out. The defaults are the paper's patches and batch, and a schedule for few steps."""

    steps: int = 20000
    learning_rate: float = 1e-4
    warm_up_steps: int = 100  # learning rate grows from 0
    decay_share: float = 0.3  # of the steps, at the end, in which the learning rate falls to a hundredth
    matching_steps: int = 1000  # in which the disparity is also drawn to the plane sweep's best match (see matching_disparity)
    matching_weight: float = 0.03
    balance: float = 0.0  # a patch's squared error is divided by (its variance + 0.005) ** balance; 0 is the paper's loss
    initial: str = ""  # digest of the weights to go on from; empty: Xavier initialisation
    average: float = 0.999  # decay of the running average of the weights; the average is what is validated and shipped
    seed: int = 1
    patches: PatchConfig = field(default_factory=PatchConfig)
    model: str = "full"


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


def prepare_scene(light_field: LightField) -> TrainingScene:
    """Find the range of disparities of a scene by a plane sweep over its corners, so that shears keep it within the levels."""
    side = min(light_field.rows, light_field.columns)
    if side < 3:
        grid = f"{light_field.rows} x {light_field.columns}"
        raise InputError(f"{light_field.name} has {grid} views; training needs 3 x 3 or more.")
    square = LightField(light_field.views[:side, :side], light_field.name, light_field.source, light_field.kind)
    levels = FullModel().config.levels
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
    return TrainingScene(square, float(low), float(high))


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
) -> None:
    """Train from `initial` or anew until `config.steps`, `runtime.stop_after_minutes` or `stopped()`; if `run_dir` holds a
    checkpoint, go on from there.

    Writes `out` (the averaged weights that scored best on `validation`, or the newest where there is none), and in `run_dir`
    checkpoint.safetensors, curve.csv and curve.png. Raises InputError for scenes too small and for a checkpoint of another
    configuration.
    """
    keep_freed_memory()
    for light_field in validation:
        k16_view(light_field)  # refuses corners alone now, not after the first minutes
    if initial is not None:
        config = replace(config, initial=initial.digest)
    trainer = Trainer(config, _device(runtime.device), run_dir, initial.model if initial else None)
    prepared = [prepare_scene(scene) for scene in scenes]
    check_room(prepared, config.patches, FullModel().config.levels)
    began = last_validation = time.monotonic()
    first_step = trainer.step
    running = math.nan
    with ThreadPoolExecutor(1) as pool:
        upcoming = pool.submit(trainer.draw, prepared, trainer.step)
        while trainer.step < config.steps:
            groups = upcoming.result()
            upcoming = pool.submit(trainer.draw, prepared, trainer.step + 1)
            loss = trainer.take_step(groups)
            running = loss if math.isnan(running) else 0.98 * running + 0.02 * loss
            now = time.monotonic()
            out_of_time = now - began > 60 * runtime.stop_after_minutes
            ending = trainer.step == config.steps or out_of_time or stopped()
            point = None
            if ending or now - last_validation > 60 * runtime.validate_minutes:
                point = trainer.validate(validation, running)
                trainer.save(out, scenes, validation)
                last_validation = time.monotonic()
            rate = (trainer.step - first_step) / max(now - began, 1e-9)
            report(Progress(trainer.step, config.steps, running, rate, point))
            if ending:
                return


class Trainer:
    """Model, running average and optimiser of one run."""

    def __init__(
        self, config: TrainConfig, device: torch.device, run_dir: Path, initial: FullModel | None = None
    ) -> None:
        self._config = config
        self._device = device
        self._run_dir = run_dir
        self._model = FullModel()
        if initial is None:
            initialise_conditioned(self._model, config.seed)
        else:
            self._model.load_state_dict(initial.state_dict())
        condition(self._model)
        self._model.to(device=device, memory_format=torch.channels_last)  # type: ignore[call-overload]
        self._average = copy.deepcopy(self._model)
        self._optimiser = torch.optim.Adam(self._model.parameters(), lr=config.learning_rate, betas=(0.9, 0.999), fused=True)
        self._bfloat16 = device.type == "cuda" or fastest_dtype() == torch.bfloat16
        self._curve: list[CurvePoint] = []
        self._seconds = 0.0
        self._resumed = time.monotonic()
        self.step = 0
        run_dir.mkdir(parents=True, exist_ok=True)
        checkpoint = load_checkpoint(self._checkpoint_path, asdict(config))
        if checkpoint is not None:
            self._restore(checkpoint)

    @property
    def _checkpoint_path(self) -> Path:
        return self._run_dir / "checkpoint.safetensors"

    def draw(self, scenes: Sequence[TrainingScene], step: int) -> list[PatchGroup]:
        """The patches of one step, by the seed and the step's number alone."""
        patches = self._config.patches
        rng = np.random.default_rng((self._config.seed, step))
        levels = self._model.config.levels
        return [sample_group(scenes, patches, levels, rng) for _ in range(patches.batch // patches.group)]

    def take_step(self, groups: Sequence[PatchGroup]) -> float:
        """One step of Adam; returns the mean squared error over RGB."""
        for parameters in self._optimiser.param_groups:
            parameters["lr"] = learning_rate(self._config, self.step)
        self._optimiser.zero_grad(set_to_none=True)
        squared_error, loss = self._loss(groups)
        loss.backward()
        torch.nn.utils.clip_grad_norm_(self._model.parameters(), 1.0)
        self._optimiser.step()
        self.step += 1
        with torch.no_grad():
            # The average forgets the first steps faster than the last ones.
            decay = min(self._config.average, (1 + self.step) / (10 + self.step))
            for mean, value in zip(self._average.parameters(), self._model.parameters(), strict=True):
                mean.lerp_(value, 1 - decay)
        return float(squared_error)

    def _loss(self, groups: Sequence[PatchGroup]) -> tuple[Tensor, Tensor]:
        levels = self._model.config.levels
        inputs = [torch.from_numpy(group.inputs).to(self._device) for group in groups]  # each (4, B, 3, H, W)
        targets = torch.cat([torch.from_numpy(group.target).to(self._device) for group in groups])  # (B, 3, P, P)
        offsets = [corner_offsets(group.u, group.v) for group in groups]
        lumas = [luminance(images) for images in inputs]
        features = torch.cat(
            [plane_sweep(luma, o, levels, g.window) for luma, o, g in zip(lumas, offsets, groups, strict=True)]
        )  # (B, 2 L, P, P)
        with self._autocast():
            disparity = self._model.disparity(features.contiguous(memory_format=torch.channels_last))  # (B, 1, P - 12, ...)
        pieces = disparity.split([images.shape[1] for images in inputs])
        warped = torch.cat([_warp_inputs(i, d, o, g) for i, d, o, g in zip(inputs, pieces, offsets, groups, strict=True)])
        positions = torch.cat([torch.tensor([[g.u, g.v]]).expand(g.target.shape[0], 2) for g in groups]).to(self._device)
        h = colour_features(disparity, warped, positions)
        with self._autocast():
            image = self._model.colour(h.contiguous(memory_format=torch.channels_last))  # (B, 3, P - 24, P - 24)
        inside = slice(2 * BORDER, -2 * BORDER)
        inner = targets[:, :, inside, inside]
        errors = (image - inner).square().mean((1, 2, 3))  # (B,)
        # Dark and flat patches have small errors; balanced, they teach as much as bright ones.
        loss = (errors / (inner.var((1, 2, 3)) + 0.005) ** self._config.balance).mean()
        fading = 1 - self.step / max(self._config.matching_steps, 1)
        if fading > 0:
            matching = self._matching_loss(groups, lumas, offsets, luminance(targets), pieces)
            loss = loss + self._config.matching_weight * fading * matching
        return errors.detach().mean(), loss

    def _matching_loss(
        self,
        groups: Sequence[PatchGroup],
        lumas: Sequence[Tensor],
        offsets: Sequence[Tensor],
        targets: Tensor,
        disparities: Sequence[Tensor],
    ) -> Tensor:
        """Distance of the disparity from the level at which the inputs match the novel view best, where that is clear."""
        inside = slice(BORDER, -BORDER)
        pieces = targets.split([d.shape[0] for d in disparities])
        for luma, o, group, target, disparity in zip(lumas, offsets, groups, pieces, disparities, strict=True):
            w, (height, width) = group.window, luma.shape[-2:]
            if min(w.top, w.left, height - w.bottom, width - w.right) < BORDER:
                continue  # at an edge of the picture not all samples count
            found, confidence = matching_disparity(luma, o, self._model.config.levels, w, target)
            error = F.smooth_l1_loss(disparity, found[:, :, inside, inside], reduction="none")
            return (confidence[:, :, inside, inside] * error).mean()  # one group a step is enough, and costs less than all
        return torch.zeros((), device=self._device)

    def _autocast(self) -> torch.autocast:
        return torch.autocast(self._device.type, dtype=torch.bfloat16, enabled=self._bfloat16)

    def validate(self, light_fields: Sequence[LightField], loss: float) -> CurvePoint:
        """K16 of the averaged weights on each held-out light field, by the synthesizer that users get."""
        synthesizer = NetworkSynthesizer(plain_copy(self._average), "validation")
        scores: dict[str, float] = {}
        for light_field in light_fields:
            row, column = k16_view(light_field)
            synthesizer.set_light_field(light_field)
            synthesis = synthesizer.synthesize(*light_field.position(row, column))
            scores[light_field.name] = k16(synthesis.image, light_field.view(row, column)).psnr
        point = CurvePoint(self.step, self._elapsed(), learning_rate(self._config, self.step), loss, scores)
        self._curve.append(point)
        return point

    def save(self, out: Path, scenes: Sequence[LightField], validation: Sequence[LightField]) -> None:
        """Checkpoint, curve, and the weights if they are the best so far."""
        best = max(self._curve, key=lambda point: point.mean)
        if best is self._curve[-1] or not validation:
            training = {
                "steps": self.step,
                "hours": round(self._elapsed() / 3600, 3),
                "config": asdict(self._config),
                "scenes": [scene.name for scene in scenes],
                "k16_psnr": {name: round(value, 3) for name, value in self._curve[-1].scores.items()},
            }
            save_weights(out, plain_copy(self._average), training)
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
        write_curve(self._run_dir, self._curve)
        write_picture(self._run_dir / "curve.png", plot(self._curve))

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
                # Adam keeps its count of steps on the CPU unless it is fused; layouts follow the parameter's.
                name: value.to(self._device) if name == "step" else torch.empty_like(parameter).copy_(value)
                for name, value in state.items()
            }


def _warp_inputs(inputs: Tensor, disparity: Tensor, offsets: Tensor, group: PatchGroup) -> Tensor:
    """The four inputs of a group warped to its novel view: (B, 12, h, w)."""
    n, b, c, height, width = inputs.shape
    spread = disparity.expand(n, *disparity.shape).flatten(0, 1)  # (4 B, 1, h, w)
    offset = offsets.to(disparity.device).repeat_interleave(b, 0)  # (4 B, 2)
    origin = group.window.top + BORDER, group.window.left + BORDER
    warped = backward_warp(inputs.reshape(n * b, c, height, width), spread, offset, origin)
    return warped.view(n, b, c, *warped.shape[2:]).transpose(0, 1).flatten(1, 2)


def learning_rate(config: TrainConfig, step: int) -> float:
    """Grows over the warm-up, stays, and falls along a cosine to a hundredth over the last part of the steps."""
    if step < config.warm_up_steps:
        return config.learning_rate * (step + 1) / config.warm_up_steps
    decay = config.decay_share * config.steps
    falling = (step - (config.steps - decay)) / max(decay, 1)
    if falling <= 0:
        return config.learning_rate
    return config.learning_rate * (0.01 + 0.99 * 0.5 * (1 + math.cos(math.pi * min(falling, 1))))


def _device(name: str) -> torch.device:
    if name == "auto":
        return torch.device("cuda" if torch.cuda.is_available() else "cpu")
    if name == "cuda" and not torch.cuda.is_available():
        raise InputError("No CUDA device was found; use --device cpu.")
    return torch.device(name)
