"""The order of the layers: a module imports only what stands before it."""

import ast
import os
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

import aqualog
from aqualog.cli.campaign import _AHEAD

PACKAGE = Path(aqualog.__file__).parent
ORDER = (
    "core", "physics", "guard", "io", "align", "features", "checks", "calibrate",
    "detect", "model", "evaluate", "campaign", "trade", "diagnose", "validate", "doctor", "report", "thesis", "config", "face", "book", "cli",
)  # fmt: skip
# align/propose and align/load read a map, which is a record of align; config turns TOML into these records
HEAVY = ("asammdf", "mcap", "rosbags", "cantools", "plotly", "numba", "scipy", "polars", "numpy", "jinja2")


READERS = {"core/vehicle.py": "config", "model/term.py": "config"}  # a record's `read` goes to its reader


def dotted(path: Path) -> str:
    return ".".join(("aqualog", *path.relative_to(PACKAGE).with_suffix("").parts)).removesuffix(".__init__")


@cache
def imports(path: Path) -> tuple[str, ...]:
    """Modules of aqualog that a module imports anywhere: at its head, in a function, for types alone."""
    found = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            own = (f"{node.module}.{n.name}" for n in node.names)
            found += [name if name in MODULES else node.module for name in own]
        if isinstance(node, ast.Import):
            found += [n.name for n in node.names]
    return tuple(m for m in dict.fromkeys(found) if m.startswith("aqualog."))


def modules():
    return [
        p
        for p in sorted(PACKAGE.rglob("*.py"))
        if p.name != "__main__.py" and (p.name != "__init__.py" or p.parent != PACKAGE)
    ]


MODULES = {dotted(p): p for p in modules()}


def circles(package: str) -> list[set[str]]:
    """Sets of modules of one package that import each other in a circle."""
    inside = {m: p for m, p in MODULES.items() if m == f"aqualog.{package}" or m.startswith(f"aqualog.{package}.")}
    below = {m: {i for i in imports(p) if i in inside and i != m} for m, p in inside.items()}
    while any(leaves := [m for m, ways in below.items() if not ways & below.keys()]):
        for module in leaves:
            del below[module]
    reach = {m: below[m] & below.keys() for m in below}
    while (wider := {m: ways.union(*(reach[w] for w in ways)) for m, ways in reach.items()}) != reach:
        reach = wider
    found: list[set[str]] = []
    for module in below:
        circle = {m for m in reach[module] if module in reach[m]}
        if circle and circle not in found:
            found.append(circle)
    return found


@pytest.mark.parametrize("path", modules(), ids=lambda p: str(p.relative_to(PACKAGE)))
def test_imports_point_downwards(path):
    own = ORDER.index(path.relative_to(PACKAGE).parts[0].removesuffix(".py"))
    reader = READERS.get(path.relative_to(PACKAGE).as_posix())
    packages = dict.fromkeys(m.split(".")[1] for m in imports(path))
    above = [name for name in packages if ORDER.index(name) > own and name != reader]
    assert not above, f"{path.name} imports {above}"


@pytest.mark.parametrize("package", ORDER)
def test_no_circle_of_imports_inside_a_package(package):
    assert not circles(package)


def test_detectors_read_no_truth_and_no_labels():
    from aqualog.features.stream import INPUTS

    assert not [s for s in INPUTS if s.startswith(("true_", "on_water", "water_depth"))]


COMMANDS = (
    "detect inspect init align simulate figures slip-slope calibrate evaluate batch bin-slipslope bin-resistance report "
    "reproduce campaign diagnose cache test plan doctor help"
)


@pytest.mark.parametrize("command", [["--help"], *([c, "--help"] for c in COMMANDS.split())])
def test_help_imports_nothing_heavy(command):
    code = f"import sys; sys.argv = ['aqualog', *{command!r}]\nfrom aqualog.cli.main import run\ntry:\n    run()\nexcept SystemExit:\n    pass\nprint('LOADED', *sys.modules)"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    loaded = out.split("LOADED")[-1].split()
    assert "typer" in loaded
    assert not [m for m in HEAVY if m in loaded]


@pytest.mark.skipif(sys.platform != "linux", reason="processes are forked there only")
def test_what_workers_are_forked_behind_starts_no_thread():
    code = f"import {', '.join(_AHEAD)}, os, sys; print(len(os.listdir('/proc/self/task')), 'numba' in sys.modules)"
    env = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}  # as a command has it
    assert subprocess.check_output([sys.executable, "-c", code], text=True, env=env).split() == ["1", "True"]


def test_no_absolute_paths_of_a_machine():
    for path in modules():
        assert "/home/" not in path.read_text(encoding="utf-8")


def test_compiled_code_is_kept_outside_the_package(tmp_path):
    """Beside the sources it would outlive an uninstallation and hide an editable one."""
    code = "from aqualog.detect import cusum; import numpy as np; cusum.scan(cusum.CusumParams(0, 1, 2, 1), cusum.initial_state(), np.ones(3))"
    before = set(PACKAGE.rglob("*.nbi"))
    env = {**os.environ, "XDG_CACHE_HOME": str(tmp_path)}
    subprocess.run([sys.executable, "-c", code], check=True, env=env)
    assert list((tmp_path / "aqualog" / "compiled").rglob("*.nbi"))
    assert set(PACKAGE.rglob("*.nbi")) == before
    (tmp_path / "file").write_text("")
    for broken in (tmp_path / "file", tmp_path / "file" / "x"):
        subprocess.run(
            [sys.executable, "-c", code],
            check=True,
            env={**os.environ, "XDG_CACHE_HOME": str(broken), "NUMBA_CACHE_DIR": ""},
        )
