"""Offsets at standstill are found with an interval, and their line mends a turned sign along with them."""

import math

import numpy as np
import pytest

from aqualog.checks.look import look
from aqualog.checks.standstill import offsets
from aqualog.checks.windows import Gather
from aqualog.core.records import Origin
from tests.checks.made import CAR, DT, made, signals


def found(columns):
    gather = Gather(columns, CAR, DT)
    gather.push(columns)
    return {o.symbol: o for o in offsets(gather.windows())}


def test_offsets_with_their_intervals():
    own = found(made(stops=3, a_x_offset=-1.5, a_y_offset=1.2, yaw_rate_offset=0.03))
    for symbol, value in (("a_x", -1.5), ("a_y", 1.2), ("yaw_rate", 0.03)):
        low, high = own[symbol].ci95
        assert low < value < high
        assert own[symbol].counts
        assert own[symbol].stops == 3
    assert own["a_x"].seconds == pytest.approx(3 * 10.0, abs=3.0)


def test_more_stops_narrow_the_interval():
    one, three = (found(made(stops=k))["a_x"].ci95 for k in (1, 3))
    assert np.diff(three) < 0.6 * np.diff(one)
    assert np.diff(one) == pytest.approx(2.0 * 2.776 * 0.25, rel=1e-3)  # Student's t of four, a slope of 2.5 %


@pytest.mark.parametrize("offset", [0.25, 0.5])
def test_one_stop_may_be_on_a_hill(offset):
    assert not found(made(stops=1, a_x_offset=offset))["a_x"].counts


def test_without_standstill_there_is_no_offset():
    assert found(made(a_x_offset=-1.5)) == {}


@pytest.mark.parametrize(("name", "offset"), [("a_y", 9.81), ("a_y", -4.0), ("yaw_rate", 0.5), ("a_y", 2.0)])
def test_a_lateral_sensor_that_is_far_off_shows_without_a_stop(name, offset):
    remarks = look(signals(made(**{f"{name}_offset": offset})), CAR)
    assert [(r.kind, r.signals) for r in remarks] == [("channel", ("a_y", "yaw_rate"))] * (offset != 2.0)


def test_a_long_bend_is_no_lateral_sensor_that_is_far_off():
    columns = made(one_way=True, turning=0.3, v=30.0)
    assert np.median(columns["a_y"]) > 3.0
    assert not [r for r in look(signals(columns), CAR) if r.signals == ("a_y", "yaw_rate")]


def test_a_car_that_never_moves_shows_no_stop():
    columns = {n: 0.0 * x + 0.6 for n, x in made().items()}
    assert found({**columns, **{n: 0.0 * x for n, x in columns.items() if n.startswith("omega_")}}) == {}


def test_one_line_mends_sign_and_offset():
    mapped = {"channel": ["Lat"], "unit": "g", "scale": 0.5, "offset": 0.2, "invalid": [1023.0]}
    origins = {"a_y": Origin("a_y", "Lat", "imu.csv", "g", 20.0, 9, mapped=mapped)}
    columns = made(stops=3, a_y_offset=-1.2)
    columns["a_y"] = -columns["a_y"]  # stands at 1.2, which 0.2 of the map is part of
    (sign, offset) = look(signals(columns, origins=origins), CAR)
    assert (sign.kind, offset.kind) == ("sign", "offset")
    assert sign.lines == offset.lines
    (text,) = sign.lines
    head, rest = text.split(", offset = ")
    assert head == 'a_y = { channel = "Lat", unit = "g", scale = -0.5'
    assert rest.endswith(", invalid = [1023.0] }")
    assert float(rest.split(",")[0]) == pytest.approx(1.2 - 0.2, abs=0.02)
    assert math.isfinite(offset.value)
