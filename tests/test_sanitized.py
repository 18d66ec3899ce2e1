"""No compiled part that paints touches memory which is not its own. For the networks' parts: `python -m tests.sanitized`."""

from __future__ import annotations

import os

import pytest
from sanitized import run_tests, sanitizer_libraries


def test_painting_touches_no_memory_but_its_own(capfd: pytest.CaptureFixture[str], compiled_painting: None) -> None:
    if not sanitizer_libraries():
        assert not os.environ.get("CI"), "gcc's sanitizers must be there"
        pytest.skip("gcc's sanitizers were not found")
    assert run_tests("app.painting._painting") == 0, "".join(capfd.readouterr())
