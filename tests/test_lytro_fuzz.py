"""A short run of the fuzzer; the long one is told in docs/lytro.md."""

from __future__ import annotations

import sys

import pytest

from tests.fuzz_lytro import ROOM, SECONDS, Outcome, fuzzer

CASES = 500


@pytest.fixture(scope="module")
def outcomes() -> list[Outcome]:
    if not sys.platform.startswith("linux"):
        pytest.skip("memory is measured in Linux's way")
    with fuzzer(seed=2016) as cases:
        return [cases.case(number) for number in range(CASES)]


def test_damaged_files_are_read_or_refused_in_a_sentence(outcomes: list[Outcome]) -> None:
    assert [outcome for outcome in outcomes if outcome.failure is not None] == []


def test_time_and_memory_stay_small(outcomes: list[Outcome]) -> None:
    assert max(outcome.seconds for outcome in outcomes) < SECONDS
    assert max(outcome.peak - 4 * outcome.size for outcome in outcomes) < ROOM


def test_the_damage_is_various_and_gets_through_the_door(outcomes: list[Outcome]) -> None:
    kinds = {name for outcome in outcomes for name in outcome.mutation.split("+")}
    assert {"cut", "flip", "lie_about_length", "shuffle_sections", "change_json", "change_data", "change_header"} <= kinds
    assert len({outcome.seed for outcome in outcomes}) == 9
    sentences = " ".join(outcome.message or "" for outcome in outcomes)
    # Refused at the door, in the metadata, in the pictures, in an archive; and some damage does no harm.
    for part in ("checksum", "so the file's metadata is damaged", "in the archive", "picture"):
        assert part in sentences
    assert any(outcome.message is None for outcome in outcomes)


def test_a_fault_would_be_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """The fuzzer itself: a reader that fails in any other way than by a sentence is reported."""

    def broken(*_: object) -> None:
        raise KeyError("frames")

    with fuzzer(seed=1) as cases:
        monkeypatch.setattr("tests.fuzz_lytro.exercise", broken)
        assert cases.case(0).failure == "KeyError: 'frames'"
