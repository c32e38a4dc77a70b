"""Fixtures that all tests share."""

import gc
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

# modules of half a minute and more, the longest first: at the end no worker waits for another
LONG = (
    "thesis/test_figures_browser.py", "book/test_examples.py", "thesis/test_simulated_claims.py",
    "report/drive/test_drive.py", "thesis/checks/test_claims_drawn.py", "diagnose/test_next_manoeuvre.py",
    "thesis/figures/test_campaign_figures.py", "blind/test_world.py", "thesis/test_joint_claims.py",
    "thesis/figures/test_scene_figures.py", "diagnose/test_run.py", "diagnose/test_known.py",
    "thesis/checks/test_pass_checks.py", "thesis/test_slip_slope_noise.py", "detect/test_long.py",
    "diagnose/test_consequence.py", "diagnose/test_water_laws.py", "report/diagnosis/test_diagnosis.py",
    "diagnose/test_level.py", "diagnose/test_refit.py", "model/test_campaign.py", "book/test_documents.py",
    "book/test_links.py", "face/test_validate.py", "cli/test_processes.py", "diagnose/test_day_to_day.py",
    "diagnose/test_full_rate.py", "report/campaign/test_campaign.py", "diagnose/test_grade.py",
    "diagnose/test_agreement.py", "damaged/test_damaged.py", "real/test_diagnose_real.py",
    "thesis/figures/test_half_car_figures.py", "trade/test_water_law.py", "validate/test_run.py",
    "validate/test_sensors.py", "trade/test_watching.py",
)  # fmt: skip

# folders whose tests take a simulated drive as given; what the simulator does, those of `model` see
ABOUT_DRIVES = {"blind", "calibrate", "cli", "diagnose", "face", "real", "report", "thesis", "validate"}


def pytest_configure(config):
    """Give workers whole modules, in the order of the collection: what a module makes once is made once."""
    if getattr(config.option, "dist", "no") == "load":
        config.option.dist = "loadscope"
    if hasattr(config.option, "loadscopereorder"):
        config.option.loadscopereorder = False


class Backwards(pytest.Dir):
    """A folder whose last modules are collected first.

    Rewriting the assertions of all modules takes 10 s: two workers that begin at both ends do half of it each.
    """

    def collect(self):
        return reversed(list(super().collect()))


def pytest_collect_directory(path, parent):
    """Let the second worker begin at the other end."""
    from tests.shared import is_second_worker

    gc.disable()  # until all are collected: looking for garbage took a third of a first collection
    is_plain = is_second_worker() and not (path / "__init__.py").exists()
    return Backwards.from_parent(parent, path=path) if is_plain else None


def pytest_collection_modifyitems(items):
    """Let long modules begin; the others follow by name, in whichever order they were collected."""
    places = {name: i for i, name in enumerate(LONG)}
    names = {item.path: item.path.relative_to(ROOT / "tests").as_posix() for item in items}
    items.sort(key=lambda item: (places.get(names[item.path], len(LONG)), names[item.path]))


def pytest_collection_finish():
    """Look for garbage less often, and not among what stays to the end: a twentieth of the processor time."""
    gc.enable()
    gc.collect()
    gc.freeze()
    gc.set_threshold(20_000, 20)


@pytest.fixture(scope="session", autouse=True)
def _shared(tmp_path_factory):
    """A folder that all workers of a run have in common; one process alone needs none."""
    from tests import shared

    if "PYTEST_XDIST_WORKER" in os.environ:
        shared.FOLDER = tmp_path_factory.getbasetemp().parent / "shared"


@pytest.fixture(scope="session")
def _simulated_once():
    from aqualog.model.follow import led_truth
    from tests import shared

    return shared.simulated_once(led_truth)


@pytest.fixture(scope="module", autouse=True)
def _simulator(request):
    """Let tests that are not about the simulator have a drive again that others have asked for: a third of them."""
    if request.path.relative_to(ROOT / "tests").parts[0] not in ABOUT_DRIVES:
        yield
        return
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("aqualog.model.follow.led_truth", request.getfixturevalue("_simulated_once"))
        yield


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
