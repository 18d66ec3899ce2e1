import json
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import torch

from lfcore import tuning
from lfcore.layers import DirectConvolution, Way
from lfcore.tuned_stack import Tuning

pytestmark = pytest.mark.usefixtures("several_threads")

CHOICE = Tuning(torch.bfloat16, 208, 32, way=Way.WINOGRAD)


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    monkeypatch.setenv("LFVIEW_CACHE", str(tmp_path / "cache"))
    tuning.machine_tuning.cache_clear()
    yield tmp_path / "cache"
    tuning.machine_tuning.cache_clear()


@pytest.fixture
def measurements(monkeypatch: pytest.MonkeyPatch) -> list[Tuning]:
    """What was measured, which is always CHOICE."""
    made: list[Tuning] = []

    def measured() -> tuple[Tuning, bool]:
        made.append(CHOICE)
        return CHOICE, True

    monkeypatch.setattr(tuning, "measured", measured)
    return made


def test_what_was_measured_is_remembered(measurements: list[Tuning], folder: Path) -> None:
    assert tuning.remembered() is None
    assert tuning.machine_tuning() == CHOICE
    tuning.machine_tuning.cache_clear()  # as a new process begins
    assert tuning.machine_tuning() == CHOICE
    assert len(measurements) == 1
    for way in Way:
        by_fourier = Tuning.by_fourier(torch.bfloat16, way)
        tuning._remember(by_fourier)
        assert tuning.remembered() == by_fourier
    assert [path.name for path in folder.iterdir()] == ["tuning.json"]  # nothing else is left behind
    tuning.retune()
    assert len(measurements) == 2


@pytest.mark.parametrize(
    "content",
    [b"", b"{", b"[1]", b"\xff\xfe", b'{"KEY": 3}', b'{"KEY": {"dtype": "int8", "tile_width": 208, "channel_multiple": 32}}',
     b'{"KEY": {"dtype": "bfloat16", "tile_width": 208, "channel_multiple": 32}}',
     b'{"KEY": {"dtype": "float32", "tile_width": 0, "channel_multiple": 1, "fourier": false}}',
     b'{"KEY": {"dtype": "float32"}}',
     b'{"KEY": {"dtype": "float32", "tile_width": true, "channel_multiple": "1", "fourier": false}}', b"[" * 50_000],
)  # fmt: skip
def test_a_damaged_file_counts_as_none_and_is_replaced(content: bytes, measurements: list[Tuning], folder: Path) -> None:
    folder.mkdir()
    key = tuning._machine_key()
    (folder / "tuning.json").write_bytes(content.replace(b"KEY", key.encode()))
    assert tuning.remembered() is None
    assert tuning.machine_tuning() == CHOICE
    assert tuning.remembered() == CHOICE


