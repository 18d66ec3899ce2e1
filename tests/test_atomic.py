"""How files are written: whole or not at all, with the mode and under the name that was asked for."""

from __future__ import annotations

import os
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from lfcore.atomic import atomic_path
from lfcore.errors import OutputError


def test_a_file_appears_when_it_is_whole_and_a_fault_leaves_the_old_one(tmp_path: Path) -> None:
    target = tmp_path / "a.txt"
    with atomic_path(target) as temporary:
        temporary.write_text("old")
        assert not target.exists()
    with pytest.raises(KeyboardInterrupt), atomic_path(target) as temporary:
        temporary.write_text("half")
        raise KeyboardInterrupt
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


@pytest.mark.parametrize("stem", ["x" * 251, "\N{GREEK SMALL LETTER OMEGA}" * 125])
def test_names_as_long_as_the_system_allows(tmp_path: Path, stem: str) -> None:
    target = tmp_path / f"{stem}.txt"
    with atomic_path(target) as temporary:
        temporary.write_text("all of it")
    assert [path.read_text() for path in tmp_path.iterdir()] == ["all of it"]
    with pytest.raises(OutputError, match="too long"), atomic_path(tmp_path / f"{stem}xxxxx.txt") as temporary:
        temporary.write_text("")


@pytest.mark.skipif(os.name != "posix", reason="files have no such modes here")
def test_files_get_the_mode_that_the_umask_leaves(tmp_path: Path) -> None:
    code = "import os, sys; os.umask(0o027); from lfcore.atomic import atomic_path\nwith atomic_path(sys.argv[1]): pass"
    subprocess.run([sys.executable, "-c", code, str(tmp_path / "a")], check=True, cwd=Path(__file__).parents[1])
    assert stat.S_IMODE((tmp_path / "a").stat().st_mode) == 0o640
