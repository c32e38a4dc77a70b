"""Faults of measured logs are found, and the lines that the remarks give mend them."""

from dataclasses import replace
from pathlib import Path

import pytest

from aqualog.align.load import load_signals
from aqualog.align.mapping import Entry, entry_line
from aqualog.checks.look import look
from aqualog.config.signal_map import load_signal_map
from aqualog.config.vehicle import load_vehicle
from aqualog.detect.slip_slope.direct import slip_slopes

HERE = Path(__file__).parent
pytestmark = pytest.mark.real


def as_logged(entries):
    """The lines of a map without what was mended by hand."""
    return {s: entry_line(replace(e, scale=1.0, offset=0.0)) for s, e in entries.items()}


class Log:
    """One drive under a map of such lines."""

    def __init__(self, paths, car, tmp_path, **how):
        self.paths, self.car, self.path, self.how = paths, car, tmp_path / "map.toml", how

    def signals(self, lines):
        self.path.write_text("[signals]\n" + "\n".join(lines.values()) + "\n", encoding="utf-8")
        return load_signals(self.paths, vehicle=self.car, signal_map=load_signal_map(self.path), **self.how)

    def remarks(self, lines):
        return look(self.signals(lines), self.car)


def mended(lines, remarks):
    return {**lines, **{line.split(" = ")[0]: line for r in remarks for line in r.lines}}


@pytest.fixture
def porsche(real_logs, tmp_path):
    car = load_vehicle(HERE / "porsche.toml")
    lines = as_logged(load_signal_map(HERE / "porsche_map.toml").entries)
    return Log(sorted((real_logs / "porsche_981").glob("*.csv")), car, tmp_path), lines


def rear_axle(log, lines):
    return next(p.line for p in slip_slopes(log.signals(lines), log.car).places if p.place == "rear axle")


def test_two_turned_signs_and_an_offset_of_the_porsche(porsche):
    log, lines = porsche
    remarks = log.remarks(lines)
    assert [r.signals for r in remarks if r.kind == "sign"] == [("a_y",), ("yaw_rate",)]
    offset = next(r for r in remarks if r.kind == "offset" and r.signals == ("a_x",))
    assert offset.value == pytest.approx(-1.56, abs=0.02)
    assert offset.lines == ('a_x = { channel = "InlineAcc", unit = "g", offset = 1.56 }',)
    assert {r.kind for r in remarks} == {"sign", "offset"}
    assert rear_axle(log, lines).slope == pytest.approx(40.0, abs=0.5)
    assert log.remarks(mended(lines, remarks)) == ()


def test_with_the_lines_of_the_remarks_the_slip_slope_is_right(porsche):
    log, lines = porsche
    line = rear_axle(log, mended(lines, log.remarks(lines)))
    assert line.slope == pytest.approx(35.3, abs=1.0)
    assert line.slope_ci == pytest.approx((32.7, 38.5), abs=0.5)


def test_the_turned_lateral_acceleration_of_the_toyota(real_logs, tmp_path):
    folder = real_logs / "toyota_rav4"
    log = Log([folder / "can_bus.mf4"], load_vehicle(HERE / "toyota.toml"), tmp_path, dbc=[folder / "toyota_2017.dbc"])
    entries = load_signal_map(HERE / "toyota_map.toml").entries
    lines = as_logged({**entries, "a_y": Entry("a_y", ("KINEMATICS.ACCEL_Y",))})
    (remark,) = log.remarks(lines)
    assert (remark.kind, remark.signals) == ("sign", ("a_y",))
    assert log.remarks(mended(lines, [remark])) == ()


@pytest.mark.parametrize("trip", ["A05", "A12", "B24", "A15", "B02"])
def test_the_trips_of_the_calibrated_car_have_no_remark(real_logs, tmp_path, trip):
    log = Log([real_logs / "bmw_i3" / f"Trip{trip}.csv"], load_vehicle(HERE / "bmw_i3.toml"), tmp_path)
    lines = {s: entry_line(e) for s, e in load_signal_map(HERE / "bmw_i3_map.toml").entries.items()}
    assert log.remarks(lines) == ()


def test_a_reduction_without_its_losses_shows_as_a_gain(real_logs, tmp_path):
    """0.857 of the motor torque times the reduction comes to the wheels, as the calibration of six trips shows."""
    log = Log([real_logs / "bmw_i3" / "TripA12.csv"], load_vehicle(HERE / "diagnose_bmw_i3.toml"), tmp_path)
    lines = {s: entry_line(e) for s, e in load_signal_map(HERE / "diagnose_bmw_i3_map.toml").entries.items()}
    (remark,) = log.remarks(lines)
    assert remark.kind == "torque"
    assert remark.value == pytest.approx(0.857, abs=0.02)
