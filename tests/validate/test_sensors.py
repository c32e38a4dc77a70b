"""Constant errors of the sensors are found, said, and taken off; errors of the car are not."""

import math
from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from aqualog.features.smoothing import earlier
from aqualog.model.effects import EFFECTS
from aqualog.model.term import Model, Term
from tests.validate.test_run import CAR, drive, judged

ROAD = drive(5)


def changed(**new):
    return replace(ROAD, frame=ROAD.frame.with_columns(**new))


def late_by(seconds):
    v = ROAD.array("v_x")
    return changed(v_x=pl.Series(np.nan_to_num(earlier(v, -seconds, ROAD.dt), nan=v[0])))


def shares(found):
    return {j.plot.y: j.share for j in found.judged if j.plot.x == "t"}


def said(found, what):
    return next((n for n in found.notes if what in n), "")


def test_a_late_velocity_is_taken_off():
    base = float(said(judged(ROAD), "v_x comes").split()[3])  # of the simulated receiver
    found = judged(late_by(0.3))
    assert float(said(found, "v_x comes").split()[3]) == pytest.approx(base + 0.3, abs=0.02)
    assert min(v for n, v in shares(found).items() if "slip" in n) > 0.98
    known = Model((Term(EFFECTS["signal_delay"], {"delay": base + 0.3}, "v_x"),))
    assert not said(judged(late_by(0.3), model=known), "v_x comes")


@pytest.mark.parametrize("given", [{"drivetrain": "awd"}, {"given": frozenset({"mass"})}])
def test_wheels_that_may_be_driven_show_no_delay(given):
    from aqualog.validate.records import Plan
    from aqualog.validate.run import validate

    found = validate([("d", late_by(0.3))], replace(CAR, **given), model=Model(), plan=Plan())
    assert not said(found, "v_x comes")
    assert said(found, "a delay of v_x would show as slip")


@pytest.mark.parametrize("name", ["steer_angle", "yaw_rate", "a_y"])
def test_a_constant_offset_is_taken_off(name):
    by = {"steer_angle": 0.01, "yaw_rate": 0.012, "a_y": 0.3}[name]
    before = said(judged(ROAD), "offsets taken off")
    found = judged(changed(**{name: pl.col(name) + by}))
    assert shares(found)["a_y"] > 0.98
    assert shares(found)["yaw_rate"] > 0.98
    text = said(found, "offsets taken off")
    assert text != before
    if name == "steer_angle":
        assert float(text.split("road wheels ")[1].split()[0]) == pytest.approx(math.degrees(by), abs=0.05)


def test_what_goes_with_the_curve_is_no_offset():
    yaw = ROAD.array("yaw_rate")
    wave = 0.05 * np.sin(0.5 * np.arange(yaw.size) * ROAD.dt)
    found = judged(changed(yaw_rate=pl.Series(yaw + wave)))
    assert shares(found)["yaw_rate"] < 0.5
