"""Training patches: four corner views, a captured novel view between them, and every exact way of making more of them.

From one light field, whose views lie equally far apart along rows and columns, come all square sub-grids, all their novel
positions, flips and transposes (positions and pixels together), shears, and tones that are the same for all five views. A shear
crops view (row, column) at a place that moves by m whole pixels per view: exact, and it adds the same number of pixels to every
disparity. What lies between two such shears comes from a shift of the sweep: with all its levels s px lower, the networks see
what they would see of a scene whose disparities are s px higher, and that is exact too, and free.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np
import numpy.typing as npt

from lfcore.errors import InputError
from lfcore.lightfield import CORNERS, FloatArray, LightField, as_float
from lfcore.planesweep import Levels, Window


@dataclass(frozen=True)
class PatchConfig:
    """What a batch is made of. `size` is the side of a patch as the networks see it, px; less comes out, by model: of `full` 24
    px less, of `single` 12, and of `realtime` 16 px less count."""

    size: int = 60
    batch: int = 20
    group: int = 4  # patches that share a viewpoint, so that one plane sweep serves them
    candidates: int = 2  # of so many places in a light field, the one whose corner views differ most is taken
    edge_share: float = 0.15  # groups that lie at an edge of the picture, where not all samples count
    tone_share: float = 0.5  # patches whose tone is changed
    shear_spread: float = 6.0  # standard deviation of the disparity that a patch's scene is brought to, px
    even_share: float = 0.4  # of the patches; the disparities that their scenes are brought to are spread evenly instead,
    even_reach: float = 22.0  # from -even_reach to even_reach, px, as far as the levels allow

    def __post_init__(self) -> None:
        if self.size < 32 or self.batch < 1 or self.group < 1 or self.batch % self.group:
            raise ValueError("the patch needs 32 px or more, and the batch must be a whole number of groups")


@dataclass(frozen=True)
class TrainingScene:
    """A light field, whose views lie equally far apart along rows and columns, and the range of its disparities, px from corner
    to corner of its largest square sub-grid."""

    light_field: LightField
    low: float
    high: float
    weight: float = 1.0  # how often it is drawn, compared with others

    @property
    def spacing(self) -> int:
        """Captured views from corner to corner of the largest square sub-grid."""
        return min(self.light_field.rows, self.light_field.columns) - 1


@dataclass(frozen=True)
class PatchGroup:
    """Patches of one viewpoint: inputs in the order of CORNERS with margin for the warp, and the novel view's patch."""

    inputs: FloatArray  # (4, B, 3, H, W)
    target: FloatArray  # (B, 3, P, P)
    window: Window  # where the target lies in the inputs
    u: float
    v: float
    shift: float = 0.0  # px that are added to every disparity by a sweep whose levels are so much lower


# Half of what lies between two shears of a whole grid of 8 x 8 views, the widest step there is here.
MOST_SHIFT = 3.5


def margin(levels: Levels) -> int:
    """How far beyond the patch a warp inside the corners can reach: the largest level, a shift and two taps. Even, so that
    patches begin at a whole pixel of half the resolution too."""
    return 2 * int(np.ceil((levels.reach + MOST_SHIFT + 2) / 2))


def check_room(scenes: Sequence[TrainingScene], config: PatchConfig, levels: Levels) -> None:
    """Raise InputError unless a patch with its margin fits into every scene."""
    side = config.size + 2 * margin(levels)
    for scene in scenes:
        field = scene.light_field
        if min(field.height, field.width) < side:
            raise InputError(
                f"{field.name} has views of {field.width} x {field.height}; patches of {config.size} px need {side} px "
                "each way with their margin: choose a smaller patch or leave this light field out."
            )


def mixed(captured: Sequence[TrainingScene], generated: Sequence[TrainingScene], generated_share: float) -> list[TrainingScene]:
    """All scenes, weighted so that generated ones make `generated_share` of what is drawn (all, or none, if there is but one
    kind)."""
    share = generated_share if captured else 1.0
    share = share if generated else 0.0
    parts = ((captured, 1 - share), (generated, share))
    return [replace(scene, weight=part / len(scenes)) for scenes, part in parts for scene in scenes if part > 0]


