"""The line between the library and the program: imports go one way."""

import subprocess
import sys

_PROBE = """
import importlib, pkgutil, sys

class Block:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in {"app", "glfw", "moderngl", "glcontext", "imgui_bundle"}:
            raise AssertionError(f"lfcore imports {name}")

sys.meta_path.insert(0, Block())
import lfcore
names = [module.name for module in pkgutil.walk_packages(lfcore.__path__, "lfcore.")]
for name in names:
    importlib.import_module(name)
print(len(names))
"""


def test_the_library_imports_neither_the_program_nor_any_window_or_gl() -> None:
    done = subprocess.run([sys.executable, "-c", _PROBE], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) > 20


def test_the_probe_notices_a_forbidden_import() -> None:
    blocked = _PROBE.replace("import lfcore\n", "import moderngl\nimport lfcore\n")
    done = subprocess.run([sys.executable, "-c", blocked], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode != 0 and "lfcore imports moderngl" in done.stderr  # the probe itself can fail
