"""Fixtures that all tests share."""

import os
import sys
from pathlib import Path

import pytest

# tests run side by side: threads of linear algebra beside them would only wait for each other
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

ROOT = Path(__file__).resolve().parents[1]
REAL_LOGS = ROOT.parent / "shared" / "real_logs"
sys.path.insert(0, str(ROOT / "sample_logs"))
sys.path.insert(0, str(ROOT / "tests"))


@pytest.fixture(scope="session")
def real_logs() -> Path:
    """The measured drives; skips the test where they are not."""
    if not REAL_LOGS.is_dir():
        pytest.skip(f"no measured drives at {REAL_LOGS}")
    return REAL_LOGS


from tests.headless import browser  # noqa: E402, F401 - a fixture, from a module on the path set above
