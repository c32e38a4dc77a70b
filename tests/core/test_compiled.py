"""Machine code that is kept from process to process."""

import importlib
import os
import re
import subprocess
import sys

import numpy as np
import pytest

import aqualog.core.compiled as compilation
from aqualog.align.load import load_signals
from aqualog.config.vehicle import load_vehicle
from aqualog.detect.slip_slope import drop, history
from aqualog.detect.stream import detect_drive
from aqualog.features import smoothing, velocity
from tests.conftest import ROOT

LOADED = """
import sys
import numpy as np
from aqualog.core.compiled import compiled, load_kept
from aqualog.features.smoothing import _lowpass
if sys.argv[1] == "ahead":
    load_kept()
    assert _lowpass.overloads
loaded = sum(_lowpass.stats.cache_hits.values())
y, last = _lowpass(0.1, 0.0, np.arange(4.0))
assert sum(_lowpass.stats.cache_hits.values()) == (loaded or 1)
print("numba.np.arraymath" in sys.modules, y.tolist())

@compiled
def of_new_code(x):
    return _lowpass(0.1, 0.0, x)[0]

print(of_new_code(np.arange(4.0)).tolist())
"""


def test_detectors_are_loaded_without_what_compiles():
    """One kernel that holds a part of numba's own library is enough to load all of it, in every process."""
    drive = ROOT / "sample_logs" / "lane_drive.parquet"
    car = drive.with_name("vehicle.toml")
    code = (
        f"import sys; sys.argv = ['aqualog', 'detect', {str(drive)!r}, '--vehicle', {str(car)!r}, '--json']\n"
        "from aqualog.cli.main import run\ntry:\n    run()\nexcept SystemExit:\n    pass\n"
        "print('numba.np.arraymath' in sys.modules, file=sys.stderr)"
    )
    detect_drive(load_signals([drive], vehicle=load_vehicle(car)), load_vehicle(car))  # kept from here on
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr.split()[-1] == "False"