def test_another_machine_measures_for_itself(measurements: list[Tuning], folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tuning.machine_tuning()
    monkeypatch.setenv("ONEDNN_MAX_CPU_ISA", "AVX2")
    assert tuning.remembered() is None
    tuning.retune()
    assert len(json.loads((folder / "tuning.json").read_text())) == 2
    monkeypatch.delenv("ONEDNN_MAX_CPU_ISA")
    assert tuning.remembered() == CHOICE


def test_a_place_that_cannot_be_written_is_no_hindrance(measurements: list[Tuning], folder: Path) -> None:
    folder.write_text("a file where the folder should be")
    assert tuning.machine_tuning() == CHOICE
    assert folder.read_text() == "a file where the folder should be"


def test_what_is_unusual_is_chosen_for_a_clear_gain_only(monkeypatch: pytest.MonkeyPatch) -> None:
    def choose(short: float, filled: float, narrow: float, fourier: float = 2.0, gaining: torch.dtype | None = None) -> Tuning:
        def seconds(choice: Tuning) -> float:
            kind = (short if choice.dtype == torch.bfloat16 else 1.0) * (filled if choice.channel_multiple == 16 else 1.0)
            return kind * (narrow if choice.tile_width == 144 else 1.0) * (fourier if choice.fourier else 1.0)

        monkeypatch.setattr(tuning, "_probe", lambda choice: lambda: seconds(choice))
        monkeypatch.setattr(tuning, "best_way", lambda dtype: Way.WINOGRAD if dtype == gaining else Way.TORCH)
        chosen, sure = tuning.measured(transforms=True)
        assert sure
        return chosen

    assert choose(0.9, 0.95, 0.97) == Tuning(torch.float32, 288, 1)
    assert choose(0.5, 0.95, 0.97) == Tuning(torch.bfloat16, 288, 1)
    assert choose(0.5, 0.7, 0.97) == Tuning(torch.bfloat16, 288, 16)
    assert choose(0.9, 0.7, 0.6) == Tuning(torch.float32, 144, 16)
    assert choose(0.9, 1.0, 0.97, 0.95) == Tuning(torch.float32, 288, 1)
    assert choose(0.9, 0.7, 0.6, 0.5) == Tuning.by_fourier(torch.float32)
    assert choose(0.5, 0.7, 0.6, 0.5) == Tuning.by_fourier(torch.bfloat16)
    assert choose(0.5, 0.7, 0.6, 0.5, torch.bfloat16) == Tuning.by_fourier(torch.bfloat16, Way.WINOGRAD)
    assert choose(0.5, 0.7, 0.6, 0.5, torch.float32) == Tuning.by_fourier(torch.bfloat16)
    assert choose(0.9, 0.7, 0.6, gaining=torch.float32) == Tuning(torch.float32, 144, 16, way=Way.WINOGRAD)


def test_where_time_is_short_only_the_plain_choices_are_timed(monkeypatch: pytest.MonkeyPatch) -> None:
    timed: list[Tuning] = []

    def probe(choice: Tuning) -> Callable[[], float]:
        timed.append(choice)
        return lambda: 0.1 if choice.dtype == torch.bfloat16 else 1.0

    monkeypatch.setattr(tuning, "_probe", probe)
    monkeypatch.setattr(tuning, "_BUDGET_SECONDS", 0.0)
    assert tuning.measured(transforms=False) == (Tuning(torch.bfloat16, 288, 1), False)
    assert timed == [Tuning(torch.float32, 144, 1), Tuning(torch.bfloat16, 144, 1)]
    timed.clear()
    tuning.measured(transforms=True)
    assert [(kind.dtype, kind.fourier) for kind in timed] == [
        (dtype, fourier) for fourier in (False, True) for dtype in (torch.float32, torch.bfloat16)
    ]


def test_what_is_far_behind_is_given_up_after_two_turns(monkeypatch: pytest.MonkeyPatch) -> None:
    timed: list[Tuning] = []

    def probe(choice: Tuning) -> Callable[[], float]:
        def seconds() -> float:
            timed.append(choice)
            return (0.1 if choice.fourier else 1.0) * (0.5 if choice.dtype == torch.bfloat16 else 1.0)

        return seconds

    monkeypatch.setattr(tuning, "_probe", probe)
    monkeypatch.setattr(tuning, "best_way", lambda dtype: Way.TORCH)
    assert tuning.measured(transforms=True) == (Tuning.by_fourier(torch.bfloat16), True)
    turns = {choice: timed.count(choice) for choice in timed}
    directly = {choice: count for choice, count in turns.items() if not choice.fourier}
    assert directly == {Tuning(dtype, 144): 2 for dtype in (torch.float32, torch.bfloat16)}  # with filled channels none
    assert min(count for choice, count in turns.items() if choice.fourier) >= 4


def test_a_choice_made_in_a_hurry_is_not_remembered(monkeypatch: pytest.MonkeyPatch, folder: Path) -> None:
    monkeypatch.setattr(tuning, "measured", lambda: (CHOICE, False))
    assert tuning.machine_tuning() == CHOICE
    assert tuning.remembered() is None and not folder.exists()


def test_it_measures_this_machine_and_leaves_random_numbers_alone() -> None:
    torch.manual_seed(1)
    expected = torch.rand(3)
    torch.manual_seed(1)
    chosen, _ = tuning.measured(widths=(144, 208), channels=(1,), transforms=False)
    assert chosen.dtype in (torch.float32, torch.bfloat16) and chosen.tile_width in (144, 208)
    assert torch.equal(torch.rand(3), expected)


@pytest.mark.usefixtures("compiled_kernels")
def test_by_transforms_is_measured_too() -> None:
    chosen, _ = tuning.measured(widths=(144,), channels=(1,))
    types = torch.float32, torch.bfloat16
    directly = [Tuning(dtype, 144, way=way) for dtype in types for way in Way]
    assert chosen in [*directly, *(Tuning.by_fourier(dtype, way) for dtype in types for way in Way)]


def test_a_way_is_for_where_it_is_clearly_faster(monkeypatch: pytest.MonkeyPatch) -> None:
    seconds = {Way.TORCH: 1.0, Way.WINOGRAD: 0.7, Way.AMX: 0.5}
    possible = {torch.float32: [Way.TORCH, Way.WINOGRAD], torch.bfloat16: list(Way)}

    def layer(weight: torch.Tensor, bias: torch.Tensor, dtype: torch.dtype, way: Way, padding: int) -> object:
        return _Other(way) if way in possible[dtype] and way is not Way.TORCH else DirectConvolution(weight, bias)

    monkeypatch.setattr(tuning, "make_layer", layer)
    monkeypatch.setattr(tuning, "_seconds", lambda layer, x: seconds[getattr(layer, "way", Way.TORCH)])
    assert tuning.best_way(torch.float32) is Way.WINOGRAD
    assert tuning.best_way(torch.bfloat16) is Way.AMX
    seconds[Way.WINOGRAD] = 0.4
    assert tuning.best_way(torch.bfloat16) is Way.WINOGRAD
    seconds[Way.WINOGRAD] = 0.95  # not worth its lost digits
    assert tuning.best_way(torch.float32) is Way.TORCH
    possible[torch.float32] = [Way.TORCH]  # what is asked for and cannot be is torch's, and is not timed as another
    assert tuning.best_way(torch.float32) is Way.TORCH


class _Other:
    """In place of a layer that not every machine has."""

    def __init__(self, way: Way) -> None:
        self.way = way
