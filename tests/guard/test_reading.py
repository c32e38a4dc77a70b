"""Each step of reading is reported, and its faults are the log's."""

import pytest

from aqualog.core.errors import AqualogError, LogError
from aqualog.guard import reading as reading_module
from aqualog.guard.limits import ReadLimits
from aqualog.guard.reading import ReadingState, reading, unfinished, watch_reading


@pytest.fixture
def told(monkeypatch):
    """What a watcher of this process is told; nobody watches afterwards."""
    monkeypatch.setattr(reading_module, "_watch", None)
    monkeypatch.setattr(reading_module, "_state", ReadingState())
    return []


def test_states_and_faults_of_reading(told, tmp_path):
    log = tmp_path / "a.csv"
    log.write_bytes(bytes(2_000_000))
    with reading(log), unfinished(log):
        pass
    watch_reading(told.append, ReadLimits(), {str(tmp_path / "b.csv"): "crashed"})
    with unfinished(tmp_path / "x"), reading(log):
        pass
    with pytest.raises(LogError, match=r"b\.csv: crashed"), reading(tmp_path / "b.csv"):
        pass
    held = list(told)
    told.clear()
    with pytest.raises(AqualogError, match=r"a\.csv: its reader failed \(IndexError: x\)"), reading(log):
        raise IndexError("x")
    assert told[-1].log == ""
    temporary = (str(tmp_path / "x"),)
    assert held == [
        ReadingState(temporary=temporary), ReadingState(str(log), 310.0, 2_000_000, 1, temporary),
        ReadingState(step=2, temporary=temporary), ReadingState(step=2),
    ]  # fmt: skip
