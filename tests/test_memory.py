"""Memory stays flat while the hand moves; tests/measure_memory.py does the same for as long as one likes."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest
from measure_memory import VIEWS_HELD, drag, dragging, resident_mib

WARM_UP, DRAGS = 40, 80


@pytest.mark.skipif(sys.platform != "linux", reason="memory is read from /proc")
def test_memory_is_flat_over_many_drags(gl: Any, tmp_path: Path) -> None:
    with dragging(gl, tmp_path, picture=(96, 128), window=(240, 160)) as viewer:
        for number in range(WARM_UP):
            drag(viewer, number)
        before = resident_mib()
        for number in range(WARM_UP, WARM_UP + DRAGS):
            drag(viewer, number)
        # A synthesis of this size takes 0.23 MiB with its 8-bit copy; a drag makes two or three, none of which may stay.
        assert resident_mib() - before < 10
        assert len(viewer.interface.controller.readout(None).cached) <= VIEWS_HELD
