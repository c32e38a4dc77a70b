"""A simulated drive in memory is what its written log would have been."""

import numpy as np
import pytest

from aqualog.align.load import load_signals
from aqualog.detect.stream import detect_drive
from aqualog.features.stream import INPUTS
from aqualog.model.log import as_signals, write_simulation
from aqualog.model.scenario import Lane, Scenario
from aqualog.model.sensors import ESC, IDEAL
from aqualog.model.simulate import simulate
from tests.thesis.passes import SEDAN

LANE = Lane(3.0, 5.0, depth_left=1e-3, depth_right=1.3e-3)


@pytest.mark.parametrize("sensors", [ESC, IDEAL], ids=lambda s: s.name)
@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_memory_is_the_written_log(tmp_path, sensors, suffix):
    drive = simulate(Scenario(SEDAN, duration_s=6.0, lanes=(LANE,), sensors=sensors))
    path = tmp_path / f"drive{suffix}"
    write_simulation(path, drive, suffix=suffix, comment="")
    written, here = load_signals([path], vehicle=SEDAN), as_signals(drive)
    assert here.dt_ns == written.dt_ns
    assert list(here.frame.columns[: len(written.frame.columns)]) == list(written.frame.columns)
    assert {"true_contact_fl", "true_v_x"} <= set(here.frame.columns)
    if suffix == ".parquet":
        assert here.start_ns == written.start_ns
    for name in written.frame.columns:
        a, b = written.frame[name], here.frame[name]
        assert a.null_count() == b.null_count(), name
        if name == "on_water":
            assert a.equals(b)
        else:
            scale = max(1.0, float(np.nanmax(np.abs(b.to_numpy()))))
            np.testing.assert_allclose(a.to_numpy(), b.to_numpy(), rtol=0, atol=1e-9 * scale, err_msg=name)


def test_truth_is_where_it_belongs():
    drive = simulate(Scenario(SEDAN, duration_s=6.0, lanes=(LANE,), sensors=IDEAL))
    frame = as_signals(drive).frame
    np.testing.assert_allclose(frame["true_v_x"].to_numpy(), frame["v_x"].to_numpy(), atol=1e-9)
    assert not [c for c in as_signals(drive, truth=False).frame.columns if c.startswith("true_")]


def test_no_detector_reads_the_truth():
    drive = simulate(Scenario(SEDAN, duration_s=6.0, lanes=(LANE,)))
    assert not [n for n in INPUTS if n.startswith("true_")]
    with_truth, without = (detect_drive(as_signals(drive, truth=b), SEDAN) for b in (True, False))
    assert with_truth.events == without.events
    assert with_truth.events