def sample_group(scenes: Sequence[TrainingScene], config: PatchConfig, levels: Levels, rng: np.random.Generator) -> PatchGroup:
    """Draw one group. The same `rng` state gives the same group."""
    u, v = _draw_viewpoint(_draw_scene(scenes, rng), rng)
    eligible = [scene for scene in scenes if _spacings(scene, u, v)]
    reach = margin(levels)
    before_y, before_x, after_y, after_x = _draw_margins(reach, config.edge_share, rng)
    shape = before_y + config.size + after_y, before_x + config.size + after_x
    window = Window(before_y, before_y + config.size, before_x, before_x + config.size)
    shift = float(rng.uniform(-MOST_SHIFT, MOST_SHIFT))
    patches = []
    for _ in range(config.group):
        scene = _draw_scene(eligible, rng)
        views = _draw_views(scene, u, v, shape, levels.moved(-shift), config, rng)
        patches.append(_draw_tone(views, config.tone_share, rng))
    stack = np.stack(patches, 1)  # (5, B, H, W, 3): TL, BL, TR, BR, novel
    return replace(_draw_symmetry(stack, window, float(u), float(v), rng), shift=shift)


def _draw_scene(scenes: Sequence[TrainingScene], rng: np.random.Generator) -> TrainingScene:
    weights = np.array([scene.weight for scene in scenes])
    return scenes[int(rng.choice(len(scenes), p=weights / weights.sum()))]


def _draw_viewpoint(scene: TrainingScene, rng: np.random.Generator) -> tuple[Fraction, Fraction]:
    spacings = np.arange(2, scene.spacing + 1)
    spacing = int(rng.choice(spacings, p=_shares(spacings)))
    while True:
        row, column = (int(k) for k in rng.integers(0, spacing + 1, 2))
        if not (row in (0, spacing) and column in (0, spacing)):
            return Fraction(column, spacing), Fraction(row, spacing)


def _shares(spacings: npt.NDArray[np.int64]) -> npt.NDArray[np.float64]:
    """How often sub-grids of each spacing are drawn: mostly the whole grid, whose corners are what the networks will be given.

    It is not only the baseline: outer views differ from inner ones, and only from the whole grid can that be learnt.
    """
    weights = spacings.astype(np.float64) ** 8
    return weights / weights.sum()


def _spacings(scene: TrainingScene, u: Fraction, v: Fraction) -> list[int]:
    """Corner-to-corner spacings, in views, at which this scene has a captured view at (u, v)."""
    return [k for k in range(2, scene.spacing + 1) if (u * k).denominator == 1 and (v * k).denominator == 1]


def _draw_margins(reach: int, edge_share: float, rng: np.random.Generator) -> tuple[int, int, int, int]:
    if rng.random() >= edge_share:
        return reach, reach, reach, reach
    edge = rng.integers(3)  # left edge, top edge or the corner between; symmetry makes the others
    return (0 if edge else reach), (0 if edge != 1 else reach), reach, reach


def _draw_views(
    scene: TrainingScene,
    u: Fraction,
    v: Fraction,
    shape: tuple[int, int],
    levels: Levels,
    config: PatchConfig,
    rng: np.random.Generator,
) -> FloatArray:
    """Five views (5, H, W, 3) of one sub-grid at one place, sheared."""
    field = scene.light_field
    spacings = _spacings(scene, u, v)
    spacing = spacings[int(rng.choice(len(spacings), p=_shares(np.array(spacings))))]
    row0 = int(rng.integers(field.rows - spacing))
    column0 = int(rng.integers(field.columns - spacing))
    shear = _draw_shear(scene, spacing, levels, config, rng)
    most = min(field.height - shape[0], field.width - shape[1]) // spacing  # what the picture has room for
    shear = min(max(shear, -most), most)
    corners = [(int(q) * spacing, int(p) * spacing) for p, q in CORNERS]
    steps = [*corners, (int(v * spacing), int(u * spacing))]  # (row, column) in the sub-grid

    # Content that sits at x in view c is found at x + m c in the crop that starts at x0 - m c: its disparity grows by m k.
    reach = abs(shear) * spacing
    room_y, room_x = field.height - shape[0] - reach, field.width - shape[1] - reach
    best, best_score = None, -1.0
    for _ in range(config.candidates):
        y0 = int(rng.integers(room_y + 1)) + max(shear, 0) * spacing
        x0 = int(rng.integers(room_x + 1)) + max(shear, 0) * spacing
        views = np.stack(
            [field.views[row0 + r, column0 + c, y0 - shear * r :, x0 - shear * c :][: shape[0], : shape[1]] for r, c in steps]
        )
        score = _difference(views)
        if score > best_score:
            best, best_score = views, score
    assert best is not None
    return as_float(best)


