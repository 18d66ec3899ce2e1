"""Generated scenes: light fields with true occlusions and known disparity, without end, to train on beside captured ones.

A scene is a stack of 4 to 14 layers, each a textured, flat, slanted or curved surface with a soft outline, sampled at its exact
sub-pixel place in every view and laid over what is behind it in linear light, then seen through a camera with the faults of an
Illum. docs/generated_scenes.md tells what is drawn, and how often.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from dataclasses import dataclass, field
from multiprocessing import get_context

import numpy as np
import torch

from lfcore.lightfield import FloatArray, LightField
from lfcore.training.scenes.arrangement import ContentConfig, arrange
from lfcore.training.scenes.camera import CameraConfig, draw_camera, expose
from lfcore.training.scenes.render import render
from lfcore.training.scenes.surfaces import CELL, Canvas
from lfcore.training.scenes.textures import Textures

__all__ = ["CameraConfig", "ContentConfig", "GeneratedScene", "SceneConfig", "Textures", "generate_pool", "generate_scene"]

_MARGIN = 8  # px about the views besides what the disparity needs: blur, interpolation


@dataclass(frozen=True)
class SceneConfig:
    """views x views viewpoints of height x width px; what is in the scene, and what it is seen with."""

    views: int = 5
    height: int = 352
    width: int = 352
    content: ContentConfig = field(default_factory=ContentConfig)
    camera: CameraConfig = field(default_factory=CameraConfig)

    def __post_init__(self) -> None:
        if self.views < 2 or min(self.height, self.width) < 32:
            raise ValueError("a generated scene needs 2 x 2 views or more, of 32 px or more each way")

    @property
    def canvas(self) -> Canvas:
        """The area that layers are drawn on."""
        margin = math.ceil((0.55 * self.content.largest_disparity + _MARGIN) / CELL) * CELL
        return Canvas(self.height, self.width, margin)


@dataclass(frozen=True)
class GeneratedScene:
    """A generated light field and its truth."""

    light_field: LightField  # uint8 views
    disparity: FloatArray  # (n, n, H, W), px over the full baseline, of the front-most surface as each view sees it
    low: float  # smallest disparity in any view
    high: float  # largest


def generate_scene(seed: int, textures: Textures, config: SceneConfig) -> GeneratedScene:
    """Draw and render one scene. The same seed, textures and configuration give the same scene to the bit."""
    rng = np.random.default_rng(seed)
    canvas, n = config.canvas, config.views
    camera = draw_camera(n, config.camera, rng)
    with torch.inference_mode():
        layers = arrange(canvas, textures, config.content, camera.softness, rng)
        views = render(canvas, layers, camera.positions, camera.shifts)
        stored = expose(views.light, camera, rng)
    disparity = views.disparity.numpy().reshape(n, n, config.height, config.width)
    facts = {"Layers": str(len(layers)), "Tone": "linear, dark" if camera.dark else "sRGB", "Seed": str(seed)}
    light_field = LightField(
        stored.reshape(n, n, config.height, config.width, 3), f"generated {seed}", f"seed {seed}", "generated", facts
    )
    return GeneratedScene(light_field, disparity, float(disparity.min()), float(disparity.max()))


def generate_pool(
    count: int,
    seed: int,
    textures: Textures,
    config: SceneConfig,
    workers: int = 1,
    progress: Callable[[int], None] = lambda done: None,
) -> Iterator[GeneratedScene]:
    """Scenes seed, seed + 1, ... one after another, in this order, whatever the number of worker processes.

    `progress` is called with the number of scenes handed out. At most two scenes a worker are kept waiting, so the memory is
    bounded however slowly they are taken.
    """
    scenes = _in_turn(count, seed, textures, config) if workers <= 1 else _in_processes(count, seed, textures, config, workers)
    for done, scene in enumerate(scenes, 1):
        progress(done)
        yield scene


def _in_turn(count: int, seed: int, textures: Textures, config: SceneConfig) -> Iterator[GeneratedScene]:
    for k in range(count):
        yield generate_scene(seed + k, textures, config)


def _in_processes(count: int, seed: int, textures: Textures, config: SceneConfig, workers: int) -> Iterator[GeneratedScene]:
    # Forking a process in which torch has started threads may hang it; a fresh one costs a second.
    with ProcessPoolExecutor(workers, get_context("spawn"), _start_worker, (textures, config)) as pool:
        waiting: dict[int, Future[GeneratedScene]] = {}
        started = 0
        try:
            for k in range(count):
                while started < count and started < k + 2 * workers:
                    waiting[started] = pool.submit(_work, seed + started)
                    started += 1
                yield waiting.pop(k).result()
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


_worker_scene: Callable[[int], GeneratedScene]


def _start_worker(textures: Textures, config: SceneConfig) -> None:
    global _worker_scene
    torch.set_num_threads(1)
    _worker_scene = lambda seed: generate_scene(seed, textures, config)  # noqa: E731


def _work(seed: int) -> GeneratedScene:
    return _worker_scene(seed)
