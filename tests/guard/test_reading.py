"""Each step of reading is reported, its faults are the log's, and its limits are set by variables."""

import os
import signal
import time

import pytest

from aqualog.core.errors import AqualogError, ConfigError, LogError
from aqualog.guard import reading as reading_module
from aqualog.guard.reading import ReadingState, ReadLimits, StatePage, limits_from, reading, unfinished, watch_reading
from aqualog.guard.system import machine_memory


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


def test_limits_are_named_by_variables():
    limits = limits_from({"AQUALOG_LIMIT_S": "5", "AQUALOG_LIMIT_MB": "0", "AQUALOG_LIMIT_FILE_MB": "1.5"})
    assert limits == ReadLimits(wall_s=5.0, memory=0, file=1_500_000)
    assert (limits.wall_for(10**9), limits.memory_here(), limits.file_for(10**9)) == (5.0, 0, 1_500_000)
    # 100 h of MF4, 4.6 GB, are read in 4 min and 0.7 GB
    assert ReadLimits().wall_for(4_600_000_000) > 3600.0
    assert ReadLimits().memory_here() >= min(2_000_000_000, machine_memory())
    for text in ("x", "-1", "nan", "inf", "1e10"):
        with pytest.raises(ConfigError, match=r"AQUALOG_LIMIT_CPU_S: is .* expected a number of seconds"):
            limits_from({"AQUALOG_LIMIT_CPU_S": text})
    assert limits_from({"AQUALOG_LIMIT_FILE_MB": "1e-300"}).file == 1  # not 0, which is none
    with pytest.raises(ConfigError, match=r"AQUALOG_LIMIT_MB: is '200'; expected 300 or more, or 0 for no limit"):
        limits_from({"AQUALOG_LIMIT_MB": "200"})


def test_what_is_told_is_read():
    page, state = StatePage(), ReadingState("drive.mf4", 2.0, 17, 3, ("a.tmp", "b.tmp"))
    page.write(state)
    assert page.read() == state


def test_page_that_is_written_just_now_leaves_what_was_read_before():
    told = [ReadingState("d.mf4", 1.0, 1, n, ("x" * (n % 7 * 40),)) for n in range(50)]
    page = StatePage()
    page.write(told[0])
    assert page.read() == told[0]
    child = os.fork()
    if child == 0:
        while True:
            for state in told:
                page.write(state)
    try:
        end = time.monotonic() + 1.0
        while time.monotonic() < end:
            assert page.read() in told
    finally:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)


def test_what_was_written_last_and_believes_no_nonsense():
    page = StatePage()
    assert page.read() == ReadingState()
    state = ReadingState("/a b/ü\udcff.csv", 12.5, 3, 7, ("/tmp/x",))
    page.write(state)
    assert page.read() == state
    page._page[1:5] = b"\xff" * 4
    assert page.read() == state
    page.write(state._replace(temporary=tuple(f"{k:05000}" for k in range(20))))
    assert page.read() == state._replace(temporary=())
    assert not page.is_finished
    page.finish()
    page.write(state)
    assert page.is_finished
