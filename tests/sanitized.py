"""`python -m tests.sanitized [--module MODULE]`: tests of the compiled parts, with every access to memory checked.

Each module is compiled as pyproject.toml says, with the address and undefined-behaviour sanitizers of gcc, in a folder that is
deleted again, and stands in for the installed one in a run of its tests. An access beyond what was allocated ends that run.
About 15 seconds for app.painting, 5 minutes for lfcore.kernels.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import sysconfig
import tempfile
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]
COMPILER = "gcc"
SANITIZERS = ("-fsanitize=address,undefined", "-fno-sanitize-recover=undefined", "-fno-omit-frame-pointer", "-g")
TESTS = {
    "app.painting._painting": ["test_painting", "test_panel_painting", "test_repainting"],
    "lfcore._kernels": [
        "test_alignment",
        "test_amx",
        "test_compact",
        "test_compact_inference",
        "test_fourier",
        "test_planesweep",
        "test_tuned_stack",
        "test_warp",
        "test_winograd",
    ],
}

# In the process that tests: module, its file, and what pytest is given. Torch first, whose OpenMP the kernels take.
_STAND_IN = """
import importlib.util, sys
name, path, *arguments = sys.argv[1:]
if name.startswith("lfcore"):
    import torch
spec = importlib.util.spec_from_file_location(name, path)
sys.modules[name] = importlib.util.module_from_spec(spec)
spec.loader.exec_module(sys.modules[name])
import pytest
sys.exit(pytest.main(arguments))
"""


def sanitizer_libraries() -> list[str]:
    """The libraries that a program compiled without the sanitizers must load first; none where they are not there."""
    try:
        names = [
            subprocess.run([COMPILER, f"-print-file-name={name}"], capture_output=True, text=True, check=True).stdout.strip()
            for name in ("libasan.so", "libubsan.so")
        ]
    except (OSError, subprocess.CalledProcessError):
        return []
    return names if all(Path(name).is_absolute() for name in names) else []


def compile_sanitized(module: str, folder: Path) -> Path:
    """The module, compiled into the folder. CalledProcessError where that fails."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())
    extension = next(e for e in settings["tool"]["setuptools"]["ext-modules"] if e["name"] == module)
    out = folder / (module.rpartition(".")[2] + sysconfig.get_config_var("EXT_SUFFIX"))
    include = ["-I", sysconfig.get_path("include")]
    arguments = [*extension["extra-compile-args"], *SANITIZERS, *include, *extension["sources"]]
    subprocess.run([COMPILER, "-shared", "-fPIC", *arguments, "-o", str(out)], cwd=ROOT, check=True)
    return out


def run_tests(module: str) -> int:
    """Pytest's exit status for the tests of a module, each access checked; or that of the sanitizer that ended them."""
    environment = os.environ | {
        "LD_PRELOAD": " ".join(sanitizer_libraries()),
        "ASAN_OPTIONS": "detect_leaks=0",  # Python keeps much until the end
        "PYTHONMALLOC": "malloc",  # small buffers, too, are known to the sanitizer
    }
    files = [str(ROOT / "tests" / f"{name}.py") for name in TESTS[module]]
    with tempfile.TemporaryDirectory() as folder:
        built = str(compile_sanitized(module, Path(folder)))
        command = [sys.executable, "-c", _STAND_IN, module, built, "-q", "--capture=no", "-p", "no:cacheprovider", *files]
        return subprocess.run(command, cwd=ROOT, env=environment, check=False).returncode


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition(":")[2])
    parser.add_argument("--module", choices=TESTS, help="the one to test; both unless named")
    named = parser.parse_args().module
    if not sanitizer_libraries():
        print("The sanitizers of gcc were not found; install gcc with libasan and libubsan.", file=sys.stderr)
        return 2
    return max(abs(run_tests(module)) for module in ([named] if named else TESTS))


if __name__ == "__main__":
    sys.exit(main())