def _difference(views: npt.NDArray[np.generic]) -> float:
    """Mean difference of opposite corner views: how much there is to get wrong."""
    thinned = views[:4, ::3, ::3].astype(np.float32)
    return float(np.abs(thinned[0] - thinned[3]).mean() + np.abs(thinned[1] - thinned[2]).mean())


def _draw_shear(scene: TrainingScene, spacing: int, levels: Levels, config: PatchConfig, rng: np.random.Generator) -> int:
    """Whole pixels per view that bring the scene's middle near a disparity drawn around the middle of the levels, within
    them."""
    scale = spacing / scene.spacing
    low, high = scene.low * scale, scene.high * scale
    even = rng.random() < config.even_share
    wanted = rng.uniform(-config.even_reach, config.even_reach) if even else rng.normal(0, config.shear_spread)
    wanted += (levels.low + levels.high) / 2 - (low + high) / 2
    first = int(np.ceil((levels.low + 1 - low) / spacing))
    last = int(np.floor((levels.high - 1 - high) / spacing))
    if first > last:  # wider than the levels
        return round((first + last) / 2)
    return int(np.clip(round(wanted / spacing), first, last))


# Patches brighter than this are taken for encoded with a gamma; linear light is darker.
_ENCODED_MEAN = 0.25


def _draw_tone(views: FloatArray, share: float, rng: np.random.Generator) -> FloatArray:
    """Another tone for the five views (5, H, W, 3), the same for all: exposure, white balance, gamma.

    The channels keep their places: a camera's outer views may differ from its inner ones, each channel in its own measure.
    """
    if rng.random() >= share:
        return views
    if float(views[:4, ::5, ::5].mean()) > _ENCODED_MEAN and rng.random() < 0.5:
        # Glints that a display's tone has pressed together stand out again.
        views = np.power(views, np.float32(rng.normal(2.1, 0.2)))
    else:
        views = np.power(views, np.float32(np.exp(np.clip(rng.normal(0.1, 0.35), -0.8, 0.8))))
    gains = (rng.uniform(0.7, 1.25) * rng.uniform(0.9, 1.1, 3)).astype(np.float32)
    toned: FloatArray = np.minimum(views * gains, 1)
    return toned


def _draw_symmetry(stack: FloatArray, window: Window, u: float, v: float, rng: np.random.Generator) -> PatchGroup:
    """One of the eight symmetries of the square, applied to pixels and positions together: disparities keep their sign."""
    novel = stack[4][:, window.top : window.bottom, window.left : window.right]
    corners = stack[:4].reshape(2, 2, *stack.shape[1:])  # (u, v, B, H, W, 3)
    height, width = stack.shape[2:4]
    top, left = window.top, window.left
    size = window.bottom - window.top
    if rng.random() < 0.5:  # x and u
        corners, novel = corners[::-1, :, :, :, ::-1], novel[:, :, ::-1]
        u, left = 1 - u, width - left - size
    if rng.random() < 0.5:  # y and v
        corners, novel = corners[:, ::-1, :, ::-1], novel[:, ::-1]
        v, top = 1 - v, height - top - size
    if rng.random() < 0.5:
        corners, novel = corners.transpose(1, 0, 2, 4, 3, 5), novel.transpose(0, 2, 1, 3)
        u, v, top, left = v, u, left, top
    inputs = np.ascontiguousarray(corners.transpose(0, 1, 2, 5, 3, 4)).reshape(4, *_channels_first(corners.shape[2:]))
    target = np.ascontiguousarray(novel.transpose(0, 3, 1, 2))
    return PatchGroup(inputs, target, Window(top, top + size, left, left + size), u, v)


def _channels_first(shape: tuple[int, ...]) -> tuple[int, int, int, int]:
    b, h, w, c = shape
    return b, c, h, w