@pytest.mark.parametrize("when", ["ahead", "called"])
def test_kept_code_is_loaded_without_what_compiles(when):
    y, _ = smoothing._lowpass(0.1, 0.0, np.arange(4.0))
    if not smoothing._lowpass._cache._cache_path:
        pytest.skip("no place to keep machine code")
    done = subprocess.run([sys.executable, "-c", LOADED, when], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    # what is new is compiled after all, and calls what was loaded
    assert done.stdout.splitlines() == [f"False {y.tolist()}", str(y.tolist())]


SLOW = """
import sys, time
import aqualog.core.compiled as compilation
from numba.core import event
class Told(event.Listener):
    def on_start(self, event):
        if str(event.data["dispatcher"]).find("once") >= 0:
            print("compiles", flush=True)
            time.sleep(1.0)
    def on_end(self, event):
        pass
event.register("numba:compile", Told())
from made_once import once
sys.stdin.readline()
print(once(3.0), once._cache._cache_path)
"""
ONCE = """
from aqualog.core.compiled import compiled


@compiled
def once(x):
    return x + 1.0
"""


def test_processes_that_begin_together_compile_once(tmp_path):
    (tmp_path / "made_once.py").write_text(ONCE)
    env = {
        **os.environ,
        "PYTHONPATH": f"{tmp_path}:{ROOT}",
        "XDG_CACHE_HOME": str(tmp_path / "kept"),
        "NUMBA_CACHE_DIR": "",
    }
    others = [
        subprocess.Popen(
            [sys.executable, "-c", SLOW], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=env
        )
        for _ in range(2)
    ]
    for process in others:
        process.stdin.write("go\n")
        process.stdin.flush()
    told = [process.communicate(timeout=60)[0] for process in others]
    assert all("4.0 " in t for t in told)
    assert sum("compiles" in t for t in told) == 1


CALLER = """
from aqualog.core.compiled import compiled
from made_here.two import called
from made_here.two.called import LIMIT, step


@compiled
def by_module(x):
    return called.step(x)


@compiled
def by_name(x):
    return step(x)


@compiled
def by_constant(x):
    return min(x, LIMIT)


@compiled
def alone(x):
    return x
"""
CALLED = """
from aqualog.core.compiled import compiled

LIMIT = 1.0


@compiled
def step(x):
    return 2.0 * x
"""


def test_kept_code_is_that_of_what_it_calls_in_other_folders(tmp_path, monkeypatch):
    """Numba looks at the caller's own file: the estimator went on with the CUSUM of before an edit."""

    def stamps(called):
        for name, text in (("one/caller.py", CALLER), ("two/called.py", called)):
            path = tmp_path / "made_here" / name
            path.parent.mkdir(parents=True, exist_ok=True)
            if not path.exists() or path.read_text() != text:
                path.write_text(text)
        for name in [n for n in sys.modules if n.startswith("made_here")]:
            del sys.modules[name]
        importlib.invalidate_caches()
        compilation._stamp.cache_clear()
        module = importlib.import_module("made_here.one.caller")
        names = ("by_module", "by_name", "by_constant", "alone")
        return {n: compilation._stamp_of(getattr(module, n).py_func) for n in names}

    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    before = stamps(CALLED)
    assert stamps(CALLED) == before
    other_code = stamps(CALLED.replace("2.0 * x", "2.0 * x + 1.0"))
    assert {n for n in before if other_code[n] != before[n]} == {"by_module", "by_name"}
    other_limit = stamps(CALLED.replace("LIMIT = 1.0", "LIMIT = 1.5"))
    assert other_limit["by_constant"] != before["by_constant"]
    assert other_limit["alone"] == before["alone"]


def test_the_stamp_is_what_kept_code_is_looked_up_by():
    if not smoothing._lowpass._cache._cache_path:
        pytest.skip("no place to keep machine code")
    for kernel in (smoothing._lowpass, velocity._scan):
        assert kernel._cache._cache_file._source_stamp[1] == compilation._stamp_of(kernel.py_func)


def test_read_only_and_strided_arrays_need_no_machine_code_of_their_own():
    x = np.arange(8.0)
    p = velocity.params_from_seconds(0.1, has_accelerometer=True)
    for a in (x, np.broadcast_to(x, 8), np.repeat(x, 2)[::2]):
        smoothing.lowpass(a, smoothing.UNSET, tau=1.0, dt=0.1)
        velocity.observe(p, velocity.initial_state(), a, np.array([a] * 4), a, a, a, weights=np.ones(4))
    assert [len(f.nopython_signatures) for f in (smoothing._lowpass, velocity._scan)] == [1, 1]


def test_the_median_of_the_wheels_is_numpys():
    rng = np.random.default_rng(0)
    for k in range(500):
        w = rng.integers(-2, 3, 4).astype(float) if k % 2 else rng.normal(size=4)
        w[rng.random(4) < 0.3] = np.nan
        known = w[~np.isnan(w)]
        np.testing.assert_equal(velocity._median(w), np.median(known) if known.size else np.nan)


@pytest.mark.parametrize("is_max", [True, False])
def test_the_reference_of_the_history_is_numpys(is_max):
    kept = 30.0 + np.random.default_rng(0).normal(size=(drop.KEPT_PERIODS, 3))
    for count in range(1, drop.KEPT_PERIODS + 1):
        periods = [history.Period(*row) for row in kept[:count].tolist()]
        expected = history.reference(periods, rule="max" if is_max else "robust")
        assert drop._reference(kept, count, is_max) == pytest.approx(expected, rel=1e-15)


def test_kept_code_is_the_users_own(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    place = tmp_path / "aqualog" / "compiled"
    place.mkdir(parents=True)
    place.chmod(0o777)
    folder = compilation._user_cache.__wrapped__
    assert folder() == str(place)
    assert place.stat().st_mode & 0o022 == 0  # nobody else puts code there
    monkeypatch.setattr(os, "geteuid", lambda: place.stat().st_uid + 1)
    assert folder() == ""


def test_nothing_is_read_as_pickle():
    """Of what others give. numba keeps its own code so, in the folder above; processes talk among themselves."""
    sources = {p: p.read_text(encoding="utf-8") for p in (ROOT / "aqualog").rglob("*.py")}
    risky = re.compile(
        r"\b(c?pickle|marshal|shelve|dill|joblib|read_pickle|allow_pickle\s*=\s*True)\b|\beval\(|\bexec\("
    )
    assert len(sources) > 300
    assert [f"{p.name}: {m[0]}" for p, text in sources.items() for m in risky.finditer(text)] == []


def test_code_that_cannot_be_kept_is_used(monkeypatch):
    from numba.core.caching import Cache

    def nothing(*_):
        raise RuntimeError("no compiled object yet")

    monkeypatch.setattr(Cache, "save_overload", nothing)
    assert compilation.compiled(lambda x: 2.0 * x)(3.0) == 6.0
