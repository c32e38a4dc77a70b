"""Fixtures that all tests share."""

import os
import sys
from pathlib import Path

import pytest

# tests run side by side: threads of linear algebra beside them would only wait for each other
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# each process that a test starts would compile all sources again: a third of what a command costs
sys.dont_write_bytecode = False
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

ROOT = Path(__file__).resolve().parents[1]
REAL_LOGS = ROOT.parent / "shared" / "real_logs"
sys.path.insert(0, str(ROOT / "sample_logs"))
sys.path.insert(0, str(ROOT / "tests"))

# modules of a quarter of a minute and more: they begin first, so that at the end no worker waits for another
LONG = (
    "real/test_diagnose_real.py", "thesis/test_figures_browser.py", "thesis/test_page.py",
    "diagnose/test_consequence.py", "diagnose/test_level.py", "cli/test_processes.py", "campaign/test_plan.py",
    "thesis/figures/test_half_car_figures.py", "campaign/test_batch.py", "campaign/test_store_faults.py",
    "campaign/test_elsewhere.py", "campaign/test_remote_store.py", "face/test_every_command.py", "guard/test_command.py",
    "diagnose/test_run.py", "diagnose/test_grade.py", "cli/test_hostile_outputs.py", "cli/test_leaving.py",
)  # fmt: skip


def pytest_configure(config):
    """Give workers whole modules, in the order of the collection: what a module makes once is made once."""
    if getattr(config.option, "dist", "no") == "load":
        config.option.dist = "loadscope"
    if hasattr(config.option, "loadscopereorder"):
        config.option.loadscopereorder = False


class Backwards(pytest.Dir):
    """A folder whose last modules are collected first.

    Rewriting the assertions of all modules takes 20 s: two workers that begin at both ends do half of it each.
    """

    def collect(self):
        return reversed(list(super().collect()))


def pytest_collect_directory(path, parent):
    """Let the second worker begin at the other end."""
    from tests.shared import is_second_worker

    is_plain = is_second_worker() and not (path / "__init__.py").exists()
    return Backwards.from_parent(parent, path=path) if is_plain else None


def pytest_collection_modifyitems(items):
    """Let long modules begin; the others follow by name, in whichever order they were collected."""
    places = {name: i for i, name in enumerate(LONG)}
    names = {item.path: item.path.relative_to(ROOT / "tests").as_posix() for item in items}
    items.sort(key=lambda item: (places.get(names[item.path], len(LONG)), names[item.path]))


@pytest.fixture(scope="session", autouse=True)
def _shared(tmp_path_factory):
    """A folder that all workers of a run have in common; one process alone needs none."""
    from tests import shared

    if "PYTEST_XDIST_WORKER" in os.environ:
        shared.FOLDER = tmp_path_factory.getbasetemp().parent / "shared"


@pytest.fixture(scope="session")
def real_logs() -> Path:
    """The measured drives; skips the test where they are not."""
    if not REAL_LOGS.is_dir():
        pytest.skip(f"no measured drives at {REAL_LOGS}")
    return REAL_LOGS


@pytest.fixture(scope="session")
def dry_folder(tmp_path_factory) -> Path:
    """Two dry drives `a.parquet` and `b.parquet`, and `car.toml`, the vehicle file before a calibration; read only."""
    from aqualog.core.vehicle import vehicle_toml
    from tests.calibrate.dry_drives import believed, campaign

    path = tmp_path_factory.mktemp("dry")
    signals, true, _ = campaign(41, 2, seconds=260.0, rate=50.0)
    for name, s in zip("ab", signals, strict=True):
        s.frame.select(c for c in s.frame.columns if not c.startswith("true_")).write_parquet(path / f"{name}.parquet")
    (path / "car.toml").write_text(vehicle_toml(believed(true)), encoding="utf-8")
    return path


from tests.headless import browser  # noqa: E402, F401 - a fixture, from a module on the path set above
