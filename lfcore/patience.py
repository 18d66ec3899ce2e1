"""How long threads that wait for one another keep their processor busy with waiting, before they sleep.

Read by libgomp when torch is loaded, so it must be set before; other OpenMP libraries do not know it.
"""

from __future__ import annotations

import os

# Turns of looking for work: a microsecond or two. 300 times as many, as libgomp takes by itself, are no faster where cores are
# free, keep a window's frames from them, and take two and more times as long where other programs want them (docs/speed.md).
_TURNS = "1000"


def wait_shortly() -> None:
    """Set it for this process and those that it starts, unless the person who started the program has chosen."""
    if "OMP_WAIT_POLICY" not in os.environ:
        os.environ.setdefault("GOMP_SPINCOUNT", _TURNS)
